"""Where the numbers of a map are kept: arrays in memory, or the chunks of a Zarr store."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from closedchain.analysis.singularity.maps.folder import damaged
from closedchain.analysis.singularity.maps.grid import NONE_FOUND, NOT_CONVERGED, OK, UNSEEN
from closedchain.analysis.singularity.maps.spreading import Job
from closedchain.analysis.singularity.maps.tiles import Found, Index, Tiles
from closedchain.closure.solve.flood import EXPLAINS, STUCK, UNTRIED
from closedchain.urdf.errors import ClosureError

_SHARE = 0.8  # of the free memory that a map may take


@dataclass(frozen=True, eq=False)
class Store:
    """Arrays of a map, those of NumPy or of Zarr: both are read and written tile by tile.

    ``arrays``: "status" int8; "ends" int8, how the ways into unseen cells ended; "joined" int8, a
    bit for each axis along which the branch leads to the next cell; the measures, NaN where a cell
    is not ok; and "q" (*shape, nq) where the postures are kept.
    """

    tiles: Tiles
    arrays: dict[str, Any]

    def status(self, tile: Index) -> np.ndarray:
        """Status of a tile's cells, as it stands."""
        return np.array(self.arrays["status"][self.tiles.slices(tile)])

    def add(self, tile: Index, found: Found) -> None:
        """Enter what was found; to enter the same again changes nothing."""
        self._put(tile, "status", found.cells, found.status)
        self._put_ends(tile, found)
        self._join(found)
        ok = found.cells[found.status == OK]
        for name, values in found.measures.items():
            self._put(tile, name, ok, values)
        if found.q is not None:
            self._put(tile, "q", ok, found.q)

    def _put(self, tile: Index, name: str, positions: np.ndarray, values: np.ndarray) -> None:
        if not len(positions):
            return
        where = self.tiles.slices(tile)
        part = np.array(self.arrays[name][where])
        part.reshape(-1, *values.shape[1:])[positions] = values
        self.arrays[name][where] = part

    def _join(self, found: Found) -> None:
        """Set bits of cells that are joined to the next ones; they may lie in the tile before."""
        if not len(found.joined):
            return
        cells, bits = found.joined[:, :-1], 1 << found.joined[:, -1]
        of = cells // np.array(self.tiles.size)
        for tile in np.unique(of, axis=0):
            here = (of == tile).all(axis=1)
            index = tuple(int(t) for t in tile)
            where = self.tiles.slices(index)
            part = np.array(self.arrays["joined"][where])
            local = tuple((cells[here] - self.tiles.origin(index)).T)
            np.bitwise_or.at(part, local, bits[here].astype(np.int8))
            self.arrays["joined"][where] = part

    def _put_ends(self, tile: Index, found: Found) -> None:
        """Of the ways into a cell, keep the ending that explains most."""
        if not len(found.ended):
            return
        where = self.tiles.slices(tile)
        part = np.array(self.arrays["ends"][where])
        flat = part.reshape(-1)
        old = flat[found.ended]
        flat[found.ended] = np.where(EXPLAINS[found.ends] > EXPLAINS[old], found.ends, old)
        self.arrays["ends"][where] = part

    def finish(self, tile: Index) -> None:
        """Say of every cell left unseen why: none found, unless the branch should have led in."""
        status = self.status(tile)
        unseen = status == UNSEEN
        if not unseen.any():
            return
        where = self.tiles.slices(tile)
        stuck = np.array(self.arrays["ends"][where]) == STUCK
        status[unseen] = np.where(stuck[unseen], NOT_CONVERGED, NONE_FOUND)
        self.arrays["status"][where] = status


def in_memory(tiles: Tiles, measures: Sequence[str], nq: int, *, keep_q: bool) -> Store:
    """Store in memory.

    Raises
    ------
    ClosureError
        The map does not fit.
    """
    cells = 1
    for n in tiles.shape:
        cells *= n
    needed = cells * (3 + 8 * len(measures) + (8 * nq if keep_q else 0))
    free = free_memory()
    if needed > _SHARE * free:
        raise ClosureError(
            f"{cells:,} cells take {_gigabytes(needed)} of memory, {_gigabytes(free)} are free; "
            "write the map to disk chunk by chunk with save='map.zarr'"
            f"{', leave out keep_q' if keep_q else ''} or take fewer values"
        )
    arrays: dict[str, Any] = {
        "status": np.full(tiles.shape, UNSEEN, dtype=np.int8),
        "ends": np.full(tiles.shape, UNTRIED, dtype=np.int8),
        "joined": np.zeros(tiles.shape, dtype=np.int8),
    }
    arrays |= {name: np.full(tiles.shape, np.nan) for name in measures}
    if keep_q:
        arrays["q"] = np.full((*tiles.shape, nq), np.nan)
    return Store(tiles, arrays)


def _gigabytes(size: float) -> str:
    return f"{size / 1e9:.3g} GB"


def free_memory() -> int:
    """Memory [bytes] that can be had without swapping."""
    try:
        for line in Path("/proc/meminfo").read_text().splitlines():
            if line.startswith("MemAvailable:"):
                return int(line.split()[1]) * 1024
    except OSError:
        pass  # not Linux
    return int(os.sysconf("SC_PHYS_PAGES")) * int(os.sysconf("SC_PAGE_SIZE"))


def in_zarr(group: Any, folder: Path, job: Job) -> dict[str, Any]:
    """Arrays of a map in its Zarr group, made where they are missing; a chunk is a tile.

    Of a group that is opened to be read, those of a complete map.

    Raises
    ------
    ClosureError
        An array that is there is not of this map, or is missing from a complete one.
    """
    import zarr

    tiles, nq = job.tiles, job.grid.start.size
    kinds: dict[str, tuple[type, float]]
    kinds = {"status": (np.int8, UNSEEN), "ends": (np.int8, UNTRIED), "joined": (np.int8, 0)}
    kinds |= dict.fromkeys(job.measures.every, (np.float64, np.nan))
    if job.keep_q:
        kinds["q"] = (np.float64, np.nan)
    if group.read_only:
        del kinds["ends"]
    arrays = {}
    for name, (kind, fill) in kinds.items():
        more = (nq,) if name == "q" else ()
        shape, chunks = (*tiles.shape, *more), (*tiles.size, *more)
        try:
            if name not in group and not group.read_only:
                group.create_array(
                    name,
                    shape=shape,
                    chunks=chunks,
                    dtype=kind,
                    fill_value=fill,
                    dimension_names=(*job.grid.names, *("nq" for _ in more)),
                )
            found = arrays[name] = group[name]
            same = isinstance(found, zarr.Array) and bool(
                (found.shape, found.chunks, found.dtype) == (shape, chunks, np.dtype(kind))
                and np.array_equal(found.fill_value, kind(fill), equal_nan=kind is np.float64)
            )
        except OSError:
            raise
        except Exception:  # whatever a decoder thinks of damaged bytes
            same = False
        if not same:
            raise damaged(folder / name, "is not the array that this map has there", folder)
    return arrays
