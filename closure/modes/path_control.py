"""Rules of following a complex path, as expressions: what a step of Newton's method leads to."""

from __future__ import annotations

from dataclasses import dataclass

from closedchain.closure.tape.expression import Expr

SMALLEST, LARGEST = 1e-8, 0.25  # steps along a path
SHORT = 0.01  # relative: largest first correction of an accepted step
AIM = 0.003  # the first correction that is aimed at
CONTRACTION = 0.25
ITERATIONS = 4
SOLVED = 1e-10  # relative correction of a solution
NEXT_BELOW_ROUNDING = 1e-6  # correction after which the next, by quadratic convergence, is nothing
NEXT_BELOW_NEED = 1e-4  # the same on the way, where the error is to be far below ``AIM``
SHIFT, LEAST, REST = 1e-3, 1e-7, 0.1
"""The slope is seen from this share of a step ahead; at least so far, or this share of the rest."""

FAR = 1e6  # dimensionless: lengths beyond are at infinity
HIGH = 16.0  # imaginary part of an angle beyond which it is
BOUND = 0.7  # longest step from afar, relative
CLOSED = 1e-7  # of steps from afar: the posture is closed
NEWTON = 60.0  # steps from afar at most

SLOPE, CORRECTING, AFAR = 0.0, 1.0, 2.0
"""What is done next: the slope here, a correction of the trial, a bounded step from afar."""

LOST, ARRIVED, RUNNING, ASKING = 0.0, 1.0, -1.0, -2.0
"""Status; ``ASKING`` for Newton's step by other means."""

SCALARS = ("share", "step", "length", "count", "last", "first", "phase", "status")
"""Share of the way that is behind, share of the next step, of the step before (0: there was none),
corrections so far, size of the last and the first one, what is done next, status."""

HUGE = 1e300


@dataclass(frozen=True, eq=False)
class Choice:
    """What a step of Newton's method leads to; truth values, and numbers of the next step.

    Attributes
    ----------
    now, asks : Expr
        Whether this step counts, and whether the path asks for it by other means.
    sloping, afar : Expr
        Whether it gave the slope, or is one from afar.
    accept, refuse, goes_on : Expr
        What becomes of a trial that it corrected; ``goes_on``: it is to be corrected again.
    keeps : Expr
        Whether the trial moves as corrected.
    at_end : Expr
        Whether this is the end of the way.
    first, taken, ahead, share : Expr
        First correction, step that was tried, step to be tried next, share of the way behind.
    """

    now: Expr
    asks: Expr
    sloping: Expr
    afar: Expr
    accept: Expr
    refuse: Expr
    goes_on: Expr
    keeps: Expr
    at_end: Expr
    first: Expr
    taken: Expr
    ahead: Expr
    share: Expr


def choice(s: dict[str, Expr], tried: Expr, size: Expr, fine: Expr | None) -> Choice:
    """Judge a step of a size at a share of the way; without ``fine``, of a path that has asked."""
    running = (s["status"] < 0.0) & (s["status"] > ASKING)
    asked = ~(s["status"] > ASKING)
    now = asked if fine is None else running & fine
    sloping, afar = now & (s["phase"] < 0.5), now & (s["phase"] > 1.5)
    correcting = now & ~(s["phase"] < 0.5) & ~(s["phase"] > 1.5)
    opening, at_end = s["count"] < 0.5, ~(tried < 1.0)
    first = opening.select(size, s["first"])
    bad = ~(size < SHORT) | (~(size < CONTRACTION * s["last"]) & ~(size < SOLVED))
    enough = at_end.select(NEXT_BELOW_ROUNDING, NEXT_BELOW_NEED)
    solved = ~bad & ((size < SOLVED) | ((size < enough) & ~opening))
    late = s["count"] > ITERATIONS - 1.5
    accept, refuse = correcting & solved, correcting & ~solved & (bad | late)
    # the predictor's error grows as the fourth power of the step
    taken = s["step"].min(1.0 - s["share"])
    ratio = (AIM * first.max(1e-9).recip()).sqrt().sqrt().max(0.5).min(2.0)
    ahead = accept.select((ratio * taken).min(LARGEST), s["step"])
    return Choice(
        now=now,
        asks=asked if fine is None else running & ~fine,
        sloping=sloping,
        afar=afar,
        accept=accept,
        refuse=refuse,
        goes_on=correcting & ~solved & ~(bad | late),
        keeps=correcting & ~bad,
        at_end=at_end,
        first=correcting.select(first, s["first"]),
        taken=taken,
        ahead=refuse.select(0.4 * taken, ahead),
        share=accept.select(tried, s["share"]),
    )


def scalars_after(
    s: dict[str, Expr], c: Choice, size: Expr, far: Expr, *, asking: bool
) -> dict[str, Expr]:
    """``SCALARS`` after a step; ``far``: whether the path is beyond all bounds.

    Paths ask where ``asking``.
    """
    gone = (c.accept | c.afar) & far
    stuck = (c.refuse | (c.accept & ~c.at_end)) & (c.ahead < SMALLEST)
    missed = c.afar & (~(size < HUGE) | (s["count"] > NEWTON - 1.5))
    arrived = (c.accept & c.at_end) | (c.afar & (size < CLOSED))
    status = arrived.select(ARRIVED, RUNNING)
    status = (gone | stuck | missed).select(LOST, status)
    status = c.asks.select(ASKING, status) if asking else status
    return {
        "share": c.share,
        "step": c.ahead,
        "length": c.accept.select(c.taken, s["length"]),
        "count": (c.goes_on | c.afar).select(s["count"] + 1.0, c.now.select(0.0, s["count"])),
        "last": c.goes_on.select(size, c.now.select(HUGE, s["last"])),
        "first": c.first,
        "phase": c.accept.select(SLOPE, c.sloping.select(CORRECTING, s["phase"])),
        "status": (c.now | c.asks).select(status, s["status"]),
    }
