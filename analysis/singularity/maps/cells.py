"""What work on a block of cells does with the mechanism: spread a branch, search, measure."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pinocchio as pin

from closedchain.analysis.singularity.maps.choice import Choice
from closedchain.analysis.singularity.maps.grid import JOINT_LIMIT, OK, UNSEEN
from closedchain.closure.chart import Chart
from closedchain.closure.solve.flood import Block, flood
from closedchain.closure.solve.outcome import Ending
from closedchain.closure.solve.path import follower_of
from closedchain.closure.solve.problem import Problem
from closedchain.closure.solve.search import Searched, descent_of, search

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

    def warm(self, *, search: bool = True) -> None:
        """Make all machine code now, that for ``search`` only where it is needed."""
        follower = follower_of(self.problem)
        follower.loop, follower.check  # noqa: B018
        if search:
            descent_of(self.problem).loop  # noqa: B018
        self.measures.at(self.chart, self.chart.start[None])

    def spread(
        self,
        values: np.ndarray,
        status: np.ndarray,
        q: np.ndarray,
        seeds: np.ndarray,
        label: int,
        signals: Signals,
    ) -> np.ndarray:
        """Reach the unseen cells of a block from its seeds, as ``flood`` says.

        Parameters
        ----------
        values : (*shape, k) array
            Coordinates of the cells.
        status : (*shape) int8 array
            Changed in place: cells reached get ``label``, as do the seeds. Beyond joint limits they
            become ``JOINT_LIMIT`` where the label is ``OK``, else they stay unseen.
        q : (*shape, nq) array
            Posture of every seed; those of reached cells are written in place.
        seeds : (s,) int array
            Flat indices of cells.

        Returns
        -------
        (*shape) int8 array
            Codes of endings: how the ways into cells that stay unseen ended, UNTRIED elsewhere.
        """
        shape = status.shape
        targets = self.chart.targets(values.reshape(-1, values.shape[-1]))
        block = Block(self.problem, targets.reshape(*shape, -1), status == UNSEEN, q)
        codes = flood(block, seeds, signals.note)
        status.reshape(-1)[seeds] = label
        status[codes == ARRIVED] = label
        if label == OK:
            status[codes == LIMIT] = JOINT_LIMIT
        unseen = (status == UNSEEN) & np.isin(codes, EXPLAINED)
        return np.where(unseen, codes, UNTRIED).astype(np.int8)

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
