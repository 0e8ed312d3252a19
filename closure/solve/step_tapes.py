"""The tapes of following branches: one step, one look at a trial, what a posture is, where it is.

One step of the method serves all: it evaluates the rows at the trial posture, eliminates, judges
the step (``control``), and accepts, refuses or goes on.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pinocchio as pin

from closedchain.closure.solve.control import (
    DOUBLE,
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
from closedchain.closure.tape.bodies import Entries
from closedchain.closure.tape.elimination import (
    Elimination,
    relative_change,
    small_determinant,
)
from closedchain.closure.tape.expression import Expr, Graph, Tape
from closedchain.closure.tape.rows import kinematics
from closedchain.closure.tape.vectors import quaternion


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
    def of(cls, tapes: StepTapes) -> Lane:
        """Inputs of a tape of a step."""
        g, nq, memory = Graph(), tapes.problem.mechanism.model.nq, tapes.memory
        first, states = 2 * nq + len(STATE), tapes.states
        return cls(
            graph=g,
            good=g.inputs(0, nq),
            trial=g.inputs(nq, nq),
            state=dict(zip(STATE, g.inputs(2 * nq, len(STATE)), strict=True)),
            old=g.inputs(first, memory),
            new=g.inputs(first + memory, memory),
            parameters=g.inputs(states, 2 * tapes.problem.prescribed + 1),
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
class StepTapes:
    """Tapes of one problem: to follow, to check, to tell where a tip is."""

    problem: Problem
    precision: Precision = DOUBLE

    # -- the tape of one step ----------------------------------------------------------------------

    @cached_property
    def step_tape(self) -> Tape:
        """One step of Newton's method, and what becomes of it: the new state, and whether to go on.

        State: good posture, trial, ``STATE``, null spaces and pivots at the good posture and at
        the trial.
        Parameters: the targets at both ends of the way, then the smallest sub-step.
        """
        problem, lane = self.problem, Lane.of(self)
        target, longest = self._target(lane, share(lane.state))
        q = problem.pinned_at(lane.trial, target)
        g = lane.graph
        k = problem.kinematics(g, q)
        rows = problem.rows(k, target)
        lu = problem.elimination(g, rows, self._sampled())
        step = lu.shortest([-rows.values[r] for r in problem.kept])
        turn, basis = self._turned(lu, lane)
        pivots = [pivot for _, _, pivot in lu.pivots]
        size = _length(g, list(step.values()))
        closed = rows.largest(g, problem.kept)
        steady = _steady(g, pivots, lane.old[self.kernel :])
        judged = Judged(size, closed, lu.determinant(problem.free), turn, lu.least, steady)
        decision = control(lane.state, judged, longest, lane.parameters[-1], self.precision)
        return lane.tape(decision, k.moved(q, step), basis + pivots)

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
        values[self.states :] = parameters(targets, targets, SMALLEST)
        return values

    # -- what a posture is -------------------------------------------------------------------------

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
        largest = rows.largest(g)
        outputs_ = [largest, k.least_sense, facing, within]
        return g.tape(outputs_, nq + problem.prescribed)

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


def parameters(begin: np.ndarray, end: np.ndarray, smallest: float) -> np.ndarray:
    """What follows the state: both targets (n, prescribed), the smallest sub-step; in columns."""
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
