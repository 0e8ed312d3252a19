"""Ways from mode to mode without a singularity, each confirmed apart from what found it.

The shortest way over the covering that keeps off small determinants is pulled straight, followed
again sample by sample with all rows by LAPACK, there and back, and measured on the way.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from closedchain.closure.clearance import clearance
from closedchain.closure.modes.connections.covering import ARRIVED, Branches, Covering, Marks, same
from closedchain.closure.modes.connections.window import TURN
from closedchain.closure.nearest import beyond_limits
from closedchain.closure.solve.alone import follow_alone
from closedchain.closure.solve.control import SMALLEST
from closedchain.closure.turns import tied, turning

WARY = 0.2  # share of the usual determinant below which a way is as long again
NARROWER = 0.5  # share of a way's least determinant that straight pieces keep
SAMPLES = 8  # of a straight piece that is tried
SEEN = 20  # later posts that a straight piece is tried to
FINE = 1.0  # samples of a passage for each cell that it crosses


@dataclass(frozen=True, eq=False)
class Passage:
    """A way without a singularity between two modes, of straight pieces in the slice.

    Attributes
    ----------
    modes : (str, str)
        Where it begins and where it ends, both with the same coordinates (or whole turns away).
    names : tuple of str
        The coordinates that vary.
    corners : (c, k) array
        Their values [m or rad] where the straight pieces begin and end.
    values : (s, k) array
        Their values at samples along it, corners among them.
    q : (s, nq) array
        Postures there. Passive hinges may stand a whole turn from where those of the mode do, so
        that they keep within their limits on the way.
    determinant : (s,) array
        Of the solved equations, dimensionless; it keeps its sign.
    sigma : (s,) array
        How far each sample is from a singularity: ``sigma_direct`` where inputs are held,
        ``sigma_inverse`` where the tip is.
    residual : float
        Largest row of all samples [m or rad].

    Examples
    --------
    >>> m = cc.load("three_rpr")
    >>> modes = cc.postures(m, inputs=m.input_values(m.home), count=False)
    >>> found = modes.connections({"q2": (2.0, 32.0), "q3": (2.0, 32.0)}, resolution=30)
    >>> way = found.passages[0]
    >>> legs = np.array([m.input_values(q) for q in way.q])
    >>> cc.track(m, legs, start=way.q[0]).complete
    True
    >>> len(set(np.sign(way.determinant))), bool(way.sigma.min() > 0.0)
    (1, True)
    """

    modes: tuple[str, str]
    names: tuple[str, ...]
    corners: np.ndarray
    values: np.ndarray
    q: np.ndarray
    determinant: np.ndarray
    sigma: np.ndarray
    residual: float

    def __post_init__(self) -> None:
        """Write-protect the arrays."""
        for array in (self.corners, self.values, self.q, self.determinant, self.sigma):
            array.setflags(write=False)

    @property
    def pieces(self) -> int:
        """Number of straight pieces."""
        return len(self.corners) - 1

    def reversed(self) -> Passage:
        """The same way back."""
        return Passage(
            self.modes[::-1],
            self.names,
            np.array(self.corners[::-1]),
            np.array(self.values[::-1]),
            np.array(self.q[::-1]),
            np.array(self.determinant[::-1]),
            np.array(self.sigma[::-1]),
            self.residual,
        )

    def then(self, other: Passage) -> Passage:
        """This way and another one that begins where it ends."""
        shift = self.corners[-1] - other.corners[0]  # whole turns, as these
        turned = TURN * np.round((self.q[-1] - other.q[0]) / TURN)

        def joined(name: str, by: np.ndarray | float = 0.0) -> np.ndarray:
            return np.concatenate([getattr(self, name), (getattr(other, name) + by)[1:]])

        return Passage(
            (self.modes[0], other.modes[1]),
            self.names,
            joined("corners", shift),
            joined("values", shift),
            joined("q", turned),
            joined("determinant"),
            joined("sigma"),
            max(self.residual, other.residual),
        )


@dataclass(frozen=True, eq=False)
class Passages:
    """Looks for passages over a covering, whose modes have ``names``."""

    covering: Covering
    branches: Branches
    names: tuple[str, ...]

    def found(self) -> tuple[list[Passage], list[tuple[str, str]]]:
        """Passages that join the modes of each part, as few as do; pairs that were not confirmed.

        The nearest modes are joined first.
        """
        good: list[Passage] = []
        failed: list[tuple[str, str]] = []
        modes = self.covering.modes
        for part in np.unique(self.covering.part[modes[modes >= 0]]):
            own = [
                int(i) for i in np.flatnonzero(modes >= 0) if self.covering.part[modes[i]] == part
            ]
            if len(own) > 1:
                self._within(own, good, failed)
        return good, failed

    def _within(self, own: list[int], good: list[Passage], failed: list[tuple[str, str]]) -> None:
        """Join modes of one part by a tree of passages."""
        modes = self.covering.modes
        apart = np.array([self._reach(i)[0][modes[own]] for i in own])
        pairs = [(a, b) for a in range(len(own)) for b in range(a + 1, len(own))]
        group = list(range(len(own)))
        for a, b in sorted(pairs, key=lambda pair: float(apart[pair])):
            if group[a] == group[b] or not np.isfinite(apart[a, b]):
                continue
            passage = self._passage(own[a], own[b])
            if passage is None:
                failed.append((self.names[own[a]], self.names[own[b]]))
                continue
            good.append(passage)
            group = [group[a] if g == group[b] else g for g in group]

    def _reach(self, mode: int) -> tuple[np.ndarray, np.ndarray]:
        """Lengths (n,) of the ways from a mode to all postures, and the posture before each."""
        from scipy.sparse.csgraph import dijkstra

        found = dijkstra(
            self._graph,
            directed=False,
            indices=int(self.covering.modes[mode]),
            return_predecessors=True,
        )
        return np.asarray(found[0]), np.asarray(found[1])

    @cached_property
    def _graph(self) -> object:
        from scipy.sparse import coo_matrix

        c = self.covering
        begin, side = np.nonzero(c.beside >= 0)
        end = c.beside[begin, side]
        length = c.window.lengths(
            c.window.onward(c.point[begin], side) - c.window.values(c.point[begin])
        )
        usual = float(np.median(np.abs(c.det))) or 1.0
        size = np.where(c.det == 0.0, usual, np.abs(c.det))  # 0 where it is not known
        near = np.minimum(size[begin], size[end]) / usual
        cost = length * (1.0 + WARY / np.maximum(near, 1e-6))
        return coo_matrix((cost, (begin, end)), shape=(c.size, c.size)).tocsr()

    def _passage(self, one: int, two: int) -> Passage | None:
        """Passage between two modes of one part, or None where it cannot be confirmed."""
        posts = self._posts(one, two)
        values = self._unwound(posts)
        for chosen in (self._straightened(posts, values), np.arange(len(posts))):
            passage = self._confirmed(one, two, values[chosen])
            if passage is not None:
                return passage
        return None

    def _posts(self, one: int, two: int) -> np.ndarray:
        """Postures of the covering from one mode to another."""
        _, before = self._reach(one)
        at, found = int(self.covering.modes[two]), []
        while at >= 0:
            found.append(at)
            at = int(before[at])
        return np.array(found[::-1])

    def _unwound(self, posts: np.ndarray) -> np.ndarray:
        """Coordinates (n, k) along postures, whole turns counted."""
        c = self.covering
        begin, end = posts[:-1], posts[1:]
        side = np.argmax(c.beside[begin] == end[:, None], axis=1)
        values = c.window.values(c.point[posts])
        turns = np.round((c.window.onward(c.point[begin], side) - values[1:]) / TURN)
        values[1:] += TURN * np.cumsum(turns, axis=0)
        return values

    def _straightened(self, posts: np.ndarray, values: np.ndarray) -> np.ndarray:
        """Indices of posts between which straight ways lead, the farthest ones."""
        chosen, at, last = [0], 0, len(posts) - 1
        while at < last:
            at = self._farthest(posts, values, at)
            chosen.append(at)
        return np.array(chosen)

    def _farthest(self, posts: np.ndarray, values: np.ndarray, at: int) -> int:
        """The farthest post that a straight way from one leads to, well off singularities."""
        later = np.arange(at + 2, len(posts))
        if not later.size:
            return at + 1
        later = np.unique(np.linspace(later[0], later[-1], SEEN).round().astype(int))
        shares = np.arange(1, SAMPLES + 1) / SAMPLES
        begin = np.repeat(values[at][None], later.size * SAMPLES, axis=0)
        end = values[at] + shares[None, :, None] * (values[later] - values[at])[:, None, :]
        q = np.repeat(self.covering.q[posts[at]][None], len(begin), axis=0)
        way, codes = self.branches.ways(q, begin, end.reshape(len(begin), -1))
        size = np.abs(way.det).reshape(later.size, SAMPLES).min(axis=1)
        arrived = (codes == ARRIVED).reshape(later.size, SAMPLES).all(axis=1)
        marks = Marks(self.covering.window.chart)
        there = marks.of(way.q.reshape(later.size, SAMPLES, -1)[:, -1])
        arrived &= same(there, self.covering.mark[posts[later]])
        least = np.array([np.abs(self.covering.det[posts[at : j + 1]]).min() for j in later])
        good = later[arrived & (size >= NARROWER * least)]
        return int(good[-1]) if good.size else at + 1

    def _confirmed(self, one: int, two: int, corners: np.ndarray) -> Passage | None:
        """Passage through corners (c, k), followed again; None where it does not hold."""
        values = self._samples(corners)
        q, there = self._walked(self.covering.modes[one], values)
        _, back = self._walked(self.covering.modes[two], values[::-1])
        mark = self.covering.mark[self.covering.modes]
        if q is None or there is None or back is None:
            return None
        if not (same(there, mark[two]) and same(back, mark[one])):
            return None
        chart = self.covering.window.chart
        m, problem = chart.mechanism, chart.problem
        q = self._turned(q)
        determinant = np.array([problem.determinant_at(x) for x in q])
        if problem.signed and (np.sign(determinant) != np.sign(determinant[0])).any():
            return None
        if self.branches.limits and any(beyond_limits(m, x) for x in q):
            return None
        return Passage(
            (self.names[one], self.names[two]),
            chart.names,
            corners,
            values,
            q,
            determinant,
            np.array([clearance(chart, x) for x in q]),
            max(float(np.abs(m.workspace.residual(x)).max(initial=0.0)) for x in q),
        )

    def _samples(self, corners: np.ndarray) -> np.ndarray:
        """Coordinates (s, k) along straight pieces, no farther apart than a share of a cell."""
        window = self.covering.window
        cells = np.array(
            [(high - low) / n for (low, high), n in zip(window.ranges, window.shape, strict=True)]
        )
        found = [corners[:1]]
        for begin, end in pairwise(corners):
            count = max(2, int(np.ceil(FINE * np.abs((end - begin) / cells).max())))
            shares = np.arange(1, count + 1)[:, None] / count
            found.append((1.0 - shares) * begin + shares * end)
        return np.concatenate(found)

    def _turned(self, q: np.ndarray) -> np.ndarray:
        """The same way (s, nq) with passive hinges that are whole turns on, so that limits hold.

        As they are where no whole turn suits all of a way.
        """
        chart = self.covering.window.chart
        m, found = chart.mechanism, q.copy()
        turns = turning(m) & ~tied(m)
        for joint in list(m.model.joints)[1:]:
            at = joint.idx_q
            if joint.nq != 1 or not turns[joint.idx_v] or at in chart.pinned_q:
                continue
            low, high = (float(limit[at]) for limit in m.limits)
            least, most = np.ceil((low - q[:, at].min()) / TURN), (high - q[:, at].max()) / TURN
            if least <= np.floor(most):
                found[:, at] += TURN * min(max(0.0, least), np.floor(most))
        return found

    def _walked(self, post: int, values: np.ndarray) -> tuple[np.ndarray | None, np.ndarray | None]:
        """Postures (s, nq) from one of the covering on along coordinates, and the last one's mark.

        Followed with all rows, by LAPACK; None where a step does not arrive.
        """
        chart = self.covering.window.chart
        targets = chart.targets(values)
        q, found = self.covering.q[post], [self.covering.q[post]]
        for begin, end in pairwise(targets):
            q, share = follow_alone(chart.problem, q, begin, end, SMALLEST)
            if share < 1.0:
                return None, None
            found.append(q)
        every = np.array(found)
        return every, Marks(chart).of(every[-1:])[0]
