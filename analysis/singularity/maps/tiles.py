"""Cutting a grid into tiles, and what work on one tile finds.

The layout depends on the grid alone, never on who works on it: the same tiles, in the same rounds,
give the same numbers with one worker or with many.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import product

import numpy as np

from closedchain.urdf.errors import ClosureError

TILE_CELLS = 16384
"""Cells of a tile, about, where nothing else is asked for."""

Index = tuple[int, ...]


@dataclass(frozen=True)
class Tiles:
    """Equal boxes of cells that cover a grid of ``shape``; those at the far ends may be smaller."""

    shape: Index
    size: Index

    @property
    def counts(self) -> Index:
        """Number of tiles along each axis."""
        return tuple(-(-n // s) for n, s in zip(self.shape, self.size, strict=True))

    def all(self) -> Iterator[Index]:
        """Every tile, in row-major order."""
        return product(*(range(n) for n in self.counts))

    def slices(self, tile: Index) -> tuple[slice, ...]:
        """Cells of a tile, in the grid."""
        return tuple(
            slice(t * s, min((t + 1) * s, n))
            for t, s, n in zip(tile, self.size, self.shape, strict=True)
        )

    def origin(self, tile: Index) -> np.ndarray:
        """First cell (k,) of a tile."""
        return np.array([t * s for t, s in zip(tile, self.size, strict=True)])

    def extent(self, tile: Index) -> Index:
        """Cells of a tile along each axis."""
        return tuple(s.stop - s.start for s in self.slices(tile))

    def holding(self, cell: Index) -> Index:
        """Tile of a cell."""
        return tuple(c // s for c, s in zip(cell, self.size, strict=True))

    def neighbours(self, tile: Index) -> Iterator[Index]:
        """Tiles that share a face with one, in a fixed order."""
        for axis, count in enumerate(self.counts):
            for step in (-1, 1):
                if 0 <= tile[axis] + step < count:
                    yield (*tile[:axis], tile[axis] + step, *tile[axis + 1 :])

    def faces(self, tile: Index, cells: np.ndarray) -> np.ndarray:
        """Which cells (n, k) of a tile touch another tile, (n,) of bool."""
        slices = self.slices(tile)
        low = np.array([s.start for s in slices])
        high = np.array([s.stop - 1 for s in slices])
        ends = np.array(self.shape) - 1
        return np.any(((cells == low) & (low > 0)) | ((cells == high) & (high < ends)), axis=1)

    def beside(self, tile: Index, cells: np.ndarray) -> np.ndarray:
        """Which cells (n, k) outside a tile share a face with one of its cells, (n,) of bool."""
        slices = self.slices(tile)
        low = np.array([s.start for s in slices])
        high = np.array([s.stop - 1 for s in slices])
        away = np.maximum(low - cells, 0) + np.maximum(cells - high, 0)
        return np.asarray(away.sum(axis=1) == 1)


def tiles_of(shape: Index, chunk: int | Mapping[str, int] | None, names: tuple[str, ...]) -> Tiles:
    """Tiles of a grid: of about ``TILE_CELLS`` cells, or with ``chunk`` cells along an axis.

    Raises
    ------
    ClosureError
        ``chunk`` is no positive number, or names no axis of the grid.
    """
    if isinstance(chunk, Mapping):
        for name in chunk:
            if name not in names:
                raise ClosureError(
                    f"chunk names {name!r}, which does not vary; the map's coordinates are "
                    f"{', '.join(names)}"
                )
    default = _even(shape)
    size = []
    for name, n, usual in zip(names, shape, default, strict=True):
        asked = chunk.get(name) if isinstance(chunk, Mapping) else chunk
        if asked is None:
            size.append(usual)
            continue
        if isinstance(asked, bool) or not isinstance(asked, int | np.integer) or asked < 1:
            raise ClosureError(
                f"chunk must be a positive number of cells along an axis, got {asked!r}"
            )
        size.append(min(int(asked), n))
    return Tiles(shape, tuple(size))


def _even(shape: Index) -> Index:
    """Sides of tiles: as equal as the axes allow, the product near ``TILE_CELLS``."""
    size = [0] * len(shape)
    left = float(TILE_CELLS)
    for rank, axis in enumerate(sorted(range(len(shape)), key=lambda i: shape[i])):
        side = max(1, int(left ** (1.0 / (len(shape) - rank)) + 1e-9))
        # equal tiles along the axis, rather than full ones and a sliver
        pieces = math.ceil(shape[axis] / side)
        size[axis] = math.ceil(shape[axis] / pieces)
        left /= size[axis]
    return tuple(size)


@dataclass(frozen=True, eq=False)
class Found:
    """What one piece of work on a tile adds to the map.

    Attributes
    ----------
    cells : (n,) array
        Cells that got a status, by their row-major position in the tile.
    status : (n,) int8 array
    ended, ends : (m,) arrays
        Cells, likewise, that no way led into, and how these ended (codes of ``Ending``).
    measures : mapping of name to (n_ok,) array
        At the cells whose status is ok, in the order of ``cells``.
    q : (n_ok, nq) array, or None where the postures are not kept
    edge : (e, k) array
        Cells of the grid that got a posture and touch another tile.
    edge_q : (e, nq) array
        Their postures, from where the next round goes on.
    joined : (j, k + 1) int array
        Cells of the grid, and the axis along which the branch leads to the next one.
    walls, walls_q : (w, k) and (w, nq) arrays
        Cells of the grid that the branch reaches beyond joint limits, and their postures.
    shore, shore_q : (c, k) and (c, nq) arrays
        Cells beside the branch with closed postures that it was not seen to lead to.
    """

    cells: np.ndarray
    status: np.ndarray
    ended: np.ndarray
    ends: np.ndarray
    measures: Mapping[str, np.ndarray] = field(default_factory=dict)
    q: np.ndarray | None = None
    edge: np.ndarray = field(default_factory=lambda: np.zeros((0, 0), dtype=int))
    edge_q: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))
    joined: np.ndarray = field(default_factory=lambda: np.zeros((0, 0), dtype=int))
    walls: np.ndarray = field(default_factory=lambda: np.zeros((0, 0), dtype=int))
    walls_q: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))
    shore: np.ndarray = field(default_factory=lambda: np.zeros((0, 0), dtype=int))
    shore_q: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))
