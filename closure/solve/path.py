"""Following branches in machine code: prescribed joints and poses move from one target to another.

The tape of one step (``step_tapes``) is repeated in machine code until it has ended, over one
posture or over many at once.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from closedchain.closure.solve.control import ASKING, FRESH, SMALLEST, STATE
from closedchain.closure.solve.problem import Problem
from closedchain.closure.solve.step_tapes import StepTapes, parameters
from closedchain.closure.tape.machine import Compiled, Looped, compiled, looped
from closedchain.closure.tape.verified import agree, verify

CHUNK = 504
"""Postures between looks at the keyboard: their states stay in the cache, and rows do not begin at
multiples of a power of two, which would share a few places of it."""

TICKS = 400  # steps of Newton's method between looks at the keyboard

BESIDE = 1e-4
"""Dimensionless: from closed postures to where the follower is tried."""


@dataclass(frozen=True, eq=False)
class Way:
    """Where following ended, for n postures: the last good posture of each, and why.

    ``codes`` are of ``Ending``; ``det`` the determinant at the last good posture (1 where the
    system is not square); ``started`` whether the start closed at all.
    """

    q: np.ndarray
    reached: np.ndarray
    codes: np.ndarray
    det: np.ndarray
    evaluations: np.ndarray
    started: np.ndarray


class Single(NamedTuple):
    """Where one way ended: as ``Way``, and what ``Follower.check`` tells of the posture."""

    q: np.ndarray
    reached: float
    code: int
    det: float
    evaluations: int
    residual: float
    sense: float
    facing: float
    beyond: float


@dataclass(frozen=True, eq=False)
class Follower:
    """Machine code of one problem: to follow, to check, to tell where a tip is."""

    problem: Problem

    @cached_property
    def tapes(self) -> StepTapes:
        """What is written in machine code."""
        return StepTapes(self.problem)

    @cached_property
    def loop(self) -> Looped:
        """Steps until the end, or until a trial asks to be judged."""
        return looped(self.tapes.step_tape, self.tapes.states)

    @cached_property
    def judging(self) -> Looped:
        """One look at the trials that ask."""
        return looped(self.tapes.judge_tape, self.tapes.states, single=False)

    @cached_property
    def check(self) -> Compiled:
        """What a posture is: ``StepTapes.check_tape``."""
        return compiled(self.tapes.check_tape)

    @cached_property
    def place(self) -> Compiled:
        """The target that a posture meets: ``StepTapes.place_tape``."""
        return compiled(self.tapes.place_tape)

    def run(
        self,
        q: np.ndarray,
        begin: np.ndarray,
        end: np.ndarray,
        smallest: float = SMALLEST,
    ) -> Way:
        """Follow the branches of postures (n, nq) from targets to targets (n, prescribed).

        A posture need not meet its first target to the last digit: it is closed there first.
        """
        nq, n = q.shape[1], len(q)
        state = np.zeros((self.tapes.states, n))
        state[:nq] = state[nq : 2 * nq] = q.T
        state[2 * nq : 2 * nq + len(STATE)] = FRESH[:, None]
        numbers = parameters(begin, end, smallest)
        for a in range(0, n, CHUNK):
            state[:, a : a + CHUNK] = self.ended(state[:, a : a + CHUNK], numbers[:, a : a + CHUNK])
        rest = dict(zip(STATE, state[2 * nq :], strict=False))
        return Way(
            q=np.ascontiguousarray(state[:nq].T),
            reached=np.maximum(rest["reached"], 0.0),
            codes=rest["status"].astype(int),
            det=rest["det"],
            evaluations=rest["evaluations"].astype(int),
            started=rest["reached"] >= 0.0,
        )

    def ended(self, state: np.ndarray, numbers: np.ndarray) -> np.ndarray:
        """State of a chunk (states, n) when every lane has ended; those that have are set aside."""
        whole, lanes = state, np.arange(state.shape[1])
        status = 2 * self.problem.mechanism.model.nq + STATE.index("status")
        state, numbers = state.copy(), numbers.copy()
        while lanes.size:
            self.loop.run(state, numbers, TICKS)
            if (state[status] == ASKING).any():
                self.judging.run(state, numbers, 1)
            on = state[status] < 0.0
            if not on.all():
                whole[:, lanes[~on]] = state[:, ~on]
                lanes = lanes[on]
                state, numbers = np.ascontiguousarray(state[:, on]), numbers[:, on].copy()
        return whole

    def alone(self, q: np.ndarray, begin: np.ndarray | None, end: np.ndarray) -> Single:
        """The same for one posture (nq,), checked; from where it is where ``begin`` is None."""
        s = self._scratch
        if begin is None:
            s.q[:] = q
            s.place()
        else:
            s.begin[:] = begin
        s.end[:] = s.target[:] = end
        s.postures[:] = q
        s.rest[:] = s.fresh
        while True:
            s.loop()
            reached, _, _, _, _, status, _, det, count = s.numbers.tolist()
            if status == ASKING:
                s.judge()
            elif status >= 0.0:
                break
        s.q[:] = s.postures[0]
        s.check()
        found = s.postures[0].copy()
        return Single(found, reached, int(status), det, int(count), *s.out.tolist())

    @property
    def _scratch(self) -> Scratch:
        local = self._local
        try:
            found: Scratch = local.scratch
        except AttributeError:
            found = local.scratch = Scratch.of(self)
        return found

    @cached_property
    def _local(self) -> threading.local:
        return threading.local()


class Scratch(NamedTuple):
    """Memory of a thread for single postures, overwritten by every call, and calls bound to it.

    ``postures`` (2, nq) are the good one and the trial, ``rest`` what follows them in the state,
    ``numbers`` its first part, named ``STATE``; ``q`` and ``target`` are what is checked.
    """

    postures: np.ndarray
    rest: np.ndarray
    fresh: np.ndarray
    numbers: np.ndarray
    begin: np.ndarray
    end: np.ndarray
    q: np.ndarray
    target: np.ndarray
    out: np.ndarray
    loop: Callable[[], None]
    judge: Callable[[], None]
    place: Callable[[], None]
    check: Callable[[], None]

    @classmethod
    def of(cls, follower: Follower) -> Scratch:
        """Memory for a follower."""
        problem, nq = follower.problem, follower.problem.mechanism.model.nq
        size = problem.prescribed
        state, numbers = np.zeros((follower.tapes.states, 1)), np.zeros((2 * size + 1, 1))
        numbers[-1] = SMALLEST
        into, out = np.zeros((nq + size, 1)), np.zeros((4, 1))
        return cls(
            postures=state[: 2 * nq, 0].reshape(2, nq),
            rest=state[2 * nq :, 0],
            fresh=np.concatenate([FRESH, np.zeros(2 * follower.tapes.memory)]),
            numbers=state[2 * nq : 2 * nq + len(STATE), 0],
            begin=numbers[:size, 0],
            end=numbers[size : 2 * size, 0],
            q=into[:nq, 0],
            target=into[nq:, 0],
            out=out[:, 0],
            loop=follower.loop.bound(state, numbers, TICKS),
            judge=_late(lambda: follower.judging.bound(state, numbers, 1)),
            place=follower.place.bound(into[:nq], numbers[:size]),
            check=follower.check.bound(into, out),
        )


def _late(made: Callable[[], Callable[[], None]]) -> Callable[[], None]:
    """Call that is made when it is first needed: the judge is long, and seldom asked."""
    known: list[Callable[[], None]] = []

    def call() -> None:
        if not known:
            known.append(made())
        known[0]()

    return call


def follower_of(problem: Problem) -> Follower:
    """Machine code of a problem, made once."""
    known = problem.mechanism.known
    found: Follower | None = known.get(problem)
    if found is None:
        found = Follower(problem)
        prove(found)
        found = known.setdefault(problem, found)
    return found


def prove(follower: Follower) -> None:
    """Compare machine code with Pinocchio at two postures before it serves.

    Raises
    ------
    TapeError
        They differ by more than ``verified.AGREE``.
    """
    problem, m = follower.problem, follower.problem.mechanism
    verify(m)
    q = problem.regular[-2:]
    targets = problem.targets_at(q)
    near = np.array([pin.integrate(m.model, x, BESIDE * m.column_scale) for x in q])
    closed = follower.run(near, targets, targets)
    left = np.array([m.workspace.residual(x) for x in closed.q[closed.started]])
    if m.rows > len(problem.kept):
        # rows that are not solved may follow from the others to the first order only
        left[np.abs(left) < 10.0 * BESIDE**2] = 0.0
    agree(f"the postures of {m.name!r}", left, np.zeros_like(left))
    welded = any(closure.kind == "fixed" for closure in m.closures)
    rng = np.random.default_rng(2)
    v = (0.0 if welded else 0.02) * rng.standard_normal(m.model.nv) * m.column_scale
    off = np.array([pin.integrate(m.model, x, v) for x in q])
    told = follower.check.run(np.concatenate([off.T, problem.targets_at(off).T]))[0]
    expected = [np.abs(m.workspace.residual(x)).max(initial=0.0) for x in off]
    agree(f"the residual of {m.name!r}", told, np.array(expected))
