"""Postures at the samples of a route, with their motion, along one branch.

Between samples the branch is followed in steps as short as they must be: Newton's method contracts
fast, the determinant keeps its sign, and the Jacobian stays so near to the last one that no
singular one fits in between. What cannot be stepped over however short the step is a singularity
(or the end of what is reachable).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from closedchain.analysis.motion.track.demands import Demand, Linear
from closedchain.analysis.motion.track.routes import Prescribed, Route
from closedchain.closure.solve.continuation import follow
from closedchain.closure.solve.factors import Factors, Range, factorise
from closedchain.closure.solve.newton import Corrected, Rows
from closedchain.closure.solve.outcome import Ending

SMALLEST = 1e-9  # share of the longest step: the shortest one
_LONGEST = 0.5  # dimensionless: a step's way
_SHORT = 0.1  # the same where freedoms are left: the third order of a shortest motion is not seen
_DIFFERENCE = 1e-6  # dimensionless way of the central difference behind a shortest motion's change


@dataclass(frozen=True, eq=False)
class State:
    """A closed posture on the route, with its motion by the route's parameter."""

    q: np.ndarray
    u: float
    residual: float
    linear: Linear
    factors: Factors | Range
    qdot: np.ndarray
    qddot: np.ndarray


@dataclass(frozen=True, eq=False)
class Stuck:
    """Nothing leads on from posture ``q`` at parameter ``u`` of the piece from sample ``piece``."""

    q: np.ndarray
    u: float
    piece: int
    ending: Ending


def state(
    demand: Demand, route: Route, q: np.ndarray, u: float, piece: int, p: Prescribed | None = None
) -> State | None:
    """Motion at a posture on the route; None where the matrix has lost rank.

    ``p`` replaces what the route says of the motion.
    """
    p = route.between(piece, u) if p is None else p
    linear = demand.linearise(q, p)
    factors = factorise(linear.matrix)
    rank = factors.s.size if isinstance(factors, Range) else factors.lu.shape[0]
    if factors.sign == 0 or rank < demand.rank:
        return None
    qdot = demand.joints(linear.known, -factors.step(linear.rhs))
    known, rhs = demand.second(q, p, qdot)
    x = -factors.step(rhs)
    if isinstance(factors, Range) and rank < linear.matrix.shape[1]:
        x = x + _turn_of_shortest(demand, q, p, qdot, factors)
    qddot = demand.joints(known, x)
    units = demand.equations(p).row_scale
    residual = float(np.abs(linear.values * units).max(initial=0.0))
    return State(q, u, residual, linear, factors, qdot, qddot)


def _turn_of_shortest(
    demand: Demand, q: np.ndarray, p: Prescribed, qdot: np.ndarray, factors: Range
) -> np.ndarray:
    """Part (free,) of the shortest motion's acceleration that lies in the null space.

    x' = A^+ b stays orthogonal to it while it turns: (1 - A^+ A) Adot^T (A^+)^T x'.
    """
    m = demand.mechanism
    x = (qdot / m.column_scale)[demand.free]
    size = float(np.linalg.norm(x))
    if size == 0.0:
        return np.zeros_like(x)
    multipliers = factors.u @ ((factors.v.T @ x) / factors.s)
    h = _DIFFERENCE / size
    ends = []
    for s in (h, -h):
        there = Prescribed(_moved(p, s), p.rate, p.second)
        moved = pin.integrate(m.model, q, s * qdot)
        ends.append(demand.linearise(moved, there).matrix)
    turn = (ends[0] - ends[1]).T @ multipliers / (2.0 * h)
    demand.linearise(q, p)
    return np.asarray(turn - factors.v @ (factors.v.T @ turn))


def _moved(p: Prescribed, s: float) -> np.ndarray | pin.SE3:
    """What is asked for a little later, to first order."""
    if not isinstance(p.value, pin.SE3):
        return np.asarray(p.value + s * p.rate)
    turned = pin.exp3(s * p.rate[3:]) @ p.value.rotation
    return pin.SE3(turned, p.value.translation + s * p.rate[:3])


def states(
    demand: Demand, route: Route, start: State, first: int, branch: int | None
) -> Iterator[State | Stuck]:
    """States at the samples after ``first``, where ``start`` is; last ``Stuck``, if it gets so."""
    here = start
    for piece in range(first, route.size - 1):
        if not route.timed and piece > first:  # the route has a corner here
            turned = state(demand, route, here.q, here.u, piece)
            if turned is None:
                yield Stuck(here.q, here.u, piece, Ending.SINGULAR)
                return
            here = turned
        there = _next(demand, route, here, piece, branch)
        yield there
        if isinstance(there, Stuck):
            return
        here = there


def _next(
    demand: Demand, route: Route, here: State, piece: int, branch: int | None
) -> State | Stuck:
    """State at the end of a piece, along the branch of the one at its begin.

    Where freedoms are left the posture depends on the way, so that steps are kept short.
    """
    end = float(route.knots[piece + 1])
    units = demand.mechanism.column_scale
    way = (end - here.u) * float(np.linalg.norm(here.qdot / units))
    spare = demand.rank < demand.free.size
    parts = max(1, int(np.ceil(way / _SHORT))) if spare else 1
    there: State | Stuck = here
    for u in np.linspace(here.u, end, parts + 1)[1:]:
        there = _reach(demand, route, here, piece, (end if u == end else float(u)), branch)
        if isinstance(there, Stuck):
            break
        here = there
    return there


def _reach(
    demand: Demand, route: Route, here: State, piece: int, to: float, branch: int | None
) -> State | Stuck:
    """State at parameter ``to`` of a piece: the branch followed from one place to another."""
    m, whole = demand.mechanism, to - here.u

    def place(share: float) -> float:
        return to if share == 1.0 else here.u + share * whole

    def at(q: np.ndarray, share: float) -> tuple[Rows, np.ndarray]:
        p = route.between(piece, place(share))
        if q is here.q:  # a first step, predicted to second order
            h = share * whole
            q = pin.integrate(m.model, q, h * here.qdot + 0.5 * h * h * here.qddot)
        return demand.equations(p), demand.place(q, p)

    start = Corrected(here.q, here.residual, branch, 0, here.factors)
    way = whole * float(np.linalg.norm(here.qdot / m.column_scale))
    found = follow(
        at, start, SMALLEST, min(1.0, _LONGEST / way) if way > 0.0 else 1.0, careful=True
    )
    u, q = place(found.reached), found.last.q
    if found.refusal is not None:
        return Stuck(q, u, piece, Ending.FOLD)
    there = state(demand, route, q, u, piece)
    return Stuck(q, u, piece, Ending.SINGULAR) if there is None else there
