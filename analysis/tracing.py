"""Tracing one-dimensional solution sets by predictor-corrector continuation.

The predictor goes along the tangent, the corrector is Newton's method in the plane across it
(pseudo-arclength). Steps adapt to how fast the corrector contracts and how far the tangent turns.
With the tangent's sense kept, det [J; t] keeps its sign but for branch points, where the curve
crosses another one and the tangent's null space is two-dimensional [Allgower2003]_.

[Allgower2003]_ E. L. Allgower and K. Georg, Introduction to numerical continuation methods, SIAM,
2003.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

SOLVED = 1e-12  # largest dimensionless row of a point on the curve
DEPENDENT = 1e-10  # the same for rows that are no longer independent on the curve
TURN = 0.25  # rad: largest change of the tangent in a step
CONTRACTION = 0.4  # of successive corrector steps
SMALLEST = 1e-6  # dimensionless step below which the curve counts as ended
ITERATIONS = 8
RANK = 1e-9
CROSSING = 1e-4  # of the usual smallest singular value: below it, two branches cross


class System(Protocol):
    """Smooth equations whose solutions are traced; points are arrays, steps dimensionless.

    ``frame`` is whatever has to be held for the equations to be smooth around a point.
    """

    @property
    def size(self) -> int:
        """Number of unknowns."""

    def frame(self, z: np.ndarray) -> Any:
        """What is held around a point."""

    def evaluate(self, z: np.ndarray, frame: Any) -> tuple[np.ndarray, np.ndarray]:
        """Residual (rows,) and Jacobian (rows, size)."""

    def move(self, z: np.ndarray, step: np.ndarray) -> np.ndarray:
        """Point after a step (size,)."""

    def difference(self, one: np.ndarray, two: np.ndarray) -> np.ndarray:
        """Step (size,) from one point to another."""


@dataclass(frozen=True)
class Bound:
    """Range of one unknown: entry ``index`` of a point, ``column`` of a step, ``unit`` between."""

    index: int
    column: int
    unit: float
    lower: float
    upper: float
    label: str

    def beyond(self, z: np.ndarray) -> float | None:
        """Value of the bound that a point lies beyond, or None."""
        slack = 1e-9 * self.unit
        if z[self.index] > self.upper + slack:
            return self.upper
        return self.lower if z[self.index] < self.lower - slack else None


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


@dataclass(eq=False)
class _Here:
    """A point of the path with the equations' frame, tangent, and what is told from it."""

    z: np.ndarray
    frame: Any
    squeeze: np.ndarray | None
    tangent: np.ndarray
    sign: float
    least: float


def settle(
    system: System,
    z: np.ndarray,
    held: Sequence[tuple[Bound, float]] = (),
    *,
    longest: float = 0.3,
    iterations: int = 25,
    tolerance: float = SOLVED,
) -> np.ndarray | None:
    """Solution near a point by damped Gauss-Newton steps of least norm, or None.

    ``held`` adds rows: the unknown of a bound at a value.
    """
    last = np.inf
    for _ in range(iterations):
        values, jacobian = system.evaluate(z, system.frame(z))
        for bound, value in held:
            row = np.zeros((1, system.size))
            row[0, bound.column] = 1.0
            jacobian = np.vstack([jacobian, row])
            values = np.append(values, (z[bound.index] - value) / bound.unit)
        worst = float(np.abs(values).max(initial=0.0))
        if worst < tolerance:
            return z
        if worst < 100.0 * tolerance and worst >= 0.5 * last:
            return z  # at rounding level
        last = worst
        step = -np.linalg.lstsq(jacobian, values, rcond=RANK)[0]
        size = float(np.linalg.norm(step))
        if not np.isfinite(size) or size < 1e-15:
            return None
        z = system.move(z, step * min(1.0, longest / size))
    return None


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
    recent: list[_Here] = []
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
            if landed is not None and np.linalg.norm(system.difference(here.z, landed)) < 3.0 * h:
                points.append(landed)
                return Path(points, hit[0], crossings)
            return Path(points, hit[0], crossings)
        if sign * here.sign < 0.0:
            crossing = _locate(system, here, h, signed=True)
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
            touch = _locate(system, recent[0], span, signed=False)
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


def _at(system: System, z: np.ndarray, towards: np.ndarray) -> _Here | None:
    """Frame, tangent and orientation at a point; None where the tangent is not unique."""
    frame = system.frame(z)
    _, jacobian = system.evaluate(z, frame)
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
    return _Here(z, frame, squeeze, tangent, _orientation(jacobian, tangent), float(s[rank - 1]))


def _orientation(jacobian: np.ndarray, tangent: np.ndarray) -> float:
    return float(np.linalg.slogdet(np.vstack([jacobian, tangent]))[0])


