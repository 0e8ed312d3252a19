"""Cusps of a slice: where a fold is itself folded, and three postures meet.

Along a curve of folds the posture always moves on, the coordinates not always: they stop and turn
back at a cusp. Round it, two of the three postures change into each other without a singularity.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from closedchain.analysis.singularity.sets.bordered import Measure
from closedchain.analysis.singularity.sets.singular_set import SingularitySet
from closedchain.analysis.singularity.sets.slices import Slice
from closedchain.closure.solve.outcome import Ending
from closedchain.closure.solve.solution_set import settle, tangents

BISECTIONS = 60
STILL = 1e-6  # share of a unit tangent that may be left in the coordinates at a cusp
SAME = 1e-6  # dimensionless: cusps that are one


def cusps_of(found: SingularitySet, outputs: tuple[str, ...]) -> np.ndarray:
    """Cusps (n, nq + k) on the curves of a set: postures, and coordinates [m or rad].

    Of kinds at which the coordinates fold; other kinds have none, nor have sets that are no curves.
    """
    chart = found.chart
    system = Slice(chart, (Measure(chart.mechanism, found.kind, outputs),))
    z = system.point(found.q, found.coordinates)
    cusps: list[np.ndarray] = []
    if found.dimension == 1 and found.kind == chart.folds:
        for i, piece in enumerate(found.pieces):
            if len(piece) < 3:
                continue
            closed = found.ends[i][0] == Ending.CLOSED.word
            for cusp in _along(system, z[np.append(piece, piece[0]) if closed else piece]):
                if all(np.linalg.norm(system.difference(cusp, other)) > SAME for other in cusps):
                    cusps.append(cusp)
    return np.array(cusps).reshape(len(cusps), z.shape[1])


def _along(system: Slice, points: np.ndarray) -> list[np.ndarray]:
    """Cusps between the points (n, nq + k) of a curve."""
    found = []
    last = None
    for one, two in pairwise(points):
        chord = system.difference(one, two)
        here = _tangent(system, one, chord) if last is None else last
        last = _tangent(system, two, chord)
        if here is None or last is None:
            continue
        if _coordinates(system, here) @ _coordinates(system, last) < 0.0:
            cusp = _between(system, one, chord, _coordinates(system, here))
            if cusp is not None:
                found.append(cusp)
    return found


def _between(
    system: Slice, begin: np.ndarray, chord: np.ndarray, way: np.ndarray
) -> np.ndarray | None:
    """Where the coordinates stand still along a chord from a point, or None."""
    way = way / np.linalg.norm(way)
    low, high = 0.0, 1.0
    place = None
    for _ in range(BISECTIONS):
        share = 0.5 * (low + high)
        settled = settle(system, system.move(begin, share * chord))
        if not settled.good:
            return None
        place = settled.posture
        tangent = _tangent(system, place, chord)
        if tangent is None:
            return None
        moving = float(_coordinates(system, tangent) @ way)
        if abs(moving) < 1e-13 or high - low < 1e-12:
            break
        low, high = (share, high) if moving > 0.0 else (low, share)
    if place is None:
        return None
    last = _tangent(system, place, chord)
    still = last is not None and np.linalg.norm(_coordinates(system, last)) < STILL
    return place if still else None


def _tangent(system: Slice, z: np.ndarray, chord: np.ndarray) -> np.ndarray | None:
    """Unit tangent (size,) of a curve at a point, along a chord; None where there is not one."""
    try:
        basis = tangents(system, z)
    except np.linalg.LinAlgError:
        return None
    if basis.shape[1] != 1:
        return None
    tangent = basis[:, 0]
    return tangent if tangent @ chord >= 0.0 else -tangent


def _coordinates(system: Slice, tangent: np.ndarray) -> np.ndarray:
    """Part of a tangent in the coordinates (k,)."""
    return tangent[system.mechanism.model.nv :]
