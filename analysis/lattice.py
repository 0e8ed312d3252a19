"""A branch on a grid of chart coordinates, with the measures of some kinds: where sets are sought.

Cells are reached from solved neighbours by continuation; what no neighbour leads to stays out.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from closedchain.analysis.bordered import Measure, kinematics
from closedchain.analysis.first_order import first_order
from closedchain.analysis.measures import oriented
from closedchain.analysis.mobility import generic_rank
from closedchain.analysis.singularities import SINGULAR, determinants, measures
from closedchain.analysis.walk import JOINT_LIMIT, OK, UNREACHABLE, UNSEEN, Progress, Walk
from closedchain.closure.chart import Chart
from closedchain.closure.charting import straight
from closedchain.closure.continuation import follow
from closedchain.closure.equations import Corrected, correct
from closedchain.closure.nearest import beyond_limits
from closedchain.urdf.errors import ClosureError

SMALLEST_STEP = 1e-4  # share of a cell
CHUNK = 1024  # cells whose matrices are held at once


@dataclass(frozen=True, eq=False)
class Lattice:
    """Postures of one branch on a grid.

    Attributes
    ----------
    chart : Chart
    values : tuple of (n_i,) arrays
        Rising values along each axis [m or rad].
    status : array of the grid's shape, int
        As in ``walk``: OK, JOINT_LIMIT, or anything else where the branch has no cell.
    q : (shape, nq) array
        Valid where the status is OK.
    sigma, det : mapping of kind to array of the grid's shape
        Vanishing singular value, and signed determinant of kinds whose matrix is square; NaN
        where the status is not OK.
    singular : mapping of kind to bool array
        Cells that are singular themselves, within ``SINGULAR``.
    """

    chart: Chart
    values: tuple[np.ndarray, ...]
    status: np.ndarray
    q: np.ndarray
    sigma: dict[str, np.ndarray]
    det: dict[str, np.ndarray]
    singular: dict[str, np.ndarray]

    @property
    def cell(self) -> np.ndarray:
        """Mean size of a cell along each axis, (k,)."""
        return np.array([float(np.diff(v).mean()) for v in self.values])

    @property
    def ok(self) -> np.ndarray:
        """Which cells belong to the branch."""
        return np.asarray(self.status == OK)

    def place(self, cells: np.ndarray) -> np.ndarray:
        """Coordinates (n, k) of cells (n, k)."""
        return np.stack([v[cells[:, i]] for i, v in enumerate(self.values)], axis=1)


def axes_of(names: Sequence[str], values: Sequence[object]) -> tuple[np.ndarray, ...]:
    """Check the values of the axes. Raises ``ClosureError``."""
    found = []
    for name, given in zip(names, values, strict=True):
        axis = np.array(given, dtype=float)
        rises = axis.ndim == 1 and axis.size >= 2 and np.isfinite(axis).all()
        if not rises or (np.diff(axis) <= 0.0).any():
            raise ClosureError(f"values of {name!r} must be at least two finite, rising numbers")
        found.append(axis)
    return tuple(found)


def spread(
    chart: Chart, values: tuple[np.ndarray, ...], progress: Progress | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Status and postures of the cells that the branch of the chart's start reaches.

    Raises
    ------
    ClosureError
        The cell nearest to the start cannot be reached from it.
    """
    shape = tuple(v.size for v in values)
    status = np.full(shape, UNSEEN, dtype=np.int8)
    q = np.zeros((*shape, chart.mechanism.model.nq))
    begin = chart.values(chart.start)
    anchor = tuple(int(np.abs(v - b).argmin()) for v, b in zip(values, begin, strict=True))
    target = np.array([v[i] for v, i in zip(values, anchor, strict=True)])
    here = correct(chart.equations(begin), chart.pinned(chart.start, begin))
    found = follow(straight(chart, begin, target), here) if here.refusal is None else None
    if found is None or found.refusal is not None:
        where = ", ".join(f"{n}={x:g}" for n, x in zip(chart.names, target, strict=True))
        raise ClosureError(
            f"the first cell ({where}) cannot be reached from the start on its branch: give "
            "values around the start, or a posture elsewhere (at=)"
        )
    status[anchor], q[anchor] = OK, found.last.q
    _fill(chart, values, status, q, {anchor: found.last}, progress)
    return status, q


def _fill(
    chart: Chart,
    values: tuple[np.ndarray, ...],
    status: np.ndarray,
    q: np.ndarray,
    known: dict[tuple[int, ...], Corrected],
    progress: Progress | None,
) -> None:
    """Reach every unseen cell from the known ones; label the others unreachable."""
    frontier = deque(known.items())
    done = int(np.count_nonzero(status != UNSEEN))
    while frontier:
        cell, here = frontier.popleft()
        begin = np.array([v[i] for v, i in zip(values, cell, strict=True)])
        for beside in _neighbours(cell, status.shape):
            if status[beside] != UNSEEN:
                continue
            target = np.array([v[i] for v, i in zip(values, beside, strict=True)])
            path = follow(straight(chart, begin, target), here, SMALLEST_STEP)
            if path.refusal is not None:
                continue
            done += 1
            if beyond_limits(chart.mechanism, path.last.q):
                status[beside] = JOINT_LIMIT
                continue
            status[beside], q[beside] = OK, path.last.q
            frontier.append((beside, path.last))
        if progress is not None:
            progress("following the branch", done, status.size)
    status[status == UNSEEN] = UNREACHABLE