def _correct(
    system: System, here: _Here, z: np.ndarray, h: float
) -> tuple[np.ndarray, np.ndarray, float] | None:
    """Newton's method across the tangent of ``here``; point, Jacobian, first step; or None."""
    first = last = np.inf
    for count in range(ITERATIONS):
        values, jacobian = system.evaluate(z, here.frame)
        every = float(np.abs(values).max(initial=0.0))
        if here.squeeze is not None:
            values, jacobian = here.squeeze @ values, here.squeeze @ jacobian
        worst = float(np.abs(values).max(initial=0.0))
        if worst < SOLVED:
            # rows taken for dependent must vanish with the others
            solved = every < DEPENDENT
            return (z, jacobian, 0.0 if count == 0 else first) if solved else None
        square = np.vstack([jacobian, here.tangent])
        try:
            step = -np.linalg.solve(square, np.append(values, 0.0))
        except np.linalg.LinAlgError:
            return None
        size = float(np.linalg.norm(step))
        if not np.isfinite(size) or size > max(CONTRACTION * last, 1e-11) or size > 0.5 * h + 1e-9:
            return None
        first, last = (size, size) if count == 0 else (first, size)
        z = system.move(z, step)
    return None


def _step(
    system: System, here: _Here, h: float
) -> tuple[tuple[np.ndarray, np.ndarray, np.ndarray] | None, float]:
    """One step of length h: (point, Jacobian, tangent) or None, and the next step's factor."""
    found = _correct(system, here, system.move(here.z, h * here.tangent), h)
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


def _closes(system: System, here: _Here, begin: _Here, h: float) -> bool:
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


def _locate(system: System, here: _Here, h: float, *, signed: bool) -> np.ndarray | None:
    """Branch point within a step of length h: zero of the smallest singular value of [J; t].

    ``signed``: the determinant changes sign, so the zero is bracketed; else the least value is
    sought, and must be almost zero.
    """
    usual = here.least
    target = np.zeros(system.size)
    target[-1] = 1.0

    def look(guess: np.ndarray) -> _Seen | None:
        found = _correct(system, here, guess, 4.0 * h)
        if found is None:
            return None
        z, jacobian, _ = found
        tangent = np.linalg.lstsq(np.vstack([jacobian, here.tangent]), target, rcond=1e-13)[0]
        square = np.vstack([jacobian, tangent / np.linalg.norm(tangent)])
        least = float(np.linalg.svd(square, compute_uv=False)[-1])
        return least * float(np.linalg.slogdet(square)[0]) * here.sign, z

    def between(one: np.ndarray, two: np.ndarray, share: float) -> _Seen | None:
        return look(system.move(one, share * system.difference(one, two)))

    ends = look(here.z), look(system.move(here.z, h * here.tangent))
    if ends[0] is None or ends[1] is None:
        return None
    search = _bracketed if signed else _least
    value, z = search(between, ends[0], ends[1], usual)
    return z if abs(value) < CROSSING * usual else None


_Seen = tuple[float, np.ndarray]
_Between = Callable[[np.ndarray, np.ndarray, float], _Seen | None]


def _bracketed(between: _Between, low: _Seen, high: _Seen, usual: float) -> _Seen:
    """Zero of a function of points on a path, of opposite sign at its ends, by Illinois steps."""
    best = min(low, high, key=_size)
    weights = [1.0, 1.0]
    for _ in range(40):
        if _size(best) < 1e-6 * CROSSING * usual or low[0] * high[0] > 0.0:
            break
        a, b = low[0] * weights[0], high[0] * weights[1]
        found = between(low[1], high[1], float(np.clip(a / (a - b), 0.01, 0.99)))
        if found is None:
            break  # the equations are singular at the branch point itself: near enough
        best = min(best, found, key=_size)
        if found[0] * low[0] > 0.0:
            low, weights = found, [1.0, 0.5 * weights[1]]
        else:
            high, weights = found, [0.5 * weights[0], 1.0]
    return best


def _least(between: _Between, low: _Seen, high: _Seen, usual: float) -> _Seen:
    """Least size of a function of points on a path, by shrinking around the best of three."""
    best = between(low[1], high[1], 0.5) or min(low, high, key=_size)
    for _ in range(40):
        if _size(best) < 1e-6 * CROSSING * usual:
            break
        beside = between(low[1], best[1], 0.5), between(best[1], high[1], 0.5)
        before, after = beside
        if before is None or after is None:
            break
        if min(_size(before), _size(after)) >= _size(best):
            low, high = before, after
        elif _size(before) < _size(after):
            best, high = before, best
        else:
            low, best = best, after
    return best


def _size(seen: _Seen) -> float:
    return abs(seen[0])
