"""All postures over a window that modes lead to without a singularity: sheets, and where they end.

A branch that goes round a cusp comes back to the same coordinates with another posture. So what is
filled is not the grid but what lies over it: each grid point has as many postures as there are, and
a way leads from a posture of one grid point to a posture of a neighbour, along the branch. Which
postures hang together is seen from these ways alone.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from closedchain.closure.chart import Chart, joint_index
from closedchain.closure.modes.connections.window import Window
from closedchain.closure.modes.seeking import unwound
from closedchain.closure.modes.shapes import shapes_of
from closedchain.closure.nearest import LIMIT_TOLERANCE
from closedchain.closure.progress import Count
from closedchain.closure.solve.control import CLOSED
from closedchain.closure.solve.hops import SMALLEST_STEP
from closedchain.closure.solve.outcome import Ending
from closedchain.closure.solve.path import Way, follower_of
from closedchain.closure.solve.ways import follow

MOST_POSTURES = 400_000
BATCH = 2048  # ways between reports

ARRIVED, LIMIT, FOLD = Ending.ARRIVED.code, Ending.LIMIT.code, Ending.FOLD.code
MIRRORED, REVERSED, STUCK = Ending.MIRRORED.code, Ending.REVERSED.code, Ending.STUCK.code
UNTRIED = Ending.UNTRIED.code

NUMBERS = 6  # of a posture's shape, enough to tell two of them apart
SAME = 1e-6


@dataclass(frozen=True, eq=False)
class Marks:
    """A few numbers for each posture that are equal where all joints stand the same."""

    chart: Chart

    @cached_property
    def _mix(self) -> np.ndarray:
        count = shapes_of(self.chart.mechanism).count
        mix = np.random.default_rng(7).standard_normal((count, NUMBERS))
        return mix / np.sqrt(max(count, 1))

    def of(self, q: np.ndarray) -> np.ndarray:
        """Marks (n, NUMBERS) of postures (n, nq)."""
        return np.asarray(shapes_of(self.chart.mechanism).of(q) @ self._mix)


def same(one: np.ndarray, two: np.ndarray) -> np.ndarray:
    """Which marks (n, NUMBERS) are the others, (n,) of bool."""
    return np.asarray(np.abs(one - two).max(axis=-1, initial=0.0) < SAME)


@dataclass(frozen=True, eq=False)
class Branches:
    """Ways along branches between coordinates of a chart, judged where they arrive."""

    chart: Chart
    limits: bool

    def ways(
        self,
        q: np.ndarray,
        begin: np.ndarray,
        end: np.ndarray,
        smallest: float = SMALLEST_STEP,
    ) -> tuple[Way, np.ndarray]:
        """Follow postures (n, nq) from coordinates to others (n, k); endings' codes (n,), too.

        LIMIT where a joint is beyond its limits at the end, and these count. Passive hinges are
        turned back by whole turns to within theirs. ``smallest`` is the share of a way at which
        steps end that no longer lead on.
        """
        one, two = self.chart.targets(begin), self.chart.targets(end)
        return self._judged(follow(self.chart.problem, q, one, two, smallest), two)

    def hasty(self, q: np.ndarray, begin: np.ndarray, end: np.ndarray) -> tuple[Way, np.ndarray]:
        """The same, up to the last posture before a singularity, or where only pivots fail."""
        one, two = self.chart.targets(begin), self.chart.targets(end)
        return self._judged(follower_of(self.chart.problem).run(q, one, two), two)

    def _judged(self, way: Way, targets: np.ndarray) -> tuple[Way, np.ndarray]:
        """Ways to targets (n, prescribed), and their codes (n,)."""
        q = self.turned_back(way.q)
        check = follower_of(self.chart.problem).check
        largest, sense, facing, within = check.run(np.concatenate([q.T, targets.T]))
        codes = np.where(way.started, way.codes, STUCK)
        arrived = codes == ARRIVED
        codes[arrived & ~(largest < CLOSED)] = STUCK
        codes[arrived & (sense < 0.0)] = MIRRORED
        codes[arrived & (facing < 0.0)] = REVERSED
        if self.limits:
            codes[(codes == ARRIVED) & (within < -LIMIT_TOLERANCE)] = LIMIT
        return replace(way, q=q), codes

    def turned_back(self, q: np.ndarray) -> np.ndarray:
        """Postures (n, nq) with passive hinges turned by whole turns to within their limits."""
        found = unwound(self.chart.mechanism, q)
        found[:, self.chart.pinned_q] = q[:, self.chart.pinned_q]
        return found


@dataclass(frozen=True, eq=False)
class Covering:
    """Postures over the grid points of a window, and the ways between them.

    Attributes
    ----------
    point : (n,) int array
        Grid point of each posture; the modes come first.
    q : (n, nq) array
    det : (n,) array
        Determinant of the kept rows.
    mark : (n, NUMBERS) array
    beside : (n, 2 k) int array
        Posture that each side of the grid leads to, down and up along each axis; or -1.
    codes : (n, 2 k) int array
        How the way to that side ended: UNTRIED where there is no grid point.
    modes : (modes,) int array
        Posture of each mode; -1 for those that no way leaves.
    cut_short : bool
        Whether there were too many postures.
    """

    window: Window
    point: np.ndarray
    q: np.ndarray
    det: np.ndarray
    mark: np.ndarray
    beside: np.ndarray
    codes: np.ndarray
    modes: np.ndarray
    cut_short: bool

    @property
    def size(self) -> int:
        """Number of postures."""
        return len(self.point)

    @cached_property
    def part(self) -> np.ndarray:
        """Number of the connected part of each posture, (n,)."""
        from scipy.sparse import coo_matrix
        from scipy.sparse.csgraph import connected_components

        begin, side = np.nonzero(self.beside >= 0)
        ones = np.ones(len(begin), dtype=bool)
        pairs = coo_matrix((ones, (begin, self.beside[begin, side])), shape=(self.size, self.size))
        return np.asarray(connected_components(pairs, directed=False)[1])

    def open_ended(self, part: int) -> bool:
        """Whether a part goes on beyond the window."""
        return bool(self.window.edge[self.point[self.part == part]].any())

    def limited(self, part: int) -> bool:
        """Whether a part goes on beyond joint limits."""
        return bool((self.codes[self.part == part] == LIMIT).any())


def covering_of(
    window: Window, q: np.ndarray, branches: Branches, report: Count | None = None
) -> Covering:
    """Covering that modes (n, nq) of a window lead to."""
    work = _Filling(window, branches)
    modes = work.begin(q)
    front = np.unique(modes[modes >= 0])
    while front.size and work.size < MOST_POSTURES:
        front = work.onward(front)
        if report is not None:
            report(work.size)
    n = work.size
    return Covering(
        window=window,
        point=work.point[:n].copy(),
        q=work.q[:n].copy(),
        det=work.det[:n].copy(),
        mark=work.mark[:n].copy(),
        beside=work.beside[:n].copy(),
        codes=work.codes[:n].copy(),
        modes=modes,
        cut_short=bool(front.size),
    )


class _Filling:
    """Postures found so far, in arrays that grow; those of a grid point are chained."""

    def __init__(self, window: Window, branches: Branches) -> None:
        m, sides = window.chart.mechanism, 2 * len(window.names)
        self.window, self.branches, self.marks = window, branches, Marks(window.chart)
        self.size, room = 0, 1024
        self.point, self.det = np.zeros(room, dtype=np.int64), np.zeros(room)
        self.q, self.mark = np.zeros((room, m.model.nq)), np.zeros((room, NUMBERS))
        self.beside = np.full((room, sides), -1)
        self.codes = np.full((room, sides), UNTRIED)
        self.before = np.full(room, -1)  # an earlier posture of the same grid point
        self.latest = np.full(len(window.beside), -1)  # of each grid point
        self.turned = [
            (axis, joint_index(m, name)[0])
            for axis, name in enumerate(window.names)
            if window.whole[axis]
        ]

    def begin(self, q: np.ndarray) -> np.ndarray:
        """Enter the modes (n, nq); their postures (n,), -1 for those that do not close."""
        here = np.repeat(self.window.at[None], len(q), axis=0)
        way, codes = self.branches.ways(q, here, here)
        found = np.full(len(q), -1)
        good = np.flatnonzero(codes == ARRIVED)
        middle = np.full(good.size, self.window.middle)
        found[good] = self.entered(middle, way.q[good], way.det[good])
        return found

    def onward(self, front: np.ndarray) -> np.ndarray:
        """Follow all ways from postures (n,) that were not gone; the new postures there."""
        first = self.size
        known = self.beside[front] >= 0
        row, side = np.nonzero(~known & (self.window.beside[self.point[front]] >= 0))
        for a in range(0, row.size, BATCH):
            self._follow(front[row[a : a + BATCH]], side[a : a + BATCH])
        return np.arange(first, self.size)

    def _follow(self, begin: np.ndarray, side: np.ndarray) -> None:
        point, window = self.point[begin], self.window
        there = window.onward(point, side)
        way, codes = self.branches.ways(self.q[begin], window.values(point), there)
        self.codes[begin, side] = codes
        good = np.flatnonzero(codes == ARRIVED)
        if not good.size:
            return
        begin, side, q = begin[good], side[good], way.q[good]
        point = window.beside[point[good], side]
        shift = there[good] - window.values(point)
        for axis, index in self.turned:  # a whole turn is gone back
            q[:, index] -= shift[:, axis]
        end = self.entered(point, q, way.det[good])
        self.beside[begin, side] = end
        self.beside[end, side ^ 1], self.codes[end, side ^ 1] = begin, ARRIVED

    def entered(self, point: np.ndarray, q: np.ndarray, det: np.ndarray) -> np.ndarray:
        """Numbers (n,) of postures over grid points, entered where they are new."""
        mark = self.marks.of(q)
        found = np.full(len(point), -1)
        left = np.arange(len(point))
        while left.size:
            # one posture of each grid point after the other: the next ones may be the same
            _, first = np.unique(point[left], return_index=True)
            now = left[first]
            found[now] = self._known(point[now], mark[now])
            new = now[found[now] < 0]
            found[new] = self._added(point[new], q[new], det[new], mark[new])
            left = np.delete(left, first)
        return found

    def _known(self, point: np.ndarray, mark: np.ndarray) -> np.ndarray:
        """Postures (n,) over grid points with these marks, or -1."""
        found = np.full(len(point), -1)
        tried = self.latest[point]
        while (tried >= 0).any():
            at = np.flatnonzero((tried >= 0) & (found < 0))
            if not at.size:
                break
            equal = same(self.mark[tried[at]], mark[at])
            found[at[equal]] = tried[at[equal]]
            tried[at] = self.before[tried[at]]
        return found

    def _added(
        self, point: np.ndarray, q: np.ndarray, det: np.ndarray, mark: np.ndarray
    ) -> np.ndarray:
        """Numbers (n,) of new postures of different grid points."""
        new = np.arange(self.size, self.size + len(point))
        while self.size + len(point) > len(self.point):
            self._grow()
        self.point[new], self.q[new], self.det[new], self.mark[new] = point, q, det, mark
        self.before[new] = self.latest[point]
        self.latest[point] = new
        self.size += len(point)
        return new

    def _grow(self) -> None:
        for name in ("point", "q", "det", "mark", "beside", "codes", "before"):
            array = getattr(self, name)
            fill = UNTRIED if name == "codes" else -1
            setattr(self, name, np.concatenate([array, np.full_like(array, fill)]))