def _neighbours(cell: tuple[int, ...], shape: tuple[int, ...]) -> Iterator[tuple[int, ...]]:
    for axis, size in enumerate(shape):
        for step in (-1, 1):
            if 0 <= cell[axis] + step < size:
                yield (*cell[:axis], cell[axis] + step, *cell[axis + 1 :])


def finer(
    lattice: Lattice, progress: Progress | None = None
) -> tuple[tuple[np.ndarray, ...], np.ndarray, np.ndarray]:
    """Axes, status and postures of the same branch on a grid twice as fine."""
    chart = lattice.chart
    values = tuple(np.sort(np.concatenate([v, 0.5 * (v[1:] + v[:-1])])) for v in lattice.values)
    shape = tuple(v.size for v in values)
    status = np.full(shape, UNSEEN, dtype=np.int8)
    q = np.zeros((*shape, chart.mechanism.model.nq))
    known = {}
    for cell in map(tuple, np.argwhere(lattice.ok)):
        place = tuple(2 * i for i in cell)
        status[place], q[place] = OK, lattice.q[cell]
        c = np.array([v[i] for v, i in zip(values, place, strict=True)])
        # factors come with the first step from here
        known[place] = correct(chart.equations(c), lattice.q[cell])
    _fill(chart, values, status, q, known, progress)
    return values, status, q


def measured(
    chart: Chart,
    values: tuple[np.ndarray, ...],
    status: np.ndarray,
    q: np.ndarray,
    kinds: Sequence[str],
    outputs: tuple[str, ...],
    progress: Progress | None = None,
) -> Lattice:
    """Lattice with the measures of some kinds."""
    mechanism = chart.mechanism
    of = {kind: Measure(mechanism, kind, outputs) for kind in kinds}
    sigma = {kind: np.full(status.shape, np.nan) for kind in kinds}
    largest = {kind: np.full(status.shape, np.nan) for kind in kinds}
    det = {kind: np.full(status.shape, np.nan) for kind in kinds}
    cells = np.argwhere(status == OK)
    for begin in range(0, len(cells), CHUNK):
        where = tuple(cells[begin : begin + CHUNK].T)
        found = [kinematics(mechanism, one, tip=True) for one in q[where]]
        closures = np.array([at.closures for at in found])
        task = np.array([Measure(mechanism, "inverse", outputs).task_rows(at) for at in found])
        for kind in kinds:
            matrix = closures if kind != "direct" else closures[:, :, mechanism.passive_v]
            matrix = np.concatenate([closures, task], axis=1) if kind == "inverse" else matrix
            s = np.linalg.svd(matrix, compute_uv=False)
            sigma[kind][where] = s[:, min(of[kind].shape) - 1]
            largest[kind][where] = s[:, 0]
        signed = _oriented(chart, determinants(mechanism, closures, task))
        for kind in {"direct", "inverse"} & set(kinds):
            value = signed[kind]
            if value is not None:
                det[kind][where] = value
        if progress is not None:
            progress("singular values", min(begin + CHUNK, len(cells)), len(cells))
    square = {kind: of[kind].codimension == 1 for kind in kinds}
    with np.errstate(invalid="ignore"):
        singular = {kind: sigma[kind] <= SINGULAR * largest[kind] for kind in kinds}
    return Lattice(
        chart, values, status, q, sigma, {k: det[k] for k in kinds if square[k]}, singular
    )


def _oriented(chart: Chart, found: dict[str, np.ndarray | None]) -> dict[str, np.ndarray | None]:
    """The sign goes to the determinant that can change on the branch, as ``maps`` has it."""
    present = {f"det_{k}": v for k, v in found.items() if v is not None}
    signed = oriented(chart, present)
    return {k: signed.get(f"det_{k}") for k in found}


def lattice_of(walked: Walk, found: Mapping[str, np.ndarray], outputs: tuple[str, ...]) -> Lattice:
    """Lattice of a walked grid and its measures, as ``maps.evaluate`` gives them."""
    grid = walked.grid
    at = first_order(grid.chart.mechanism, grid.start, outputs)
    largest = measures(at, generic_rank(grid.chart.mechanism))[1]
    sigma = {k: found[f"sigma_{k}"] for k in largest if f"sigma_{k}" in found}
    det = {k: found[f"det_{k}"] for k in largest if f"det_{k}" in found}
    with np.errstate(invalid="ignore"):
        singular = {k: s <= SINGULAR * largest[k] for k, s in sigma.items()}
    return Lattice(grid.chart, grid.values, walked.status, walked.q, sigma, det, singular)


def cells_around(shape: tuple[int, ...]) -> list[tuple[int, ...]]:
    """Offsets to all neighbours of a cell, diagonal ones too."""
    return [o for o in product((-1, 0, 1), repeat=len(shape)) if any(o)]
