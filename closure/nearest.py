"""``close``: the closed posture nearest to a guess, with joints held, bodies placed."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from closedchain.closure.constraints import flipped_axes, gaps
from closedchain.closure.equations import Equations
from closedchain.closure.fitting import fit
from closedchain.closure.given import finite_vector
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.ranks import null_space
from closedchain.closure.solution import Solution
from closedchain.closure.solve.control import CLOSED
from closedchain.closure.solve.descend import Descent, descend
from closedchain.closure.solve.double_roots import at_fold
from closedchain.closure.solve.starts import scattered, turned
from closedchain.closure.task import Goal, goal
from closedchain.urdf.errors import ClosureError, known_names

LIMIT_TOLERANCE = 1e-9
ELSEWHERE = "found from another start: descent from the guess does not lead to it"
MOST_WORK = 4e8
"""Evaluations of a search times the cube of the freedoms: a bound of seconds for large ones."""


def close(
    mechanism: Mechanism,
    guess: ArrayLike | None = None,
    *,
    fixed: Mapping[str, float | ArrayLike | pin.SE3] | None = None,
    place: Mapping[str, pin.SE3] | None = None,
    points: Mapping[str, ArrayLike] | None = None,
) -> Solution:
    """Find the closed posture nearest to ``guess``.

    Distance is measured in the tangent space, lengths divided by ``mechanism.length``. Postures
    within the joint limits are preferred; joints beyond them are reported.

    Parameters
    ----------
    guess : (nq,) array, optional
        Any posture, closed or not; home by default.
    fixed : mapping of joint or input name to value, optional
        Joints held: a number [m or rad], or for a floating joint a ``pin.SE3``.
    place : mapping of link name to pin.SE3, optional
        Bodies and their poses in the world, held exactly.
    points : mapping of frame name to (3,) array, optional
        Named points and world positions [m], met in the least-squares sense where the loops do
        not let them be met exactly.

    Returns
    -------
    Solution
        ``converged`` says that all loops close, held joints and placed bodies included, and that
        no cut joint is mirrored. The message states how far fitted points remain from their goals.
        A guess that is closed as asked is never left for a posture that is closed less well. Where
        no descent from the guess closes, starts elsewhere are tried, the same ones every time, for
        postures within the joint limits; that none closes is a numerical verdict.

    Raises
    ------
    ClosureError
        Unknown names, malformed numbers.

    Examples
    --------
    >>> m = cc.load("linear_delta")
    >>> guess = m.home + 0.1  # no posture: the loops are open
    >>> s = cc.close(m, guess, fixed={"q1": -0.1})
    >>> s.converged, float(s.q[m.input_q[0]])
    (True, -0.1)
    """
    q = mechanism.configuration(mechanism.home if guess is None else guess)
    goals = (
        *(goal(mechanism, name, _pose(name, pose)) for name, pose in (place or {}).items()),
        *(_point_goal(mechanism, name, xyz) for name, xyz in (points or {}).items()),
    )
    q, free = _hold(mechanism, q, fixed or {})
    equations = Equations(mechanism, free, goals)
    start = _lay_floating_bodies(mechanism, q, free, goals)
    within, found = _descended(equations, start)
    given = Descent(q, *equations.evaluate(q), 1)
    kept = _proper(mechanism, given) and not beyond_limits(mechanism, q)
    beside = found
    if not kept and not _proper(mechanism, found):
        within, found = _searched(within, found, start, len(points or {}))
    elsewhere = found is not beside
    found = _nearest(within, found, start, len(points or {}))
    if kept and given.residual <= found.residual:
        found = replace(given, evaluations=found.evaluations)  # nothing is nearer to the guess
    solution = _report(within, found, points or {})
    if elsewhere and solution.converged:
        return replace(solution, message=f"{solution.message}; {ELSEWHERE}")
    return solution


def closed_beside(
    mechanism: Mechanism, guess: np.ndarray, free: np.ndarray | None = None
) -> Solution:
    """Closed posture that descent from a guess (nq,) leads to, without a look elsewhere.

    For postures that are stated and have to close where they are. ``free`` are the tangent
    coordinates that may move, all by default. As ``close`` for the rest.
    """
    free = np.arange(mechanism.model.nv) if free is None else free
    within, found = _descended(Equations(mechanism, free), guess)
    return _report(within, _nearest(within, found, guess, 0), {})


def beyond_limits(mechanism: Mechanism, q: np.ndarray) -> tuple[str, ...]:
    """Names of joints outside their limits at ``q`` (nq,)."""
    lower, upper = mechanism.limits
    bad = np.flatnonzero((q < lower) | (q > upper))
    bad = bad[np.maximum(lower[bad] - q[bad], q[bad] - upper[bad]) > LIMIT_TOLERANCE]
    if not bad.size:
        return ()
    names = {j.idx_q: n for j, n in zip(mechanism.model.joints, mechanism.model.names, strict=True)}
    return tuple(names[int(i)] for i in bad)


def limit_note(beyond: tuple[str, ...]) -> str:
    """Sentence on joints beyond their limits; empty where there are none."""
    return f"; beyond their limits: {', '.join(beyond)}" if beyond else ""


def open_closure(mechanism: Mechanism, values: np.ndarray) -> str:
    """Sentence naming the closure that is open the widest."""
    name, gap = gaps(mechanism, values)[0]
    return f"closure {name} stays open by {gap:.3g}"


def _pose(name: str, pose: object) -> pin.SE3:
    if not isinstance(pose, pin.SE3):
        raise ClosureError(f"place[{name!r}] must be a pin.SE3, got {type(pose).__name__}")
    if not np.isfinite(pose.homogeneous).all():
        raise ClosureError(f"place[{name!r}] has entries that are not finite")
    return pose


def _point_goal(mechanism: Mechanism, name: str, xyz: ArrayLike) -> Goal:
    position = finite_vector(xyz, 3, f"points[{name!r}]", "x y z in m")
    return goal(mechanism, name, pin.SE3(np.eye(3), position), ("x", "y", "z"))


def _hold(
    mechanism: Mechanism, q: np.ndarray, fixed: Mapping[str, float | ArrayLike | pin.SE3]
) -> tuple[np.ndarray, np.ndarray]:
    """Put held joints at their values; return the posture and the columns left free."""
    q = q.copy()
    driven = {spec.name: spec.joint for spec in mechanism.description.inputs}
    held = np.zeros(mechanism.model.nv, dtype=bool)
    for name, value in fixed.items():
        if name in mechanism.inputs:
            joint_id = mechanism.model.getJointId(driven[name])
        elif name != "universe" and mechanism.model.existJointName(name):
            joint_id = mechanism.model.getJointId(name)
        else:
            known = [*mechanism.inputs, *list(mechanism.model.names)[1:]]
            raise ClosureError(known_names(name, "joint", known))
        joint = mechanism.model.joints[joint_id]
        if isinstance(value, pin.SE3):
            value = pin.SE3ToXYZQUAT(value)
        numbers = finite_vector(value, joint.nq, f"fixed[{name!r}]", "m, rad")
        q[joint.idx_q : joint.idx_q + joint.nq] = numbers
        held[joint.idx_v : joint.idx_v + joint.nv] = True
    return mechanism.configuration(q), np.flatnonzero(~held)


def _lay_floating_bodies(
    mechanism: Mechanism, q: np.ndarray, free: np.ndarray, goals: tuple[Goal, ...]
) -> np.ndarray:
    """Start with placed bodies already in place where a free floating joint carries them."""
    q = q.copy()
    for g in goals:
        joint = mechanism.model.joints[g.joint] if g.joint else None
        if len(g.outputs) == 6 and joint is not None and joint.nv == 6 and joint.idx_v in free:
            parent = mechanism.model.parents[g.joint]
            if parent == 0:
                root = mechanism.model.jointPlacements[g.joint]
                q[joint.idx_q : joint.idx_q + 7] = pin.SE3ToXYZQUAT(
                    root.actInv(g.target * g.placement.inverse())
                )
    return q


def _nearest(equations: Equations, found: Descent, guess: np.ndarray, n_points: int) -> Descent:
    """The nearest of the closed postures around one that was found; with points left, the best."""
    if found.closed:
        return at_fold(equations, _approach(equations, found, guess))
    return fit(equations, found, n_points) if n_points else found


def _descended(equations: Equations, q: np.ndarray) -> tuple[Equations, Descent]:
    """Where descent from a start ends, within joint limits where that closes as well."""
    found = descend(equations, q)
    if beyond_limits(equations.mechanism, found.q):
        clipped = replace(equations, within=equations.mechanism.limits)
        inside = descend(clipped, np.clip(q, *equations.mechanism.limits))
        if inside.residual <= max(found.residual, CLOSED):
            return clipped, inside
    return equations, found


def _proper(mechanism: Mechanism, found: Descent) -> bool:
    return found.closed and not flipped_axes(mechanism, found.q)


def _searched(
    equations: Equations, found: Descent, guess: np.ndarray, n_points: int
) -> tuple[Equations, Descent]:
    """Close from elsewhere, and within limits, what stays open or mirrored beside the guess.

    Descent ends where rows are least around, as at a guess just opposite to what is asked for. So
    it starts again where the loops close without the held joints, then from around the guess, then
    with angles anywhere. Points need not be met: without them the rest has to close.
    """
    mechanism = equations.mechanism
    hard = replace(equations, goals=equations.goals[: len(equations.goals) - n_points])
    if n_points and _proper(mechanism, _descended(hard, found.q)[1]):
        return equations, found
    most, spent = MOST_WORK / mechanism.model.nv**3, 0
    for start in _elsewhere(hard, guess):
        within, there = _descended(hard, start)
        spent += there.evaluations
        if _proper(mechanism, there) and not beyond_limits(mechanism, there.q):
            again = replace(equations, within=within.within)
            there = descend(again, there.q) if n_points else there
            return again, replace(there, evaluations=found.evaluations + spent)
        if spent > most:
            break
    return equations, replace(found, evaluations=found.evaluations + spent)


def _elsewhere(equations: Equations, guess: np.ndarray) -> Iterator[np.ndarray]:
    """Starts beside the guess and beside home, with the held joints of the guess."""
    mechanism, free = equations.mechanism, equations.free
    everything = np.arange(mechanism.model.nv)
    home = _with(equations, guess, mechanism.home)
    for start in (guess, home):
        if free.size < everything.size:
            loose = descend(replace(equations, free=everything), start)
            yield _with(equations, guess, loose.q)
    yield home
    yield from scattered(mechanism, guess, free)[1:]
    yield from scattered(mechanism, home, free)[1:]
    yield from turned(mechanism, guess, free)


def _with(equations: Equations, held: np.ndarray, q: np.ndarray) -> np.ndarray:
    """A posture (nq,) with the joints that are not free where ``held`` (nq,) has them."""
    model = equations.mechanism.model
    change = np.asarray(pin.difference(model, held, q))
    kept = np.ones(model.nv, dtype=bool)
    kept[equations.free] = False
    return np.asarray(pin.integrate(model, held, np.where(kept, 0.0, change)))


def _approach(equations: Equations, found: Descent, guess: np.ndarray) -> Descent:
    """Slide along the closed postures until none nearer to the guess is found.

    At the nearest one no motion in the null space of the rows shortens the displacement to the
    guess: to first order, the displacement is orthogonal to it.
    """
    mechanism = equations.mechanism
    free = equations.free

    scale = mechanism.column_scale

    def displacement(q: np.ndarray) -> np.ndarray:
        return np.asarray((pin.difference(mechanism.model, q, guess) / scale)[free])

    def nearer_by(q: np.ndarray) -> np.ndarray:
        """Derivative (free, free) of minus the displacement: not 1 where rotations differ."""
        derivative = pin.dDifference(mechanism.model, q, guess, pin.ARG0)
        return np.asarray(-(derivative * scale / scale[:, None])[np.ix_(free, free)])

    evaluations, share = found.evaluations, 1.0
    away = displacement(found.q)
    for _ in range(60):
        basis, _ = null_space(found.system)
        if not basis.shape[1]:
            break
        along = np.linalg.lstsq(nearer_by(found.q) @ basis, away, rcond=None)[0]
        if np.linalg.norm(along) < 1e-9 * (1.0 + np.linalg.norm(away)) or share < 1e-3:
            break
        start = equations.move(found.q, share * (basis @ along))
        nearer = descend(equations, start)
        evaluations += nearer.evaluations
        away_new = displacement(nearer.q)
        if nearer.closed and np.linalg.norm(away_new) < np.linalg.norm(away):
            found, away, share = nearer, away_new, min(1.0, 2.0 * share)
        else:
            share *= 0.5
    return replace(found, evaluations=evaluations)


def _report(equations: Equations, found: Descent, points: Mapping[str, ArrayLike]) -> Solution:
    mechanism = equations.mechanism
    loops = found.values[: mechanism.rows]
    beyond = beyond_limits(mechanism, found.q)
    flipped = flipped_axes(mechanism, found.q)
    off = [float(np.linalg.norm(mechanism.point(found.q, n) - xyz)) for n, xyz in points.items()]
    if flipped:
        message = f"closes only with a mirrored joint: closure {', '.join(flipped)}"
    elif found.closed:
        message = f"closed to {found.residual:.1e}"
    elif loops.size and np.abs(loops).max() >= CLOSED:
        message = f"does not close: {open_closure(mechanism, loops)}"
    else:
        extra = np.abs(found.values[mechanism.rows :]).max()
        message = f"the placed bodies cannot be reached: off by {extra:.3g}"
    if off and max(off) > CLOSED:
        message += f"; fitted points remain off by up to {max(off):.3g} m"
    return Solution(
        q=found.q,
        residual=found.residual,
        converged=found.closed and not flipped,
        iterations=found.evaluations,
        message=message + limit_note(beyond),
        beyond_limits=beyond,
        jacobian=lambda q: equations.evaluate(q)[1],
    )
