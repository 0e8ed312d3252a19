"""The journal of a saved map, in a folder of the store.

A file for the state, a list of all others, and a file for each find. Every file is written at one
stroke and carries its checksum. A file is put on the list before what it holds is entered in the
store; so one that is on the list and is gone, or is not as it was written, is missed, and the map
is refused rather than made with a hole.
"""

from __future__ import annotations

import io
import json
import re
import shutil
import zlib
from collections.abc import Mapping
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

import numpy as np

from closedchain.analysis.singularity.maps.folder import damaged, read_whole, write_whole, writing
from closedchain.analysis.singularity.maps.journal import (
    STAGES,
    Edge,
    State,
    put_aside,
    together,
)
from closedchain.analysis.singularity.maps.tiles import Found, Index, Tiles

JOURNAL = "journal"
"""Folder of a store, as long as it is not complete."""

SUMS = "sums"
"""Folder of the journal for the checksums of chunks."""

_MEASURE = "measure_"
_ASIDE, _STATE, _LIST = "aside", "state.json", "list.txt"
_STAGE = "|".join(STAGES)
_TILE = r"[0-9]+(?:_[0-9]+)*"
_FIND = re.compile(rf"(?:{_STAGE})-[0-9]+/{_TILE}\.find")
_PUT_ASIDE = re.compile(rf"{_ASIDE}/(walls|shore)-({_STAGE})-([0-9]+)-({_TILE})\.find")


