"""Proofs that a posture exists, and alone in its box: Krawczyk's test on intervals.

The unknowns are the tangent coordinates of a step from the posture. With C an approximate inverse
of the Jacobian, the operator K(X) = -C F(0) + (1 - C F'(X)) X maps the box X into its inside only
where X holds exactly one solution, whatever the rounding [Krawczyk1969]_. The equations are the
kept rows; rows beside them, which depend on these by the geometry, cannot be proved by numbers.

[Krawczyk1969]_ R. Krawczyk, Newton-Algorithmen zur Bestimmung von Nullstellen mit Fehlerschranken,
Computing 4, 1969.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from closedchain.closure.solve.problem import Problem
from closedchain.closure.tape.derivative import forward
from closedchain.closure.tape.expression import Graph, Tape
from closedchain.closure.tape.intervals import Interval, interval, outward
from closedchain.closure.tape.numbers import evaluate
from closedchain.closure.tape.rows import Kinematics

RADII = (1e-10, 1e-8, 1e-6, 1e-4)
"""Half the sides of the boxes that are tried, dimensionless, the smallest first."""


@dataclass(frozen=True, eq=False)
class Certificates:
    """What was proved of postures.

    Attributes
    ----------
    proved : (n,) array of bool
        Whether exactly one solution lies in the box around each.
    radius : (n,) array
        Half the sides of that box, dimensionless (lengths by ``mechanism.length``); NaN without.
    """

    proved: np.ndarray
    radius: np.ndarray


@dataclass(frozen=True, eq=False)
class Proving:
    """Kept rows and their derivatives along steps from a posture, on any number type."""

    problem: Problem

    @cached_property
    def tape(self) -> Tape:
        """Inputs: posture, step, targets. Outputs: rows, then their derivatives by each step."""
        problem, nq, size = self.problem, self.problem.mechanism.model.nq, len(self.problem.free)
        g = Graph()
        first = Kinematics(problem.mechanism, g, g.inputs(0, nq), upright=False)
        step = dict(zip(problem.free, g.inputs(nq, size), strict=True))
        q = first.moved(first.q, step)
        k = Kinematics(problem.mechanism, g, q, upright=False)
        rows = problem.rows(k, g.inputs(nq + size, problem.prescribed))
        values = [rows.values[r] for r in problem.kept]
        out = list(values)
        for i in range(size):
            out += forward(g, values, {nq + i: 1.0})
        return g.tape(out, nq + size + problem.prescribed)

    def at(
        self, q: np.ndarray, step: list[Interval], targets: np.ndarray
    ) -> tuple[list[Interval], list[list[Interval]]]:
        """Rows, and derivatives by each unknown, over boxes of steps from postures (n, nq)."""
        given = [interval(x) for x in q.T]
        wanted = [interval(x) for x in targets.T]
        found = evaluate(self.tape, [*given, *step, *wanted])
        r = len(self.problem.kept)
        columns = [found[r * (i + 1) : r * (i + 2)] for i in range(len(self.problem.free))]
        return found[:r], columns


def certified(problem: Problem, q: np.ndarray, targets: np.ndarray) -> Certificates:
    """Prove postures (n, nq) at targets (prescribed,); the kept rows are as many as unknowns."""
    n, size = len(q), len(problem.free)
    proved, radius = np.zeros(n, dtype=bool), np.full(n, np.nan)
    key = "modes.proving", problem.pinned, problem.goals
    proving = problem.mechanism.known.setdefault(key, Proving(problem))
    every = np.repeat(targets[None], n, axis=0)
    for r in RADII:
        left = np.flatnonzero(~proved)
        if not left.size or not size:
            break
        good = _contracts(proving, q[left], every[left], r)
        proved[left[good]], radius[left[good]] = True, r
    if not size:
        proved[:], radius[:] = True, 0.0
    return Certificates(proved, radius)


def _contracts(proving: Proving, q: np.ndarray, targets: np.ndarray, r: float) -> np.ndarray:
    """Whether Krawczyk's operator maps boxes of half side ``r`` into their inside, (n,) of bool."""
    n, size = len(q), len(proving.problem.free)
    zero = [interval(np.zeros(n))] * size
    box = [Interval(np.full(n, -r), np.full(n, r))] * size
    values, slopes = proving.at(q, zero, targets)
    middle = np.array([[_whole(e, n).middle for e in column] for column in slopes])
    jacobian = middle.transpose(2, 1, 0)  # (n, rows, unknowns)
    inverse = np.full_like(jacobian, np.nan)
    for i in range(n):
        try:
            inverse[i] = np.linalg.inv(jacobian[i])
        except np.linalg.LinAlgError:
            continue
    c = inverse.transpose(1, 2, 0)  # (unknowns, rows, n)
    _, wide = proving.at(q, box, targets)
    f = _stacked(values, n)
    lead = _matrix_times(c, f[0][:, None], f[1][:, None])
    j = _stacked([e for column in wide for e in column], n)
    low = j[0].reshape(size, size, n).transpose(1, 0, 2)
    high = j[1].reshape(size, size, n).transpose(1, 0, 2)
    product = _matrix_times(c, low, high)
    eye = np.eye(size)[:, :, None]
    rest = outward(eye - product.high, eye - product.low)
    # |1 - C F'| times the half side, rounded up
    spread = np.zeros((size, n))
    for k in range(size):
        spread = np.nextafter(spread + np.nextafter(rest.size[:, k] * r, np.inf), np.inf)
    reach = np.nextafter(lead.size[:, 0] + spread, np.inf)
    return np.asarray((reach < r).all(axis=0))


def _whole(x: Interval, n: int) -> Interval:
    """The same for all boxes, where an entry does not depend on them."""
    return Interval(np.broadcast_to(x.low, (n,)), np.broadcast_to(x.high, (n,)))


def _stacked(numbers: list[Interval], n: int) -> tuple[np.ndarray, np.ndarray]:
    whole = [_whole(x, n) for x in numbers]
    return np.array([x.low for x in whole]), np.array([x.high for x in whole])


def _matrix_times(c: np.ndarray, low: np.ndarray, high: np.ndarray) -> Interval:
    """C (a, b, n) of exact numbers times intervals (b, m, n)."""
    zeros = np.zeros((c.shape[0], low.shape[1], c.shape[2]))
    found = Interval(zeros, zeros)
    for k in range(c.shape[1]):
        found = found + interval(c[:, k, None]) * Interval(low[k][None], high[k][None])
    return found
