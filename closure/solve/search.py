"""Closed postures from anywhere: damped least squares from many starts, in machine code.

Levenberg and Marquardt's method with the damping of [Nielsen1999]_, on all rows of a problem: one
evaluation of rows and Jacobian a step, the normal matrix eliminated sparsely. What comes near is
closed by Newton's method. That no start closes is therefore a numerical verdict.

[Nielsen1999]_ H. B. Nielsen, Damping parameter in Marquardt's method, IMM-REP-1999-05, Technical
University of Denmark, 1999.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from weakref import WeakKeyDictionary

import numpy as np

from closedchain.closure.nearest import LIMIT_TOLERANCE
from closedchain.closure.solve.control import CLOSED
from closedchain.closure.solve.outcome import Ending
from closedchain.closure.solve.path import CHUNK, follower_of
from closedchain.closure.solve.problem import Problem
from closedchain.closure.tape.expression import Expr, Graph
from closedchain.closure.tape.machine import Looped, looped
from closedchain.closure.tape.rows import Kinematics
from closedchain.closure.tape.sparse import normal_equations, positive_solve

EVALUATIONS = 120
SETTLED = 1e-2
"""A squared gap that cannot be lowered by more than this share stays open."""

NEAR = 1e-8
"""Squared gap from which Newton's method closes the loops."""

LONGEST = 0.7  # of a step, dimensionless
STATE = ("cost", "mu", "factor", "promised", "again", "count", "status")
RUNNING = -1.0
TICKS = 20  # steps between looks at the keyboard

_RANK = (Ending.ARRIVED, Ending.LIMIT, Ending.MIRRORED, Ending.REVERSED, Ending.SLOW, Ending.OPEN)
BETTER = np.full(len(Ending), len(_RANK))
"""By code: which end of several starts counts, the smallest."""
BETTER[[ending.code for ending in _RANK]] = range(len(_RANK))


