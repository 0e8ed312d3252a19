"""What work on a block of cells does with the mechanism: spread a branch, search, measure."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pinocchio as pin

from closedchain.analysis.singularity.maps.choice import Choice
from closedchain.analysis.singularity.maps.grid import (
    BEHIND_LIMIT,
    JOINT_LIMIT,
    OK,
    OTHER_BRANCH,
    UNSEEN,
    Grid,
)
from closedchain.analysis.singularity.maps.isthmuses import Shore
from closedchain.closure.chart import Chart
from closedchain.closure.solve.flood import Block, flood
from closedchain.closure.solve.hops import SMALLEST_STEP
from closedchain.closure.solve.outcome import Ending
from closedchain.closure.solve.path import follower_of
from closedchain.closure.solve.problem import Problem
from closedchain.closure.solve.search import Searched, descent_of, search
from closedchain.closure.solve.ways import follow
from closedchain.closure.turns import same_postures

STARTS = 30  # random starts at a cell where other branches are sought

ARRIVED, UNTRIED, LIMIT = Ending.ARRIVED.code, Ending.UNTRIED.code, Ending.LIMIT.code
EXPLAINED = [e.code for e in (Ending.FOLD, Ending.STUCK, Ending.MIRRORED, Ending.REVERSED)]


class Stopped(Exception):
    """The work was asked to stop before it was done."""


@dataclass(frozen=True, eq=False)
class Signals:
    """What worker and asker tell each other while a task is worked on; shared between threads.

    ``done`` (1,) counts cells, ``stop`` (1,) is above zero where the work is to be given up.
    """

    done: np.ndarray
    stop: np.ndarray

    @classmethod
    def fresh(cls) -> Signals:
        """Nothing done, go on."""
        return cls(np.zeros(1, dtype=np.int64), np.zeros(1, dtype=np.int64))

    def note(self, cells: int = 0) -> None:
        """Count cells. Raises ``Stopped`` where the work is to be given up."""
        self.done[0] += cells
        if self.stop[0]:
            raise Stopped


@dataclass(eq=False)
class Spreading:
    """Cells of a block while a branch is spread over it; changed in place.

    Attributes
    ----------
    values : (*shape, k) array
        Coordinates of the cells.
    status : (*shape) int8 array
    q : (*shape, nq) array
        Posture of every seed and of reached cells, those beyond limits too.
    """

    values: np.ndarray
    status: np.ndarray
    q: np.ndarray

    def __post_init__(self) -> None:
        """Nothing is solved or joined; how ways into unseen cells ended is not known."""
        shape = self.status.shape
        self.solved = np.zeros(shape, dtype=bool)
        self.ends = np.full(shape, UNTRIED, dtype=np.int8)
        self.joined = np.zeros((*shape, len(shape)), dtype=bool)
        self.shore = [(np.zeros((0, len(shape)), dtype=int), np.zeros((0, self.q.shape[-1])))]

    def beside(self, cells: np.ndarray, q: np.ndarray) -> None:
        """Keep closed postures (n, nq) of cells (n, k) beside the branch."""
        self.shore.append((cells, q))


@dataclass(frozen=True, eq=False)
class Cells:
    """Spreading, searching and measuring, for the coordinates of one chart. Threads may share it.

    ``measures`` says what is measured at the cells of the branch.
    """

    chart: Chart
    measures: Choice

    @cached_property
    def problem(self) -> Problem:
        """Equations of the chart."""
        return self.chart.problem

    def ready(self) -> bool:
        """Whether all machine code is made."""
        made = vars(follower_of(self.problem)), vars(descent_of(self.problem))
        return "loop" in made[0] and "check" in made[0] and "loop" in made[1]

    def warm(self) -> None:
        """Make all machine code now."""
        follower = follower_of(self.problem)
        follower.loop, follower.check  # noqa: B018
        descent_of(self.problem).loop  # noqa: B018
        self.measures.at(self.chart, self.chart.start[None])

    def spread(self, block: Spreading, seeds: np.ndarray, label: int, signals: Signals) -> None:
        """Reach the unseen cells of a block from its seeds, as ``flood`` says, in place.

        Cells reached get ``label``, as do seeds that have no status. Beyond joint limits they
        become ``JOINT_LIMIT`` where the branch meets these, stay unseen where another branch does,
        and are like the others behind them. The
        branch itself, ``OK``, is also followed through isthmuses; other branches give way to what
        closes from their postures.

        Parameters
        ----------
        seeds : (s,) int array
            Flat indices of cells.
        """
        tried = np.zeros(block.status.shape, dtype=bool)
        while seeds.size:
            self._flooded(block, seeds, label, signals)
            if label == BEHIND_LIMIT:
                return
            shore = Shore(self.chart, block.values, block.solved, block.q)
            cells = shore.beside()
            at = tuple(cells.T)
            cells = cells[~tried[at] & (block.status[at] == UNSEEN)]
            tried[tuple(cells.T)] = True
            good, q = shore.closed(cells)
            found, q = cells[good], q[good]
            if label == OK:
                block.beside(found, q)
                found, q = shore.crossed(found, signals.note)
            block.q[tuple(found.T)] = q
            seeds = np.ravel_multi_index(tuple(found.T), block.status.shape)

    def _flooded(self, block: Spreading, seeds: np.ndarray, label: int, signals: Signals) -> None:
        """Flood once."""
        status, values = block.status, block.values
        targets = self.chart.targets(values.reshape(-1, values.shape[-1]))
        targets = targets.reshape(*status.shape, -1)
        # the branch may lead to a cell beyond a limit by one way, and within limits by another
        unseen = (status == UNSEEN) | ((label == OK) & (status == JOINT_LIMIT))
        filled = Block(self.problem, targets, unseen, block.q)
        through = label == BEHIND_LIMIT
        flooded = flood(filled, seeds, signals.note, through=through)
        codes = flooded.codes
        status[unseen & (codes == ARRIVED)] = label
        if label != OTHER_BRANCH:
            status[unseen & (codes == LIMIT)] = JOINT_LIMIT if label == OK else label
        flat = status.reshape(-1)
        flat[seeds[flat[seeds] == UNSEEN]] = label
        block.solved |= codes == ARRIVED
        block.joined |= flooded.joined
        ended = (status == UNSEEN) & np.isin(codes, EXPLAINED)
        block.ends[ended] = codes[ended]

    def joined(
        self,
        grid: Grid,
        one: tuple[np.ndarray, np.ndarray],
        two: tuple[np.ndarray, np.ndarray],
    ) -> np.ndarray:
        """Which cells (n, k) with postures (n, nq) the branch leads to from others, (n,) bool."""
        (begin, q), (end, other) = one, two
        targets = [self.chart.targets(grid.coordinates(cells)) for cells in (begin, end)]
        found = np.zeros(len(begin), dtype=bool)
        for start, goal, way in ((q, other, targets), (other, q, targets[::-1])):
            i = np.flatnonzero(~found)
            if i.size:
                went = follow(self.problem, start[i], way[0][i], way[1][i], SMALLEST_STEP)
                there = went.codes == ARRIVED
                found[i] = there & same_postures(self.chart.mechanism, went.q, goal[i])
        return found

    def search(self, values: np.ndarray, starts: np.ndarray) -> Searched:
        """Closed postures at coordinates (n, k) from starts (n, s, nq), tried in order."""
        return search(self.problem, self.chart.targets(values), starts)


def random_postures(chart: Chart, seed: tuple[int, ...], count: int = STARTS) -> np.ndarray:
    """Postures (count, nq) far around home: any angle, lengths within about ``length``."""
    mechanism, rng = chart.mechanism, np.random.default_rng(seed)
    slides = mechanism.translational
    found = np.empty((count, mechanism.model.nq))
    for i in range(count):
        v = rng.uniform(-np.pi, np.pi, mechanism.model.nv)
        v[slides] = mechanism.column_scale[slides] * rng.standard_normal(np.count_nonzero(slides))
        found[i] = pin.integrate(mechanism.model, mechanism.home, v)
    return found
