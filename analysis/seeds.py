"""Where to look for singular sets on a lattice: sign changes, ends of the branch, least values."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from closedchain.analysis.lattice import Lattice, cells_around
from closedchain.analysis.walk import JOINT_LIMIT


@dataclass(frozen=True, eq=False)
class Seed:
    """A place to start from.

    Attributes
    ----------
    place : (k,) array
        Where the set is expected, [m or rad].
    cell : tuple of int
        Cell of the branch to start from.
    axis : int or None
        Axis along which it is bracketed, if any.
    reach : float
        Cells that the search may lead away from ``place``.
    """

    place: np.ndarray
    cell: tuple[int, ...]
    axis: int | None
    reach: float


REACH = 1.5  # cells from a bracketed seed to the set
FAR = 2.5  # cells from a least value to the set


def sign_changes(lattice: Lattice, kind: str) -> list[Seed]:
    """Pairs of neighbours in the branch between which the determinant of a kind changes sign.

    Cells that are singular themselves count as either sign.
    """
    det = np.where(lattice.singular[kind], 0.0, lattice.det[kind])
    sigma = lattice.sigma[kind]
    seeds = []
    for axis in range(det.ndim):
        one, two = _pairs(det.ndim, axis)
        with np.errstate(invalid="ignore"):
            product = np.sign(det[one]) * np.sign(det[two])
        both = lattice.ok[one] & lattice.ok[two]
        for cell in map(tuple, np.argwhere(both & (product <= 0.0))):
            beside = (*cell[:axis], cell[axis] + 1, *cell[axis + 1 :])
            start = cell if sigma[cell] <= sigma[beside] else beside
            ends = lattice.place(np.array([cell, beside]))
            share = _share(det[cell], det[beside])
            place = ends[0] + share * (ends[1] - ends[0])
            seeds.append(Seed(place, start, axis, REACH))
    return seeds


def _share(one: float, two: float) -> float:
    return 0.5 if one == two else float(one / (one - two))


def ends_of_branch(lattice: Lattice) -> list[Seed]:
    """Cells of the branch beside cells that it does not reach, joint limits excepted."""
    ok = lattice.ok
    out = ~ok & (lattice.status != JOINT_LIMIT)
    seeds = []
    for axis in range(ok.ndim):
        one, two = _pairs(ok.ndim, axis)
        for inside, outside, shift in ((one, two, 0), (two, one, 1)):
            for cell in map(tuple, np.argwhere(ok[inside] & out[outside])):
                lower = lattice.place(np.array([cell]))[0]
                start = (*cell[:axis], cell[axis] + shift, *cell[axis + 1 :])
                place = lower.copy()
                v = lattice.values[axis]
                place[axis] = 0.5 * (v[cell[axis]] + v[cell[axis] + 1])
                seeds.append(Seed(place, start, axis, REACH))
    return seeds


def least_values(lattice: Lattice, kind: str, most: int = 60) -> list[Seed]:
    """Cells of the branch where the singular value is no larger than at any neighbour, rising."""
    sigma = np.where(lattice.ok, lattice.sigma[kind], np.inf)
    padded = np.pad(sigma, 1, constant_values=np.inf)
    lowest = lattice.ok.copy()
    for offset in cells_around(sigma.shape):
        window = tuple(slice(1 + o, 1 + o + n) for o, n in zip(offset, sigma.shape, strict=True))
        lowest &= sigma <= padded[window]
    cells = np.argwhere(lowest)
    order = np.argsort(sigma[tuple(cells.T)], kind="stable")[:most]
    places = lattice.place(cells)
    return [Seed(places[i], tuple(int(j) for j in cells[i]), None, FAR) for i in order]


def _pairs(ndim: int, axis: int) -> tuple[tuple[slice, ...], tuple[slice, ...]]:
    """Views of an array shifted by one along an axis."""
    one = tuple(slice(None, -1) if i == axis else slice(None) for i in range(ndim))
    two = tuple(slice(1, None) if i == axis else slice(None) for i in range(ndim))
    return one, two
