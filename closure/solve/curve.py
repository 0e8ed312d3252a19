"""Tracing a one-dimensional solution set by arc length, through folds and branch points.

The predictor goes along the tangent, the corrector is Newton's method in the plane across it
(pseudo-arclength). Steps adapt to how fast the corrector contracts and how far the tangent turns.
With the tangent's sense kept, det [J; t] keeps its sign but for branch points, where the curve
crosses another one and the tangent's null space is two-dimensional [Allgower2003]_.

[Allgower2003]_ E. L. Allgower and K. Georg, Introduction to numerical continuation methods, SIAM,
2003.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from closedchain.closure.solve.branching import branch_points
from closedchain.closure.solve.outcome import Ending
from closedchain.closure.solve.solution_set import Bound, SmoothEquations, settle
from closedchain.closure.solve.stepping import Here, at, onward

ARRIVED = 1e-9  # dimensionless: a point nearer to a bound than this lies on it


@dataclass(frozen=True, eq=False)
class Path:
    """One direction of a curve.

    Attributes
    ----------
    points : list of arrays
        From the start on, the start included.
    ending : Ending
        CLOSED where the start was met again, that of a bound, DEGENERATE (the equations lose rank,
        or no step leads on), or BUDGET.
    label : str
        Of the bound at which it ends, if any.
    crossings : list of int
        Indices of the points that are branch points.
    """

    points: list[np.ndarray]
    ending: Ending
    label: str = ""
    crossings: list[int] = field(default_factory=list)

    @property
    def end(self) -> str:
        """In a word: the label of the bound, or else that of the ending."""
        return self.label or self.ending.word


def trace(
    system: SmoothEquations,
    start: np.ndarray,
    towards: np.ndarray,
    longest: np.ndarray,
    bounds: Sequence[Bound] = (),
    most: int = 3000,
) -> Path:
    """Trace the curve through ``start`` in the direction ``towards``.

    Parameters
    ----------
    start : array
        A solution, where the equations have full rank but for one direction.
    towards : (size,) array
        Tangent there, roughly; its sense is kept.
    longest : (size,) array
        Largest change of each unknown in a step.
    bounds : sequence of Bound
        The path ends on the first that it meets.
    """
    begin = at(system, start, towards)
    if begin is None:
        return Path([start], Ending.DEGENERATE)
    here, points = begin, [start]
    weakest, flips = [begin.least], [False]

    def ended(ending: Ending, label: str = "") -> Path:
        found, crossings = branch_points(system, points, weakest, flips)
        return Path(found, ending, label, crossings)

    h = 0.3 * _reach(here.tangent, longest)
    while len(points) < most:
        h = min(h, _reach(here.tangent, longest))
        if len(points) > 3 and _closes(system, here, begin, 1.1 * h):
            return ended(Ending.CLOSED)
        new, h, grow = onward(system, here, h)
        if new is None:
            return ended(Ending.DEGENERATE)
        z, flip, there = new
        hit = _first_bound(here.z, z, bounds)
        if hit is not None:
            landed = settle(system, z, [hit])
            if landed.good:
                gap = float(np.linalg.norm(system.difference(here.z, landed.posture)))
                if ARRIVED < gap < 3.0 * h:
                    points.append(landed.posture)
            return ended(hit[0].ending, hit[0].label)
        points.append(z)
        flips.append(flip)
        if there is None:
            weakest.append(0.0)
            return ended(Ending.DEGENERATE)
        weakest.append(there.least)
        here, h = there, h * grow
    return ended(Ending.BUDGET)


def _reach(tangent: np.ndarray, longest: np.ndarray) -> float:
    """Longest step along a tangent that changes no unknown by more than its share."""
    return float((longest / np.maximum(np.abs(tangent), 1e-12)).min())


def _closes(system: SmoothEquations, here: Here, begin: Here, h: float) -> bool:
    """Whether the start lies ahead, within a step, in the sense of the path."""
    if here.tangent @ begin.tangent < 0.5:
        return False
    gap = system.difference(here.z, begin.z)
    ahead = float(gap @ here.tangent)
    aside = float(np.linalg.norm(gap - ahead * here.tangent))
    return 0.0 < ahead <= h and aside < 0.3 * h


def _first_bound(
    before: np.ndarray, after: np.ndarray, bounds: Sequence[Bound]
) -> tuple[Bound, float] | None:
    """The bound that is met first on the way, with its value."""
    best, share = None, np.inf
    for bound in bounds:
        value = bound.beyond(after)
        if value is None:
            continue
        way = after[bound.index] - before[bound.index]
        met = (value - before[bound.index]) / way if way else 0.0
        if met < share:
            best, share = (bound, value), met
    return best
