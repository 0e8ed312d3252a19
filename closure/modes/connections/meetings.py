"""Singularities near the modes: where two of them meet on a straight way, and nothing stands between.

From the modes' coordinates straight ways lead to the window's edge. Each mode is followed along
each; where it ends at a fold, two postures become one, and the other one is followed back on the
same way: it is the mode that meets the first.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from closedchain.closure.clearance import clearance
from closedchain.closure.modes.connections.covering import (
    ARRIVED,
    LIMIT,
    Branches,
    Marks,
    same,
)
from closedchain.closure.modes.connections.window import Window
from closedchain.closure.nearest import beyond_limits
from closedchain.closure.solve.alone import Between
from closedchain.closure.solve.control import SMALLEST
from closedchain.closure.solve.folds import Fold, fold_near

WAYS = {1: 2, 2: 64, 3: 200}
"""Straight ways from the modes' coordinates, by the number of coordinates."""

MOST_WAYS = 4000  # of all modes together
ASIDE = 0.2  # dimensionless: how far beside a fold its two postures are looked at
SHORT = 0.9  # share of the way to a fold that is gone back at most
LOOKS = 16  # on a way, whether joints are within limits
NEARLY = 0.98  # share of the way to a fold up to which it is looked at
BESIDE = 0.05  # share of a way: from where a branch ended to its fold


@dataclass(frozen=True, eq=False)
class Meeting:
    """A singularity on a straight way from the modes' coordinates.

    Attributes
    ----------
    modes : tuple of str
        Those that meet there; one where the other posture is no mode here, or where the branch goes
        on through the singularity.
    names : tuple of str
        The coordinates that vary.
    values : (k,) array
        Their values there [m or rad].
    distance : float
        Length of the straight way, dimensionless (lengths by ``mechanism.length``).
    q : (nq,) array
        The singular posture.
    fold : bool
        Whether the branch ends there; else it goes on with the other sign of the determinant.
    sigma : float
        Zero but for rounding, see ``Passage.sigma``.
    """

    modes: tuple[str, ...]
    names: tuple[str, ...]
    values: np.ndarray
    distance: float
    q: np.ndarray
    fold: bool
    sigma: float

    def __post_init__(self) -> None:
        """Write-protect the arrays."""
        self.values.setflags(write=False)
        self.q.setflags(write=False)


@dataclass(frozen=True, eq=False)
class _End:
    """A fold that one or two modes meet on a way."""

    way: int
    modes: tuple[int, ...]
    fold: Fold


