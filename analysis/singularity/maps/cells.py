"""What work on a block of cells needs from the mechanism, on arrays; and the reference for it.

The reference follows with ``closure.continuation`` and measures with LAPACK, posture by posture.
The kernel of ``closure.batch`` does the same in bulk.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from typing import Protocol

import numpy as np
import pinocchio as pin

from closedchain.analysis.singularity.maps.grid import JOINT_LIMIT, OK, UNSEEN
from closedchain.analysis.singularity.maps.measures import measures_at, oriented
from closedchain.closure.batch.codes import FOLD, STUCK, UNTRIED
from closedchain.closure.chart import Chart
from closedchain.closure.charting import straight
from closedchain.closure.constraints import flipped_axes
from closedchain.closure.continuation import At, Followed, follow
from closedchain.closure.equations import Corrected, Equations, correct
from closedchain.closure.nearest import beyond_limits
from closedchain.closure.task import faces_away
from closedchain.closure.trust_region import descend

SMALLEST_STEP = 1e-4  # share of a cell; a fold is located better than this when it is polished
STARTS = 30  # random starts at a cell where other branches are sought
DESCENT = 60  # evaluations of one start
SETTLED = 1e-2  # a squared gap that cannot be lowered by more than this share stays open
_SHORT = 1e-2  # share of a cell below which a way is too short to judge where it leads


class Cells(Protocol):
    """Spreading, searching and measuring, for the coordinates of one chart."""

    def compiled(self) -> bool:
        """Whether the next call need not compile anything."""

    def spread(
        self,
        values: np.ndarray,
        status: np.ndarray,
        q: np.ndarray,
        seeds: np.ndarray,
        label: int,
        done: np.ndarray,
    ) -> np.ndarray:
        """Reach the unseen cells of a block from its seeds, as ``Batch.spread`` says.

        ``values`` (*shape, k), ``status`` (*shape) and ``q`` (*shape, nq); the latter two are
        changed in place. ``seeds`` (s,) are flat indices; ``done`` (1,) counts cells. Returns how
        the ways into cells that stay unseen ended, (*shape) of ``closure.batch.codes``.
        """

    def search(self, values: np.ndarray, starts: np.ndarray) -> np.ndarray | None:
        """Closed posture (nq,) at coordinates (k,), within joint limits; None if none is found.

        ``starts`` (s, nq) are tried in order.
        """

    def measures(self, q: np.ndarray) -> dict[str, np.ndarray]:
        """Measures (n,) of closed postures (n, nq), by name."""


class ReferenceCells:
    """Cells by Pinocchio and LAPACK, one posture after the other."""

    def __init__(self, chart: Chart, outputs: tuple[str, ...]) -> None:
        """Prepare for a chart; ``outputs`` are those of the measures."""
        self.chart = chart
        self.outputs = outputs
        self.closures = Equations(chart.mechanism, chart.free)

    def compiled(self) -> bool:
        """Nothing is ever compiled."""
        return True

    def spread(
        self,
        values: np.ndarray,
        status: np.ndarray,
        q: np.ndarray,
        seeds: np.ndarray,
        label: int,
        done: np.ndarray,
    ) -> np.ndarray:
        """Breadth first with a queue; joints beyond their limits are walls."""
        mechanism, shape = self.chart.mechanism, status.shape
        ends = np.full(shape, UNTRIED, dtype=np.int8)
        queue: deque[tuple[tuple[int, ...], Corrected]] = deque()
        for seed in seeds:
            cell = tuple(int(i) for i in np.unravel_index(seed, shape))
            status[cell] = label
            here = correct(self.equations(values[cell]), q[cell])
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
                    done += 1
                elif label == OK:
                    status[beside] = JOINT_LIMIT
        ends[status != UNSEEN] = UNTRIED
        return ends

    def follow(self, here: Corrected, begin: np.ndarray, target: np.ndarray) -> Followed:
        """Follow a branch from coordinates (k,) to others.

        A step covers a characteristic length, or a radian, at most.
        """
        longest = 1.0 / max(1.0, float(np.abs((target - begin) / self.chart.scale).max()))
        return follow(self._path(begin, target), here, SMALLEST_STEP, longest)

    def equations(self, values: np.ndarray) -> Equations:
        """Equations at coordinates (k,); those of joints alone do not depend on them."""
        return self.chart.equations(values) if self.chart.outputs else self.closures

    def _path(self, begin: np.ndarray, target: np.ndarray) -> At:
        if self.chart.outputs:
            return straight(self.chart, begin, target)
        (one, two), _, _ = self.chart.prescribed(np.stack([begin, target]))
        pinned = self.chart.pinned_q

        def at(q: np.ndarray, t: float) -> tuple[Equations, np.ndarray]:
            q = q.copy()
            q[pinned] = two if t == 1.0 else one + t * (two - one)
            return self.closures, q

        return at

    def ends_at_fold(self, q: np.ndarray, begin: np.ndarray, target: np.ndarray) -> bool:
        """Whether the way from a posture (nq,) at coordinates (k,) to others ends at a fold."""
        here = correct(self.equations(begin), q)
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
        if travel < _SHORT:
            back = self.follow(here, begin, 2.0 * begin - target)
            away, where = back.last.q, begin + back.reached * (begin - target)
            travel += back.reached
        end = begin + way.reached * (target - begin)
        fall = np.exp(2.0 * (self._volume(way.last.q, end) - self._volume(away, where)))
        return bool(fall * (1.0 + travel) <= 1.0)

    def _volume(self, q: np.ndarray, values: np.ndarray) -> float:
        """Logarithm of the product of the singular values of the chart's Jacobian."""
        s = np.linalg.svd(self.equations(values).evaluate(q)[1], compute_uv=False)
        return float(np.log(np.maximum(s, np.finfo(float).tiny)).sum())

    def search(self, values: np.ndarray, starts: np.ndarray) -> np.ndarray | None:
        """Descend from each start. That none is found is therefore a numerical verdict."""
        equations = self.equations(values)
        for start in starts:
            q = self.chart.pinned(start, values)
            found = descend(equations, q, evaluations=DESCENT, settle=SETTLED)
            if not found.closed or not proper(equations, found.q):
                continue
            first = correct(equations, found.q)
            if first.refusal is None:
                return first.q
        return None

    def measures(self, q: np.ndarray) -> dict[str, np.ndarray]:
        """Singular values and determinants by LAPACK."""
        return oriented(self.chart, measures_at(self.chart.mechanism, q, self.outputs))


def proper(equations: Equations, q: np.ndarray) -> bool:
    """No joint beyond its limits, no cut joint mirrored, no goal met backwards."""
    mechanism = equations.mechanism
    return not (
        beyond_limits(mechanism, q)
        or flipped_axes(mechanism, q)
        or any(faces_away(mechanism, q, g) for g in equations.goals)
    )


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


def neighbours(cell: tuple[int, ...], shape: tuple[int, ...]) -> Iterator[tuple[int, ...]]:
    """Cells that share a face with one, axis by axis, down before up."""
    for axis, size in enumerate(shape):
        for step in (-1, 1):
            i = cell[axis] + step
            if 0 <= i < size:
                yield (*cell[:axis], i, *cell[axis + 1 :])
