"""Work on one tile: spreading a branch from cell to cell, and seeking other branches.

Every cell is reached from a solved neighbour by continuation; a cell that no neighbour leads to
is labelled, never filled with a guess. Cells with joints beyond their limits are walls: the branch
is not followed behind them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from closedchain.analysis.singularity.maps.cells import (
    STARTS,
    UNTRIED,
    Cells,
    Signals,
    Spreading,
    random_postures,
)
from closedchain.analysis.singularity.maps.choice import Choice
from closedchain.analysis.singularity.maps.grid import JOINT_LIMIT, OK, UNSEEN, Grid
from closedchain.analysis.singularity.maps.tiles import Found, Index, Tiles

FIRST_STARTS = 6
"""Starts at every cell of the lattice, before what they reach is known; then the others."""

_OUTSIDE = np.int8(-2)  # status of cells beside a tile, where work on the tile has no say
_TOGETHER = 32  # cells that are searched together
_MEASURED = 2048  # postures measured together


Seams = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]


@dataclass(frozen=True, eq=False)
class Job:
    """All that work on any tile of one map needs. Pickles, so that other processes can work."""

    grid: Grid
    tiles: Tiles
    measures: Choice
    keep_q: bool = False

    @cached_property
    def cells(self) -> Cells:
        """Spreading, searching and measuring; made once in each process."""
        return Cells(self.grid.chart, self.measures)

    def __getstate__(self) -> dict[str, object]:
        """Pickle the fields, not the solver made from them."""
        return {name: getattr(self, name) for name in self.__dataclass_fields__}

    def __setstate__(self, state: dict[str, object]) -> None:
        """Restore the fields."""
        for name, value in state.items():
            object.__setattr__(self, name, value)


@dataclass(frozen=True, eq=False)
class Task:
    """One piece of work on a tile.

    Attributes
    ----------
    tile : tuple of int
    status : (extent of the tile) int8 array
        As it stands.
    label : int
        ``OK``, ``BEHIND_LIMIT`` or ``OTHER_BRANCH``: what cells become that are reached.
    cells, q : (n, k) and (n, nq) arrays
        Solved cells of the grid from which to go on: beside the tile, or in it.
    seams : tuple of (m, k), (m, nq), (m, k) and (m, nq) arrays
        Cells beside the tile that were solved at once with cells of it, their postures; the
        latter cells and theirs. Whether the branch joins them is to be found out.
    lattice : (m, k) array
        Cells of the tile where other branches are sought.
    signals : Signals
        For whoever shares the memory of the worker.
    """

    tile: Index
    status: np.ndarray
    label: int
    cells: np.ndarray
    q: np.ndarray
    lattice: np.ndarray
    seams: Seams | None = None
    signals: Signals = field(default_factory=Signals.fresh)


def work(job: Job, task: Task) -> Found:
    """Do a task.

    Raises
    ------
    Stopped
        It was asked to stop.
    """
    block = _Block(job, task)
    if task.seams is not None:
        block.join(*task.seams)
    if len(task.cells):
        block.spread(task.cells, task.q)
    if len(task.lattice):
        block.seek(task.lattice, 0, FIRST_STARTS)
        block.seek(task.lattice, FIRST_STARTS, STARTS)
    return block.found()


class _Block:
    """A tile being worked on, with the layer of cells around it that its seeds lie in."""

    def __init__(self, job: Job, task: Task) -> None:
        self.job, self.task = job, task
        shape = np.array(job.grid.shape)
        where = job.tiles.slices(task.tile)
        low = np.maximum([s.start - 1 for s in where], 0)
        high = np.minimum([s.stop + 1 for s in where], shape)
        self.origin = low
        self.inner = tuple(
            slice(s.start - int(b), s.stop - int(b)) for s, b in zip(where, low, strict=True)
        )
        extent = tuple(int(n) for n in high - low)
        status = np.full(extent, _OUTSIDE)
        status[self.inner] = task.status
        axes = [v[b:e] for v, b, e in zip(job.grid.values, low, high, strict=True)]
        values = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
        self.spreading = Spreading(values, status, np.zeros((*extent, job.grid.start.size)))
        self.across = [np.zeros((0, len(extent) + 1), dtype=int)]

    @property
    def status(self) -> np.ndarray:
        """Status of the cells as it stands."""
        return self.spreading.status

    def join(self, one: np.ndarray, q: np.ndarray, two: np.ndarray, other: np.ndarray) -> None:
        """Find which cells ``one`` (m, k) lead to the cells ``two`` beside them."""
        joined = self.job.cells.joined(self.job.grid, (one, q), (two, other))
        axis = np.abs(two - one).argmax(axis=1)
        self.across.append(np.column_stack([np.minimum(one, two), axis])[joined])

    def spread(self, cells: np.ndarray, q: np.ndarray) -> None:
        """Reach every unseen cell that the branch leads to from solved cells (n, k), (n, nq)."""
        local = tuple((cells - self.origin).T)
        self.spreading.q[local] = q
        seeds = np.ravel_multi_index(local, self.status.shape)
        self.job.cells.spread(self.spreading, seeds, self.task.label, self.task.signals)

    def seek(self, lattice: np.ndarray, first: int, last: int) -> None:
        """Go on from closed postures found at unseen cells (n, k), from some of their starts."""
        unseen = lattice[self.status[tuple((lattice - self.origin).T)] == UNSEEN]
        cells, q = [unseen[:0]], [np.zeros((0, self.job.grid.start.size))]
        for begin in range(0, len(unseen), _TOGETHER):
            some = unseen[begin : begin + _TOGETHER]
            starts = [
                random_postures(self.job.grid.chart, tuple(int(i) for i in cell))[first:last]
                for cell in some
            ]
            result = self.job.cells.search(self.job.grid.coordinates(some), np.array(starts))
            cells.append(some[result.found])
            q.append(result.q[result.found])
            self.task.signals.note()
        if len(every := np.concatenate(cells)):
            self.spread(every, np.concatenate(q))

    def _measured(self, q: np.ndarray) -> dict[str, np.ndarray]:
        parts = []
        for begin in range(0, max(len(q), 1), _MEASURED):
            self.task.signals.note()
            part = q[begin : begin + _MEASURED]
            parts.append(self.job.measures.at(self.job.grid.chart, part))
        return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}

    def found(self) -> Found:
        """What was added to the map."""
        job, label = self.job, self.task.label
        status = self.status[self.inner]
        new = (task_status := self.task.status) == UNSEEN
        new |= (task_status == JOINT_LIMIT) & (label == OK)  # another way led within
        new &= status != task_status
        positions = np.flatnonzero(new)
        found = status.ravel()[positions]
        q = self._placed(positions[found == label])[1]
        onward, onward_q = self._placed(positions[found != JOINT_LIMIT])
        edge = job.tiles.faces(self.task.tile, onward)
        walls, walls_q = self._placed(positions[(found == JOINT_LIMIT) & (label == OK)])
        ends = np.where(status == UNSEEN, self.spreading.ends[self.inner], UNTRIED).ravel()
        ended = np.flatnonzero(ends != UNTRIED)
        branch = label == OK
        shore, shore_q = self._shore()
        return Found(
            cells=positions,
            status=found,
            ended=ended,
            ends=ends[ended],
            measures=self._measured(q) if branch else {},
            q=q if branch and job.keep_q else None,
            edge=onward[edge],
            edge_q=onward_q[edge],
            joined=self._joined() if branch else self.across[0],
            walls=walls,
            walls_q=walls_q,
            shore=shore,
            shore_q=shore_q,
        )

    def _placed(self, positions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Cells of the grid (n, k), and their postures, at positions in the tile."""
        extent = self.job.tiles.extent(self.task.tile)
        cells = np.stack(np.unravel_index(positions, extent), axis=1)
        q = self.spreading.q[self.inner].reshape(math.prod(extent), -1)[positions]
        return cells + self.job.tiles.origin(self.task.tile), q

    def _shore(self) -> tuple[np.ndarray, np.ndarray]:
        """Cells beside the branch that are still unseen, and postures that close there."""
        cells, q = (np.concatenate(part) for part in zip(*self.spreading.shore, strict=True))
        unseen = self.status[tuple(cells.T)] == UNSEEN
        return cells[unseen] + self.origin, q[unseen]

    def _joined(self) -> np.ndarray:
        """Cells of the grid, and axes along which the branch leads to the next one."""
        found = np.argwhere(self.spreading.joined)
        found[:, :-1] += self.origin
        return np.concatenate([*self.across, found])
