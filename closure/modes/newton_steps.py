"""Newton's steps of a block of equations on complex numbers, as machine code for many postures.

Rows, Jacobian, sparse elimination and the posture after the step are one tape. Its order of pivots
is chosen at random complex postures. Where a posture meets a small pivot all the same, what the
step leaves of the linear equations tells, and LAPACK solves them instead.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from closedchain.closure.modes.complex_tape import ComplexTape, complex_tape
from closedchain.closure.solve.problem import Problem
from closedchain.closure.tape.elimination import eliminate
from closedchain.closure.tape.expression import Expr, Graph
from closedchain.closure.tape.rows import Kinematics

LEFT = 1e-4
"""Share of the rows that a step may leave of the linear equations."""

ROUNDING = 1e-11
"""Dimensionless: what rounding leaves of them."""

Slow = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]


@dataclass(frozen=True, eq=False)
class NewtonSteps:
    """Newton's steps of rows in columns, as a tape.

    Attributes
    ----------
    tape : ComplexTape
        Inputs: posture, targets. Outputs: the block's numbers after the step, the step, and a
        weighted sum of the rows, before and after, as the linear equations have them.
    own : (m,) int array
        The block's numbers of q.
    size : int
        Unknowns of the block.
    slow : callable
        The same step for postures (n, nq) and targets (n, prescribed) by LAPACK: postures (n, nq)
        and steps (n, size).
    """

    tape: ComplexTape
    own: np.ndarray
    size: int
    slow: Slow

    def at(self, q: np.ndarray, targets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The block's numbers (n, m) after a step from postures (n, nq), and steps (n, size)."""
        found = self.tape.run(np.concatenate([q, targets], axis=1).T)
        m = len(self.own)
        before, after = found[-2], found[-1]
        moved, step = found[:m].T, found[m : m + self.size].T
        bad = ~(np.abs(after) <= LEFT * np.abs(before) + ROUNDING)
        bad |= ~np.isfinite(moved).all(axis=1)
        if bad.any():
            i = np.flatnonzero(bad)
            moved, step = moved.copy(), step.copy()
            whole, step[i] = self.slow(q[i], targets[i])
            moved[i] = whole[:, self.own]
        return moved, step


@dataclass(frozen=True, eq=False)
class Linear:
    """Square equations with their derivatives, as expressions.

    ``entries`` are the derivatives of each value by the unknowns, those that are not always zero.
    """

    values: list[Expr]
    entries: list[dict[int, Expr]]
    unknown: list[int]


def newton_steps(
    problem: Problem, rows: np.ndarray, columns: np.ndarray, samples: np.ndarray, slow: Slow
) -> NewtonSteps:
    """Steps of kept rows (k,) in unknowns (k,), with pivots chosen at samples (inputs, n).

    Raises
    ------
    ArithmeticError
        The rows are dependent at the samples.
    """
    g, nq = Graph(), problem.mechanism.model.nq
    k = Kinematics(problem.mechanism, g, g.inputs(0, nq), upright=False)
    every = problem.rows(k, g.inputs(nq, problem.prescribed))
    chosen = [problem.kept[r] for r in rows]
    unknown = [problem.free[c] for c in columns]
    entries = [{v: e for v, e in every.entries[r].items() if v in unknown} for r in chosen]
    linear = Linear([every.values[r] for r in chosen], entries, unknown)
    step, guard = solved(g, linear, samples)
    moved = k.moved(k.q, step)
    own = [i for i in range(nq) if moved[i] != k.q[i]]
    out = [*(moved[i] for i in own), *(step[v] for v in unknown), *guard]
    tape = complex_tape(g.tape(out, nq + problem.prescribed))
    return NewtonSteps(tape, np.array(own, dtype=int), len(unknown), slow)


def solved(
    g: Graph, linear: Linear, samples: np.ndarray
) -> tuple[dict[int, Expr], tuple[Expr, Expr]]:
    """Newton's step by unknown, and weighted sums of the values before and after it."""
    step = eliminate(g, linear.entries, linear.unknown, samples).solve([-v for v in linear.values])
    weights = 1.0 + 0.5 * np.sin(np.arange(1, len(linear.values) + 1))
    before, after = g.constant(0.0), g.constant(0.0)
    for weight, value, row in zip(weights, linear.values, linear.entries, strict=True):
        left = value
        for v, entry in row.items():
            left = left + entry * step[v]
        before, after = before + float(weight) * value, after + float(weight) * left
    return step, (before, after)
