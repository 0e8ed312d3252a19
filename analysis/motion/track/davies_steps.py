"""Davies' method of following a path: Euler steps with the closure error fed back.

The secondary rates follow from the primary ones by the closures' velocity equation, with the error
r that the loops have gathered led back to zero: N_s qdot_s = -N_p qdot_p - K_e r [Simas, Dias and
Martins, eqs (9)-(11)]. Rows are those of ``cc.residual``, and of the tip's goal along poses. An
error decays by 1 - K_e dt a step: K_e must stay below 2 / dt; K_e = 1 / dt is Newton's step.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pinocchio as pin

from closedchain.analysis.motion.track.demands import Demand
from closedchain.analysis.motion.track.routes import Prescribed, Route
from closedchain.analysis.motion.track.states import State, Stuck
from closedchain.closure.solve.factors import Range
from closedchain.closure.solve.outcome import Ending

LOST = 1e3
"""Dimensionless error at which an integration counts as lost."""


def integrate(
    demand: Demand, route: Route, q: np.ndarray, first: int, gain: float, inner: int
) -> Iterator[State | Stuck]:
    """States at sample ``first`` and those after it, one Euler step each."""
    m = demand.mechanism
    here = _state(demand, route, q, first, gain)
    if here is None:
        return
    yield here
    for piece in range(first, route.size - 1):
        dt = float(route.knots[piece + 1] - route.knots[piece])
        after = route.between(piece, float(route.knots[piece + 1]))
        moved = demand.place(pin.integrate(m.model, here.q, dt * here.qdot), after)
        for _ in range(inner):
            moved = _newton(demand, moved, after)
        new = _state(demand, route, moved, piece + 1, gain)
        if new is None:
            yield Stuck(here.q, here.u, piece, Ending.SINGULAR)
            return
        if not np.abs(new.linear.values).max(initial=0.0) < LOST:
            yield Stuck(here.q, here.u, piece, Ending.LOST)
            return
        here = new
        yield here


def _state(demand: Demand, route: Route, q: np.ndarray, i: int, gain: float) -> State | None:
    p = route.reported(i)
    linear = demand.linearise(q, p)
    if not np.isfinite(linear.matrix).all():
        return None
    factors = _bases(demand, linear.matrix)
    if factors.s.size < demand.rank:
        return None
    qdot = demand.joints(linear.known, -factors.step(linear.rhs - gain * linear.values))
    known, rhs = demand.second(q, p, qdot)
    qddot = demand.joints(known, -factors.step(rhs))
    residual = float(np.abs(linear.values * demand.equations(p).row_scale).max(initial=0.0))
    return State(q, float(route.knots[i]), residual, linear, factors, qdot, qddot)


def _newton(demand: Demand, q: np.ndarray, p: Prescribed) -> np.ndarray:
    linear = demand.linearise(q, p)
    x = _bases(demand, linear.matrix).step(linear.values)
    v = demand.joints(np.zeros(demand.mechanism.model.nv), x)
    return np.asarray(pin.integrate(demand.mechanism.model, q, v))


def _bases(demand: Demand, matrix: np.ndarray) -> Range:
    """Singular bases cut at the rank of closed postures: off them redundant rows may add to it."""
    found = Range.of(matrix)
    return Range(found.u[:, : demand.rank], found.s[: demand.rank], found.v[:, : demand.rank])
