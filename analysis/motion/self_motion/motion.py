"""Self-motion: the curve of closed postures along which the outputs keep their values.

With the task held, [K; J] has a one-dimensional null space; the curve tangent to it is traced both
ways. It goes smoothly through direct singularities, where the inputs come to rest and the robot
cannot be driven on, and it crosses other such curves where the null space is larger.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike

from closedchain.analysis.first_order import first_order
from closedchain.analysis.motion.self_motion.curve import (
    Curve,
    driven,
    marked,
    polished,
    while_closed,
)
from closedchain.analysis.motion.self_motion.held_task import HeldTask
from closedchain.analysis.motion.self_motion.result import End, SelfMotion
from closedchain.analysis.singularity.classify import classify
from closedchain.analysis.singularity.maps.measures import measures_at
from closedchain.analysis.structure.mobility import generic_rank
from closedchain.closure.chart import joint_index, joint_names
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.nearest import beyond_limits
from closedchain.closure.ranks import null_space
from closedchain.closure.solve.joining import both_ways
from closedchain.closure.solve.outcome import Ending
from closedchain.closure.solve.solution_set import settle
from closedchain.closure.solve.system import System
from closedchain.closure.task import goal
from closedchain.urdf.description import OUTPUTS
from closedchain.urdf.errors import ClosureError, known_names

__all__ = ["End", "SelfMotion", "self_motion"]

Lock = str | Sequence[str] | Mapping[str, float]

SAME = 1e-9  # m or rad: a locked joint is where it is to be
PROBE = 0.02  # dimensionless way by which a singular null motion is tried
ENDED = 1e-6  # relative singular value that counts as zero where a curve could not be followed on


def self_motion(
    mechanism: Mechanism,
    q: ArrayLike,
    outputs: str | tuple[str, ...] | list[str] | None = None,
    *,
    lock: Lock = (),
    through: bool = False,
    step: float = 0.1,
    most: int = 2000,
) -> SelfMotion:
    """Trace the postures that hold the outputs of a closed posture, both ways.

    Each way ends at a joint limit, at a direct singularity, or where the loop closes. Where the
    null space of [K; J] becomes two-dimensional, another self-motion crosses: such branch points
    are noted and passed.

    Parameters
    ----------
    q : (nq,) array
        Closed posture to start from.
    outputs : str, optional
        Such as "x y z rx rz"; those of the task by default.
    lock : str, sequence of str, or mapping of name to value, optional
        Inputs or joints that stay where they are, needed where the outputs leave more than one
        freedom. A value must be the one at ``q``.
    through : bool
        Go on through direct singularities: the whole curve, also what the inputs cannot drive to.
    step : float
        Largest change of an unknown from posture to posture, dimensionless.
    most : int
        Number of postures each way after which tracing ends.

    Raises
    ------
    ClosureError
        Malformed or open posture, unknown names, no task; a posture that the task fixes, or whose
        freedom is infinitesimal only; more than one freedom left; a start beyond a joint limit,
        or, without ``through``, at a direct singularity.

    Examples
    --------
    >>> m = cc.load("d1")
    >>> s = cc.self_motion(m, m.home, "x y z rx rz")
    >>> bool(np.ptp(s.inputs[:, :3], axis=0).min() > 0.1)  # the legs of the coupler move [m]
    True
    >>> bool(np.ptp(s.inputs[:, 3:], axis=0).max() < 1e-9)  # those of the platform rest
    True
    """
    if not step > 0.0 or most < 2:
        raise ClosureError(f"step must be positive and most at least 2, got {step!r}, {most!r}")
    names = first_order(mechanism, q, outputs).outputs
    locked, free = _unlocked(mechanism, lock, mechanism.configuration(q))
    closed = settle(HeldTask(System(mechanism, free)), mechanism.configuration(q))
    z = closed.posture if closed.good else mechanism.configuration(q)
    beyond = beyond_limits(mechanism, z)
    if beyond:
        raise ClosureError(f"the start is beyond the limits of {', '.join(beyond)}")
    target = goal(mechanism, mechanism.required_task().tip, mechanism.pose(z), names)
    system = HeldTask(System(mechanism, free, (target,)))
    tangent, degenerate = _direction(system, z, names, locked)
    longest = np.full(system.size, step)
    traced = both_ways(system, z, tangent, longest, system.limits, most)
    curve = polished(system, traced)
    if degenerate:
        curve = while_closed(system, curve)
    curve = marked(system, curve)
    return _result(system, curve if through else driven(curve), names, locked, degenerate)


def _unlocked(
    mechanism: Mechanism, lock: Lock, q: np.ndarray
) -> tuple[tuple[str, ...], np.ndarray]:
    """Names of the locked joints, and the columns of v that are free."""
    names = tuple(lock.replace(",", " ").split() if isinstance(lock, str) else map(str, lock))
    values = lock if isinstance(lock, Mapping) else {}
    held = []
    for name in names:
        try:
            in_q, in_v = joint_index(mechanism, name)
        except KeyError:
            known = joint_names(mechanism)
            raise ClosureError(known_names(name, "input or joint to lock", known)) from None
        if not abs(values.get(name, q[in_q]) - q[in_q]) <= SAME:
            raise ClosureError(
                f"lock holds joints where they are: {name} is {q[in_q]:.6g} at the start, not "
                f"{values[name]:.6g}. Start from a posture that has it so (cc.close)"
            )
        held.append(in_v)
    return names, np.setdiff1d(np.arange(mechanism.model.nv), held)


def _direction(
    system: HeldTask, z: np.ndarray, names: tuple[str, ...], locked: tuple[str, ...]
) -> tuple[np.ndarray, bool]:
    """Tangent of the self-motion at the start, and whether the curve is singular throughout."""
    m, free = system.mechanism, system.equations.free
    basis, rank = null_space(system.evaluate(z)[1])
    expected = max(system.size - generic_rank(m) - len(names), 0)
    held = " ".join(names) + " held" + (f" and {' '.join(locked)} locked" if locked else "")
    if basis.shape[1] == 0:
        raise ClosureError(
            f"{m.name}: with outputs {held} nothing can move, the task fixes the posture (smallest "
            f"singular value of [K; J] {rank.above:.3g}). Hold fewer outputs"
            + (" or lock less" if locked else "")
        )
    if basis.shape[1] > 1 and basis.shape[1] > expected:
        raise ClosureError(
            f"{m.name}: the start is a branch point: {basis.shape[1]} null motions with outputs "
            f"{held}, {expected} nearby, so that several self-motions meet or one has no "
            "single direction. Start from a posture beside it"
        )
    in_free = [int(np.searchsorted(free, v)) for v in m.input_v if v in free]
    driven = [n for n, v in zip(m.inputs, m.input_v, strict=True) if v in free]
    if basis.shape[1] > 1:
        extra = basis.shape[1] - 1
        moving = [n for n, i in zip(driven, in_free, strict=True) if np.abs(basis[i]).max() > 1e-9]
        more = [n for n in OUTPUTS if n not in names]
        advice = [f"lock {extra} of the inputs that move ({', '.join(moving)})"] if moving else []
        advice += [f"hold more outputs ({', '.join(more)})"] if more else []
        advice += [] if moving else ["lock a joint that moves"]
        raise ClosureError(
            f"{m.name}: with outputs {held}, {basis.shape[1]} freedoms remain: no curve. "
            f"{' or '.join(advice)}"
        )
    tangent = basis[:, 0]
    rates = tangent[in_free] if np.abs(tangent[in_free]).max(initial=0.0) > 1e-9 else tangent
    sizes = np.abs(rates)
    tangent = tangent * np.sign(rates[int((sizes >= 0.999 * sizes.max()).argmax())])
    if expected == 0 and not _finite(system, z, tangent):
        raise ClosureError(
            f"{m.name}: with outputs {held} the start is an inverse singularity whose null motion "
            "is infinitesimal: no posture beside it holds the task"
        )
    return tangent, expected == 0


def _finite(system: HeldTask, z: np.ndarray, tangent: np.ndarray) -> bool:
    """Whether a null motion of a singular posture leads to other postures that hold the task."""
    for way in (PROBE, -PROBE):
        landed = settle(system, system.move(z, way * tangent))
        if landed.good and np.linalg.norm(system.difference(z, landed.posture)) > 0.5 * PROBE:
            return True
    return False


def _result(
    system: HeldTask,
    curve: Curve,
    names: tuple[str, ...],
    locked: tuple[str, ...],
    degenerate: bool,
) -> SelfMotion:
    m = system.mechanism
    q = np.array(curve.points)
    following = [*curve.points[1:], curve.points[0]] if curve.closed else curve.points[1:]
    steps = np.array([system.change(a, b) for a, b in zip(curve.points, following, strict=False)])
    steps = steps.reshape(-1, m.model.nv)
    way = np.append(0.0, np.cumsum(np.linalg.norm(steps / m.column_scale, axis=1)))
    found = measures_at(m, q, names)
    gaps = np.array([system.residuals(z) for z in q])
    return SelfMotion(
        q=q,
        arclength=way[: len(q)] - way[curve.start],
        length=float(way[-1]),
        inputs=q[:, m.input_q],
        sigma_direct=found["sigma_direct"],
        sigma_inverse=found["sigma_inverse"],
        sigma_constraint=found["sigma_constraint"],
        condition=found["condition"],
        residual=gaps[:, 0],
        task_error=gaps[:, 1],
        ends=(
            _end(system, curve.ends[0], curve.points[0], names),
            _end(system, curve.ends[1], curve.points[-1], names),
        ),
        closed=curve.closed,
        turns=MappingProxyType(_turns(m, steps.sum(axis=0)) if curve.closed else {}),
        start=curve.start,
        singular=curve.singular,
        branch_points=curve.crossings,
        degenerate=degenerate,
        outputs=names,
        locked=locked,
        mechanism=m,
    )


def _turns(mechanism: Mechanism, total: np.ndarray) -> dict[str, int]:
    """Whole turns of joints with one freedom, from their motions (nv,) along a loop."""
    m = mechanism
    names = {int(v): n for n, v in zip(m.inputs, m.input_v, strict=True)}
    found: dict[str, int] = {}
    for j in range(1, m.model.njoints):
        v = int(m.model.idx_vs[j])
        if m.model.nvs[j] == 1 and not m.translational[v]:
            count = round(float(total[v]) / (2.0 * np.pi))
            found |= {names.get(v, m.model.names[j]): count} if count else {}
    return found


def _end(system: HeldTask, end: str, z: np.ndarray, names: tuple[str, ...]) -> End:
    for bound in system.limits:
        if bound.label == end:
            value = float(z[bound.index])
            low = abs(value - bound.lower) < abs(value - bound.upper)
            side = "lower" if low else "upper"
            text = f"{side} limit {bound.lower if low else bound.upper:.6g} of {end}"
            return End("joint limit", end, frozenset(), text, bound.ending)
    ending = Ending.named(end)
    if ending is Ending.CLOSED:
        return End("closed loop", None, frozenset(), "the loop closes", ending)
    if ending is Ending.BUDGET:
        return End("longest", None, frozenset(), "as many postures as were allowed", ending)
    kinds = classify(system.mechanism, z, names, tolerance=ENDED).kinds
    if ending is Ending.SINGULARITY:
        kinds |= {"direct"}
        return End("singularity", None, kinds, f"{_listed(kinds)} singularity", ending)
    if kinds:
        text = f"{_listed(kinds)} singularity, not to be passed"
        return End("singularity", None, kinds, text, ending)
    return End("branch point", None, kinds, "the curve has no single direction there", ending)


def _listed(kinds: frozenset[str]) -> str:
    return " and ".join(k for k in ("direct", "inverse", "constraint") if k in kinds)
