"""Branch points of one-dimensional solution sets: where they lie, and which curves leave them.

They are zeros of the smallest singular value of [J; t]. On a small circle in the two-dimensional
null space there, the equations but one are solved for the rest of the unknowns (Lyapunov-Schmidt
reduction); the zeros of the one left out are where curves leave. This finds any number of curves,
tangent ones excepted.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from closedchain.closure.solve.events import Seen, least, zero
from closedchain.closure.solve.solution_set import SOLVED, SmoothEquations, settle
from closedchain.closure.solve.stepping import Here, across, at

CROSSING = 1e-4  # of the usual smallest singular value: below it, two branches cross
CLOSE = 1e-3  # of that: near enough
BESIDE = 0.01  # of a step: from a branch point to regular points beside it
BLUNT = 1e-4  # of the largest singular value: smaller ones are not divided by at a branch point
DIP = 0.3  # of the usual smallest singular value: where one lower than this is looked at
USUAL = 30  # points over which that is the median
RAYS = 48  # directions that are looked at; curves closer than two of them are taken for one
ITERATIONS = 6


def branch_points(
    system: SmoothEquations,
    points: Sequence[np.ndarray],
    weakest: Sequence[float],
    flips: Sequence[bool],
) -> tuple[list[np.ndarray], list[int]]:
    """Points of a traced curve with its branch points among them, and the indices of these.

    Where the determinant of [J; t] changes sign on the way to a point (``flips``), and where its
    smallest singular value (``weakest``) dips to zero: there an even number of branches crosses, or
    one touches. The last point may have none of both.
    """
    crossed, touched = {}, {}
    for i in np.flatnonzero(flips).tolist():
        z = _within(system, points[i - 1], points[i], signed=True)
        if z is not None:
            crossed[i] = z
    for i in range(1, len(weakest) - 1):
        if weakest[i] >= min(weakest[i - 1], weakest[i + 1]):
            continue
        if weakest[i] >= DIP * np.median(weakest[max(0, i + 1 - USUAL) : i + 1]):
            continue
        z = _within(system, points[i - 1], points[i + 1], signed=False)
        span = np.linalg.norm(system.difference(points[i - 1], points[i + 1]))
        if z is not None and not any(
            np.linalg.norm(system.difference(z, known)) < 0.1 * span for known in crossed.values()
        ):
            touched[i] = z
    found: list[np.ndarray] = []
    crossings = []
    for i, point in enumerate(points):
        if i in crossed:
            crossings.append(len(found))
            found.append(crossed[i])
        if i in touched:
            crossings.append(len(found))
        found.append(touched.get(i, point))
    return found, crossings


def _within(
    system: SmoothEquations, one: np.ndarray, two: np.ndarray, *, signed: bool
) -> np.ndarray | None:
    """Branch point on the way from one point to another.

    ``signed``: the determinant changes sign between them; else the least value is sought, and must
    be almost zero.
    """
    chord = system.difference(one, two)
    h = float(np.linalg.norm(chord))
    here = at(system, one, chord)
    if here is None:
        return None
    target = np.zeros(system.size)
    target[-1] = 1.0

    def look(guess: np.ndarray) -> Seen | None:
        found = across(system, here, guess, 4.0 * h)
        if found is None:
            return None
        matrix = found[1].matrix
        tangent = np.linalg.lstsq(matrix, target, rcond=1e-13)[0]
        square = np.vstack([matrix[:-1], tangent / np.linalg.norm(tangent)])
        smallest = float(np.linalg.svd(square, compute_uv=False)[-1])
        return smallest * float(np.linalg.slogdet(square)[0]) * here.sign, found[0]

    def between(low: np.ndarray, high: np.ndarray, share: float) -> Seen | None:
        return look(system.move(low, share * system.difference(low, high)))

    ends = look(here.z), look(system.move(here.z, h * here.tangent))
    if ends[0] is None or ends[1] is None:
        return None
    search = zero if signed else least
    value, z = search(between, ends[0], ends[1], CLOSE * CROSSING * here.least)
    return _between_regular(system, here, z, h) if abs(value) < CROSSING * here.least else None


def _between_regular(system: SmoothEquations, here: Here, z: np.ndarray, h: float) -> np.ndarray:
    """A branch point by a cubic through regular points of its curve on both sides.

    The equations are almost singular at the point itself: rounding could shift it along the other
    curve. Only those that are not are solved there.
    """
    beside = []
    for share, weight in zip((-2.0, -1.0, 1.0, 2.0), (-1.0, 4.0, 4.0, -1.0), strict=True):
        found = across(system, here, system.move(z, share * BESIDE * h * here.tangent), 4.0 * h)
        if found is None:
            return z
        beside.append(weight / 6.0 * system.difference(z, found[0]))
    z = system.move(z, np.sum(beside, axis=0))
    try:
        values, jacobian = system.evaluate(z, here.frame)
    except np.linalg.LinAlgError:
        return z
    return system.move(z, -np.linalg.lstsq(jacobian, values, rcond=BLUNT)[0])


def leaving(system: SmoothEquations, z: np.ndarray, radius: float) -> list[np.ndarray]:
    """Points of the solution set about ``radius`` away from a branch point, one for each curve end.

    Empty where the null space is not two-dimensional to the accuracy of the point.
    """
    frame = system.frame(z)
    try:
        _, jacobian = system.evaluate(z, frame)
    except np.linalg.LinAlgError:
        return []
    u, s, vt = np.linalg.svd(jacobian)
    rank = system.size - 2
    if len(s) <= rank or s[rank] > 1e-2 * s[rank - 1]:
        return []
    plane, kept, left = vt[rank:], u[:, :rank].T, u[:, rank]

    def beside(angle: float) -> tuple[float, np.ndarray] | None:
        offset = radius * (np.cos(angle) * plane[0] + np.sin(angle) * plane[1])
        point = system.move(z, offset)
        for _ in range(ITERATIONS):
            try:
                values, matrix = system.evaluate(point, frame)
            except np.linalg.LinAlgError:
                return None
            rest = kept @ values
            if np.abs(rest).max(initial=0.0) < 1e2 * SOLVED:
                return float(left @ values), point
            square = np.vstack([kept @ matrix, plane])
            try:
                step = np.linalg.solve(square, np.append(-rest, [0.0, 0.0]))
            except np.linalg.LinAlgError:
                return None
            if np.linalg.norm(step) > radius:
                return None
            point = system.move(point, step)
        return None

    angles = np.linspace(0.0, 2.0 * np.pi, RAYS + 1) + 0.0123
    seen = [beside(a) for a in angles]
    found: list[np.ndarray] = []
    for (a, one), (b, two) in pairwise(zip(angles, seen, strict=True)):
        if one is None or two is None or one[0] * two[0] > 0.0:
            continue
        low, high, at_low, at_high = a, b, one[0], two[0]
        best = one if abs(one[0]) < abs(two[0]) else two
        for _ in range(5):
            middle = (low * at_high - high * at_low) / (at_high - at_low)
            met = beside(middle)
            if met is None:
                break
            best = met if abs(met[0]) < abs(best[0]) else best
            if met[0] * at_low > 0.0:
                low, at_low = middle, met[0]
            else:
                high, at_high = middle, met[0]
        settled = settle(system, best[1])
        if settled.good:
            found.append(settled.posture)
    return found
