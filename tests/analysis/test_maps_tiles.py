"""Tiles of a map: each cell is in one, and its neighbours are known."""

from __future__ import annotations

import numpy as np
import pytest

from closedchain.analysis.singularity.maps.rounds import lattice_of
from closedchain.analysis.singularity.maps.tiles import TILE_CELLS, Tiles, tiles_of


@pytest.mark.parametrize(
    "shape", [(7,), (5000,), (100, 100), (1000, 3), (40, 50, 60), (9,) * 6, (1, 2)]
)
def test_tiles_cover_the_grid_once(shape: tuple[int, ...]) -> None:
    tiles = tiles_of(shape, None, tuple("abcdef"[: len(shape)]))
    covered = np.zeros(shape, dtype=int)
    for tile in tiles.all():
        covered[tiles.slices(tile)] += 1
        assert np.prod(tiles.extent(tile)) <= TILE_CELLS
        assert tiles.holding(tuple(int(i) for i in tiles.origin(tile))) == tile
    assert (covered == 1).all()
    if np.prod(shape) > 2 * TILE_CELLS:
        assert np.prod(tiles.size) > TILE_CELLS / 4


def test_faces_are_the_cells_beside_other_tiles() -> None:
    tiles = Tiles((5, 6), (3, 4))
    cells = np.array(list(np.ndindex(5, 6)))
    owner = [tiles.holding(tuple(c)) for c in cells]
    for tile in tiles.all():
        mine = np.array([o == tile for o in owner])
        near = np.abs(cells[:, None] - cells[None]).sum(axis=-1) == 1
        assert np.array_equal(tiles.faces(tile, cells[mine]), (near[mine][:, ~mine]).any(axis=1))
        assert np.array_equal(tiles.beside(tile, cells[~mine]), near[~mine][:, mine].any(axis=1))
        expected = {o for o, n in zip(owner, near[:, mine].any(axis=1) & ~mine, strict=True) if n}
        assert set(tiles.neighbours(tile)) == expected


@pytest.mark.parametrize("shape", [(3,), (400,), (30, 500), (9, 9, 9), (4,) * 6])
def test_other_branches_are_sought_all_over_the_grid(shape: tuple[int, ...]) -> None:
    axes = lattice_of(shape)
    assert 1 <= np.prod([len(a) for a in axes]) <= 1024
    for n, axis in zip(shape, axes, strict=True):
        ends = np.array([-1, *axis, n])
        assert np.diff(ends).max() <= max(1, 2 * n // len(axis))
