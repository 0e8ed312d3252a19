"""Where to look for singular sets on a lattice: sign changes, ends of the branch, least values."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from closedchain.analysis.singularity.maps.grid import JOINT_LIMIT
from closedchain.analysis.singularity.sets.edges import Edges
from closedchain.analysis.singularity.sets.lattice import Lattice, cells_around, pairs


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
    others : tuple of cells
        Neighbours to start from where the cell itself leads to nothing.
    """

    place: np.ndarray
    cell: tuple[int, ...]
    axis: int | None
    reach: float
    others: tuple[tuple[int, ...], ...] = ()


REACH = 1.5  # cells from a bracketed seed to the set
FAR = 2.5  # cells from a least value to the set
NEXT = 3  # neighbours of a least value to start from


def brackets(lattice: Lattice, kind: str) -> Edges:
    """Edges of the grid that the set of a kind crosses: none where that cannot be told.

    A kind at which the chart folds ends the branch: edges lead from cells of the branch to cells
    that it does not reach, joint limits excepted, and from one sheet of the branch to another.
    Other kinds change the sign of a determinant between joined cells of the branch; cells that are
    singular themselves count as either sign.
    """
    ok = lattice.ok
    folds = kind == lattice.chart.folds
    if not folds and kind not in lattice.det:
        none = np.zeros(0, dtype=int)
        return Edges(np.zeros((0, ok.ndim), dtype=int), none, none.astype(bool))
    out = ~ok & (lattice.status != JOINT_LIMIT)
    det = np.zeros(ok.shape) if folds else np.where(lattice.singular[kind], 0.0, lattice.det[kind])
    lower, axes, downs = [], [], []
    for axis in range(ok.ndim):
        one, two = pairs(ok.ndim, axis)
        if folds:
            chosen = (ok[one] & out[two]) | (out[one] & ok[two])
        else:
            with np.errstate(invalid="ignore"):
                chosen = lattice.joined[one][..., axis]
                chosen = chosen & (np.sign(det[one]) * np.sign(det[two]) <= 0.0)
        cells = np.argwhere(chosen)
        lower.append(cells)
        axes.append(np.full(len(cells), axis))
        downs.append(~ok[tuple(cells.T)])
    found = Edges(np.concatenate(lower), np.concatenate(axes), np.concatenate(downs))
    return found.and_also(Edges(*lattice.seams)) if folds else found


def middles(lattice: Lattice, edges: Edges) -> np.ndarray:
    """Coordinates (n, k) halfway along edges."""
    return 0.5 * (lattice.place(edges.lower) + lattice.place(edges.upper))


def seed_on(lattice: Lattice, kind: str, edges: Edges, i: int) -> Seed:
    """An edge as a seed: from the end whose sheet is sought, or from that nearer to the set."""
    one, two = tuple(edges.lower[i]), tuple(edges.upper[i])
    sigma = [lattice.sigma[kind][c] if lattice.ok[c] else np.inf for c in (one, two)]
    upper = edges.down[i] if kind == lattice.chart.folds else sigma[1] < sigma[0]
    cell = tuple(int(j) for j in (two if upper else one))
    place = middles(lattice, edges.take(np.array([i])))[0]
    return Seed(place, cell, int(edges.axis[i]), REACH)


def least_values(lattice: Lattice, kind: str, most: int = 60, *, wide: bool = False) -> list[Seed]:
    """Cells of the branch where the singular value is no larger than at any neighbour, rising.

    ``wide`` is for sets that nothing else shows: a least value along lines of the grid is enough,
    neighbours may be started from, and the search may lead anywhere.
    """
    sigma = np.where(lattice.ok, lattice.sigma[kind], np.inf)
    padded = np.pad(sigma, 1, constant_values=np.inf)
    lowest = lattice.ok.copy()
    around = cells_around(sigma.shape)
    for offset in around:
        if wide and np.count_nonzero(offset) > 1:
            continue
        window = tuple(slice(1 + o, 1 + o + n) for o, n in zip(offset, sigma.shape, strict=True))
        lowest &= sigma <= padded[window]
    cells = np.argwhere(lowest)
    order = np.argsort(sigma[tuple(cells.T)], kind="stable")[:most]
    places = lattice.place(cells)
    seeds = []
    for i in order:
        others: list[tuple[int, ...]] = []
        if wide:
            beside = [tuple(int(j) for j in cells[i] + o) for o in around]
            # padded cells are one further on
            beside.sort(key=lambda c: float(padded[tuple(j + 1 for j in c)]))
            others = [c for c in beside if np.isfinite(padded[tuple(j + 1 for j in c)])][:NEXT]
        cell = tuple(int(j) for j in cells[i])
        seeds.append(Seed(places[i], cell, None, np.inf if wide else FAR, tuple(others)))
    return seeds
