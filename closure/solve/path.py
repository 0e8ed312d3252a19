"""Following branches in machine code: prescribed joints and poses move from one target to another.

One step of the method, written on a tape, serves all: it evaluates the rows at the trial posture,
eliminates, judges the step (``control``), and accepts, refuses or goes on. Repeated in machine code
until it has ended, over one posture or over many at once.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from closedchain.closure.solve.control import (
    ASKING,
    DOUBLE,
    FRESH,
    LONGEST,
    MOST,
    SMALLEST,
    STATE,
    STEADY,
    Decision,
    Judged,
    Precision,
    control,
    judge,
    share,
)
from closedchain.closure.solve.problem import POSE, Problem, pose_of
from closedchain.closure.tape.elimination import (
    Elimination,
    relative_change,
    small_determinant,
)
from closedchain.closure.tape.expression import Expr, Graph, Tape
from closedchain.closure.tape.machine import Compiled, Looped, compiled, looped
from closedchain.closure.tape.rows import Entries, Rows, kinematics
from closedchain.closure.tape.vectors import quaternion
from closedchain.closure.tape.verified import agree, verify

CHUNK = 504
"""Postures between looks at the keyboard: their states stay in the cache, and rows do not begin at
multiples of a power of two, which would share a few places of it."""

TICKS = 400  # steps of Newton's method between looks at the keyboard


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
class Lane:
    """Numbers of one way as expressions: the state, and the parameters behind it.

    ``old`` and ``new`` are the null space and the pivots at the last good posture and at the trial.
    """

    graph: Graph
    good: list[Expr]
    trial: list[Expr]
    state: dict[str, Expr]
    old: list[Expr]
    new: list[Expr]
    parameters: list[Expr]

    @classmethod
    def of(cls, follower: Follower) -> Lane:
        """Inputs of a tape for a follower."""
        g, nq, memory = Graph(), follower.problem.mechanism.model.nq, follower.memory
        first, states = 2 * nq + len(STATE), follower.states
        return cls(
            graph=g,
            good=g.inputs(0, nq),
            trial=g.inputs(nq, nq),
            state=dict(zip(STATE, g.inputs(2 * nq, len(STATE)), strict=True)),
            old=g.inputs(first, memory),
            new=g.inputs(first + memory, memory),
            parameters=g.inputs(states, 2 * follower.problem.prescribed + 1),
        )

    def tape(self, decision: Decision, q: Sequence[Expr], basis: Sequence[Expr]) -> Tape:
        """Tape of a decision on a posture that was found, its null space and pivots."""
        places = list(zip(self.good, self.trial, q, strict=True))
        spaces = list(zip(self.old, self.new, basis, strict=True))
        out = [decision.good(*x) for x in places] + [decision.trial(*x) for x in places]
        out += [decision.state[name] for name in STATE]
        out += [decision.good(*x) for x in spaces] + [decision.trial(*x) for x in spaces]
        return self.graph.tape([*out, decision.running], self.inputs)

    @property
    def inputs(self) -> int:
        """How many numbers go in."""
        return 2 * len(self.good) + len(STATE) + 2 * len(self.old) + len(self.parameters)


@dataclass(frozen=True, eq=False)
class Asked:
    """A trial that asks: kept rows of the Jacobian at the last good posture and now, factors."""

    lane: Lane
    lu: Elimination
    before: list[Entries]
    now: list[Entries]


@dataclass(frozen=True, eq=False)
class Follower:
    """Tapes of one problem and their machine code: to follow, to check, to tell where a tip is."""

    problem: Problem
    precision: Precision = DOUBLE

    # -- the tape of one step ----------------------------------------------------------------------

    @cached_property
    def loop(self) -> Looped:
        """Machine code of steps until the end, or until a trial asks to be judged."""
        return looped(self.step_tape, self.states)

    @cached_property
    def step_tape(self) -> Tape:
        """One step of Newton's method, and what becomes of it: the new state, and whether to go on.

        State: good posture, trial, ``STATE``, null spaces and pivots at the good posture and at
        the trial.
        Parameters: the targets at both ends of the way, then the smallest sub-step.
        """
        problem, lane = self.problem, Lane.of(self)
        target, longest = self._target(lane, share(lane.state))
        q = list(lane.trial)
        for index, value in zip(problem.pinned_q, target, strict=False):
            q[int(index)] = value
        g = lane.graph
        k = problem.kinematics(g, q)
        rows = problem.rows(k, target)
        lu = problem.elimination(g, rows, self._sampled())
        step = lu.shortest([-rows.values[r] for r in problem.kept])
        turn, basis = self._turned(lu, lane)
        pivots = [pivot for _, _, pivot in lu.pivots]
        size = _length(g, list(step.values()))
        closed = _largest(g, rows, problem.kept)
        steady = _steady(g, pivots, lane.old[self.kernel :])
        judged = Judged(size, closed, lu.determinant(problem.free), turn, lu.least, steady)
        decision = control(lane.state, judged, longest, lane.parameters[-1], self.precision)
        return lane.tape(decision, k.moved(q, step), basis + pivots)

    @cached_property
    def judging(self) -> Looped:
        """Machine code of one look at the trials that ask."""
        return looped(self.judge_tape, self.states, single=False)

    @cached_property
    def judge_tape(self) -> Tape:
        """One look at a trial that asks; state and parameters as those of ``step_tape``."""
        asked = self.asked()
        change = relative_change(asked.lu, asked.before, asked.now)
        return self.judged_tape(asked.lane, change)

    def asked(self) -> Asked:
        """What a judgement looks at, as expressions."""
        problem, lane = self.problem, Lane.of(self)
        before, now = (
            problem.rows_met(problem.kinematics(lane.graph, q)) for q in (lane.good, lane.trial)
        )
        lu = problem.elimination(lane.graph, now, self._sampled())
        kept = problem.kept
        return Asked(lane, lu, [before.entries[r] for r in kept], [now.entries[r] for r in kept])

    def judged_tape(self, lane: Lane, change: Expr) -> Tape:
        """What becomes of a trial that asks, by the relative change of its Jacobian."""
        _, longest = self._target(lane, share(lane.state))
        decision = judge(lane.state, change, longest, lane.parameters[-1])
        return lane.tape(decision, lane.trial, lane.new)

    @property
    def kernel(self) -> int:
        """Numbers of a basis of the null space, none where the system is square."""
        problem = self.problem
        return len(problem.free) * (len(problem.free) - len(problem.kept))

    @property
    def memory(self) -> int:
        """Numbers that a good posture leaves for the next: its null space, its pivots."""
        return self.kernel + len(self.problem.kept)

    @property
    def states(self) -> int:
        """Numbers of the state."""
        return 2 * self.problem.mechanism.model.nq + len(STATE) + 2 * self.memory

    def _turned(self, lu: Elimination, lane: Lane) -> tuple[Expr, list[Expr]]:
        """How the null space turned since the last good posture, and what it is now.

        With A the kept rows, N and M the null spaces then and now, det [A; N^T] keeps its sign
        while A keeps its rank and its null space turns by less than a right angle. With B the
        pivot columns of A and M scaled to units in the free ones, it is det B det (N^T M): here is
        the second factor, 1 where A is square.
        """
        free, g = self.problem.free, lu.graph
        if self.problem.square:
            return g.constant(1.0), []
        zero, size = g.constant(0.0), len(free)
        opening = lane.state["reached"] < 0.0
        kernel = [[m.get(v, zero) for v in free] for m in lu.kernel()]
        turned: dict[int, dict[int, Expr]] = {}
        for i, m in enumerate(kernel):
            before = [opening.select(a, b) for a, b in zip(m, lane.old[i * size :], strict=False)]
            turned[i] = {j: _inner(g, before, other) for j, other in enumerate(kernel)}
        return small_determinant(g, turned), [x for m in kernel for x in m]

    def _target(self, lane: Lane, tried: Expr) -> tuple[list[Expr], Expr]:
        """Target at a share of the way, and the longest sub-step.

        Joints and origins move on straight lines, rotations about a fixed axis.
        """
        problem, g = self.problem, lane.graph
        p, m = len(problem.pinned), problem.mechanism
        begin = list(lane.parameters[: problem.prescribed])
        end = list(lane.parameters[problem.prescribed : 2 * problem.prescribed])
        whole = ~(tried < 1.0)
        travel = g.constant(0.0)
        for a, b, v in zip(begin, end, problem.pinned, strict=False):
            travel = travel.max(abs(b - a) * (1.0 / m.column_scale[v]))
        for i in range(len(problem.goals)):
            origin = slice(p + POSE * i, p + POSE * i + 3)
            turn = slice(p + POSE * i + 3, p + POSE * (i + 1))
            apart = _inner(g, begin[turn], end[turn]) < 0.0
            end[turn] = [apart.select(-x, x) for x in end[turn]]
            shift = _length(g, [b - a for a, b in zip(begin[origin], end[origin], strict=True)])
            chord = _length(g, [b - a for a, b in zip(begin[turn], end[turn], strict=True)])
            travel = travel.max((1.0 / m.length) * shift + 2.0 * chord)
        there = [a + tried * (b - a) for a, b in zip(begin, end, strict=True)]
        for i in range(len(problem.goals)):
            turn = slice(p + POSE * i + 3, p + POSE * (i + 1))
            inverse = _length(g, there[turn]).recip()
            there[turn] = [x * inverse for x in there[turn]]
        longest = g.constant(1.0)
        if travel.value is None:  # a way on which nothing is prescribed has no length
            longest = (LONGEST * travel.max(1e-300).recip()).max(1.0 / MOST).min(1.0)
        return [whole.select(b, a) for a, b in zip(there, end, strict=True)], longest

    def _sampled(self) -> np.ndarray:
        """Values (inputs, n) of the tape's inputs at the samples and near them."""
        problem = self.problem
        q, rng = problem.regular, np.random.default_rng(1)
        model, scale = problem.mechanism.model, problem.mechanism.column_scale
        near = [pin.integrate(model, x, 0.02 * rng.standard_normal(model.nv) * scale) for x in q]
        both = np.concatenate([q, np.array(near)])
        targets = np.concatenate([problem.targets_at(q)] * 2)
        values = np.zeros((self.states + 2 * problem.prescribed + 1, len(both)))
        values[: model.nq] = values[model.nq : 2 * model.nq] = both.T
        values[self.states :] = _parameters(targets, targets, SMALLEST)
        return values

    # -- what a posture is -------------------------------------------------------------------------

    @cached_property
    def check(self) -> Compiled:
        """Machine code of ``check_tape``."""
        return compiled(self.check_tape)

    @cached_property
    def check_tape(self) -> Tape:
        """From q and a target: the largest of all rows [m or rad], and what must not be negative.

        Those are the least cosine of joint axes that must not be opposed, that of the direction of
        a tip with two rotations prescribed, and how far the joints are within their limits
        [m or rad].
        """
        problem, nq = self.problem, self.problem.mechanism.model.nq
        k = kinematics(problem.mechanism, upright=False)  # rows as the public residual has them
        g = k.graph
        target = g.inputs(nq, problem.prescribed)
        rows = problem.rows(k, target)
        facing, p = g.constant(1.0), len(problem.pinned)
        for i, (frame, outputs) in enumerate(problem.goals):
            pose = pose_of(target[p + POSE * i : p + POSE * (i + 1)], problem.mechanism.length)
            facing = facing.min(k.faces(frame, outputs, pose))
        within = g.constant(1.0)
        for i, (lower, upper) in enumerate(zip(*problem.mechanism.limits, strict=True)):
            if np.isfinite(lower):
                within = within.min(k.q[i] - float(lower))
            if np.isfinite(upper):
                within = within.min(float(upper) - k.q[i])
        largest = _largest(g, rows, range(len(rows.values)))
        outputs_ = [largest, k.least_sense, facing, within]
        return g.tape(outputs_, nq + problem.prescribed)

    @cached_property
    def place(self) -> Compiled:
        """Machine code of ``place_tape``."""
        return compiled(self.place_tape)

    @cached_property
    def place_tape(self) -> Tape:
        """From q to the target that it meets: values of pinned joints, poses of frames."""
        problem = self.problem
        k = kinematics(problem.mechanism)
        found = [k.q[int(i)] for i in problem.pinned_q]
        for frame, _ in problem.goals:
            (turned, origin), _ = k.named(frame)
            found += [problem.mechanism.length * x for x in origin] + quaternion(turned)
        return k.graph.tape(found, problem.mechanism.model.nq)

    # -- running -----------------------------------------------------------------------------------

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
        state = np.zeros((self.states, n))
        state[:nq] = state[nq : 2 * nq] = q.T
        state[2 * nq : 2 * nq + len(STATE)] = FRESH[:, None]
        numbers = _parameters(begin, end, smallest)
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
        state, parameters = np.zeros((follower.states, 1)), np.zeros((2 * size + 1, 1))
        parameters[-1] = SMALLEST
        into, out = np.zeros((nq + size, 1)), np.zeros((4, 1))
        return cls(
            postures=state[: 2 * nq, 0].reshape(2, nq),
            rest=state[2 * nq :, 0],
            fresh=np.concatenate([FRESH, np.zeros(2 * follower.memory)]),
            numbers=state[2 * nq : 2 * nq + len(STATE), 0],
            begin=parameters[:size, 0],
            end=parameters[size : 2 * size, 0],
            q=into[:nq, 0],
            target=into[nq:, 0],
            out=out[:, 0],
            loop=follower.loop.bound(state, parameters, TICKS),
            judge=_late(lambda: follower.judging.bound(state, parameters, 1)),
            place=follower.place.bound(into[:nq], parameters[:size]),
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
    near = np.array([pin.integrate(m.model, x, 1e-4 * m.column_scale) for x in q])
    closed = follower.run(near, targets, targets)
    left = np.array([m.workspace.residual(x) for x in closed.q[closed.started]])
    agree(f"the postures of {m.name!r}", left, np.zeros_like(left))
    welded = any(closure.kind == "fixed" for closure in m.closures)
    rng = np.random.default_rng(2)
    v = (0.0 if welded else 0.02) * rng.standard_normal(m.model.nv) * m.column_scale
    off = np.array([pin.integrate(m.model, x, v) for x in q])
    told = follower.check.run(np.concatenate([off.T, problem.targets_at(off).T]))[0]
    expected = [np.abs(m.workspace.residual(x)).max(initial=0.0) for x in off]
    agree(f"the residual of {m.name!r}", told, np.array(expected))


def _parameters(begin: np.ndarray, end: np.ndarray, smallest: float) -> np.ndarray:
    """Parameters (parameters, n) of ways between targets (n, prescribed)."""
    size = begin.shape[1]
    numbers = np.empty((2 * size + 1, len(begin)))
    numbers[:size], numbers[size:-1], numbers[-1] = begin.T, end.T, smallest
    return numbers


def _steady(g: Graph, now: Sequence[Expr], before: Sequence[Expr]) -> Expr:
    """Whether no number changed by more than the share ``STEADY``."""
    worst = g.constant(-1.0)
    for a, b in zip(now, before, strict=True):
        worst = worst.max(abs(a - b) - STEADY * abs(b))
    return worst < 0.0


def _inner(g: Graph, a: Sequence[Expr], b: Sequence[Expr]) -> Expr:
    found = g.constant(0.0)
    for x, y in zip(a, b, strict=True):
        found = found + x * y
    return found


def _length(g: Graph, values: Sequence[Expr]) -> Expr:
    return _inner(g, values, values).sqrt()


def _largest(g: Graph, rows: Rows, which: Sequence[int]) -> Expr:
    """Largest of some rows, in m or rad."""
    found = g.constant(0.0)
    for r in which:
        found = found.max(rows.units[r] * abs(rows.values[r]))
    return found