@dataclass(frozen=True, eq=False)
class Descent:
    """Machine code of the descent for one problem."""

    problem: Problem

    @cached_property
    def loop(self) -> Looped:
        """Steps until the end: state is the last good posture, a trial, and ``STATE``."""
        problem, nq = self.problem, self.problem.mechanism.model.nq
        g = Graph()
        good, trial = g.inputs(0, nq), g.inputs(nq, nq)
        names = dict(zip(STATE, g.inputs(2 * nq, len(STATE)), strict=True))
        first = 2 * nq + len(STATE)
        target = g.inputs(first, problem.prescribed)
        q = problem.pinned_at(trial, target)
        k = Kinematics(problem.mechanism, g, q)
        rows = problem.rows(k, target)
        cost = g.constant(0.0)
        for value in rows.values:
            cost = cost + value * value
        matrix, slope = normal_equations(g, rows.entries, rows.values, problem.free)
        most = g.constant(0.0)
        for column in matrix:
            most = most.max(matrix[column][column])
        accepted, mu, factor = _weighed(names, cost, most)
        damping = mu * cost.min(1.0)
        for column in matrix:
            matrix[column][column] = matrix[column][column] + damping
        step = positive_solve(matrix, {c: -s for c, s in slope.items()})
        size, along = g.constant(0.0), g.constant(0.0)
        for column, value in step.items():
            size, along = size + value * value, along - slope[column] * value
        # what the linear model promises: -2 g.s - s.N s, with N s = -g - damping s
        promised = along + damping * size
        settled = (promised < SETTLED * cost) & ~(damping > 1e-2 * most)
        long = size > LONGEST * LONGEST
        moves = accepted & ~long
        status = _status(names, cost, moves & settled)
        after = {
            "cost": accepted.select(cost, names["cost"]),
            # a step too long for the linear model: damp more, without a look
            "mu": (accepted & long).select(4.0 * mu, mu),
            "factor": factor,
            "promised": promised,
            "again": moves.select(0.0, 1.0),
            "count": names["count"] + 1.0,
            "status": status,
        }
        running = names["status"] < 0.0
        best = [(running & accepted).select(b, a) for a, b in zip(good, q, strict=True)]
        moved = zip(k.moved(q, step), best, strict=True)
        tries = [moves.select(new, old) for new, old in moved]
        state = best + [running.select(new, old) for new, old in zip(tries, trial, strict=True)]
        state += [running.select(after[n], names[n]) for n in STATE]
        goes = running & (status < 0.0)
        return looped(g.tape([*state, goes], first + problem.prescribed), first, single=False)

    def run(self, q: np.ndarray, targets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Descend from postures (n, nq) at targets (n, prescribed).

        Returns the least postures (n, nq) and codes (n,): ARRIVED where the squared gap fell below
        ``NEAR``, OPEN, or SLOW.
        """
        nq, n = q.shape[1], len(q)
        state = np.zeros((2 * nq + len(STATE), n))
        state[:nq] = state[nq : 2 * nq] = q.T
        given = np.ascontiguousarray(targets.T)
        status = 2 * nq + STATE.index("status")
        state[status], state[2 * nq + STATE.index("factor")] = RUNNING, 2.0
        for a in range(0, n, CHUNK):
            part = state[:, a : a + CHUNK]
            while (part[status] == RUNNING).any():
                self.loop.run(part, given[:, a : a + CHUNK], TICKS)
        return np.ascontiguousarray(state[:nq].T), state[status].astype(int)


def _weighed(names: dict[str, Expr], cost: Expr, most: Expr) -> tuple[Expr, Expr, Expr]:
    """Whether the trial is accepted, and the damping and its factor after it."""
    first = names["count"] < 0.5
    again = names["again"] > 0.5
    gain = (names["cost"] - cost) * names["promised"].max(1e-300).recip()
    fallen = (gain > 0.0) & ~(names["promised"] < 0.0)
    bend = 2.0 * gain - 1.0
    eased = names["mu"] * (1.0 - bend * bend * bend).max(1.0 / 3.0)
    mu = first.select(
        1e-3 * most, again.select(names["mu"], fallen.select(eased, names["mu"] * names["factor"]))
    )
    factor = fallen.select(2.0, again.select(names["factor"], 2.0 * names["factor"]))
    return first | again | fallen, mu, factor


def _status(names: dict[str, Expr], cost: Expr, settled: Expr) -> Expr:
    near, late = cost < NEAR, ~(names["count"] < EVALUATIONS - 1.5)
    open_, slow, arrived = (float(e.code) for e in (Ending.OPEN, Ending.SLOW, Ending.ARRIVED))
    return near.select(arrived, settled.select(open_, late.select(slow, RUNNING)))


@dataclass(frozen=True, eq=False)
class Searched:
    """What a search found at n targets: the best posture (n, nq) of each, and codes (n,).

    ARRIVED: closed, within joint limits, no joint mirrored, the tip not reversed; LIMIT, MIRRORED,
    REVERSED: closed but for that; SLOW: some start did not settle; OPEN: all settled open.
    """

    q: np.ndarray
    codes: np.ndarray

    @property
    def found(self) -> np.ndarray:
        """Which ones are as asked, (n,) of bool."""
        return np.asarray(self.codes == Ending.ARRIVED.code)


def search(problem: Problem, targets: np.ndarray, starts: np.ndarray) -> Searched:
    """Look for closed postures at targets (n, prescribed).

    ``starts`` (n, s, nq), or (s, nq) for all targets: the first that closes as it should counts.
    """
    n, nq = len(targets), starts.shape[-1]
    every = np.broadcast_to(starts, (n, *starts.shape[-2:]))
    count = every.shape[1]
    q = every.reshape(n * count, nq)
    wanted = np.repeat(targets, count, axis=0)
    q, codes = descent_of(problem).run(q, wanted)
    near = np.flatnonzero(codes == Ending.ARRIVED.code)
    if near.size:
        q[near], codes[near] = _closed(problem, q[near], wanted[near])
    best = np.argmin(BETTER[codes].reshape(n, count), axis=1) if count else np.zeros(n, dtype=int)
    chosen = np.arange(n) * count + best
    return Searched(q[chosen], codes[chosen])


def _closed(problem: Problem, q: np.ndarray, targets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Close postures (n, nq) near closed ones at targets (n, prescribed); codes as ``Searched``."""
    follower = follower_of(problem)
    way = follower.run(q, targets, targets)
    found = way.q
    largest, sense, facing, within = follower.check.run(np.hstack([found, targets]).T)
    codes = np.where(within < -LIMIT_TOLERANCE, Ending.LIMIT.code, Ending.ARRIVED.code)
    codes[facing < 0.0] = Ending.REVERSED.code
    codes[sense < 0.0] = Ending.MIRRORED.code
    codes[~way.started | ~(largest < CLOSED)] = Ending.SLOW.code
    return found, codes


_DESCENTS: WeakKeyDictionary[Problem, Descent] = WeakKeyDictionary()


def descent_of(problem: Problem) -> Descent:
    """Machine code of a problem, made once."""
    if problem not in _DESCENTS:
        _DESCENTS[problem] = Descent(problem)
    return _DESCENTS[problem]
