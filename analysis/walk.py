"""Walking a grid in memory along one branch: the status and posture of every cell."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from closedchain.analysis.grid import (
    JOINT_LIMIT,
    NOT_CONVERGED,
    OK,
    OTHER_BRANCH,
    STATUSES,
    UNREACHABLE,
    UNSEEN,
    Grid,
    Progress,
    grid_of,
)
from closedchain.closure.mechanism import Mechanism

__all__ = [
    "JOINT_LIMIT",
    "NOT_CONVERGED",
    "OK",
    "OTHER_BRANCH",
    "STATUSES",
    "UNREACHABLE",
    "UNSEEN",
    "Grid",
    "Progress",
    "Walk",
    "grid_of",
    "walk",
]


@dataclass(frozen=True, eq=False)
class Walk:
    """Outcome of a walk: status (shape) of int, and q (shape, nq) where the status is OK."""

    grid: Grid
    status: np.ndarray
    q: np.ndarray


def walk(mechanism: Mechanism, grid: Grid, progress: Progress | None = None) -> Walk:
    """Follow the branch of the grid's start over all cells.

    Raises
    ------
    ClosureError
        The cell nearest to the start cannot be reached from it, or memory does not suffice.
    """
    from closedchain.analysis.anchor import anchor_of
    from closedchain.analysis.journal import InMemory
    from closedchain.analysis.rounds import fill
    from closedchain.analysis.scheduling import crew
    from closedchain.analysis.spreading import Job
    from closedchain.analysis.storage import in_memory
    from closedchain.analysis.tiles import tiles_of

    tiles = tiles_of(grid.shape, None, grid.names)
    job = Job(grid, tiles, (), keep_q=True, measured=False)
    store = in_memory(tiles, (), mechanism.model.nq, keep_q=True)
    with crew(job) as workers:
        fill(job, anchor_of(grid), store, InMemory(), workers, progress)
    return Walk(grid, store.arrays["status"], store.arrays["q"])
