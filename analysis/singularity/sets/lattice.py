"""A branch on a grid of chart coordinates, with its measures: where singular sets are sought."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from closedchain.analysis.first_order import OPEN, first_order
from closedchain.analysis.singularity.bulk.measuring import bulk_measures
from closedchain.analysis.singularity.classify import SINGULAR
from closedchain.analysis.singularity.maps.grid import OK, Grid
from closedchain.analysis.singularity.maps.measures import KINDS, oriented
from closedchain.analysis.singularity.sets.postures_at import first_order_code
from closedchain.closure.chart import Chart
from closedchain.closure.generic import generic_ranks
from closedchain.closure.progress import Progress
from closedchain.closure.solve.control import SMALLEST
from closedchain.closure.solve.outcome import Ending
from closedchain.closure.solve.path import follower_of
from closedchain.closure.solve.ways import follow

Measuring = Callable[[np.ndarray], dict[str, np.ndarray]]


@dataclass(frozen=True, eq=False)
class Lattice:
    """Postures of one branch on a grid.

    Attributes
    ----------
    grid : Grid
    outputs : tuple of str
        Of the task.
    status : array of the grid's shape, int
        As in a map: OK, JOINT_LIMIT, or anything else where the branch has no cell.
    q : (shape, nq) array
        Valid where the status is OK.
    sigma, det : mapping of kind to array of the grid's shape
        Vanishing singular value, and signed determinant of kinds whose matrix is square; NaN
        where the status is not OK.
    singular : mapping of kind to bool array
        Cells that are singular themselves, within ``SINGULAR``.
    joined : (*shape, k) array of bool
        Whether the branch leads from a cell to the next one along each axis, posture to posture.
    """

    grid: Grid
    outputs: tuple[str, ...]
    status: np.ndarray
    q: np.ndarray
    sigma: dict[str, np.ndarray]
    det: dict[str, np.ndarray]
    singular: dict[str, np.ndarray]
    joined: np.ndarray

    @property
    def chart(self) -> Chart:
        """Coordinates of the grid."""
        return self.grid.chart

    @property
    def values(self) -> tuple[np.ndarray, ...]:
        """Rising values along each axis [m or rad]."""
        return self.grid.values

    @property
    def cell(self) -> np.ndarray:
        """Mean size of a cell along each axis, (k,)."""
        return np.array([float(np.diff(v).mean()) for v in self.values])

    @cached_property
    def ok(self) -> np.ndarray:
        """Which cells belong to the branch."""
        return np.asarray(self.status == OK)

    def follow(self, q: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Follow branches from postures (n, nq) to coordinates (n, k).

        Returns the last postures on the ways, (n, nq), and the share of each way that was gone,
        (n,): 1 for those that arrived, and for no others.
        """
        problem = self.chart.problem
        here = follower_of(problem).place.run(np.ascontiguousarray(q.T)).T
        targets = self.chart.targets(values)
        way = follow(problem, q, np.ascontiguousarray(here), targets, SMALLEST)
        arrived = way.codes == Ending.ARRIVED.code
        return way.q, np.where(arrived, 1.0, np.minimum(way.reached, 1.0 - 1e-12))

    def measures(self, q: np.ndarray) -> dict[str, np.ndarray]:
        """Measures (n,) of postures (n, nq); NaN, but for the residual, where one is not closed."""
        return self._measured(q, bulk_measures(self.chart.mechanism, self.outputs).measures)

    def determinants(self, q: np.ndarray) -> dict[str, np.ndarray]:
        """The same for the determinants and the residual alone."""
        return self._measured(q, bulk_measures(self.chart.mechanism, self.outputs).determinants)

    def _measured(self, q: np.ndarray, of: Measuring) -> dict[str, np.ndarray]:
        at = first_order_code(self.chart.mechanism, self.outputs).at(q)
        gap = np.abs(at.residual * self.chart.mechanism.row_scale).max(axis=1, initial=0.0)
        closed = gap <= OPEN
        found = {}
        for name, values in oriented(self.chart, of(q[closed])).items():
            found[name] = np.full(len(q), np.nan)
            found[name][closed] = values
        return found | {"residual": gap}

    @cached_property
    def cells(self) -> np.ndarray:
        """Cells (n, k) of the branch."""
        return np.argwhere(self.ok)

    @cached_property
    def tree(self) -> Any:
        """Search tree of the places of ``cells``, in cells."""
        from scipy.spatial import cKDTree

        return cKDTree(self.place(self.cells) / self.cell)

    @cached_property
    def apart(self) -> np.ndarray:
        """Where neighbours on the branch are on different sheets, (*shape, k), as ``joined``."""
        found = np.zeros_like(self.joined)
        for axis in range(self.ok.ndim):
            one, two = pairs(self.ok.ndim, axis)
            along = found[..., axis]
            along[one] = self.ok[one] & self.ok[two] & ~self.joined[..., axis][one]
        return found

    @cached_property
    def seams(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Where neighbours of the branch lie on different sheets and one of these ends between.

        Cells (n, k), axes (n,) towards the next ones, and whether the sheet of the next one is the
        one that ends, (n,) of bool. A seam at which both sheets end is there twice. Cells that are
        singular themselves have no sheet of their own.
        """
        special = self.singular.get(self.chart.folds or "", np.zeros_like(self.ok))
        lower, axes, downs = [], [], []
        for axis in range(self.ok.ndim):
            cells = np.argwhere(self.apart[..., axis] & ~special)
            other = cells.copy()
            other[:, axis] += 1
            plain = ~special[tuple(other.T)]
            cells, other = cells[plain], other[plain]
            for begin, end, down in ((cells, other, False), (other, cells, True)):
                if not len(cells):
                    continue
                gone = self.follow(self.q[tuple(begin.T)], self.place(end))[1]
                lower.append(cells[gone < 1.0])
                axes.append(np.full(len(lower[-1]), axis))
                downs.append(np.full(len(lower[-1]), down))
        if not lower:
            none = np.zeros(0, dtype=int)
            return np.zeros((0, self.ok.ndim), dtype=int), none, none.astype(bool)
        return np.concatenate(lower), np.concatenate(axes), np.concatenate(downs)

    def place(self, cells: np.ndarray) -> np.ndarray:
        """Coordinates (n, k) of cells (n, k)."""
        return self.grid.coordinates(cells)


def lattice_on(grid: Grid, outputs: tuple[str, ...], progress: Progress | None = None) -> Lattice:
    """Follow the branch of the grid's start over its cells, as a map does.

    Raises
    ------
    ClosureError
        The cells nearest to the start cannot be reached from it, or memory does not suffice.
    """
    from closedchain.analysis.singularity.maps.anchor import anchor_of
    from closedchain.analysis.singularity.maps.choice import chosen
    from closedchain.analysis.singularity.maps.journal import InMemory
    from closedchain.analysis.singularity.maps.mapping import warm
    from closedchain.analysis.singularity.maps.rounds import fill
    from closedchain.analysis.singularity.maps.scheduling import crew
    from closedchain.analysis.singularity.maps.spreading import Job
    from closedchain.analysis.singularity.maps.storage import in_memory
    from closedchain.analysis.singularity.maps.tiles import tiles_of

    choice = chosen(grid.chart.mechanism, outputs, grid.names, None)
    job = Job(grid, tiles_of(grid.shape, None, grid.names), choice, keep_q=True)
    anchor = anchor_of(grid)
    store = in_memory(job.tiles, choice.every, grid.start.size, keep_q=True)
    warm(job, progress)
    with crew(job) as workers:
        fill(job, anchor, store, InMemory(), workers, progress, others=False)
    return lattice_of(grid, store.arrays, outputs)


def lattice_of(grid: Grid, arrays: Mapping[str, np.ndarray], outputs: tuple[str, ...]) -> Lattice:
    """Lattice of the arrays of a map that kept its postures: "status", "q" and the measures."""
    mechanism = grid.chart.mechanism
    at = first_order(mechanism, grid.start, outputs)
    largest = dict.fromkeys(KINDS, 1.0)
    if at.K.size:
        largest["constraint"] = float(np.linalg.norm(at.K, 2))
    largest["inverse"] = generic_ranks(mechanism, outputs).output_scale
    sigma = {k: np.asarray(arrays[f"sigma_{k}"]) for k in KINDS if f"sigma_{k}" in arrays}
    det = {k: np.asarray(arrays[f"det_{k}"]) for k in KINDS if f"det_{k}" in arrays}
    with np.errstate(invalid="ignore"):
        singular = {k: s <= SINGULAR * largest[k] for k, s in sigma.items()}
    status, q = np.asarray(arrays["status"]), np.asarray(arrays["q"])
    masks = 1 << np.arange(len(grid.shape))
    joined = (np.asarray(arrays["joined"])[..., None] & masks) > 0
    return Lattice(grid, outputs, status, q, sigma, det, singular, joined)


_FINER: WeakKeyDictionary[Lattice, Lattice] = WeakKeyDictionary()


def finer(lattice: Lattice, progress: Progress | None = None) -> Lattice:
    """The same branch on a grid twice as fine, made once."""
    if lattice not in _FINER:
        axes = tuple(np.sort(np.concatenate([v, 0.5 * (v[1:] + v[:-1])])) for v in lattice.values)
        grid = replace(lattice.grid, values=axes)
        _FINER[lattice] = lattice_on(grid, lattice.outputs, progress)
    return _FINER[lattice]


def pairs(ndim: int, axis: int) -> tuple[tuple[slice, ...], tuple[slice, ...]]:
    """Views of an array shifted by one along an axis."""
    one = tuple(slice(None, -1) if i == axis else slice(None) for i in range(ndim))
    two = tuple(slice(1, None) if i == axis else slice(None) for i in range(ndim))
    return one, two


def cells_around(shape: tuple[int, ...]) -> list[tuple[int, ...]]:
    """Offsets to all neighbours of a cell, diagonal ones too."""
    return [o for o in product((-1, 0, 1), repeat=len(shape)) if any(o)]
