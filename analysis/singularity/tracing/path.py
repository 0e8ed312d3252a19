"""Tracing one-dimensional solution sets by predictor-corrector continuation.

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

from closedchain.analysis.singularity.tracing.corrector import (
    RANK,
    Bound,
    Here,
    System,
    correct_across,
    settle,
)
from closedchain.analysis.singularity.tracing.crossing import crossing_within

__all__ = ["Bound", "Path", "System", "settle", "tangents", "trace"]

TURN = 0.25  # rad: largest change of the tangent in a step
ARRIVED = 1e-9  # dimensionless: a point nearer to a bound than this lies on it
SMALLEST = 1e-6  # dimensionless step below which the curve counts as ended


@dataclass(frozen=True, eq=False)
class Path:
    """One direction of a curve.

    Attributes
    ----------
    points : list of arrays
        From the start on, the start included.
    end : str
        "closed" (the start was met again), the label of a bound, "degenerate" (the equations lose
        rank, or steps become too small) or "cut short" (too many points).
    crossings : list of int
        Indices of the points that are branch points.
    """

    points: list[np.ndarray]
    end: str
    crossings: list[int] = field(default_factory=list)


def tangents(system: System, z: np.ndarray, tolerance: float = 1e-7) -> np.ndarray:
    """Orthonormal basis (size, dimension) of the solutions' tangent space at a point."""
    _, jacobian = system.evaluate(z, system.frame(z))
    _, s, vt = np.linalg.svd(jacobian)
    rank = int(np.count_nonzero(s > tolerance * s[0]))
    return np.ascontiguousarray(vt[rank:].T)


def trace(
    system: System,
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
    here = _at(system, start, towards)
    if here is None:
        return Path([start], "degenerate")
    begin = here
    points = [start]
    crossings: list[int] = []
    recent: list[Here] = []
    least: list[float] = []
    h = 0.3 * _reach(here.tangent, longest)
    while len(points) < most:
        h = min(h, _reach(here.tangent, longest))
        if len(points) > 3 and _closes(system, here, begin, 1.1 * h):
            return Path(points, "closed", crossings)
        new, grow = None, 0.5
        while new is None and h >= SMALLEST:
            new, grow = _step(system, here, h)
            h *= grow if new is None else 1.0
        if new is None:
            return Path(points, "degenerate", crossings)
        z, jacobian, tangent = new
        sign = _orientation(jacobian, tangent)
        hit = _first_bound(here.z, z, bounds)
        if hit is not None:
            landed = settle(system, z, [hit[1]])
            gap = np.inf
            if landed is not None:
                gap = float(np.linalg.norm(system.difference(here.z, landed)))
            if landed is not None and ARRIVED < gap < 3.0 * h:
                points.append(landed)
                return Path(points, hit[0], crossings)
            return Path(points, hit[0], crossings)
        if sign * here.sign < 0.0:
            crossing = crossing_within(system, here, h, signed=True)
            if crossing is not None:
                crossings.append(len(points))
                points.append(crossing)
        onward = _at(system, z, tangent)
        if onward is None:
            points.append(z)
            return Path(points, "degenerate", crossings)
        points.append(z)
        recent = [*recent[-1:], here]
        dips = here.least < min(recent[0].least, onward.least)
        least.append(here.least)
        if len(recent) == 2 and dips and here.least < 0.3 * float(np.median(least[-30:])):
            span = float(np.linalg.norm(system.difference(recent[0].z, z)))
            touch = crossing_within(system, recent[0], span, signed=False)
            known = [points[i] for i in crossings]
            if touch is not None and not any(
                np.linalg.norm(system.difference(touch, k)) < 0.1 * span for k in known
            ):
                crossings.append(len(points) - 2)
                points[-2] = touch
        here = onward
        h *= grow
    return Path(points, "cut short", crossings)


def _reach(tangent: np.ndarray, longest: np.ndarray) -> float:
    """Longest step along a tangent that changes no unknown by more than its share."""
    return float((longest / np.maximum(np.abs(tangent), 1e-12)).min())


def _at(system: System, z: np.ndarray, towards: np.ndarray) -> Here | None:
    """Frame, tangent and orientation at a point; None where the tangent is not unique.

    None as well where not even the frame makes the equations regular.
    """
    frame = system.frame(z)
    try:
        _, jacobian = system.evaluate(z, frame)
    except np.linalg.LinAlgError:
        return None
    u, s, vt = np.linalg.svd(jacobian)
    rank = system.size - 1
    if len(s) < rank or s[rank - 1] < RANK * s[0]:
        return None
    tangent = vt[-1]
    tangent = tangent * (1.0 if tangent @ towards >= 0.0 else -1.0)
    squeeze = None
    if jacobian.shape[0] != rank:  # more rows than their rank: dependent, yet consistent
        squeeze = u[:, :rank].T
        jacobian = squeeze @ jacobian
    return Here(z, frame, squeeze, tangent, _orientation(jacobian, tangent), float(s[rank - 1]))


def _orientation(jacobian: np.ndarray, tangent: np.ndarray) -> float:
    return float(np.linalg.slogdet(np.vstack([jacobian, tangent]))[0])


def _step(
    system: System, here: Here, h: float
) -> tuple[tuple[np.ndarray, np.ndarray, np.ndarray] | None, float]:
    """One step of length h: (point, Jacobian, tangent) or None, and the next step's factor."""
    found = correct_across(system, here, system.move(here.z, h * here.tangent), h)
    if found is None:
        return None, 0.5
    z, jacobian, first = found
    target = np.zeros(system.size)
    target[-1] = 1.0
    try:
        tangent = np.linalg.solve(np.vstack([jacobian, here.tangent]), target)
    except np.linalg.LinAlgError:
        return None, 0.7
    tangent /= np.linalg.norm(tangent)
    turn = float(np.arccos(min(1.0, tangent @ here.tangent)))
    if turn > TURN:
        return None, max(0.2, 0.7 * TURN / turn)
    strain = max(turn / (0.6 * TURN), (first / h / 0.05) if h > 0.0 else 0.0, 0.25)
    return (z, jacobian, tangent), float(np.clip(1.0 / strain, 0.5, 2.0))


def _closes(system: System, here: Here, begin: Here, h: float) -> bool:
    """Whether the start lies ahead, within a step, in the sense of the path."""
    if here.tangent @ begin.tangent < 0.5:
        return False
    gap = system.difference(here.z, begin.z)
    ahead = float(gap @ here.tangent)
    aside = float(np.linalg.norm(gap - ahead * here.tangent))
    return 0.0 < ahead <= h and aside < 0.3 * h


def _first_bound(
    before: np.ndarray, after: np.ndarray, bounds: Sequence[Bound]
) -> tuple[str, tuple[Bound, float]] | None:
    """The bound that is met first on the way, with its value."""
    best, share = None, np.inf
    for bound in bounds:
        value = bound.beyond(after)
        if value is None:
            continue
        way = after[bound.index] - before[bound.index]
        met = (value - before[bound.index]) / way if way else 0.0
        if met < share:
            best, share = (bound.label, (bound, value)), met
    return best