class OnDisk:
    """Journal in the folder of a store."""

    def __init__(self, store: Path, tiles: Tiles) -> None:
        """Use the journal of a store, made if need be.

        Raises
        ------
        ClosureError
            It is damaged, or cannot be made.
        """
        self.store, self.tiles = store, tiles
        self.folder = store / JOURNAL
        with writing(store):
            self.folder.mkdir(parents=True, exist_ok=True)
        self.listed: dict[str, None] = {}
        self.put_aside: dict[tuple[str, str], dict[str, None]] = {}
        self._read_list()
        self.begun = self._read_state()

    @property
    def empty(self) -> bool:
        """Whether no run has written anything."""
        return self.begun is None and not self.listed

    def state(self) -> State | None:
        """Where the last run stood."""
        return self.begun

    def begin(self, state: State, keep: str | None) -> None:
        """Write the state, then drop old rounds."""
        folders = (keep, state.name, _ASIDE)
        self.listed = {name: None for name in self.listed if name.split("/")[0] in folders}
        with writing(self.store):
            partial = self.folder / (_LIST + ".partial")
            partial.write_text("".join(map(_line, self.listed)))
            partial.replace(self.folder / _LIST)
            content = json.dumps(asdict(state) | {"listed": len(self.listed)})
            write_whole(self.folder / _STATE, content.encode())
            for folder in self.folder.iterdir():
                if folder.is_dir() and folder.name not in (*folders, SUMS):
                    shutil.rmtree(folder)
            (self.folder / state.name).mkdir(exist_ok=True)
        self.begun = state

    def put(self, name: str, tile: Index, found: Found) -> None:
        """Write a find, and put it on the list."""
        for what, (cells, q) in put_aside(found).items():
            self._write(_aside_name(what, name, tile), {"cells": cells, "q": q})
        kept = {f.name: getattr(found, f.name) for f in fields(found) if f.name != "measures"}
        arrays = {key: value for key, value in kept.items() if value is not None}
        arrays |= {_MEASURE + key: value for key, value in found.measures.items()}
        self._write(_find_name(name, tile), arrays)

    def get(self, name: str, tile: Index) -> Found | None:
        """Read a find."""
        arrays = self._read(_find_name(name, tile))
        if arrays is None:
            return None
        own = {key: arrays.pop(key) for key in list(arrays) if key.startswith(_MEASURE)}
        measures = {key.removeprefix(_MEASURE): value for key, value in own.items()}
        return Found(**arrays, measures=measures)

    def edge(self, name: str, tile: Index) -> Edge | None:
        """Read the edge of a find only."""
        arrays = self._read(_find_name(name, tile))
        return None if arrays is None else (arrays["edge"], arrays["edge_q"])

    def aside(self, what: str, tile: Index) -> Edge | None:
        """Read the walls or the shore, of all rounds."""
        names = self.put_aside.get((what, _tile_name(tile)), {})
        parts = []
        for name in sorted(names, key=_when):
            arrays = self._read(name)
            if arrays is not None:
                parts.append((arrays["cells"], arrays["q"]))
        return together(parts)

    def _write(self, name: str, arrays: Mapping[str, Any]) -> None:
        content = io.BytesIO()
        np.savez(content, **arrays)
        path = self.folder / name
        with writing(self.store):
            path.parent.mkdir(exist_ok=True)
            write_whole(path, content.getvalue())
            if name not in self.listed:
                with (self.folder / _LIST).open("a") as file:
                    file.write(_line(name))
        self._enter(name)

    def _enter(self, name: str) -> None:
        self.listed[name] = None
        aside = _PUT_ASIDE.fullmatch(name)
        if aside is not None:
            self.put_aside.setdefault((aside[1], aside[4]), {})[name] = None

    def _read(self, name: str) -> dict[str, np.ndarray] | None:
        """Arrays of a file; None where there is none and none is listed."""
        path = self.folder / name
        try:
            content = read_whole(path)
        except FileNotFoundError:
            if name in self.listed:
                raise damaged(path, "is missing", self.store) from None
            return None
        if content is None:
            raise damaged(path, "is damaged", self.store)
        with np.load(io.BytesIO(content)) as kept:
            return {key: kept[key] for key in kept.files}

    def _read_list(self) -> None:
        """Names of the files that were written; a last line that is not whole is of none."""
        path = self.folder / _LIST
        lines = path.read_text(errors="replace").split("\n")[:-1] if path.exists() else []
        for line in lines:
            name = line.rpartition(" ")[0]
            if line + "\n" != _line(name) or not (
                _FIND.fullmatch(name) or _PUT_ASIDE.fullmatch(name)
            ):
                raise damaged(path, "is damaged", self.store)
            self._enter(name)

    def _read_state(self) -> State | None:
        path = self.folder / _STATE
        try:
            content = read_whole(path)
        except FileNotFoundError:
            if self.listed:
                raise damaged(path, "is missing", self.store) from None
            return None
        kept = None if content is None else json.loads(content)
        state = self._checked(kept)
        if kept is None or state is None:
            raise damaged(path, "is damaged", self.store)
        if len(self.listed) < kept["listed"]:
            raise damaged(self.folder / _LIST, "is damaged or missing", self.store)
        return state

    def _checked(self, kept: Any) -> State | None:
        """A state that a run of this map can have been in, else None."""
        try:
            active = tuple(tuple(tile) for tile in kept["active"])
            state = State(kept["stage"], kept["round"], active, kept["seen"])
            numbers = (state.round, state.seen, kept["listed"])
        except (TypeError, KeyError):
            return None
        whole = all(type(n) is int and n >= 0 for n in numbers) and state.stage in STAGES
        return state if whole and set(active) <= set(self.tiles.all()) else None


def _tile_name(tile: Index) -> str:
    return "_".join(map(str, tile))


def _find_name(name: str, tile: Index) -> str:
    return f"{name}/{_tile_name(tile)}.find"


def _aside_name(what: str, name: str, tile: Index) -> str:
    return f"{_ASIDE}/{what}-{name}-{_tile_name(tile)}.find"


def _when(name: str) -> tuple[int, int]:
    """Stage and round of a file that was put aside."""
    found = _PUT_ASIDE.fullmatch(name)
    assert found is not None
    return STAGES.index(found[2]), int(found[3])


def _line(name: str) -> str:
    """Line of the list, with its checksum."""
    return f"{name} {zlib.crc32(name.encode()):08x}\n"
