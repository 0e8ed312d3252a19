"""Maps a second time, slowly: Pinocchio, continuation and LAPACK, cell after cell.

No tests here. ``ReferenceCells`` stands in the place of ``maps.cells.Cells``.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from closedchain.analysis.singularity.maps.cells import ARRIVED, UNTRIED, Signals
from closedchain.analysis.singularity.maps.grid import JOINT_LIMIT, OK, UNSEEN
from closedchain.analysis.singularity.maps.measures import measures_at, oriented
from closedchain.closure.chart import Chart
from closedchain.closure.charting import straight
from closedchain.closure.constraints import flipped_axes
from closedchain.closure.nearest import beyond_limits
from closedchain.closure.solve.continuation import Followed, follow
from closedchain.closure.solve.descend import descend
from closedchain.closure.solve.newton import Corrected, correct
from closedchain.closure.solve.outcome import Ending
from closedchain.closure.solve.search import Searched
from closedchain.closure.task import faces_away

SMALLEST_STEP = 1e-4  # share of a cell; a fold is located better than this when it is polished
DESCENT = 60  # evaluations of one start
SETTLED = 1e-2  # a squared gap that cannot be lowered by more than this share stays open
SHORT = 1e-2  # share of a cell below which a way is too short to judge where it leads

FOLD, STUCK = Ending.FOLD.code, Ending.STUCK.code


@dataclass(frozen=True, eq=False)
class ReferenceCells:
    """Cells by Pinocchio and LAPACK, one posture after the other."""

    chart: Chart

    def spread(
        self,
        values: np.ndarray,
        status: np.ndarray,
        q: np.ndarray,
        seeds: np.ndarray,
        label: int,
        signals: Signals | None = None,
    ) -> np.ndarray:
        """Breadth first with a queue; joints beyond their limits are walls."""
        mechanism, shape = self.chart.mechanism, status.shape
        ends = np.full(shape, UNTRIED, dtype=np.int8)
        queue: deque[tuple[tuple[int, ...], Corrected]] = deque()
        for seed in seeds:
            cell = tuple(int(i) for i in np.unravel_index(seed, shape))
            status[cell] = label
            here = correct(self.chart.equations(values[cell]), q[cell])
            if here.refusal is None:
                queue.append((cell, here))
        while queue:
            cell, here = queue.popleft()
            for beside in neighbours(cell, shape):
                if status[beside] != UNSEEN:
                    continue
                way = self.follow(here, values[cell], values[beside])
                if way.refusal is not None:
                    if ends[beside] != FOLD:
                        fold = self._folds(here, values[cell], values[beside], way)
                        ends[beside] = FOLD if fold else STUCK
                elif not beyond_limits(mechanism, way.last.q):
                    status[beside], q[beside] = label, way.last.q
                    queue.append((beside, way.last))
                elif label == OK:
                    status[beside] = JOINT_LIMIT
        ends[status != UNSEEN] = UNTRIED
        return ends

    def follow(self, here: Corrected, begin: np.ndarray, target: np.ndarray) -> Followed:
        """Follow a branch from coordinates (k,) to others.

        A step covers a characteristic length, or a radian, at most.
        """
        longest = 1.0 / max(1.0, float(np.abs((target - begin) / self.chart.scale).max()))
        return follow(straight(self.chart, begin, target), here, SMALLEST_STEP, longest)

    def ends_at_fold(self, q: np.ndarray, begin: np.ndarray, target: np.ndarray) -> bool:
        """Whether the way from a posture (nq,) at coordinates (k,) to others ends at a fold."""
        here = correct(self.chart.equations(begin), q)
        if here.refusal is not None:
            return True
        way = self.follow(here, begin, target)
        return way.refusal is not None and self._folds(here, begin, target, way)

    def _folds(self, here: Corrected, begin: np.ndarray, target: np.ndarray, way: Followed) -> bool:
        """Whether a way that did not arrive ended with a singularity in sight.

        Towards a singularity where the branch ends, the square of the Jacobian's volume falls
        linearly, or faster. It is in sight where that line reaches zero within a cell. A way too
        short to tell is judged together with the way backwards.
        """
        away, where, travel = here.q, begin, way.reached
        if travel < SHORT:
            back = self.follow(here, begin, 2.0 * begin - target)
            away, where = back.last.q, begin + back.reached * (begin - target)
            travel += back.reached
        end = begin + way.reached * (target - begin)
        fall = np.exp(2.0 * (self._volume(way.last.q, end) - self._volume(away, where)))
        return bool(fall * (1.0 + travel) <= 1.0)

    def _volume(self, q: np.ndarray, values: np.ndarray) -> float:
        """Logarithm of the product of the singular values of the chart's Jacobian."""
        s = np.linalg.svd(self.chart.equations(values).evaluate(q)[1], compute_uv=False)
        return float(np.log(np.maximum(s, np.finfo(float).tiny)).sum())

    def search(self, values: np.ndarray, starts: np.ndarray) -> Searched:
        """Descend from each start of each cell."""
        q, codes = np.zeros((len(values), starts.shape[-1])), np.full(len(values), UNTRIED)
        for i, (place, some) in enumerate(zip(values, starts, strict=True)):
            found = self._closed(place, some)
            if found is not None:
                q[i], codes[i] = found, ARRIVED
        return Searched(q, codes)

    def _closed(self, values: np.ndarray, starts: np.ndarray) -> np.ndarray | None:
        equations, mechanism = self.chart.equations(values), self.chart.mechanism
        for start in starts:
            q = self.chart.pinned(start, values)
            found = descend(equations, q, evaluations=DESCENT, settle=SETTLED)
            improper = (
                beyond_limits(mechanism, found.q)
                or flipped_axes(mechanism, found.q)
                or any(faces_away(mechanism, found.q, g) for g in equations.goals)
            )
            first = correct(equations, found.q)
            if found.closed and not improper and first.refusal is None:
                return first.q
        return None

    def measures(self, q: np.ndarray, outputs: tuple[str, ...]) -> dict[str, np.ndarray]:
        """Singular values and determinants by LAPACK."""
        return oriented(self.chart, measures_at(self.chart.mechanism, q, outputs))


def neighbours(cell: tuple[int, ...], shape: tuple[int, ...]) -> Iterator[tuple[int, ...]]:
    """Cells that share a face with one, axis by axis, down before up."""
    for axis, size in enumerate(shape):
        for step in (-1, 1):
            i = cell[axis] + step
            if 0 <= i < size:
                yield (*cell[:axis], i, *cell[axis + 1 :])
