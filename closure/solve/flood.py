"""Filling a grid of prescribed values from solved cells: branches followed from cell to cell.

Breadth first, by fronts: the ways from all cells of a front into their unsolved neighbours are
followed together. The order is that of a queue (cells as they were reached, neighbours axis by
axis, down before up), so that what is found depends on the grid and its seeds alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from closedchain.closure.nearest import LIMIT_TOLERANCE
from closedchain.closure.progress import Reached
from closedchain.closure.solve.alone import healthy
from closedchain.closure.solve.hops import Hops
from closedchain.closure.solve.outcome import Ending
from closedchain.closure.solve.path import Way
from closedchain.closure.solve.problem import Problem
from closedchain.closure.turns import same_postures

CLOSED = 1e-9
"""Largest of all rows [m or rad] of a solution of the kept ones that is one of all."""

SHORT = 1e-2
"""Share of a way below which it is too short to judge where it leads."""

ARRIVED, UNTRIED, LIMIT = Ending.ARRIVED.code, Ending.UNTRIED.code, Ending.LIMIT.code
FOLD, STUCK = Ending.FOLD.code, Ending.STUCK.code
MIRRORED, REVERSED = Ending.MIRRORED.code, Ending.REVERSED.code

EXPLAINS = np.zeros(len(Ending), dtype=int)
"""By code: of several ways into a cell that was not reached, the one that explains most is kept."""
EXPLAINS[[STUCK, MIRRORED, REVERSED, FOLD]] = 1, 2, 3, 4


def beside(shape: tuple[int, ...]) -> np.ndarray:
    """Flat index of each cell's neighbours (cells, 2 k), down and up along each axis; or -1."""
    index = np.arange(int(np.prod(shape))).reshape(shape)
    found = np.full((*shape, 2 * index.ndim), -1)
    for axis in range(index.ndim):
        low = tuple(slice(1, None) if a == axis else slice(None) for a in range(index.ndim))
        high = tuple(slice(-1) if a == axis else slice(None) for a in range(index.ndim))
        found[(*low, 2 * axis)] = index[high]
        found[(*high, 2 * axis + 1)] = index[low]
    return found.reshape(index.size, -1)


@dataclass(frozen=True, eq=False)
class Block:
    """Cells of a grid.

    Attributes
    ----------
    problem : Problem
        With as many kept rows as unknowns.
    targets : (*shape, prescribed) array
        What each cell prescribes.
    open : (*shape) array of bool
        Cells that may be reached.
    q : (*shape, nq) array
        Posture of every seed; those of reached cells are written in place, beyond limits too.
    """

    problem: Problem
    targets: np.ndarray
    open: np.ndarray
    q: np.ndarray

    @property
    def size(self) -> int:
        """Number of cells."""
        return self.open.size

    @cached_property
    def beside(self) -> np.ndarray:
        """Flat index of each cell's neighbours (cells, 2 k), down and up along each axis; or -1."""
        return beside(self.open.shape)


@dataclass(frozen=True, eq=False)
class Flooded:
    """What became of the cells of a block.

    Attributes
    ----------
    codes : (*shape) int array
        Code of an ``Ending`` for each cell: ARRIVED where it was reached, or is a seed; LIMIT
        where it was reached, but beyond a joint's limit by all ways that led there; else how the
        ways into it ended: FOLD, STUCK, MIRRORED or REVERSED, and UNTRIED where there was none.
        SINGULAR_START for seeds that lead nowhere.
    joined : (*shape, k) array of bool
        Whether the branch leads from a cell to the next one along each axis, posture to posture.
        Neighbours that were both reached need not be joined: a branch can lie over a grid in
        several sheets.
    """

    codes: np.ndarray
    joined: np.ndarray


