"""Direct and inverse position problems, solved along the branch of a guess."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from closedchain.closure.constraints import flipped_axes
from closedchain.closure.continuation import follow
from closedchain.closure.equations import RESIDUAL_TOLERANCE, Corrected, Equations, correct
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.nearest import beyond_limits, limit_note, open_closure
from closedchain.closure.solution import Solution
from closedchain.closure.task import Goal, faces_away, goal
from closedchain.closure.trust_region import Descent, descend
from closedchain.urdf.errors import ClosureError

RESTARTS = 12
LONGEST_STEP = 1.0  # dimensionless: a characteristic length, or a radian
MOST_STEPS = 1000  # that this bound may ask for


def direct(
    mechanism: Mechanism,
    input_values: ArrayLike | Mapping[str, float],
    guess: ArrayLike | None = None,
) -> Solution:
    """Direct position problem: the posture with given inputs, on the assembly branch of ``guess``.

    The inputs move on a straight line from those of the guess; the branch is followed in
    sub-steps. A path that meets a direct singularity ends there: the answer then says where, and
    carries the closest posture that could be found.

    Parameters
    ----------
    input_values : (n_inputs,) array, or mapping of input name to value
        [m or rad].
    guess : (nq,) array, optional
        Posture whose branch is kept; home by default. It need not be closed to the last digit.

    Returns
    -------
    Solution

    Raises
    ------
    ClosureError
        Malformed numbers, unknown or missing inputs, or a mechanism without inputs.
    """
    if not mechanism.inputs:
        raise ClosureError(f"mechanism {mechanism.name!r} has no inputs (<transmission> elements)")
    target = mechanism.input_vector(input_values, "input values")
    first = _answered(mechanism, guess)
    if first is not None:
        start = first.q
    else:
        start = mechanism.home if guess is None else mechanism.configuration(guess)
    equations = Equations(mechanism, mechanism.passive_v)
    begin = start[mechanism.input_q]

    def at(q: np.ndarray, t: float) -> tuple[Equations, np.ndarray]:
        q = q.copy()
        q[mechanism.input_q] = target if t == 1.0 else begin + t * (target - begin)
        return equations, q

    first = first or _on_branch(equations, start)
    if first is None:
        found = descend(equations, at(start, 1.0)[1])
        return _not_closed(equations, found, "the guess has no branch: it is singular or open", 0)
    travel = (target - begin) / mechanism.column_scale[mechanism.input_v]
    path = follow(at, first, longest=_longest_step(float(np.abs(travel).max())))
    if path.refusal is None:
        mechanism.workspace.last_direct = path.last
        return _solution(equations, path.last, path.evaluations)
    here = path.last.q[mechanism.input_q]
    where = ", ".join(f"{n}={x:.6g}" for n, x in zip(mechanism.inputs, here, strict=True))
    why = (
        f"the straight path of the inputs meets a direct singularity after {path.reached:.1%} of "
        f"the way, at {where}"
    )
    found = descend(equations, at(path.last.q, 1.0)[1])
    return _not_closed(equations, found, why, path.evaluations)


def inverse(
    mechanism: Mechanism,
    pose: pin.SE3,
    guess: ArrayLike | None = None,
    outputs: str | tuple[str, ...] | list[str] | None = None,
) -> Solution:
    """Inverse position problem: a posture with the tip at ``pose``, on the branch of ``guess``.

    The tip moves from its pose at the guess: its origin on a straight line, its rotation about a
    fixed axis. Where the guess itself is singular there is no branch to follow; the equations are
    then solved by descent from the guess and from nearby starts.

    Parameters
    ----------
    pose : pin.SE3
        Of the tip in the world. Components that are no outputs are not used.
    guess : (nq,) array, optional
        Home by default.
    outputs : str, optional
        Outputs that are prescribed; those of the task by default.

    Returns
    -------
    Solution
        With fewer outputs than freedoms, the posture is the one that short steps from the guess
        lead to.

    Raises
    ------
    ClosureError
        No task, malformed pose, outputs or guess.
    """
    names = mechanism.outputs(outputs)
    if not isinstance(pose, pin.SE3) or not np.isfinite(pose.homogeneous).all():
        raise ClosureError(f"pose must be a pin.SE3 of finite numbers, got {pose!r}")
    tip = mechanism.required_task().tip
    start = mechanism.home if guess is None else mechanism.configuration(guess)
    begin = mechanism.pose(start)
    every = np.arange(mechanism.model.nv)
    final = goal(mechanism, tip, pose, names)

    def at(q: np.ndarray, t: float) -> tuple[Equations, np.ndarray]:
        g = final if t == 1.0 else replace(final, target=_between(begin, pose, t))
        return Equations(mechanism, every, (g,)), q

    first = _on_branch(at(start, 0.0)[0], start)
    evaluations, why = 0, "the guess is an inverse singularity: no branch to follow"
    if first is not None:
        travel = np.linalg.norm(
            pose.translation - begin.translation
        ) / mechanism.length + np.linalg.norm(pin.log3(begin.rotation.T @ pose.rotation))
        path = follow(at, first, longest=_longest_step(float(travel)))
        if path.refusal is None and not faces_away(mechanism, path.last.q, final):
            return _solution(at(path.last.q, 1.0)[0], path.last, path.evaluations)
        evaluations = path.evaluations
        why = f"the tip's path meets a singularity after {path.reached:.1%} of the way"
        start = path.last.q
    return _by_descent(mechanism, at(start, 1.0)[0], start, first is None, why, evaluations)


def _answered(mechanism: Mechanism, guess: object) -> Corrected | None:
    """Last answer of ``direct``, if the guess is that posture: it need not be closed again."""
    last: Corrected | None = mechanism.workspace.last_direct
    if last is None or not isinstance(guess, np.ndarray):
        return None
    # an array that nobody can have changed is the same without a look at its numbers
    unchanged = guess is last.q and not guess.flags.writeable
    return last if unchanged or np.array_equal(guess, last.q) else None


def _by_descent(
    mechanism: Mechanism,
    equations: Equations,
    start: np.ndarray,
    branchless: bool,
    why: str,
    evaluations: int,
) -> Solution:
    """Solve without a branch: from the start, then from starts scattered around it."""
    best: Descent | None = None
    for q in _scattered(mechanism, start):
        found = descend(equations, q)
        evaluations += found.evaluations
        good = found.closed and _proper(mechanism, found.q, equations.goals)
        if best is None or found.residual < best.residual or good:
            best = found
        if good:
            corrected = Corrected(found.q, found.residual, None, evaluations)
            solution = _solution(equations, corrected, evaluations, f"by descent; {why}")
            if branchless:
                return solution
            message = f"{why}; another branch reaches the pose: give a guess on it"
            return replace(solution, converged=False, message=message)
    assert best is not None
    where = "the joint limits, with a mirrored joint or with the tip reversed"
    return _not_closed(equations, best, why, evaluations, where)


def _scattered(mechanism: Mechanism, start: np.ndarray) -> list[np.ndarray]:
    """The start and the same starts around it each time, wider and wider."""
    rng = np.random.default_rng(0)
    starts = [start]
    for i in range(RESTARTS):
        v = rng.standard_normal(mechanism.model.nv) * mechanism.column_scale
        starts.append(pin.integrate(mechanism.model, start, 0.05 * (1 + i) * v))
    return starts


def _proper(mechanism: Mechanism, q: np.ndarray, goals: tuple[Goal, ...]) -> bool:
    """No joint beyond its limits, no mirrored closure, no goal met backwards."""
    return not (
        beyond_limits(mechanism, q)
        or flipped_axes(mechanism, q)
        or any(faces_away(mechanism, q, g) for g in goals)
    )


def _longest_step(travel: float) -> float:
    """Share of a dimensionless ``travel`` that one step may cover."""
    return float(np.clip(LONGEST_STEP / travel, MOST_STEPS**-1, 1.0)) if travel > 0.0 else 1.0


def _between(begin: pin.SE3, end: pin.SE3, t: float) -> pin.SE3:
    """Pose at share ``t`` of the way: straight line, rotation about a fixed axis."""
    turn = pin.log3(begin.rotation.T @ end.rotation)
    return pin.SE3(
        begin.rotation @ pin.exp3(t * turn),
        (1.0 - t) * begin.translation + t * end.translation,
    )


def _on_branch(equations: Equations, q: np.ndarray) -> Corrected | None:
    """Close the guess on its branch; None where it is singular or does not close nearby."""
    first = correct(equations, q)
    if first.refusal in {"step", "slow"}:
        found = descend(equations, q)
        if not found.closed:
            return None
        first = correct(equations, found.q)
    return first if first.refusal is None else None


def _solution(
    equations: Equations,
    found: Corrected,
    evaluations: int,
    how: str = "on the branch of the guess",
) -> Solution:
    mechanism = equations.mechanism
    beyond = beyond_limits(mechanism, found.q)
    flipped = flipped_axes(mechanism, found.q) if mechanism.workspace.cuts else []
    message = f"closed to {found.residual:.1e} {how}{limit_note(beyond)}"
    if flipped:
        message = f"closes only with a mirrored joint: closure {', '.join(flipped)}"
    return Solution(
        q=found.q,
        residual=found.residual,
        converged=not flipped and found.residual < RESIDUAL_TOLERANCE,
        iterations=evaluations,
        message=message,
        branch=found.branch,
        beyond_limits=beyond,
        equations=equations,
    )


def _not_closed(
    equations: Equations,
    found: Descent,
    why: str,
    evaluations: int,
    where: str = "that singularity",
) -> Solution:
    mechanism = equations.mechanism
    loops = found.values[: mechanism.rows]
    if found.closed:
        message = f"{why}; the loops close there only beyond {where}"
    elif loops.size and np.abs(loops).max() >= RESIDUAL_TOLERANCE:
        message = f"{why}; out of reach: {open_closure(mechanism, loops)}"
    else:
        message = f"{why}; out of reach: the tip stays off by {found.residual:.3g}"
    beyond = beyond_limits(mechanism, found.q)
    return Solution(
        q=found.q,
        residual=found.residual,
        converged=False,
        iterations=evaluations + found.evaluations,
        message=message + limit_note(beyond),
        beyond_limits=beyond,
        equations=equations,
    )
