"""Checksums of the chunks of a saved map, so that what was damaged on the disk is never believed.

While a map is made, each chunk has a small file beside the journal with the checksum of what is in
it. It is written before the chunk, with the checksum of what was there before as well, and after
it without: a run may be killed in between, and either is then right. Of a complete map all of them
are one more array, "checksums".
"""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from closedchain.analysis.singularity.maps.folder import damaged, read_whole, write_whole, writing
from closedchain.analysis.singularity.maps.tiles import Index, Tiles

CHECKSUMS = "checksums"


@dataclass(eq=False)
class CheckedArray:
    """An array of a store that is read and written by whole tiles, and checked when it is read.

    Attributes
    ----------
    array : zarr.Array
        Its chunks are the tiles.
    name : str
    tiles : Tiles
    folder : Path
        The store.
    sums : Path
        Folder of the checksums of this array.
    """

    array: Any
    name: str
    tiles: Tiles
    folder: Path
    sums: Path
    count: int = field(init=False)

    def __post_init__(self) -> None:
        """Make the folder of the checksums; count those that are there."""
        with writing(self.folder):
            self.sums.mkdir(parents=True, exist_ok=True)
        self.count = sum(1 for _ in self.sums.iterdir())

    def __getitem__(self, where: tuple[slice, ...]) -> np.ndarray:
        """Values of a tile.

        Raises
        ------
        ClosureError
            They are not what was written.
        """
        tile = self._tile(where)
        known = self._known(tile)
        try:
            part = np.asarray(self.array[where])
        except Exception:  # whatever a decoder thinks of damaged bytes
            part = None
        if part is None or _sum(part) not in (known or (self._empty(where),)):
            raise self._damaged(tile)
        return part

    def __setitem__(self, where: tuple[slice, ...], part: np.ndarray) -> None:
        """Write the values of a tile, of which the checksums are right before and after."""
        tile = self._tile(where)
        known = self._known(tile)
        after = _sum(np.asarray(part, dtype=self.array.dtype))
        with writing(self.folder):
            self._write(tile, (known[-1] if known else self._empty(where), after))
            self.array[where] = part
            self._write(tile, (after,))
        self.count += not known

    def check(self) -> None:
        """Check every tile.

        Raises
        ------
        ClosureError
            One is not what was written.
        """
        for tile in self.tiles.all():
            self.final(tile)

    def final(self, tile: Index) -> int:
        """Checksum of a tile as it stands, checked.

        Raises
        ------
        ClosureError
            It is not what was written.
        """
        return _sum(self[self.tiles.slices(tile)])

    def _tile(self, where: tuple[slice, ...]) -> Index:
        return tuple(s.start // size for s, size in zip(where, self.tiles.size, strict=True))

    def _path(self, tile: Index) -> Path:
        return self.sums / "_".join(map(str, tile))

    def _known(self, tile: Index) -> tuple[int, ...]:
        """Checksums of what may be in a tile; nothing where none was written."""
        path = self._path(tile)
        try:
            content = read_whole(path)
        except FileNotFoundError:
            return ()
        if content is None:
            raise damaged(path, "is damaged", self.folder)
        return tuple(int(word) for word in content.split())

    def _write(self, tile: Index, sums: tuple[int, ...]) -> None:
        write_whole(self._path(tile), " ".join(map(str, sums)).encode())

    def _empty(self, where: tuple[slice, ...]) -> int:
        shape = (*(s.stop - s.start for s in where), *self.array.shape[len(where) :])
        return _sum(np.full(shape, self.array.fill_value, dtype=self.array.dtype))

    def _damaged(self, tile: Index) -> Exception:
        chunk = self.folder / self.name / "c" / "/".join(map(str, tile))
        return damaged(chunk, "is damaged or missing", self.folder)


def pack(group: Any, arrays: Mapping[str, CheckedArray], tiles: Tiles) -> None:
    """Write the checksums of all arrays of a complete map as one array, (tiles, arrays)."""
    sums = [[array.final(tile) for array in arrays.values()] for tile in tiles.all()]
    packed = group.create_array(
        CHECKSUMS,
        data=np.array(sums, dtype=np.uint32),
        dimension_names=("tile", "array"),
        overwrite=True,
    )
    packed.update_attributes({"of": list(arrays), "all": _sum(np.array(sums, "u4"))})


def verify(group: Any, names: Mapping[str, Any], tiles: Tiles, folder: Path) -> None:
    """Check every chunk of a complete map; ``names`` are its arrays.

    Raises
    ------
    ClosureError
        A chunk, or the checksums, are not what was written.
    """
    try:
        packed = group[CHECKSUMS]
        sums, of = np.asarray(packed[:]), list(packed.attrs["of"])
        whole = packed.attrs["all"] == _sum(sums.astype("u4"))
    except Exception:  # whatever a decoder thinks of damaged bytes
        whole, of, sums = False, [], np.zeros((0, 0))
    if not whole or set(of) != set(names):
        raise damaged(folder / CHECKSUMS, "is damaged or missing", folder)
    for row, tile in zip(sums, tiles.all(), strict=True):
        for name, known in zip(of, row, strict=True):
            if not _holds(names[name], tiles.slices(tile), int(known)):
                chunk = folder / name / "c" / "/".join(map(str, tile))
                raise damaged(chunk, "is damaged or missing", folder)


def _holds(array: Any, where: tuple[slice, ...], known: int) -> bool:
    try:
        return _sum(np.asarray(array[where])) == known
    except Exception:  # whatever a decoder thinks of damaged bytes
        return False


def _sum(part: np.ndarray) -> int:
    return zlib.crc32(np.ascontiguousarray(part).tobytes())
