"""Where a branch is narrower than a cell: neighbours that a straight way does not lead into.

Beside every cell that ways in ended short of, closed postures are sought from its neighbours'. A
cell that has one may belong to the branch, round a corner of its boundary: it is looked for on
grids that are finer there, window by window.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np

from closedchain.closure.chart import Chart
from closedchain.closure.progress import Reached
from closedchain.closure.solve.flood import ARRIVED, Block, beside, flood
from closedchain.closure.solve.search import search

FINER = {1: (8,), 2: (2, 8), 3: (2, 4)}
"""Parts into which a cell is cut, one trial after the other, by the number of coordinates."""

TOGETHER = 64  # windows that are filled together


@dataclass(frozen=True, eq=False)
class Windows(Block):
    """Grids that do not touch, one a window: axis 0 counts them."""

    @cached_property
    def beside(self) -> np.ndarray:
        """As for a block, but nothing leads from one window to another."""
        found = beside(self.open.shape)
        found[:, :2] = -1
        return found


@dataclass(frozen=True, eq=False)
class Shore:
    """Solved cells of a block, and unsolved ones beside them.

    Attributes
    ----------
    chart : Chart
    values : (*shape, k) array
        Coordinates of the cells.
    solved : (*shape) array of bool
    q : (*shape, nq) array
        Postures of solved cells.
    """

    chart: Chart
    values: np.ndarray
    solved: np.ndarray
    q: np.ndarray

    def beside(self) -> np.ndarray:
        """Cells (n, k) that are not solved and touch one that is, at a face or a corner."""
        padded = np.pad(self.solved, 1)
        touching = np.zeros_like(self.solved)
        for offset in self._around:
            touching |= padded[
                tuple(slice(1 + o, 1 + o + n) for o, n in zip(offset, touching.shape, strict=True))
            ]
        return np.argwhere(touching & ~self.solved)

    def closed(self, cells: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Which cells (n, k) close from a solved neighbour's posture, (n,) of bool; postures."""
        start = np.zeros((len(cells), 1, self.q.shape[-1]))
        for i, cell in enumerate(cells):
            start[i, 0] = self.q[self._neighbour(cell)]
        found = search(self.chart.problem, self.chart.targets(self.values[tuple(cells.T)]), start)
        return found.found, found.q

    def crossed(
        self, cells: np.ndarray, progress: Reached | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Cells (n, k) into which the branch leads through finer grids; and their postures."""
        reached = [np.zeros((0, cells.shape[1]), dtype=int)]
        postures = [np.zeros((0, self.q.shape[-1]))]
        for parts in FINER.get(cells.shape[1], (2,)):
            left = []
            for begin in range(0, len(cells), TOGETHER):
                some = cells[begin : begin + TOGETHER]
                good, q = self._through(some, parts, progress)
                reached.append(some[good])
                postures.append(q[good])
                left.append(some[~good])
            cells = np.concatenate([cells[:0], *left])
        return np.concatenate(reached), np.concatenate(postures)

    @cached_property
    def _around(self) -> list[tuple[int, ...]]:
        """Offsets to all neighbours of a cell, those that share a face first."""
        every = product((-1, 0, 1), repeat=self.solved.ndim)
        return sorted((o for o in every if any(o)), key=lambda o: (sum(map(abs, o)), o))

    def _neighbour(self, cell: np.ndarray) -> tuple[int, ...]:
        """First solved cell that touches one."""
        for offset in self._around:
            other = tuple(int(c) + o for c, o in zip(cell, offset, strict=True))
            inside = all(0 <= c < n for c, n in zip(other, self.solved.shape, strict=True))
            if inside and self.solved[other]:
                return other
        raise ValueError("no solved cell touches it")

    def _through(
        self, cells: np.ndarray, parts: int, progress: Reached | None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Which cells (n, k) are reached within a cell around them, cut in parts; postures."""
        k, side = cells.shape[1], 2 * parts + 1
        offsets = np.stack(np.meshgrid(*[np.arange(side)] * k, indexing="ij"), axis=-1)
        fine = (cells[:, None] - 1) * parts + offsets.reshape(1, -1, k)  # of the finer grid
        last = (np.array(self.solved.shape) - 1) * parts
        inside = ((fine >= 0) & (fine <= last)).all(axis=-1)
        fine = np.clip(fine, 0, last)
        low = np.minimum(fine // parts, np.array(self.solved.shape) - 2)
        low = np.maximum(low, 0)
        share = fine / parts - low
        values = np.empty(fine.shape)
        for i in range(k):
            line = np.moveaxis(self.values[..., i], i, 0).reshape(self.values.shape[i], -1)[:, 0]
            upper = np.minimum(low[..., i] + 1, len(line) - 1)
            begin, end = line[low[..., i]], line[upper]
            values[..., i] = begin + share[..., i] * (end - begin)
        coarse = inside & (fine % parts == 0).all(axis=-1)
        known = coarse & self.solved[tuple(np.moveaxis(fine // parts, -1, 0))]
        shape = (len(cells), *[side] * k)
        q = np.zeros((*known.shape, self.q.shape[-1]))
        q[known] = self.q[tuple((fine[known] // parts).T)]
        targets = self.chart.targets(values.reshape(-1, k))
        block = Windows(
            self.chart.problem,
            targets.reshape(*shape, -1),
            (inside & ~known).reshape(shape),
            q.reshape(*shape, -1),
        )
        look = None if progress is None else lambda cells: progress(0)
        codes = flood(block, np.flatnonzero(known), look).codes.reshape(known.shape)
        middle = codes.shape[1] // 2
        return codes[:, middle] == ARRIVED, block.q.reshape(*known.shape, -1)[:, middle]
