"""Following branches: postures whose prescribed joints and poses move from one target to another.

One step of the method, written on a tape, serves all: it evaluates the rows at the trial posture,
eliminates, judges the step, and accepts, refuses or goes on. Repeated in machine code until it has
ended, over one posture or over many at once.

A way of share 1 is cut into sub-steps until Newton's method, started from the last posture,
contracts fast and the determinant keeps its sign: a step that would land on another branch is
refused, not taken.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from weakref import WeakKeyDictionary

import numpy as np
import pinocchio as pin

from closedchain.closure.solve.outcome import Ending
from closedchain.closure.solve.problem import POSE, Problem, pose_of
from closedchain.closure.tape.elimination import Elimination, small_determinant
from closedchain.closure.tape.expression import Expr, Graph
from closedchain.closure.tape.machine import Compiled, Looped, compiled, looped
from closedchain.closure.tape.rows import Kinematics, Rows, kinematics

CLOSED = 1e-12
"""Largest row [m or rad] of a posture that counts as closed."""

FIRST_STEP = 0.5  # dimensionless: half the characteristic length, or half a radian
CONTRACTION = 0.3  # of successive steps: what Newton's method shows well inside its basin
SETTLED = 1e-7  # a step this small leaves an error at rounding level
ROUNDING = 1e-9  # below it steps are rounding: a closed posture does not get any better
PIVOT = 1e-13  # dimensionless: below it the system counts as singular
ITERATIONS = 12
LONGEST = 1.0  # of one sub-step, dimensionless: a characteristic length, or a radian
SMALLEST = 1e-6  # share of the longest sub-step
CHUNK = 2048  # postures between looks at the keyboard
TICKS = 400  # steps of Newton's method between looks at the keyboard

STATE = ("reached", "step", "bound", "count", "sign", "status", "det", "evaluations")
RUNNING = -1.0
FRESH = np.array([-1.0, 0.0, FIRST_STEP, 0.0, 0.0, RUNNING, 0.0, 0.0])
"""``STATE`` at the start; the step is set to the longest."""

REFUSED = (Ending.SINGULAR, Ending.OTHER_SIDE, Ending.FAR, Ending.SLOW)


@dataclass(frozen=True, eq=False)
class Follower:
    """Machine code of one problem: to follow, and to check what was found."""

    problem: Problem

    # -- the tape of one step ----------------------------------------------------------------------

    @cached_property
    def loop(self) -> Looped:
        """Steps until the end; state and parameters as ``run`` lays them out."""
        problem, nq = self.problem, self.problem.mechanism.model.nq
        g = Graph()
        accepted, trial = g.inputs(0, nq), g.inputs(nq, nq)
        names = dict(zip(STATE, g.inputs(2 * nq, len(STATE)), strict=True))
        first = self.states
        numbers = g.inputs(first, self.parameters)
        share = _share(names)
        target = self._target(numbers, share)
        q = list(trial)
        for index, pin_value in zip(problem.pinned_q, target, strict=False):
            q[int(index)] = pin_value
        k = Kinematics(problem.mechanism, g, q)
        rows = problem.rows(k, target)
        lu = problem.elimination(g, rows, self._sampled(g, first + self.parameters, nq, first))
        step = lu.shortest([-rows.values[r] for r in problem.kept])
        size = _length(g, list(step.values()))
        old = g.inputs(2 * nq + len(STATE), self.kernel)
        turn, basis = self._turned(lu, old, names["reached"] < 0.0)
        det = lu.determinant(problem.free)
        moved = k.moved(q, step)
        judged = Judged(size, _largest(g, rows, problem.kept), det, turn, lu.least)
        after, running = control(names, share, judged, numbers[-2], numbers[-1])
        keep, take, back = after.pop("keep"), after.pop("take"), after.pop("back")
        state = [take.select(b, a) for a, b in zip(accepted, moved, strict=True)]
        state += [
            keep.select(old, back.select(a, new))
            for old, a, new in zip(trial, accepted, moved, strict=True)
        ]
        state += [keep.select(names[n], after[n]) for n in STATE]
        state += [take.select(b, a) for a, b in zip(old, basis, strict=True)]
        return looped(g.tape([*state, running], first + self.parameters), first)

    @property
    def kernel(self) -> int:
        """Numbers of a basis of the null space, none where the system is square."""
        problem = self.problem
        return len(problem.free) * (len(problem.free) - len(problem.kept))

    @property
    def states(self) -> int:
        """Numbers of the state: both postures, ``STATE``, the null space at the last good one."""
        return 2 * self.problem.mechanism.model.nq + len(STATE) + self.kernel

    def _turned(
        self, lu: Elimination, old: Sequence[Expr], opening: Expr
    ) -> tuple[Expr, list[Expr]]:
        """How the null space turned since the last good posture (``old``), and what it is now.

        With A the kept rows, N and M the null spaces then and now, det [A; N^T] keeps its sign
        while A keeps its rank and its null space turns by less than a right angle. With B the
        pivot columns of A and M scaled to units in the free ones, it is det B det (N^T M): here is
        the second factor, 1 where A is square.
        """
        free, g = self.problem.free, lu.graph
        if self.problem.square:
            return g.constant(1.0), []
        zero, size = g.constant(0.0), len(free)
        kernel = [[m.get(v, zero) for v in free] for m in lu.kernel()]
        turned: dict[int, dict[int, Expr]] = {}
        for i, m in enumerate(kernel):
            before = [opening.select(a, b) for a, b in zip(m, old[i * size :], strict=False)]
            turned[i] = {j: _inner(g, before, other) for j, other in enumerate(kernel)}
        return small_determinant(g, turned), [x for m in kernel for x in m]

    @property
    def parameters(self) -> int:
        """Targets at both ends, then the longest and the smallest step."""
        return 2 * self.problem.prescribed + 2

    def _target(self, numbers: Sequence[Expr], share: Expr) -> list[Expr]:
        """Target at a share of the way: straight lines, rotations about a fixed axis."""
        p, count = len(self.problem.pinned), self.problem.prescribed
        begin, end = numbers[:count], numbers[count : 2 * count]
        whole = ~(share < 1.0)
        there = [whole.select(b, a + share * (b - a)) for a, b in zip(begin, end, strict=True)]
        for i in range(len(self.problem.goals)):
            at = slice(p + POSE * i + 3, p + POSE * (i + 1))
            x, y, z, w = there[at]
            inverse = ((x * x + y * y) + (z * z + w * w)).sqrt().recip()
            there[at] = [
                whole.select(b, a * inverse) for a, b in zip(there[at], end[at], strict=True)
            ]
        return there

    def _sampled(self, g: Graph, inputs: int, nq: int, first: int) -> np.ndarray:
        """Values (inputs, n) of the tape's inputs at the samples, both ends of the way there."""
        q = self.problem.regular
        rng = np.random.default_rng(1)
        near = [
            pin.integrate(
                self.problem.mechanism.model,
                one,
                0.02
                * rng.standard_normal(self.problem.mechanism.model.nv)
                * self.problem.mechanism.column_scale,
            )
            for one in q
        ]
        both = np.concatenate([q, np.array(near)])
        values = np.zeros((inputs, len(both)))
        values[:nq] = values[nq : 2 * nq] = both.T
        targets = np.concatenate([self.problem.targets_at(q)] * 2)
        values[first:] = self._lay_out(targets, targets, 1.0, SMALLEST).T
        return values

    # -- checking ----------------------------------------------------------------------------------

    @cached_property
    def check(self) -> Compiled:
        """From q and a target: largest of all rows [m or rad], and what must not be negative."""
        g = Graph()
        k = kinematics(self.problem.mechanism, g)
        nq = self.problem.mechanism.model.nq
        target = g.inputs(nq, self.problem.prescribed)
        rows = self.problem.rows(k, target)
        every = range(len(rows.values))
        faces = g.constant(1.0)
        p, length = len(self.problem.pinned), self.problem.mechanism.length
        for i, (frame, outputs) in enumerate(self.problem.goals):
            pose = pose_of(target[p + POSE * i : p + POSE * (i + 1)], length)
            faces = faces.min(k.faces(frame, outputs, pose))
        outputs_ = [_largest(g, rows, every), k.least_sense, faces]
        return compiled(g.tape(outputs_, nq + self.problem.prescribed))

    # -- running -----------------------------------------------------------------------------------

    def run(
        self,
        q: np.ndarray,
        begin: np.ndarray,
        end: np.ndarray,
        smallest: float = SMALLEST,
        branch: np.ndarray | None = None,
    ) -> Way:
        """Follow the branches of postures (n, nq) from targets to targets (n, prescribed).

        A posture need not meet its first target to the last digit: it is closed there first, on
        its own side of the singular set unless ``branch`` (n,) says which sign is wanted.
        """
        nq, n = q.shape[1], len(q)
        state = np.zeros((self.states, n))
        state[:nq] = state[nq : 2 * nq] = q.T
        numbers = np.ascontiguousarray(self._lay_out(begin, end, None, smallest).T)
        state[2 * nq : 2 * nq + len(STATE)] = FRESH[:, None]
        state[2 * nq + 1] = numbers[-2]
        if branch is not None:
            state[2 * nq + 4] = branch
        for a in range(0, n, CHUNK):
            part, given = state[:, a : a + CHUNK], numbers[:, a : a + CHUNK]
            self.loop.run(part, given, TICKS)
            while (part[2 * nq + 5] == RUNNING).any():
                self.loop.run(part, given, TICKS)
        rest = dict(zip(STATE, state[2 * nq :], strict=False))
        return Way(
            q=np.ascontiguousarray(state[:nq].T),
            reached=np.maximum(rest["reached"], 0.0),
            codes=rest["status"].astype(int),
            det=rest["det"],
            evaluations=rest["evaluations"].astype(int),
            started=rest["reached"] >= 0.0,
        )

    def _lay_out(
        self, begin: np.ndarray, end: np.ndarray, longest: float | None, smallest: float
    ) -> np.ndarray:
        """Parameters (n, parameters) of ways between targets, quaternions on one side."""
        p, m = len(self.problem.pinned), self.problem.mechanism
        end = end.copy()
        units = m.column_scale[list(self.problem.pinned)]
        travel = np.abs((end[:, :p] - begin[:, :p]) / units).max(axis=1, initial=0.0)
        for i in range(len(self.problem.goals)):
            one, two = (x[:, p + POSE * i : p + POSE * (i + 1)] for x in (begin, end))
            two[(one[:, 3:] * two[:, 3:]).sum(axis=1) < 0.0, 3:] *= -1.0
            gap = two - one
            shift = np.sqrt((gap[:, :3] ** 2).sum(axis=1)) / m.length
            turn = 2.0 * np.sqrt((gap[:, 3:] ** 2).sum(axis=1))
            travel = np.maximum(travel, shift + turn)
        bound = np.full(len(begin), longest or 1.0)
        if longest is None:
            bound = np.clip(LONGEST / np.maximum(travel, 1e-300), 1e-3, 1.0)
        return np.column_stack([begin, end, bound, smallest * bound])


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


