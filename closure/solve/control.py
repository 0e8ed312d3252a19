"""Rules of following a branch, as expressions: what one step of Newton's method leads to.

A way of share 1 is cut into sub-steps until Newton's method, started from the last good posture,
contracts fast and the determinant keeps its sign: a step that would land on another branch is
refused, not taken.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from closedchain.closure.solve.outcome import Ending
from closedchain.closure.tape.expression import Expr

CLOSED = 1e-12
"""Largest row [m or rad] of a posture that counts as closed."""

FIRST_STEP = 0.5  # dimensionless: half the characteristic length, or half a radian
CONTRACTION = 0.3  # of successive steps: what Newton's method shows well inside its basin
SETTLED = 1e-7  # a step this small leaves an error at rounding level
ROUNDING = 1e-9  # below it steps are rounding: a closed posture does not get any better
PIVOT = 1e-13  # dimensionless: below it the system counts as singular
ITERATIONS = 12
LONGEST = 1.0  # of one sub-step, dimensionless: a characteristic length, or a radian
MOST = 1000  # sub-steps that this bound may ask for
SMALLEST = 1e-6  # share of the longest sub-step

RUNNING = -1.0
STATE = ("reached", "step", "bound", "count", "side", "status", "det", "evaluations")
"""Share of the way that is behind, share of the next sub-step, largest step of Newton's method that
is accepted next, its steps so far on this sub-step, sign of the determinant, ``RUNNING`` or the
code of the ending, determinant at the last good posture, evaluations."""

FRESH = np.array([-1.0, 1.0, FIRST_STEP, 0.0, 0.0, RUNNING, 0.0, 0.0])
"""``STATE`` at the start: the posture is closed where it is before it moves."""


@dataclass(frozen=True, eq=False)
class Judged:
    """What one step of Newton's method tells.

    Its length, the largest row [m or rad], the determinant of the pivot columns, how the null
    space turned since the last good posture (1 for square systems), and the smallest pivot.
    """

    size: Expr
    closed: Expr
    det: Expr
    turn: Expr
    least: Expr


@dataclass(frozen=True, eq=False)
class Decision:
    """State after a step, and truth values: what becomes of the posture.

    ``take``: the one that the step leads to is good; ``back``: the last good one is tried again;
    ``keep``: the lane ended before; ``running``: it goes on.
    """

    state: dict[str, Expr]
    take: Expr
    back: Expr
    keep: Expr
    running: Expr


def share(state: dict[str, Expr]) -> Expr:
    """Share of the way that is tried: 0 until the start is closed."""
    ahead = (state["reached"] + state["step"]).min(1.0)
    return (state["reached"] < 0.0).select(0.0, ahead)


def control(
    state: dict[str, Expr], tried: Expr, judged: Judged, longest: Expr, smallest: Expr
) -> Decision:
    """Judge a step at the share ``tried`` of the way; sub-steps are between two shares of it."""
    running = state["status"] < 0.0
    opening = state["reached"] < 0.0
    singular = ~(judged.least > PIVOT)
    wrong = judged.det * judged.turn * state["side"] < 0.0
    late = ~(state["count"] < float(ITERATIONS))
    rounding = (judged.size < ROUNDING) & (judged.closed < CLOSED)
    short = (judged.size < state["bound"]) | rounding
    refuse = singular | wrong | ~short | late
    settled = (judged.size < SETTLED) | rounding
    take, back = running & settled & ~refuse, running & refuse
    half = 0.5 * state["step"]
    doubled = (2.0 * state["step"]).min(longest)
    failed = back & ((half < smallest * longest) | opening)
    done = take & ~(tried < 1.0)
    why = _code(late, Ending.SLOW, Ending.FAR)
    why = wrong.select(float(Ending.OTHER_SIDE.code), why)
    why = singular.select(float(Ending.SINGULAR.code), why)
    again = take | back
    after = {
        "reached": take.select(tried, state["reached"]),
        "step": take.select(opening.select(longest, doubled), back.select(half, state["step"])),
        "bound": again.select(FIRST_STEP, (CONTRACTION * judged.size).max(1e-14)),
        "count": again.select(0.0, state["count"] + 1.0),
        "side": take.select((judged.det < 0.0).select(-1.0, 1.0), state["side"]),
        "status": done.select(float(Ending.ARRIVED.code), failed.select(why, RUNNING)),
        "det": take.select(judged.det, state["det"]),
        "evaluations": state["evaluations"] + 1.0,
    }
    kept = {name: running.select(after[name], old) for name, old in state.items()}
    return Decision(kept, take, back, ~running, running & (after["status"] < 0.0))


def _code(where: Expr, then: Ending, otherwise: Ending) -> Expr:
    return where.select(float(then.code), float(otherwise.code))