@dataclass(frozen=True, eq=False)
class Meetings:
    """Looks for meetings of modes ``q`` (n, nq), which have ``names``, along straight ways."""

    window: Window
    branches: Branches
    q: np.ndarray
    names: tuple[str, ...]

    @cached_property
    def ways(self) -> np.ndarray:
        """Coordinates (w, k) of the far ends of the straight ways, on the window's edge."""
        k = len(self.window.names)
        count = max(2 * k, min(WAYS[k], MOST_WAYS // max(len(self.q), 1)))
        ranges = np.array(self.window.ranges)
        half = ranges[:, 1] - ranges[:, 0]
        directions = _directions(k, count) * half
        with np.errstate(divide="ignore", invalid="ignore"):
            room = np.where(directions > 0.0, ranges[:, 1], ranges[:, 0]) - self.window.at
            shares = np.where(directions == 0.0, np.inf, room / directions)
        ends = self.window.at + shares.min(axis=1)[:, None] * directions
        return np.asarray(ends[shares.min(axis=1) > 0.0])

    def found(self) -> list[Meeting]:
        """Of each pair that meets the nearest meeting, nearest first.

        Singularities at which a mode meets none of the others only where they are nearer.
        """
        found: list[Meeting] = []
        met: set[int] = set()
        known: set[tuple[int, ...]] = set()
        for end in sorted(self._ends, key=self._distance):
            pair = tuple(sorted(end.modes))
            if pair in known or (len(pair) == 1 and pair[0] in met):
                continue
            if self._within_limits(end):
                known.add(pair)
                met.update(pair)
                found.append(self._meeting(end))
        return found

    @cached_property
    def _ends(self) -> list[_End]:
        """What stands at the end of each way of each mode."""
        modes, ways = len(self.q), len(self.ways)
        number, mode = np.divmod(np.arange(ways * modes), max(modes, 1))
        begin = np.repeat(self.window.at[None], len(mode), axis=0)
        way, codes = self.branches.hasty(self.q[mode], begin, self.ways[number])
        ended = (codes != ARRIVED) & (codes != LIMIT) & way.started
        done: set[tuple[int, int]] = set()
        found = []
        for i in np.flatnonzero(ended):
            at = int(number[i]), int(mode[i])
            if at in done:
                continue
            end = self._end(at, way.q[i], float(way.reached[i])) or self._slowly(at)
            if end is not None:
                found.append(end)
                done.update((at[0], other) for other in end.modes)
        return found

    def _slowly(self, at: tuple[int, int]) -> _End | None:
        """What stands at the end of a way that may go on where only pivots fail."""
        number, mode = at
        begin, end = self.window.at[None], self.ways[number][None]
        way, codes = self.branches.ways(self.q[mode][None], begin, end, SMALLEST)
        if codes[0] in (ARRIVED, LIMIT):
            return None
        return self._end(at, way.q[0], float(way.reached[0]))

    def _end(self, at: tuple[int, int], q: np.ndarray, reached: float) -> _End | None:
        """The singularity just ahead of a posture (nq,) where a way ended, if there is one."""
        number, mode = at
        fold = fold_near(self._between(number), q, reached)
        if fold is None or not -1e-9 <= fold.share - reached <= BESIDE:
            return None
        if fold.bend >= 0.0:
            return _End(number, (mode,), fold)
        own, other = self._beside(number, mode, fold)
        if not own:
            return None
        return _End(number, (mode,) if other is None else (mode, other), fold)

    def _between(self, number: int) -> Between:
        targets = self.window.targets(np.array([self.window.at, self.ways[number]]))
        return Between(self.window.chart.problem, *targets)

    def _beside(self, number: int, mode: int, fold: Fold) -> tuple[bool, int | None]:
        """Whether a fold is met by a mode, and the mode that the other posture there leads back to.

        None where it leads to none.
        """
        share = max(fold.share + fold.bend * ASIDE**2, (1.0 - SHORT) * fold.share)
        aside = fold.aside(share)
        if aside is None:
            return False, None
        system, q = self._between(number)(fold.q, share)
        near = np.array([system.move(q, side * aside * fold.along) for side in (1.0, -1.0)])
        there = self.window.at + share * (self.ways[number] - self.window.at)
        begin, end = np.repeat(there[None], 2, axis=0), np.repeat(self.window.at[None], 2, axis=0)
        way, codes = self.branches.ways(near, begin, end, SMALLEST)
        arrived = (codes == ARRIVED) | (codes == LIMIT)
        back = self._marks.of(way.q)
        own = arrived & same(back, self._mode_marks[mode])
        if own.sum() != 1:
            return False, None
        second = int(np.argmin(own))
        if not arrived[second]:
            return True, None
        known = np.flatnonzero(same(self._mode_marks, back[second]))
        return True, int(known[0]) if known.size else None

    @cached_property
    def _marks(self) -> Marks:
        return Marks(self.window.chart)

    @cached_property
    def _mode_marks(self) -> np.ndarray:
        return self._marks.of(self.q)

    def _distance(self, end: _End) -> float:
        """Of a fold from the modes' coordinates, along the straight way, dimensionless."""
        return float(self.window.lengths(end.fold.share * (self.ways[end.way] - self.window.at)))

    def _meeting(self, end: _End) -> Meeting:
        change = end.fold.share * (self.ways[end.way] - self.window.at)
        return Meeting(
            tuple(self.names[i] for i in end.modes),
            self.window.names,
            self.window.at + change,
            self._distance(end),
            end.fold.q,
            end.fold.bend < 0.0,
            clearance(self.window.chart, end.fold.q),
        )

    def _within_limits(self, end: _End) -> bool:
        """Whether the modes' joints stay within their limits on the way, where these count."""
        if not self.branches.limits:
            return True
        shares = end.fold.share * NEARLY * np.arange(1, LOOKS + 1) / LOOKS
        there = self.window.at + shares[:, None] * (self.ways[end.way] - self.window.at)
        begin = np.repeat(self.window.at[None], LOOKS, axis=0)
        for mode in end.modes:
            q = np.repeat(self.q[mode][None], LOOKS, axis=0)
            _, codes = self.branches.ways(q, begin, there)
            if (codes == LIMIT).any():
                return False
        return not beyond_limits(self.window.chart.mechanism, end.fold.q)


def _directions(k: int, count: int) -> np.ndarray:
    """Directions (count, k), spread evenly; the axes are among them for one and two coordinates."""
    if k == 1:
        return np.array([[1.0], [-1.0]])
    if k == 2:
        angles = 2.0 * np.pi * np.arange(count) / count
        found = np.stack([np.cos(angles), np.sin(angles)], axis=1)
        return np.where(np.abs(found) < 1e-12, 0.0, found)
    # a spiral from pole to pole, turned by the golden angle from one to the next
    height = 1.0 - 2.0 * (np.arange(count) + 0.5) / count
    angles = np.pi * (3.0 - np.sqrt(5.0)) * np.arange(count)
    wide = np.sqrt(1.0 - height**2)
    return np.stack([wide * np.cos(angles), wide * np.sin(angles), height], axis=1)
