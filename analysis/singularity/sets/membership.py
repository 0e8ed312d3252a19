"""Whether singular postures are met by the branch of a lattice, or lie on another sheet."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from closedchain.analysis.singularity.sets.lattice import Lattice
from closedchain.analysis.singularity.sets.slices import Slice
from closedchain.closure.solve.solution_set import settle

CELLS = 2  # nearest cells of the branch that are tried
AWAY = 2.5  # cells: how far they may be
SAME = 1e-6  # dimensionless: postures that are one
SHORT = 0.02  # share of the way that may be left at a fold
MERGING = 0.02  # dimensionless: how far apart postures may be, short of a fold by ``CLOSE``
CLOSE = 1e-4  # share of the way
AROUND = 9  # cells that ways to a self-motion are tried from
STANDING = 0.3  # dimensionless: from the end of such a way to the self-motion
SAMPLE = 5  # points of a curve between two that are looked at, while they agree


def reached(system: Slice, branch: Sequence[Lattice], points: np.ndarray) -> np.ndarray:
    """Whether the straight way from a nearby cell of the branch leads to each very point.

    At a fold of the chart the way ends just before the point.

    Parameters
    ----------
    branch : sequence of Lattice
        The branch on one grid or on several: to be reached from one is enough.
    points : (n, nq + k) array

    Returns
    -------
    (n,) array of bool
    """
    out = np.zeros(len(points), dtype=bool)
    for lattice in branch:
        left = np.flatnonzero(~out)
        out[left] = _reached(system, lattice, points[left])
    return out


def _reached(system: Slice, lattice: Lattice, points: np.ndarray) -> np.ndarray:
    out = np.zeros(len(points), dtype=bool)
    if not len(points) or not len(lattice.cells):
        return out
    places = system.coordinates(points)
    apart, near = lattice.tree.query(places / lattice.cell, k=min(CELLS, len(lattice.cells)))
    apart, near = apart.reshape(len(points), -1), near.reshape(len(points), -1)
    for rank in range(apart.shape[1]):
        todo = np.flatnonzero(~out & (apart[:, rank] <= AWAY))
        if todo.size:
            cells = lattice.cells[near[todo, rank]]
            out[todo] = _leads(system, lattice, cells, points[todo])
    return out


def turned_alike(system: Slice, lattice: Lattice, points: np.ndarray) -> np.ndarray:
    """Points (n, nq + k) with joints as many turns round as at the nearest cells of the branch."""
    if not len(points) or not len(lattice.cells):
        return points
    _, near = lattice.tree.query(system.coordinates(points) / lattice.cell)
    cells = lattice.cells[near]
    there = system.point(lattice.q[tuple(cells.T)], lattice.place(cells))
    found = system.move(there, system.difference(there, points))
    return np.concatenate([system.posture(found), system.coordinates(points)], axis=1)


def met(system: Slice, branch: Sequence[Lattice], z: np.ndarray) -> bool:
    """Whether a way from a nearby cell of the branch ends in some solution above a point's place.

    For points (nq + k,) above which a whole set of postures stands: which of them a way ends in
    depends on where it comes from.
    """
    return any(_met(system, lattice, z) for lattice in branch)


def _met(system: Slice, lattice: Lattice, z: np.ndarray) -> bool:
    place = system.coordinates(z)
    count = min(AROUND, len(lattice.cells))
    if not count:
        return False
    apart, near = lattice.tree.query(place / lattice.cell, k=count)
    cells = lattice.cells[np.atleast_1d(near)[np.atleast_1d(apart) <= AWAY]]
    if not len(cells):
        return False
    short = place + SHORT * (lattice.place(cells) - place)
    q, gone = lattice.follow(lattice.q[tuple(cells.T)], short)
    for start in system.point(q, short)[gone == 1.0]:
        found = settle(system, start)
        there = found.posture
        if not found.good or np.abs(system.difference(start, there)).max() > STANDING:
            continue
        if (np.abs(system.coordinates(there) - place) <= 1e-4 * lattice.cell).all():
            return True
    return False


def along(system: Slice, branch: Sequence[Lattice], points: np.ndarray) -> np.ndarray:
    """``reached`` for the points (n, nq + k) of a curve: every one only where that changes."""
    n = len(points)
    marks = np.unique([*range(0, n, SAMPLE), n - 1])
    at = reached(system, branch, points[marks])
    out = np.repeat(at, np.diff(np.append(marks, n)))
    changes = np.flatnonzero(at[:-1] != at[1:])
    between = [np.arange(marks[i] + 1, marks[i + 1]) for i in changes]
    unsure = np.concatenate([np.zeros(0, dtype=int), *between])
    out[unsure] = reached(system, branch, points[unsure])
    return out


def _leads(system: Slice, lattice: Lattice, cells: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Whether ways from cells (n, k) lead to points (n, nq + k), (n,) of bool."""
    target = system.coordinates(points)
    q, gone = lattice.follow(lattice.q[tuple(cells.T)], target)
    gap = np.abs(system.difference(points, system.point(q, target))).max(axis=1)
    # short of a fold by the share s of the way, postures differ like the root of s
    merging = MERGING + 2.0 * np.sqrt(np.maximum(1.0 - gone, CLOSE))
    ended = (gone < 1.0) & (1.0 - gone <= SHORT) & (gap < merging)
    return np.asarray(((gone == 1.0) & (gap < SAME)) | ended)
