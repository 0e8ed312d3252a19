"""Completeness of a traced set: a grid twice as fine must show nothing that lies away from it."""

from __future__ import annotations

import numpy as np

from closedchain.analysis.curves import seeds_of
from closedchain.analysis.lattice import finer, measured
from closedchain.analysis.seeds import Seed
from closedchain.analysis.tracked import Tracker
from closedchain.analysis.walk import Progress

ROUNDS = 2  # times that what was missed is traced


def complete(
    tracker: Tracker, kind: str, outputs: tuple[str, ...], progress: Progress | None = None
) -> int:
    """Trace what a grid twice as fine shows besides; return how much of it stays away from the set.

    Every sign change, and every end of the branch where the chart folds, must lie within a cell of
    the coarse grid of some point of the set.
    """
    coarse = tracker.lattice
    axes, status, q = finer(coarse, progress)
    fine = measured(coarse.chart, axes, status, q, (kind,), outputs, progress)
    seeds = seeds_of(fine, kind)
    tracker.lattice = fine
    away = _away(tracker, seeds, coarse.cell)
    for _ in range(ROUNDS):
        if not away:
            break
        dropped = tracker.dropped
        tracker.follow(away)
        tracker.dropped = dropped  # what leads nowhere is counted as missed
        away = _away(tracker, away, coarse.cell)
    tracker.lattice = coarse
    return len(away)


def _away(tracker: Tracker, seeds: list[Seed], cell: np.ndarray) -> list[Seed]:
    """Seeds whose solution lies on nothing that was traced, or is further than a cell from it.

    The solution tells apart sheets that lie on top of each other in the coordinates.
    """
    from scipy.spatial import cKDTree

    points = [tracker.system.coordinates(c.points) for c in tracker.linked()]
    points += [tracker.system.coordinates(z)[None] for z in tracker.points]
    if not points or not seeds:
        return seeds
    tree = cKDTree(np.concatenate(points) / cell)
    apart, _ = tree.query(np.array([seed.place for seed in seeds]) / cell)
    away = []
    for seed, distance in zip(seeds, apart, strict=True):
        z = tracker.polished(seed) if distance <= 1.0 else None
        known = distance <= 1.0 and (
            z is None or any(b.beyond(z) is not None for b in tracker.bounds) or tracker.knows(z)
        )
        if not known:
            away.append(seed)
    return away