def flood(
    block: Block,
    seeds: ArrayLike,
    progress: Reached | None = None,
    *,
    through: bool = False,
) -> Flooded:
    """Reach the open cells of a block from its seeds.

    Parameters
    ----------
    seeds : (s,) int array
        Flat indices (C order) of cells whose ``q`` is closed; they lead on whether open or not.
    through : bool
        Cells beyond joint limits lead on, too.
    """
    work = _Work(block, through=through)
    front = work.begin(np.array(list(dict.fromkeys(np.asarray(seeds).tolist())), dtype=np.int64))
    while front.size:
        front = work.onward(front)
        if progress is not None:
            progress(front.size)
    work.join()
    solved = np.flatnonzero(work.solved[:-1] | (work.codes == LIMIT))
    block.q.reshape(block.size, -1)[solved] = work.hops.q[:, solved].T
    shape = block.open.shape
    return Flooded(work.codes.reshape(shape), work.joined[:, 1::2].reshape(*shape, len(shape)))


class _Work:
    """What is known of the cells of a block, flat, while it is filled; a last one is no cell."""

    def __init__(self, block: Block, *, through: bool) -> None:
        self.through = through
        self.beside = block.beside
        self.hops = Hops(
            block.problem, block.targets.reshape(block.size, -1), block.q.reshape(block.size, -1)
        )
        self.left = np.append(block.open.reshape(-1), False)
        self.solved = np.zeros(block.size + 1, dtype=bool)
        self.codes = np.full(block.size, UNTRIED)
        self.mark = np.zeros(block.size, dtype=np.int64)
        self.seed = np.zeros(block.size, dtype=bool)
        self.joined = np.zeros(self.beside.shape, dtype=bool)

    def begin(self, seeds: np.ndarray) -> np.ndarray:
        """Close seeds (s,); those that lead on."""
        closed = self.hops.closed(seeds)
        for i in np.flatnonzero(~closed):  # it may be but the choice of rows, or of pivots
            closed[i] = self.hops.closed_alone(seeds[i])
        self.codes[seeds] = np.where(closed, ARRIVED, Ending.SINGULAR_START.code)
        self.left[seeds] = False
        self.seed[seeds] = True
        self.solved[seeds[closed]] = True
        return seeds[closed]

    def onward(self, front: np.ndarray) -> np.ndarray:
        """Cells reached from a front, in order.

        Of several ways into a cell the next one is tried where those before fail.
        """
        beside = self.beside[front]
        row, side = np.nonzero(self.left[beside])
        begin, end = front[row], beside[row, side]
        order = np.arange(end.size)
        reached, places = [front[:0]], [order[:0]]
        while end.size:
            self.mark[end[::-1]] = order[::-1]  # the first one stays
            first = self.mark[end] == order
            good = self._enter(begin[first], end[first], side[first])
            self.joined[begin[first][good], side[first][good]] = True
            self.joined[end[first][good], side[first][good] ^ 1] = True
            reached.append(end[first][good])
            places.append(order[first][good])
            rest = self.left[end] & ~first
            begin, end, side, order = begin[rest], end[rest], side[rest], order[rest]
        found = np.concatenate(reached)
        return found[np.argsort(np.concatenate(places))] if len(reached) > 2 else found

    def join(self) -> None:
        """Follow the ways between neighbours that were reached from elsewhere, up and back."""
        for back in (0, 1):
            lower, side = np.nonzero(self.solved[self.beside[:, 1::2]] & ~self.joined[:, 1::2])
            upper = self.beside[lower, 2 * side + 1]
            both = self.solved[lower] & ~(self.seed[lower] & self.seed[upper])
            lower, upper, side = lower[both], upper[both], side[both]
            begin, end, onward = (upper, lower, 2 * side) if back else (lower, upper, 2 * side + 1)
            hop = self.hops.ways(begin, end, self._behind(begin, onward ^ 1))
            found = self._arrived(hop.way, end)
            self._looked_into(hop.way, found, begin, end)
            there = found != STUCK
            there &= same_postures(self.hops.problem.mechanism, hop.way.q, self.hops.q[:, end].T)
            self.joined[lower[there], 2 * side[there] + 1] = True

    def _enter(self, begin: np.ndarray, end: np.ndarray, side: np.ndarray) -> np.ndarray:
        """Follow ways from cells into others, all different; which ones lead on, (n,) of bool."""
        hop = self.hops.ways(begin, end, self._behind(begin, side ^ 1))
        found = self._judged(hop.way, begin, end)
        again = self._looked_into(hop.way, found, begin, end)
        done = (found == ARRIVED) | (found == LIMIT)
        good = done if self.through else found == ARRIVED
        self.hops.enter(end[done], hop, done)
        self.hops.reopen(end[again & good])
        self.solved[end[good]] = True
        # beyond a limit another way, with other turns of the joints, may still lead within
        better = done | (EXPLAINS[found] > EXPLAINS[self.codes[end]])
        better &= good | (self.codes[end] != LIMIT)
        self.codes[end[better]] = found[better]
        self.left[end[good]] = False
        return good

    def _behind(self, cells: np.ndarray, side: np.ndarray) -> np.ndarray:
        """The two cells (2, n) on a side of others, or -1 where one before them is not solved."""
        one = self.beside[cells, side]
        one = np.where(self.solved[one], one, -1)
        two = np.where(one < 0, -1, self.beside[one, side])
        return np.stack([one, np.where(self.solved[two], two, -1)])

    def _judged(self, way: Way, begin: np.ndarray, end: np.ndarray) -> np.ndarray:
        """Codes (n,): ARRIVED, LIMIT, MIRRORED, REVERSED, FOLD or STUCK."""
        found = self._arrived(way, end)
        ended = np.flatnonzero(way.codes != ARRIVED)
        if ended.size:
            folds = self._folds(way, begin[ended], end[ended], ended)
            found[ended] = np.where(folds, FOLD, STUCK)
        return found

    def _arrived(self, way: Way, end: np.ndarray) -> np.ndarray:
        """Codes (n,) of ways that arrived: ARRIVED, LIMIT, MIRRORED, REVERSED, or else STUCK."""
        largest, sense, facing, within = self.hops.follower.check.run(
            np.concatenate([way.q.T, self.hops.targets[:, end]])
        )
        found = np.where(within < -LIMIT_TOLERANCE, LIMIT, ARRIVED)
        found[facing < 0.0] = REVERSED
        found[sense < 0.0] = MIRRORED
        found[~(largest < CLOSED) | (way.codes != ARRIVED)] = STUCK
        return found

    def _looked_into(
        self, way: Way, found: np.ndarray, begin: np.ndarray, end: np.ndarray
    ) -> np.ndarray:
        """Follow ways once more, in place, that ended though all rows keep their rank.

        Nothing but the choice of rows, or of pivots, is singular there. Returns which ones were
        followed, (n,) of bool; what is known of the chosen rows does not hold at their ends.
        """
        again = (found == FOLD) | (found == STUCK)
        for i in np.flatnonzero(again):
            again[i] = healthy(self.hops.problem, way.q[i])
        again |= self.hops.det[begin] == 0.0
        where = np.flatnonzero(again)
        if not where.size:
            return again
        slow = self.hops.slowly(begin[where], end[where])
        codes = self._arrived(slow, end[where])
        for k in np.flatnonzero(slow.codes != ARRIVED):
            codes[k] = STUCK if healthy(self.hops.problem, slow.q[k]) else FOLD
        found[where], way.q[where] = codes, slow.q
        return again

    def _folds(self, way: Way, begin: np.ndarray, end: np.ndarray, ended: np.ndarray) -> np.ndarray:
        """Whether ways ``ended`` (e,), from cells to others, ended with a singularity in sight.

        Towards a singularity where the branch ends, the square of the determinant falls linearly,
        or faster. It is in sight where that line reaches zero within a cell. A way too short to
        tell is judged together with the way backwards.
        """
        away, travel = self.hops.det[begin], way.reached[ended].copy()
        short = np.flatnonzero(travel < SHORT)
        if short.size:
            back = self.hops.backwards(begin[short], end[short])
            away[short] = back.det
            travel[short] += back.reached
        share = np.divide(way.det[ended], away, out=np.ones_like(away), where=away != 0.0)
        fall = share * share
        return np.asarray(fall * (1.0 + travel) <= 1.0)
