"""Finding the singularity at which a path stops: where on the path, and of which kind."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from closedchain.analysis.first_order import OPEN
from closedchain.analysis.motion.track.demands import Demand, TipDemand
from closedchain.analysis.motion.track.routes import Route
from closedchain.analysis.motion.track.states import Stuck
from closedchain.analysis.singularity.classify import classify
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.ranks import RANK_TOLERANCE
from closedchain.closure.solve.outcome import Ending

_ITERATIONS = 20
_STEP = 1e-6  # of central differences of the singular value
_FOUND = 1e-9  # closure and singular value of a singularity that counts as found
_NEARBY = 1e-5  # share of the way between two samples within which it must lie
_CONTRADICTS = 1e-6  # dimensionless rate at which the path may open the loops
_SHOWN = 1e-6  # tolerance of the kinds there
_SHOWN_NEAR = 1e-3  # the same at a posture that only comes near, as the root of the distance


@dataclass(frozen=True, eq=False)
class Stop:
    """Why following a path ended before its last sample.

    Attributes
    ----------
    where : float
        Path parameter: time, or index of the sample for a path without times.
    kinds : frozenset of str
        Kinds of the singularity there, as ``cc.classify`` gives them; none where it is no
        singularity.
    message : str
    q : (nq,) array
        The last good posture.
    parameter : float
        Path parameter of ``q``.
    ending : Ending
        The same in a word: FOLD at a singularity, STUCK at no singularity, CONTRADICTION, LOST;
        UNREACHED or SINGULAR_START at the first sample.

    Examples
    --------
    >>> m = cc.load("linear_delta")
    >>> t = cc.track(m, [[-0.15, -0.15, -0.15], [-0.15, -0.15, 0.9]])
    >>> sorted(t.stop.kinds), 0.0 < t.stop.where < 1.0
    (['direct'], True)
    """

    where: float
    kinds: frozenset[str]
    message: str
    q: np.ndarray
    parameter: float
    ending: Ending

    def __post_init__(self) -> None:
        """Write-protect the posture."""
        self.q.setflags(write=False)


def stop(demand: Demand, route: Route, here: Stuck) -> Stop:
    """Report of a place that following does not pass."""
    name = "t" if route.timed else "sample"
    residual = np.abs(demand.mechanism.workspace.residual(here.q)).max(initial=0.0)
    if here.ending is Ending.LOST or residual > OPEN:  # an integration that left the loops
        message = f"the integration is lost after {name} = {here.u:.6g}: its errors grow"
        return Stop(here.u, frozenset(), message, here.q, here.u, Ending.LOST)
    miss = _contradiction(demand, route, here)
    if miss > _CONTRADICTS:
        message = (
            f"the path contradicts the loops after {name} = {here.u:.6g}, at a rate of {miss:.3g}: "
            "with more demands than freedoms only some combinations are possible"
        )
        return Stop(here.u, frozenset(), message, here.q, here.u, Ending.CONTRADICTION)
    outputs = demand.outputs if isinstance(demand, TipDemand) else None
    found = _locate(demand, route, here)
    q, where, tolerance = (here.q, here.u, _SHOWN_NEAR) if found is None else (*found, _SHOWN)
    kinds = kinds_at(demand.mechanism, q, outputs, tolerance)
    what = "a place without a way on"
    if kinds:
        article = "an" if min(kinds) == "inverse" else "a"
        what = f"{article} {' and '.join(sorted(kinds))} singularity"
    at = f"at {name} = {where:.9g}"
    if demand.mechanism.inputs:
        values = q[demand.mechanism.input_q]
        at += ", " + ", ".join(
            f"{n}={x:.6g}" for n, x in zip(demand.mechanism.inputs, values, strict=True)
        )
    ending = Ending.FOLD if kinds else Ending.STUCK
    return Stop(where, kinds, f"the path meets {what} {at}", here.q, here.u, ending)


def _contradiction(demand: Demand, route: Route, here: Stuck) -> float:
    """Share of the demanded rates that no motion of the joints can meet."""
    p = route.between(here.piece, here.u)
    linear = demand.linearise(here.q, p)
    met = linear.matrix @ np.linalg.lstsq(linear.matrix, linear.rhs, rcond=RANK_TOLERANCE)[0]
    size = float(np.abs(linear.rhs).max(initial=0.0))
    return float(np.abs(met - linear.rhs).max(initial=0.0)) / size if size > 0.0 else 0.0


def kinds_at(
    mechanism: Mechanism, q: np.ndarray, outputs: tuple[str, ...] | None, tolerance: float
) -> frozenset[str]:
    """Kinds of singularity of a posture; without a task only a direct one can be told."""
    if mechanism.task is None:
        return frozenset({"direct"})
    return classify(mechanism, q, outputs, tolerance=tolerance).kinds


def _locate(demand: Demand, route: Route, here: Stuck) -> tuple[np.ndarray, float] | None:
    """Posture and parameter of the singularity, by Newton's method in both; None where it fails.

    Equations: those of the path, and sigma = u^T A v of the matrix A that loses rank. At a fold the
    posture runs with the root of the distance along the path, so both are unknowns alike.
    """
    piece, m = here.piece, demand.mechanism
    whole = float(route.knots[piece + 1] - route.knots[piece])
    q, u = here.q, here.u
    for _ in range(_ITERATIONS):
        p = route.between(piece, u)
        linear = demand.linearise(q, p)
        left, s, right = np.linalg.svd(linear.matrix, full_matrices=False)
        ends = left[:, demand.rank - 1], right[demand.rank - 1]
        sigma = s[demand.rank - 1]
        off = max(np.abs(linear.values).max(initial=0.0), sigma)
        if off < _FOUND:
            near = abs(u - here.u) < _NEARBY * whole
            return (q, u) if near else None
        gradient = np.array(
            [_slope(demand, route, piece, q, u, ends, unit, whole) for unit in _units(demand)]
        )
        rows = np.vstack([np.column_stack([linear.matrix, -whole * linear.rhs]), gradient])
        x = -np.linalg.lstsq(rows, np.append(linear.values, sigma), rcond=1e-12)[0]
        x *= min(1.0, 0.3 / max(float(np.linalg.norm(x[:-1])), 1e-300))
        move = demand.joints(np.zeros(m.model.nv), x[:-1])
        u = float(np.clip(u + whole * x[-1], route.knots[piece], route.knots[piece + 1]))
        q = demand.place(pin.integrate(m.model, q, move), route.between(piece, u))
    return None


def _units(demand: Demand) -> np.ndarray:
    """Directions (free + 1, free + 1): one unknown each, the path parameter last."""
    return np.eye(demand.free.size + 1)


def _slope(
    demand: Demand,
    route: Route,
    piece: int,
    q: np.ndarray,
    u: float,
    ends: tuple[np.ndarray, np.ndarray],
    direction: np.ndarray,
    whole: float,
) -> float:
    """Derivative of u^T A v along a direction of unknowns, by central differences."""
    m = demand.mechanism
    matrices = []
    for h in (_STEP, -_STEP):
        v = demand.joints(np.zeros(m.model.nv), h * direction[:-1])
        p = route.between(piece, u + h * whole * float(direction[-1]))
        moved = demand.place(pin.integrate(m.model, q, v), p)
        matrices.append(demand.linearise(moved, p).matrix)
    return float(ends[0] @ (matrices[0] - matrices[1]) @ ends[1]) / (2.0 * _STEP)
