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

TINY = 1e-290
"""More than what products can lose below the smallest numbers."""


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
    def tapes(self) -> tuple[Tape, Tape]:
        """Inputs: posture, step, targets. Outputs: rows; their derivatives by each step."""
        problem, nq, size = self.problem, self.problem.mechanism.model.nq, len(self.problem.free)
        g = Graph()
        first = Kinematics(problem.mechanism, g, g.inputs(0, nq), upright=False)
        step = dict(zip(problem.free, g.inputs(nq, size), strict=True))
        q = first.moved(first.q, step)
        k = Kinematics(problem.mechanism, g, q, upright=False)
        rows = problem.rows(k, g.inputs(nq + size, problem.prescribed))
        values = [rows.values[r] for r in problem.kept]
        slopes = [x for i in range(size) for x in forward(g, values, {nq + i: 1.0})]
        inputs = nq + size + problem.prescribed
        return g.tape(values, inputs), g.tape(slopes, inputs)

    def rows(self, q: np.ndarray, targets: np.ndarray) -> list[Interval]:
        """Rows at postures (n, nq)."""
        zero = [interval(np.zeros(len(q)))] * len(self.problem.free)
        given = [*(interval(x) for x in q.T), *zero, *(interval(x) for x in targets.T)]
        found: list[Interval] = evaluate(self.tapes[0], given)
        return found

    def middle(self, q: np.ndarray, targets: np.ndarray) -> np.ndarray:
        """Derivatives (n, rows, unknowns) at postures (n, nq), as rounding leaves them."""
        n, size = len(q), len(self.problem.free)
        found = evaluate(self.tapes[1], [*q.T, *[np.zeros(n)] * size, *targets.T])
        columns = np.array([np.broadcast_to(x, (n,)) for x in found])
        return columns.reshape(size, -1, n).transpose(2, 1, 0)

    def slopes(self, q: np.ndarray, r: float, targets: np.ndarray) -> list[Interval]:
        """Derivatives by each unknown, over boxes of half side ``r`` around postures (n, nq)."""
        box = [Interval(np.full(len(q), -r), np.full(len(q), r))] * len(self.problem.free)
        given = [*(interval(x) for x in q.T), *box, *(interval(x) for x in targets.T)]
        found: list[Interval] = evaluate(self.tapes[1], given)
        return found


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
    jacobian = proving.middle(q, targets)
    inverse = np.full_like(jacobian, np.nan)
    for i in range(n):  # C need not be accurate: what it leaves is bounded below
        try:
            inverse[i] = np.linalg.inv(jacobian[i])
        except np.linalg.LinAlgError:
            continue
    lead = times(inverse, _stacked(proving.rows(q, targets), (n, size, 1)))
    product = times(inverse, _stacked(proving.slopes(q, r, targets), (n, size, size)))
    eye = np.eye(size)
    rest = outward(eye - product.high, eye - product.low)
    # |1 - C F'| times the half side, rounded up
    spread = np.zeros((n, size))
    for k in range(size):
        spread = np.nextafter(spread + np.nextafter(rest.size[..., k] * r, np.inf), np.inf)
    reach = np.nextafter(lead.size[..., 0] + spread, np.inf)
    return np.asarray((reach < r).all(axis=1))


def _stacked(numbers: list[Interval], shape: tuple[int, int, int]) -> Interval:
    """Matrices (n, rows, columns) of intervals from their entries, column after column."""
    n, rows, columns = shape
    bounds = []
    for side in ("low", "high"):
        every = np.array([np.broadcast_to(getattr(x, side), (n,)) for x in numbers])
        bounds.append(every.reshape(columns, rows, n).transpose(2, 1, 0))
    return Interval(*bounds)


def times(c: np.ndarray, m: Interval) -> Interval:
    """Matrices C (n, a, k) of exact numbers times matrices of intervals (n, k, b).

    By middles and radii [Rump1999]_: whatever the order of additions, k products and their sum are
    off by less than k eps, eps twice the unit of rounding, times the sum of absolute values.

    [Rump1999]_ S. M. Rump, Fast and parallel interval arithmetic, BIT 39, 1999.
    """
    share = (c.shape[2] + 4) * np.finfo(float).eps
    with np.errstate(invalid="ignore", over="ignore"):
        middle = m.middle
        radius = np.nextafter(np.maximum(m.high - middle, middle - m.low), np.inf)
        size = np.abs(c)
        product = c @ middle
        bound = (size @ radius + share * (size @ np.abs(middle))) * (1.0 + share) + TINY
        return outward(product - bound, product + bound)
