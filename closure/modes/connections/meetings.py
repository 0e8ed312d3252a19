"""Singularities near the modes: where two of them meet on a straight way.

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
    SAME,
    Branches,
    Marks,
    same,
)
from closedchain.closure.modes.connections.window import Window
from closedchain.closure.nearest import beyond_limits
from closedchain.closure.solve.control import SMALLEST
from closedchain.closure.solve.folds import Folds, folds_near, moved, side_of

FEW = 100  # ends of ways that are all looked into with patience
WAYS = {1: 2, 2: 64, 3: 200}
"""Straight ways from the modes' coordinates, by the number of coordinates."""

MOST_WAYS = 4000  # of all modes together
ASIDE = (0.2, 0.05, 0.0125)
"""Dimensionless: how far beside a fold its two postures are looked at, one after the other."""
SHORT = 0.9  # share of the way to a fold that is gone back at most
LOOKS = 16  # on a way, whether joints are within limits
NEARLY = 0.98  # share of the way to a fold up to which it is looked at
AT_ONCE = 1e-4  # the same for what is no fold
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

    Examples
    --------
    >>> m = cc.load("five_bar")
    >>> modes = cc.postures(m, inputs=m.input_values(m.home), count=False)
    >>> (meeting,) = modes.connections("q1 q2", resolution=20).meetings
    >>> meeting.modes
    ('home', '+1')
    >>> cc.classify(m, meeting.q).kinds
    frozenset({'direct'})
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
    """A singularity (share, posture, whether the branch folds) that modes meet on a way."""

    way: int
    modes: tuple[int, ...]
    share: float
    q: np.ndarray
    fold: bool


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
            pair = end.modes
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
        ended = np.flatnonzero((codes != ARRIVED) & (codes != LIMIT) & way.started)
        found, left = self._singular(number[ended], mode[ended], way.q[ended], way.reached[ended])
        # those that ended with no singularity in sight: maybe only pivots failed
        i = ended[left]
        if i.size:
            way, codes = self.branches.ways(
                self.q[mode[i]], begin[i], self.ways[number[i]], SMALLEST
            )
            k = np.flatnonzero((codes != ARRIVED) & (codes != LIMIT))
            more, _ = self._singular(number[i[k]], mode[i[k]], way.q[k], way.reached[k])
            found += more
        return found

    def _singular(
        self, number: np.ndarray, mode: np.ndarray, q: np.ndarray, reached: np.ndarray
    ) -> tuple[list[_End], np.ndarray]:
        """Singularities just ahead of postures (n, nq) at which ways of modes ended.

        Beside them which ways (k,) have none.
        """
        problem, n = self.window.chart.problem, len(number)
        begin = np.repeat(self.window.targets(self.window.at[None]), n, axis=0)
        end = self.window.targets(self.ways[number]) if n else begin
        folds = folds_near(problem, q, begin, end, reached)
        there = folds.found & (folds.share >= reached - 1e-9) & (folds.share <= reached + BESIDE)
        sided, own, other = self._beside(number, mode, folds)
        # without two sides branches cross there, or several folds coincide
        there &= np.where(sided, own, folds.share <= reached + AT_ONCE)
        found = []
        for i in np.flatnonzero(there):
            modes = tuple(sorted({int(mode[i]), int(other[i])} - {-1}))
            place = float(folds.share[i]), folds.q[i], bool(sided[i])
            found.append(_End(int(number[i]), modes, *place))
        return found, np.flatnonzero(~there)

    def _beside(
        self, number: np.ndarray, mode: np.ndarray, folds: Folds
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Which folds on ways (n,) have two sides, and which of these modes (n,) really meet.

        Beside them the modes that meet them there, -1 where there is none.

        The two postures beside a fold are followed back: one must be the mode, the other one may
        be one.
        """
        sided, own = np.zeros((2, len(number)), dtype=bool)
        other = np.full(len(number), -1)
        i, q, there = self._two_sides(number, folds)
        if not i.size:
            return sided, own, other
        sided[i] = True
        reached, mark = self._back(q.reshape(2 * len(i), -1), np.repeat(there, 2, axis=0))
        mine = reached & same(mark, self._mode_marks[np.repeat(mode[i], 2)]).reshape(-1, 2)
        own[i] = mine.sum(axis=1) == 1
        second = np.argmin(mine, axis=1)
        rows = np.arange(len(i))
        theirs = mark.reshape(len(i), 2, -1)[rows, second]
        equal = np.abs(theirs[:, None] - self._mode_marks[None]).max(axis=2) < SAME
        known = own[i] & reached[rows, second] & equal.any(axis=1)
        other[i[known]] = equal[known].argmax(axis=1)
        return sided, own, other

    def _two_sides(
        self, number: np.ndarray, folds: Folds
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Folds (k,) of ways (n,), the postures (k, 2, nq) on both sides, and coordinates there.

        On one side the determinant has the other sign. Near a cusp a third posture may be taken
        for one of the two, and has not: then they are sought nearer to the fold.
        """
        problem, nq = self.window.chart.problem, self.q.shape[1]
        left = np.flatnonzero(folds.found & (folds.bend < 0.0))
        chosen, postures, places = [left[:0]], [np.zeros((0, 2, nq))], [self.window.at[None][:0]]
        for aside in ASIDE:
            share = np.maximum(folds.share + folds.bend * aside**2, (1.0 - SHORT) * folds.share)
            aside_here = folds.aside(share)
            left = left[np.isfinite(aside_here[left])]
            if not left.size:
                break
            step = np.repeat(aside_here[left, None] * folds.along[left], 2, axis=0)
            step[1::2] *= -1.0
            start = moved(problem, np.repeat(folds.q[left], 2, axis=0), step)
            there = self.window.at + share[left, None] * (self.ways[number[left]] - self.window.at)
            both = np.repeat(there, 2, axis=0)
            way, codes = self.branches.ways(start, both, both)
            closed = np.isin(codes, (ARRIVED, LIMIT)).reshape(-1, 2).all(axis=1)
            which, targets = np.repeat(left, 2), self.window.targets(both)
            sides = side_of(problem, folds, which, way.q, targets).reshape(-1, 2)
            good = closed & (sides.prod(axis=1) < 0.0)
            chosen.append(left[good])
            postures.append(way.q.reshape(-1, 2, nq)[good])
            places.append(there[good])
            left = left[~good]
        return np.concatenate(chosen), np.concatenate(postures), np.concatenate(places)

    def _back(self, q: np.ndarray, there: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Follow pairs of postures (2 n, nq) back: which arrive (n, 2), and their marks (2 n, ..).

        What does not arrive is followed once more, past where only kept rows or pivots fail: of
        pairs that do not both arrive, or, where no rows are left out and they are many, only of
        those of which none does.
        """
        end = np.repeat(self.window.at[None], len(q), axis=0)
        way, codes = self.branches.hasty(q, there, end)
        arrived, marks = np.isin(codes, (ARRIVED, LIMIT)), self._marks.of(way.q)
        pairs = arrived.reshape(-1, 2)
        patient = self.window.chart.problem.redundant or len(pairs) <= FEW
        lost = ~pairs.all(axis=1) if patient else ~pairs.any(axis=1)
        again = np.flatnonzero(np.repeat(lost, 2) & ~arrived)
        if again.size:
            way, codes = self.branches.ways(q[again], there[again], end[again], SMALLEST)
            arrived[again] = np.isin(codes, (ARRIVED, LIMIT))
            marks[again] = self._marks.of(way.q)
        return arrived.reshape(-1, 2), marks

    @cached_property
    def _marks(self) -> Marks:
        return Marks(self.window.chart)

    @cached_property
    def _mode_marks(self) -> np.ndarray:
        return self._marks.of(self.q)

    def _distance(self, end: _End) -> float:
        """Of a fold from the modes' coordinates, along the straight way, dimensionless."""
        return float(self.window.lengths(end.share * (self.ways[end.way] - self.window.at)))

    def _meeting(self, end: _End) -> Meeting:
        change = end.share * (self.ways[end.way] - self.window.at)
        return Meeting(
            tuple(self.names[i] for i in end.modes),
            self.window.names,
            self.window.at + change,
            self._distance(end),
            end.q,
            end.fold,
            clearance(self.window.chart, end.q),
        )

    def _within_limits(self, end: _End) -> bool:
        """Whether the modes' joints stay within their limits on the way, where these count."""
        if not self.branches.limits:
            return True
        shares = end.share * NEARLY * np.arange(1, LOOKS + 1) / LOOKS
        there = self.window.at + shares[:, None] * (self.ways[end.way] - self.window.at)
        begin = np.repeat(self.window.at[None], LOOKS, axis=0)
        for mode in end.modes:
            q = np.repeat(self.q[mode][None], LOOKS, axis=0)
            _, codes = self.branches.ways(q, begin, there)
            if (codes == LIMIT).any():
                return False
        (q,) = self.branches.turned_back(end.q[None])
        return not beyond_limits(self.window.chart.mechanism, q)


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
