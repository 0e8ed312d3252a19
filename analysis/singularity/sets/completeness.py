"""Completeness of a traced set: a grid twice as fine must show nothing that lies away from it."""

from __future__ import annotations

import numpy as np

from closedchain.analysis.singularity.sets.lattice import finer
from closedchain.analysis.singularity.sets.seeds import brackets, middles
from closedchain.analysis.singularity.sets.tracked import Tracker
from closedchain.closure.progress import Progress


def complete(
    tracker: Tracker, kind: str, touched: np.ndarray, progress: Progress | None = None
) -> int:
    """Trace what a grid twice as fine shows besides; return how much of it stays away from the set.

    Every sign change, and every end of the branch where the chart folds, must lie within a cell of
    the coarse grid of some point of the set, ``touched`` (n, k) among them.
    """
    from scipy.spatial import cKDTree

    fine, cell = finer(tracker.lattice, progress), tracker.lattice.cell
    tracker.finer = fine
    edges = brackets(fine, kind)
    if len(touched):  # a cell that is singular itself counts as either sign
        apart, _ = cKDTree(touched / cell).query(middles(fine, edges) / cell)
        edges = edges.take(apart > 1.0)
    places, found = middles(fine, edges), tracker.located(kind, fine, edges)
    away = _away(tracker, places, found, cell)
    if away.any():
        for _ in tracker.follow(found[away]):
            pass
        away &= _away(tracker, places, found, cell)
    return int(away.sum())


def _away(tracker: Tracker, places: np.ndarray, found: np.ndarray, cell: np.ndarray) -> np.ndarray:
    """Which places (n, k) have no traced point within a cell, or a solution that none passes.

    The solution (n, nq + k) tells apart sheets that lie on top of each other in the coordinates.
    """
    from scipy.spatial import cKDTree

    points = [tracker.system.coordinates(c.points) for c in tracker.linked()]
    points += [tracker.system.coordinates(z)[None] for z in tracker.alone()]
    if not points or not len(places):
        return np.ones(len(places), dtype=bool)
    apart, _ = cKDTree(np.concatenate(points) / cell).query(places / cell)
    away = apart > 1.0
    for i in np.flatnonzero(~away & np.isfinite(found[:, 0])):
        outside = any(b.beyond(found[i]) is not None for b in tracker.bounds)
        away[i] = not outside and not tracker.knows(found[i])
    return np.asarray(away)
