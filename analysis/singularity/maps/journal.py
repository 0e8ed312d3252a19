"""What happened in the rounds of a map, so that a stopped run goes on where it stopped.

A round's finds are kept until the next round is over, which starts from their edges. On disk each
find is written, under a name of its own and at one stroke, before it is entered in the store: what
is entered twice is entered the same, so a run may be killed at any time. See ``journal_folder``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from closedchain.analysis.singularity.maps.tiles import Found, Index

STAGES = ("branch", "behind", "others")
"""Stages of a run, in their order."""

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
        for what, part in put_aside(found).items():
            self.kept.setdefault((what, tile), []).append(part)

    def get(self, name: str, tile: Index) -> Found | None:
        """Never anything: there was no earlier run."""
        return None

    def edge(self, name: str, tile: Index) -> Edge | None:
        """Edge, if any."""
        return self.edges.get(name, {}).get(tile)

    def aside(self, what: str, tile: Index) -> Edge | None:
        """Walls or shore, if any."""
        return together(self.kept.get((what, tile), []))


def put_aside(found: Found) -> dict[str, Edge]:
    """What is needed when the branch is done: cells beyond limits, and beside the branch."""
    parts = {"walls": (found.walls, found.walls_q), "shore": (found.shore, found.shore_q)}
    return {what: part for what, part in parts.items() if len(part[0])}


def together(parts: list[Edge]) -> Edge | None:
    """Cells and postures of several rounds as one; None of none."""
    if not parts:
        return None
    cells, q = zip(*parts, strict=True)
    return np.concatenate(cells), np.concatenate(q)
