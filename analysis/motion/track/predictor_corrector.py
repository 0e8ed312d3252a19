"""Following a route by prediction of second order and more, and Newton's correction onto it.

A step is taken only if Newton's method contracts fast from the prediction, the determinant keeps
its sign, and the Jacobian stays so near to the last one that no singular one fits in between. What
cannot be stepped over however short the step is a singularity (or the end of what is reachable).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from closedchain.analysis.motion.track.demands import Demand, Linear
from closedchain.analysis.motion.track.routes import Prescribed, Route
from closedchain.closure.equations import correct
from closedchain.closure.solve.factors import NEAR, Factors, Range

SMALLEST = 1e-9  # share of the way between two samples: the shortest step
_MISS = 1e-2  # dimensionless distance from prediction to posture that steps aim at
_WORST_MISS = 10.0 * _MISS
_LONGEST = 0.5  # dimensionless: a step's way
_GROWTH = 3.0
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
    """No step leads on from ``state``, which lies on the piece that begins at sample ``piece``."""

    state: State
    piece: int
    refusal: str


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
        x = x + _turn_of_shortest(demand, route, q, u, piece, p, qdot, factors)
    qddot = demand.joints(known, x)
    units = demand.equations(p).row_scale
    residual = float(np.abs(linear.values * units).max(initial=0.0))
    return State(q, u, residual, linear, factors, qdot, qddot)


def factorise(matrix: np.ndarray) -> Factors | Range:
    """LU factors of a square matrix, singular bases of another."""
    square = matrix.shape[0] == matrix.shape[1] and matrix.size
    return Factors.of(matrix) if square else Range.of(matrix)


def _turn_of_shortest(
    demand: Demand,
    route: Route,
    q: np.ndarray,
    u: float,
    piece: int,
    p: Prescribed,
    qdot: np.ndarray,
    factors: Range,
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


def follow(
    demand: Demand, route: Route, start: State, first: int, branch: int | None
) -> Iterator[State | Stuck]:
    """States at the samples after ``first``, where ``start`` is; last ``Stuck``, if it gets so."""
    here, before, share = start, None, 1.0
    for piece in range(first, route.size - 1):
        end = float(route.knots[piece + 1])
        whole = end - float(route.knots[piece])
        if not route.timed and piece > first:  # the route has a corner here
            turned = state(demand, route, here.q, here.u, piece)
            if turned is None:
                yield Stuck(here, piece, "singular")
                return
            here, before = turned, None
        step = min(share, 1.0) * whole
        while here.u < end:
            step = min(step, _longest(demand, here))
            to = end if here.u + step > end - 1e-3 * step else here.u + step
            taken, miss = _try(demand, route, here, before, to, piece, branch)
            if isinstance(taken, State):
                step = (to - here.u) * min(_GROWTH, (_MISS / max(miss, 1e-12)) ** (1.0 / 3.0))
                here, before = taken, here
                share = step / whole
            else:
                step = 0.5 * (to - here.u)
                if step < SMALLEST * whole:
                    yield Stuck(here, piece, taken)
                    return
        yield here


def _longest(demand: Demand, here: State) -> float:
    speed = float(np.linalg.norm(here.qdot / demand.mechanism.column_scale))
    return _LONGEST / speed if speed > 0.0 else np.inf


def _try(
    demand: Demand,
    route: Route,
    here: State,
    before: State | None,
    to: float,
    piece: int,
    branch: int | None,
) -> tuple[State | str, float]:
    """State after one step and how far off the prediction was, or why it is refused."""
    m = demand.mechanism
    p = route.between(piece, to)
    predicted = demand.place(_predict(demand, here, before, to - here.u), p)
    found = correct(demand.equations(p), predicted, branch, here.factors)
    if found.refusal is not None:
        return found.refusal, 0.0
    miss = float(np.linalg.norm(pin.difference(m.model, predicted, found.q) / m.column_scale))
    if miss > _WORST_MISS:
        return "far", miss
    new = state(demand, route, found.q, to, piece, p)
    if new is None:
        return "singular", miss
    return ("far" if _left(here, new) else new), miss


def _predict(demand: Demand, here: State, before: State | None, h: float) -> np.ndarray:
    """Taylor's second order; the third from the last change of the acceleration."""
    way = h * here.qdot + 0.5 * h * h * here.qddot
    if before is not None:
        way += h**3 / 6.0 * (here.qddot - before.qddot) / (here.u - before.u)
    return np.asarray(pin.integrate(demand.mechanism.model, here.q, way))


def _left(here: State, new: State) -> bool:
    """Whether a singular matrix may lie on the straight line from one matrix to the other."""
    if isinstance(here.factors, Range):
        return isinstance(new.factors, Range) and here.factors.left_by(new.factors)
    change = new.linear.matrix - here.linear.matrix
    relative = here.factors.step(change)
    return bool(np.linalg.norm(relative) >= NEAR and np.linalg.norm(relative, 2) >= NEAR)
