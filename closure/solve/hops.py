"""Ways between neighbouring cells of a grid: followed together, begun where solved cells point.

A way begins at a solved cell, so nothing need be closed there again. Newton's method at its end
starts from where the cells behind extrapolate to; where that is refused the way is halved and
begun from the cell itself, as any other is.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from closedchain.closure.solve.alone import close_alone, healthy
from closedchain.closure.solve.control import FRESH, LONGEST, MOST, STATE
from closedchain.closure.solve.outcome import Ending
from closedchain.closure.solve.path import Follower, Way, follower_of
from closedchain.closure.solve.problem import POSE, Problem
from closedchain.closure.solve.ways import follow

SMALLEST_STEP = 1e-4
"""Share of the way to a neighbour, where steps end that no longer lead on."""

SAME = 1e-9
"""Change of a posture [m or rad] by closing it again that is rounding."""

ARRIVED = Ending.ARRIVED.code


@dataclass(frozen=True, eq=False)
class Hop:
    """Where ways ended, and what followers keep of the last good postures beside, in columns."""

    way: Way
    memory: np.ndarray


class Hops:
    """Cells being solved: numbers in columns, one a cell.

    Attributes
    ----------
    problem : Problem
        With as many kept rows as unknowns.
    targets : (prescribed, cells) array
    q : (nq, cells) array
        Postures of solved cells.
    det : (cells,) array
        Determinants of the kept rows there; 0 where nothing is known of these rows.
    memory : (memory, cells) array
        What followers keep of good postures beside.
    """

    def __init__(self, problem: Problem, targets: np.ndarray, q: np.ndarray) -> None:
        """Take ``targets`` (cells, prescribed) and postures ``q`` (cells, nq)."""
        self.problem = problem
        self.targets = np.ascontiguousarray(targets.T)
        self.q = np.ascontiguousarray(q.T)
        self.det = np.zeros(len(q))
        self.memory = np.zeros((self.follower.tapes.memory, len(q)))

    @cached_property
    def follower(self) -> Follower:
        """Machine code of the problem."""
        return follower_of(self.problem)

    def closed(self, cells: np.ndarray) -> np.ndarray:
        """Close cells (n,) whose postures are given; which ones do, (n,) of bool."""
        targets = self.targets[:, cells]
        state, numbers = self._laid_out(cells, targets, targets)
        nq, fresh = len(self.q), FRESH[:, None]
        state[2 * nq : 2 * nq + len(STATE)] = fresh
        hop = self._followed(state, numbers)
        self.enter(cells, hop, slice(None))
        return hop.way.started

    def closed_alone(self, cell: int) -> bool:
        """Close a cell whose posture is given with all rows; nothing is known of the kept ones."""
        q, target = self.q[:, cell], self.targets[:, cell]
        if not np.isfinite(q).all() or not healthy(self.problem, q):
            return False
        found = close_alone(self.problem, q, target)
        if found is None:
            return False
        self.q[:, cell], self.det[cell] = found, 0.0
        return True

    def reopen(self, cells: np.ndarray) -> None:
        """Learn of the kept rows at cells (n,) that were reached without them."""
        if not cells.size:
            return
        q = self.q[:, cells]
        closed = self.closed(cells) & (np.abs(self.q[:, cells] - q).max(axis=0) < SAME)
        self.q[:, cells] = q
        self.det[cells[~closed]] = 0.0

    def enter(self, cells: np.ndarray, hop: Hop, which: slice | np.ndarray) -> None:
        """Keep where some of the ways ended as what is known of cells (n,)."""
        self.q[:, cells] = hop.way.q.T[:, which]
        self.det[cells], self.memory[:, cells] = hop.way.det[which], hop.memory[:, which]

    def ways(self, begin: np.ndarray, end: np.ndarray, behind: np.ndarray) -> Hop:
        """Follow the branches of solved cells (n,) to the targets of others (n,).

        ``behind`` (2, n) are the cells before ``begin`` on the same line, nearest first; -1 where
        there is none to extrapolate from.
        """
        state, numbers = self._laid_out(begin, self.targets[:, begin], self.targets[:, end])
        nq = len(self.q)
        state[nq : 2 * nq] = self._ahead(state[:nq], behind)
        return self._followed(state, numbers)

    def backwards(self, begin: np.ndarray, end: np.ndarray) -> Way:
        """Follow ways as long as those from cells to others (n,), in the opposite direction."""
        one, two = self.targets[:, begin], self.targets[:, end]
        back = 2.0 * one - two
        for at in self._turns:  # the other end, mirrored at this one on the sphere
            back[at] = 2.0 * (one[at] * two[at]).sum(axis=0) * one[at] - two[at]
        return self._followed(*self._laid_out(begin, one, back)).way

    def slowly(self, begin: np.ndarray, end: np.ndarray) -> Way:
        """Follow ways past where only the kept rows, or their pivots, fail.

        Determinants are those of other rows, or none; the starts are closed again.
        """
        one, two, q = (
            np.ascontiguousarray(x.T)
            for x in (self.targets[:, begin], self.targets[:, end], self.q[:, begin])
        )
        return follow(self.problem, q, one, two, SMALLEST_STEP)

    def _followed(self, state: np.ndarray, numbers: np.ndarray) -> Hop:
        """Follow until every way has ended."""
        nq = len(self.q)
        state = self.follower.ended(state, numbers)
        rest = dict(zip(STATE, state[2 * nq :], strict=False))
        first = 2 * nq + len(STATE)
        way = Way(
            q=state[:nq].T,
            reached=np.maximum(rest["reached"], 0.0),
            codes=rest["status"].astype(int),
            det=rest["det"],
            evaluations=rest["evaluations"].astype(int),
            started=rest["reached"] >= 0.0,
        )
        return Hop(way, state[first : first + self.follower.tapes.memory])

    def _ahead(self, q: np.ndarray, behind: np.ndarray) -> np.ndarray:
        """Postures (nq, n) that solved cells extrapolate to, through three where they are there."""
        slope = np.where(behind[0] < 0, 0.0, q - self.q[:, behind[0]])
        earlier = self.q[:, behind[0]] - self.q[:, behind[1]]
        ahead = q + slope + np.where(behind[1] < 0, 0.0, slope - earlier)
        for at in self._floating:
            x = ahead[at]
            ahead[at] = x / np.sqrt((x[0] * x[0] + x[1] * x[1]) + (x[2] * x[2] + x[3] * x[3]))
        return ahead

    @cached_property
    def _floating(self) -> list[slice]:
        """Where q holds quaternions."""
        joints = list(self.problem.mechanism.model.joints)[1:]
        return [slice(j.idx_q + 3, j.idx_q + 7) for j in joints if j.nq == 7]

    @cached_property
    def _turns(self) -> list[slice]:
        """Where targets hold quaternions."""
        p = len(self.problem.pinned)
        return [slice(p + POSE * i + 3, p + POSE * (i + 1)) for i in range(len(self.problem.goals))]

    def _laid_out(
        self, begin: np.ndarray, one: np.ndarray, two: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """State and parameters of the loop for ways of cells (n,), good ones, between targets."""
        q, det, nq = self.q[:, begin], self.det[begin], len(self.q)
        state = np.empty((self.follower.tapes.states, begin.size))
        state[:nq], state[nq : 2 * nq] = q, q
        first, memory = 2 * nq + len(STATE), self.follower.tapes.memory
        state[2 * nq : first] = FRESH[:, None]
        state[first : first + memory] = state[first + memory :] = self.memory[:, begin]
        rest = dict(zip(STATE, state[2 * nq :], strict=False))
        rest["reached"][:], rest["step"][:] = 0.0, self._longest(one, two)
        rest["side"][:], rest["det"][:] = np.sign(det), det
        numbers = np.concatenate([one, two, np.full((1, begin.size), SMALLEST_STEP)])
        return state, numbers

    def _longest(self, one: np.ndarray, two: np.ndarray) -> np.ndarray:
        """Longest share (n,) of ways between targets (prescribed, n) that a sub-step may take."""
        m, pins = self.problem.mechanism, list(self.problem.pinned)
        gap = two - one
        travel = np.abs(gap[: len(pins)] / m.column_scale[pins][:, None]).max(axis=0, initial=0.0)
        for at in self._turns:
            place = slice(at.start - 3, at.start)
            shift, chord = (np.sqrt((gap[x] * gap[x]).sum(axis=0)) for x in (place, at))
            # quaternions of either sign say the same
            turn = 2.0 * np.minimum(chord, np.sqrt(np.maximum(4.0 - chord * chord, 0.0)))
            travel = np.maximum(travel, shift / m.length + turn)
        return np.clip(LONGEST / np.maximum(travel, 1e-300), 1.0 / MOST, 1.0)
