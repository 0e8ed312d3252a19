"""Rules of following a branch, as expressions: what one step of Newton's method leads to.

A way of share 1 is cut into sub-steps until Newton's method, started from the last good posture,
contracts fast and the determinant keeps its sign: a step that would land on another branch is
refused, not taken.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from closedchain.closure.solve.outcome import Ending
from closedchain.closure.tape.expression import Expr


@dataclass(frozen=True)
class Precision:
    """What following a branch asks of a kind of floating-point number.

    Attributes
    ----------
    closed : float
        Largest row [m or rad] of a posture that counts as closed.
    settled : float
        A step this small leaves an error at rounding level.
    rounding : float
        Below it steps are rounding: a closed posture does not get any better.
    pivot : float
        Dimensionless; below it the system counts as singular.
    bound : float
        Least bound of the next step.
    smallest : float
        Smallest sub-step, as a share of the longest.
    """

    closed: float
    settled: float
    rounding: float
    pivot: float
    bound: float
    smallest: float


DOUBLE = Precision(1e-12, 1e-7, 1e-9, 1e-13, 1e-14, 1e-6)
SINGLE = Precision(2e-5, 3e-4, 1e-4, 1e-5, 1e-5, 1e-3)
"""For numbers of 24 binary digits: lengths of metres are closed to some hundredths of a mm."""

CLOSED = DOUBLE.closed
"""Largest row [m or rad] of a posture that counts as closed."""

FIRST_STEP = 0.5  # dimensionless: half the characteristic length, or half a radian
CONTRACTION = 0.3  # of successive steps: what Newton's method shows well inside its basin
ITERATIONS = 12
LONGEST = 1.0  # of one sub-step, dimensionless: a characteristic length, or a radian
MOST = 1000  # sub-steps that this bound may ask for
SMALLEST = DOUBLE.smallest  # share of the longest sub-step

RUNNING, ASKING = -1.0, -2.0  # status of a lane that goes on, and of one that is to be judged
STEADY = 0.3  # share that pivots may change by without a judgement of the Jacobian as a whole
NEAR = 0.9  # relative change of a Jacobian that is surely not singular in between: below 1
STATE = ("reached", "step", "bound", "count", "side", "status", "cleared", "det", "evaluations")
"""Share of the way that is behind, share of the next sub-step, largest step of Newton's method that
is accepted next, its steps so far on this sub-step, sign of the determinant, ``RUNNING``,
``ASKING`` or the code of the ending, whether the trial was judged and found near, last
determinant, evaluations."""

FRESH = np.array([-1.0, 1.0, FIRST_STEP, 0.0, 0.0, RUNNING, 0.0, 0.0, 0.0])
"""``STATE`` at the start: the posture is closed where it is before it moves."""


@dataclass(frozen=True, eq=False)
class Judged:
    """What one step of Newton's method tells.

    Its length, the largest row [m or rad], the determinant of the pivot columns, how the null
    space turned since the last good posture (1 for square systems), the smallest pivot, and
    whether no pivot changed by more than the share ``STEADY`` since.
    """

    size: Expr
    closed: Expr
    det: Expr
    turn: Expr
    least: Expr
    steady: Expr


@dataclass(frozen=True, eq=False)
class Decision:
    """State after a step, and what becomes of the posture.

    ``good`` and ``trial`` choose among (last good one, trial, the one that the step leads to);
    ``running`` says whether the lane goes on by itself.
    """

    state: dict[str, Expr]
    good: Callable[[Expr, Expr, Expr], Expr]
    trial: Callable[[Expr, Expr, Expr], Expr]
    running: Expr


def share(state: dict[str, Expr]) -> Expr:
    """Share of the way that is tried: 0 until the start is closed."""
    ahead = (state["reached"] + state["step"]).min(1.0)
    return (state["reached"] < 0.0).select(0.0, ahead)


def control(
    state: dict[str, Expr],
    judged: Judged,
    longest: Expr,
    smallest: Expr,
    precision: Precision = DOUBLE,
) -> Decision:
    """Judge a step of Newton's method; sub-steps are between two shares of the way.

    A trial at which the pivots are not steady is judged before it leads anywhere, see ``judge``:
    a long step could pass a singularity while Newton's method contracts.
    """
    running = (state["status"] < 0.0) & (state["status"] > ASKING)
    opening = state["reached"] < 0.0
    singular = ~(judged.least > precision.pivot)
    wrong = judged.det * judged.turn * state["side"] < 0.0
    late = ~(state["count"] < float(ITERATIONS))
    rounding = (judged.size < precision.rounding) & (judged.closed < precision.closed)
    short = (judged.size < state["bound"]) | rounding
    refuse = singular | wrong | ~short | late
    settled = (judged.size < precision.settled) | rounding
    back = running & refuse
    asks = running & ~refuse & ~opening & ~judged.steady & (state["cleared"] < 0.5)
    take = running & ~refuse & ~asks & settled
    tried = share(state)
    done = take & ~(tried < 1.0)
    why = _code(late, Ending.SLOW, Ending.FAR)
    why = wrong.select(float(Ending.OTHER_SIDE.code), why)
    why = singular.select(float(Ending.SINGULAR.code), why)
    doubled = (2.0 * state["step"]).min(longest)
    after = _refused(state, back, longest, smallest, why)
    after["reached"] = take.select(tried, state["reached"])
    after["step"] = take.select(opening.select(longest, doubled), after["step"])
    shrunk = asks.select(state["bound"], (CONTRACTION * judged.size).max(precision.bound))
    after["bound"] = (take | back).select(FIRST_STEP, shrunk)
    counted = asks.select(state["count"], state["count"] + 1.0)
    after["count"] = (take | back).select(0.0, counted)
    after["side"] = take.select((judged.det < 0.0).select(-1.0, 1.0), state["side"])
    after["status"] = asks.select(ASKING, after["status"])
    after["status"] = done.select(float(Ending.ARRIVED.code), after["status"])
    after["cleared"] = state["cleared"] * 0.0
    after["det"] = take.select(judged.det, state["det"])
    after["evaluations"] = state["evaluations"] + 1.0
    kept = {name: running.select(after[name], old) for name, old in state.items()}
    moves = running & ~asks
    return Decision(
        kept,
        lambda good, trial, new: take.select(new, good),
        lambda good, trial, new: moves.select(back.select(good, new), trial),
        running & (after["status"] < 0.0) & ~asks,
    )


def judge(state: dict[str, Expr], change: Expr, longest: Expr, smallest: Expr) -> Decision:
    """Clear the trial that asks, or refuse it, by the relative change of the Jacobian.

    Where that is below 1, no Jacobian on the straight line from the one at the last good posture
    is singular.
    """
    asks = ~(state["status"] > ASKING)
    back = asks & ~(change < NEAR)
    zero = state["step"] * 0.0
    after = _refused(state, back, longest, smallest, zero + float(Ending.RANK.code))
    after["cleared"] = back.select(0.0, zero + 1.0)
    after["count"] = back.select(0.0, state["count"])
    after["bound"] = back.select(FIRST_STEP, state["bound"])
    kept = {name: asks.select(after.get(name, old), old) for name, old in state.items()}
    return Decision(
        kept,
        lambda good, trial, new: good,
        lambda good, trial, new: back.select(good, trial),
        asks & (after["status"] < 0.0),
    )


def _refused(
    state: dict[str, Expr], back: Expr, longest: Expr, smallest: Expr, why: Expr
) -> dict[str, Expr]:
    """Half the sub-step where the trial is refused, or the end, with a code ``why``."""
    half = 0.5 * state["step"]
    failed = back & ((half < smallest * longest) | (state["reached"] < 0.0))
    return {
        "step": back.select(half, state["step"]),
        "status": failed.select(why, RUNNING),
    }


def _code(where: Expr, then: Ending, otherwise: Ending) -> Expr:
    return where.select(float(then.code), float(otherwise.code))
