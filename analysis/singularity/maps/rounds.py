"""Filling a map in rounds: the branch from its anchor outwards, then other branches, then verdicts.

Between the two, the branch is followed behind joint limits.

In a round, all tiles that the last round's cells lie beside are worked on at once, each knowing of
its neighbours only what the last round found. What is found therefore does not depend on who works
on which tile, or in what order.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from contextlib import closing
from itertools import product

import numpy as np

from closedchain.analysis.singularity.maps.anchor import Anchor
from closedchain.analysis.singularity.maps.grid import (
    BEHIND_LIMIT,
    JOINT_LIMIT,
    OK,
    OTHER_BRANCH,
    UNSEEN,
)
from closedchain.analysis.singularity.maps.journal import Edge, Journal, State
from closedchain.analysis.singularity.maps.scheduling import Crew
from closedchain.analysis.singularity.maps.spreading import Job, Seams, Task
from closedchain.analysis.singularity.maps.storage import Store
from closedchain.analysis.singularity.maps.tiles import Found, Index, Tiles
from closedchain.closure.progress import Progress

LATTICE = 256
"""Cells, about, from which other branches are sought."""
_LINE = 16  # along each of one or two axes; twice as many at most

_STAGES = {
    "branch": "following the branch",
    "behind": "following it behind limits",
    "others": "searching other branches",
}
_LABELS = {"branch": OK, "behind": BEHIND_LIMIT, "others": OTHER_BRANCH}
_ASIDE = {"behind": "walls", "others": "shore"}
"""What was put aside for each stage to begin with."""


def fill(
    job: Job,
    anchor: Anchor,
    store: Store,
    journal: Journal,
    crew: Crew,
    report: Progress | None,
    *,
    others: bool = True,
) -> None:
    """Fill the store, from where the journal says that an earlier run stopped.

    Without ``others`` only the branch is followed, and what it does not reach is not told apart.
    """
    run = _Run(job, anchor, store, journal, crew, report)
    state = journal.state()
    if state is None:
        state = State("branch", 0, (job.tiles.holding(anchor.cell),), 0)
    journal.begin(state, _before(state))
    while state.active or state.stage != "others":
        if state.active:
            run.round(state)
        following = run.after(state, others=others)
        journal.begin(following, state.name)
        state = following
    for tile in job.tiles.all():
        store.finish(tile)
    run.tell(state, job.grid.size)


def lattice_of(shape: Index) -> list[np.ndarray]:
    """Positions along each axis of the cells where other branches are sought."""
    k = len(shape)
    if k <= 2:
        return [np.arange(n // (2 * _LINE), n, max(1, n // _LINE)) for n in shape]
    line = max(2, round(LATTICE ** (1.0 / k)))
    return [np.unique((np.arange(line) + 0.5) * n // line).astype(int) for n in shape]


def _before(state: State) -> str | None:
    """Name of the round whose edges a round starts from."""
    return f"{state.stage}-{state.round - 1}" if state.round else None


def _open(status: np.ndarray, stage: str) -> np.ndarray:
    """Cells that a stage may reach: the branch also those that one way led to beyond a limit."""
    return (status == UNSEEN) | ((status == JOINT_LIMIT) & (stage == "branch"))


class _Run:
    """One run over a map."""

    def __init__(
        self,
        job: Job,
        anchor: Anchor,
        store: Store,
        journal: Journal,
        crew: Crew,
        report: Progress | None,
    ) -> None:
        self.job, self.anchor, self.store, self.journal = job, anchor, store, journal
        self.crew, self.report = crew, report
        self.tiles: Tiles = job.tiles
        self.lattice = lattice_of(job.tiles.shape)
        self.seen = 0
        self.edges: dict[Index, bool] = {}

    def tell(self, state: State, done: int) -> None:
        """Report progress."""
        if self.report is not None:
            what = _STAGES.get(state.stage, _STAGES["others"])
            self.report(what, min(done, self.job.grid.size), self.job.grid.size)

    def round(self, state: State) -> None:
        """Work on the round's tiles, but for those that an earlier run finished."""
        self.seen, self.edges = state.seen, {}
        todo = []
        for tile in state.active:
            kept = self.journal.get(state.name, tile)
            if kept is None:
                todo.append(tile)
            else:
                self._enter(tile, kept)
        self.tell(state, self.seen)
        tasks = self._tasks(state, todo)
        with closing(
            self.crew.run(tasks, lambda more: self.tell(state, self.seen + more))
        ) as finds:
            for tile, found in finds:
                self.journal.put(state.name, tile, found)
                self._enter(tile, found)
                self.tell(state, self.seen)

    def _enter(self, tile: Index, found: Found) -> None:
        self.store.add(tile, found)
        self.seen += len(found.cells)
        self.edges[tile] = len(found.edge) > 0

    def after(self, state: State, *, others: bool) -> State:
        """Next round: the tiles beside those whose cells at their edges got solved."""
        grown = {
            beside
            for tile in state.active
            if self.edges.get(tile)
            for beside in self.tiles.neighbours(tile)
        }
        self.edges, seen = {}, max(self.seen, state.seen)
        if grown or state.stage == "others":
            return State(state.stage, state.round + 1, tuple(sorted(grown)), seen)
        if not others:
            return State("others", 0, (), seen)
        stage = "behind" if state.stage == "branch" else "others"
        active = {t for t in self.tiles.all() if self.journal.aside(_ASIDE[stage], t) is not None}
        if stage == "others":
            lattice = zip(self.lattice, self.tiles.size, strict=True)
            active |= {
                tuple(map(int, t)) for t in product(*(np.unique(a // s) for a, s in lattice))
            }
        return State(stage, 0, tuple(sorted(active)), seen)

    def _tasks(self, state: State, todo: Iterable[Index]) -> Iterator[Task]:
        nothing = np.zeros((0, len(self.tiles.shape)), dtype=int)
        before = _before(state)
        for tile in todo:
            status = self.store.status(tile)
            seams = None
            if state.stage == "branch" and before is not None:
                seams = self._seams(before, tile)
            if not _open(status, state.stage).any() and state.round and seams is None:
                continue
            cells, q, lattice = nothing, np.zeros((0, self.job.grid.start.size)), nothing
            if before is not None:
                cells, q = self._seeds(before, tile, _open(status, state.stage))
                if not len(cells) and seams is None:
                    continue
            elif state.stage == "branch":
                cells, q = np.array([self.anchor.cell]), self.anchor.q[None]
            else:
                cells, q = self._put_aside(state.stage, tile, status)
                if state.stage == "others":
                    lattice = self._lattice(tile)
            yield Task(tile, status, _LABELS[state.stage], cells, q, lattice, seams)

    def _put_aside(
        self, stage: str, tile: Index, status: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Where a stage begins: cells beyond limits, or unseen ones beside the branch."""
        kept = self.journal.aside(_ASIDE[stage], tile)
        if kept is None:
            return np.zeros((0, status.ndim), dtype=int), np.zeros((0, self.job.grid.start.size))
        cells, q = kept
        kept_as = UNSEEN if stage == "others" else JOINT_LIMIT
        wanted = status[tuple((cells - self.tiles.origin(tile)).T)] == kept_as
        return cells[wanted], q[wanted]

    def _seams(self, before: str, tile: Index) -> Seams | None:
        """Cells of this tile and of those before it that share a face and got solved at once."""
        own = self.journal.edge(before, tile)
        if own is None or not len(own[0]):
            return None
        place = {tuple(cell): i for i, cell in enumerate(own[0].tolist())}
        found: list[tuple[int, int, Edge]] = []
        for beside in self.tiles.neighbours(tile):
            edge = self.journal.edge(before, beside)
            if beside > tile or edge is None:
                continue
            axis = next(i for i, (a, b) in enumerate(zip(tile, beside, strict=True)) if a != b)
            for j, cell in enumerate(edge[0].tolist()):
                cell[axis] += 1
                if tuple(cell) in place:
                    found.append((place[tuple(cell)], j, edge))
        if not found:
            return None
        mine = np.array([i for i, _, _ in found])
        cells, q = (np.array([edge[part][j] for _, j, edge in found]) for part in (0, 1))
        return cells, q, own[0][mine], own[1][mine]

    def _seeds(self, before: str, tile: Index, open_: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Solved cells of the last round beside open ones of a tile, with their postures."""
        edges = [self.journal.edge(before, beside) for beside in self.tiles.neighbours(tile)]
        kept = [edge for edge in edges if edge is not None and len(edge[0])]
        if not kept:
            return np.zeros((0, open_.ndim), dtype=int), np.zeros((0, 0))
        all_cells, all_q = (np.concatenate(part) for part in zip(*kept, strict=True))
        where = self.tiles.slices(tile)
        low, high = [s.start for s in where], [s.stop - 1 for s in where]
        # the cell of the tile that shares a face, for those that do
        within = np.clip(all_cells, low, high)
        wanted = self.tiles.beside(tile, all_cells)
        wanted &= open_[tuple((within - self.tiles.origin(tile)).T)]
        return all_cells[wanted], all_q[wanted]

    def _lattice(self, tile: Index) -> np.ndarray:
        axes = [
            a[(a >= s.start) & (a < s.stop)]
            for a, s in zip(self.lattice, self.tiles.slices(tile), strict=True)
        ]
        if math.prod(len(a) for a in axes) == 0:
            return np.zeros((0, len(axes)), dtype=int)
        return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))
