"""What happened in the rounds of a map, so that a stopped run goes on where it stopped.

A round's finds are kept until the next round is over, which starts from their edges. On disk each
find is written, under a name of its own and at one stroke, before it is entered in the store: what
is entered twice is entered the same, so a run may be killed at any time.
"""

from __future__ import annotations

import json
import shutil
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from closedchain.analysis.singularity.maps.tiles import Found, Index

_MEASURE = "measure_"
ASIDE = "aside"

Edge = tuple[np.ndarray, np.ndarray]
"""Solved cells (e, k) that touch other tiles, and their postures (e, nq)."""


@dataclass(frozen=True)
class State:
    """Where a run stands: its stage and round, that round's tiles, cells seen before it."""

    stage: str
    round: int
    active: tuple[Index, ...]
    seen: int

    @property
    def name(self) -> str:
        """Of the round."""
        return f"{self.stage}-{self.round}"


class Journal(Protocol):
    """Memory of a run."""

    def state(self) -> State | None:
        """Where the run stands; None at its beginning."""

    def begin(self, state: State, keep: str | None) -> None:
        """Enter a new round; finds of rounds other than ``keep`` are no longer needed."""

    def put(self, name: str, tile: Index, found: Found) -> None:
        """Keep what was found in round ``name``."""

    def get(self, name: str, tile: Index) -> Found | None:
        """What an earlier run found there and may not have entered in the store."""

    def edge(self, name: str, tile: Index) -> Edge | None:
        """Edge of what was found in a tile in round ``name``."""

    def aside(self, what: str, tile: Index) -> Edge | None:
        """The "walls" or the "shore" that were found in a tile in any round."""


class InMemory:
    """Journal of a run that is not saved: the edges only, walls and shores."""

    def __init__(self) -> None:
        """Start empty."""
        self.edges: dict[str, dict[Index, Edge]] = {}
        self.kept: dict[tuple[str, Index], list[Edge]] = {}

    def state(self) -> State | None:
        """Never anything to go on from."""
        return None

    def begin(self, state: State, keep: str | None) -> None:
        """Forget all rounds but one."""
        self.edges = {name: kept for name, kept in self.edges.items() if name == keep}

    def put(self, name: str, tile: Index, found: Found) -> None:
        """Keep the edge."""
        self.edges.setdefault(name, {})[tile] = (found.edge, found.edge_q)
        for what, part in _aside(found).items():
            self.kept.setdefault((what, tile), []).append(part)

    def get(self, name: str, tile: Index) -> Found | None:
        """Never anything: there was no earlier run."""
        return None

    def edge(self, name: str, tile: Index) -> Edge | None:
        """Edge, if any."""
        return self.edges.get(name, {}).get(tile)

    def aside(self, what: str, tile: Index) -> Edge | None:
        """Walls or shore, if any."""
        return _together(self.kept.get((what, tile), []))


class OnDisk:
    """Journal in a folder: one file for the state, one for each find."""

    def __init__(self, folder: Path) -> None:
        """Use a folder, made if need be."""
        self.folder = folder
        folder.mkdir(parents=True, exist_ok=True)

    def state(self) -> State | None:
        """Read the state."""
        path = self.folder / "state.json"
        if not path.exists():
            return None
        kept = json.loads(path.read_text())
        return State(**kept | {"active": tuple(tuple(tile) for tile in kept["active"])})

    def begin(self, state: State, keep: str | None) -> None:
        """Write the state, then drop old rounds."""
        partial = self.folder / "state.partial"
        partial.write_text(json.dumps(asdict(state)))
        partial.replace(self.folder / "state.json")
        for folder in self.folder.iterdir():
            if folder.is_dir() and folder.name not in (keep, state.name, ASIDE):
                shutil.rmtree(folder)
        (self.folder / state.name).mkdir(exist_ok=True)

    def put(self, name: str, tile: Index, found: Found) -> None:
        """Write a find beside its place, then move it there."""
        for what, (cells, q) in _aside(found).items():
            self._write(self._path(ASIDE, tile, f"{what}-{name}-"), {"cells": cells, "q": q})
        kept = {f.name: getattr(found, f.name) for f in fields(found) if f.name != "measures"}
        arrays = {key: value for key, value in kept.items() if value is not None}
        arrays |= {_MEASURE + key: value for key, value in found.measures.items()}
        self._write(self._path(name, tile), arrays)

    def _write(self, path: Path, arrays: dict[str, Any]) -> None:
        path.parent.mkdir(exist_ok=True)
        partial = path.with_suffix(".partial")
        with partial.open("wb") as file:
            np.savez(file, **arrays)
        partial.replace(path)

    def get(self, name: str, tile: Index) -> Found | None:
        """Read a find."""
        path = self._path(name, tile)
        if not path.exists():
            return None
        with np.load(path) as kept:
            arrays = {key: kept[key] for key in kept.files}
        measures = {
            key.removeprefix(_MEASURE): arrays.pop(key)
            for key in list(arrays)
            if key.startswith(_MEASURE)
        }
        return Found(**arrays, measures=measures)

    def edge(self, name: str, tile: Index) -> Edge | None:
        """Read the edge of a find only."""
        path = self._path(name, tile)
        if not path.exists():
            return None
        with np.load(path) as kept:
            return kept["edge"], kept["edge_q"]

    def aside(self, what: str, tile: Index) -> Edge | None:
        """Read the walls or the shore, of all rounds."""
        pattern = self._path(ASIDE, tile, f"{what}-*-").name
        parts = []
        for path in sorted((self.folder / ASIDE).glob(pattern), key=_round):
            with np.load(path) as kept:
                parts.append((kept["cells"], kept["q"]))
        return _together(parts)

    def _path(self, name: str, tile: Index, before: str = "") -> Path:
        return self.folder / name / (before + "_".join(map(str, tile)) + ".npz")


def _aside(found: Found) -> dict[str, Edge]:
    """What is needed when the branch is done: cells beyond limits, and beside the branch."""
    parts = {"walls": (found.walls, found.walls_q), "shore": (found.shore, found.shore_q)}
    return {what: part for what, part in parts.items() if len(part[0])}


def _together(parts: list[Edge]) -> Edge | None:
    if not parts:
        return None
    cells, q = zip(*parts, strict=True)
    return np.concatenate(cells), np.concatenate(q)


def _round(path: Path) -> int:
    """Number of the round of a file that was put aside: WHAT-STAGE-ROUND-TILE.npz."""
    return int(path.name.split("-")[2])