@dataclass(frozen=True, eq=False)
class Judged:
    """What one step of Newton's method tells.

    Its length, the largest row, the determinant of the pivot columns, how the null space turned
    (see ``Follower``), and the smallest pivot.
    """

    size: Expr
    closed: Expr
    det: Expr
    turn: Expr
    least: Expr


def control(
    names: dict[str, Expr], share: Expr, judged: Judged, longest: Expr, smallest: Expr
) -> tuple[dict[str, Expr], Expr]:
    """Rules of following: the state after a step, and whether to go on.

    Beside the state come the truth values ``take`` (accept the posture that the step leads to),
    ``back`` (try again from the last good one) and ``keep`` (ended before).
    """
    running = names["status"] < 0.0
    opening = names["reached"] < 0.0
    singular = ~(judged.least > PIVOT)
    wrong = judged.det * judged.turn * names["sign"] < 0.0
    late = ~(names["count"] < float(ITERATIONS))
    rounding = (judged.size < ROUNDING) & (judged.closed < CLOSED)
    short = (judged.size < names["bound"]) | rounding
    refuse = singular | wrong | ~short | late
    settled = (judged.size < SETTLED) | rounding
    take, back = running & settled & ~refuse, running & refuse
    done = take & ~(share < 1.0)
    half = 0.5 * names["step"]
    failed = back & ((half < smallest) | opening)
    codes = [float(e.code) for e in REFUSED]
    why = singular.select(codes[0], wrong.select(codes[1], late.select(codes[3], codes[2])))
    restarted = take | back
    side = (judged.det < 0.0).select(-1.0, 1.0)
    doubled = (2.0 * names["step"]).min(longest)
    after = {
        "reached": take.select(share, names["reached"]),
        "step": take.select(opening.select(longest, doubled), back.select(half, names["step"])),
        "bound": restarted.select(FIRST_STEP, (CONTRACTION * judged.size).max(1e-14)),
        "count": restarted.select(0.0, names["count"] + 1.0),
        "sign": take.select(side, names["sign"]),
        "status": done.select(float(Ending.ARRIVED.code), failed.select(why, RUNNING)),
        "det": take.select(judged.det, names["det"]),
        "evaluations": names["evaluations"] + 1.0,
        "keep": ~running,
        "take": take,
        "back": back,
    }
    return after, running & (after["status"] < 0.0)


def _share(names: dict[str, Expr]) -> Expr:
    """Share of the way that is tried: 0 until the start is closed."""
    ahead = (names["reached"] + names["step"]).min(1.0)
    return (names["reached"] < 0.0).select(0.0, ahead)


def _inner(g: Graph, a: Sequence[Expr], b: Sequence[Expr]) -> Expr:
    found = g.constant(0.0)
    for x, y in zip(a, b, strict=True):
        found = found + x * y
    return found


def _length(g: Graph, values: Sequence[Expr]) -> Expr:
    found = g.constant(0.0)
    for value in values:
        found = found + value * value
    return found.sqrt()


def _largest(g: Graph, rows: Rows, which: Sequence[int]) -> Expr:
    """Largest of some rows, in m or rad."""
    found = g.constant(0.0)
    for r in which:
        found = found.max(rows.units[r] * abs(rows.values[r]))
    return found


_FOLLOWERS: WeakKeyDictionary[Problem, Follower] = WeakKeyDictionary()


def follower_of(problem: Problem) -> Follower:
    """Machine code of a problem, made once."""
    if problem not in _FOLLOWERS:
        _FOLLOWERS[problem] = Follower(problem)
    return _FOLLOWERS[problem]
