"""Direct and inverse position problems, solved along the branch of a guess, one or many at once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from closedchain.closure.branchless import anywhere, closed_near, not_closed
from closedchain.closure.constraints import flipped_axes
from closedchain.closure.generic import dimensionless_jacobian, generic_ranks
from closedchain.closure.given import LARGEST_SQUARE, real_array
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.nearest import beyond_limits, limit_note
from closedchain.closure.ranks import null_space, numerical_rank
from closedchain.closure.solution import Solution, Solutions, found_on_branch
from closedchain.closure.solve.control import CLOSED
from closedchain.closure.solve.outcome import Ending
from closedchain.closure.solve.path import Follower, Single, Way, follower_of
from closedchain.closure.solve.problem import POSE, Problem, problem_of
from closedchain.closure.solve.system import System
from closedchain.closure.solve.ways import follow
from closedchain.closure.task import goal
from closedchain.urdf.errors import ClosureError

LIMIT_TOLERANCE = 1e-9
ARRIVED = Ending.ARRIVED.code
DRIVEN, POSED = "driven", "posed"


def direct(
    mechanism: Mechanism,
    input_values: ArrayLike | Mapping[str, float],
    guess: ArrayLike | None = None,
) -> Any:
    """Posture with given inputs on the branch of a guess, as ``cc.direct`` says."""
    if not mechanism.inputs:
        raise ClosureError(f"mechanism {mechanism.name!r} has no inputs (<transmission> elements)")
    problem = mechanism.known.get(DRIVEN) or driven(mechanism)
    if _is_table(input_values):
        end = mechanism.input_rows(np.asarray(input_values), "input values")
        return solve_many(problem, end, guess)
    end = mechanism.input_vector(input_values, "input values")
    start = mechanism.home if guess is None else mechanism.configuration(guess)
    found = follower_of(problem).alone(start, start[mechanism.input_q], end)
    if _fine(found):
        return _solution(problem, found)
    system = System(mechanism, mechanism.passive_v)
    kept_alone = found.code == ARRIVED  # the kept rows closed, others did not
    found, start = _again(problem, start, end, found)
    if _good(found):
        return _solution(problem, found)
    if found.reached < 0.0:
        held = _pinned(mechanism, start, end)
        return not_closed(system, held, "the guess has no branch: it is singular or open", 0)
    if found.code == ARRIVED or (kept_alone and _tied(mechanism, start)[1]):
        why = _contradiction(mechanism, start, end)
        return not_closed(system, _pinned(mechanism, found.q, end), why, found.evaluations)
    here = found.q[mechanism.input_q]
    where = ", ".join(f"{n}={x:.6g}" for n, x in zip(mechanism.inputs, here, strict=True))
    why = (
        f"the straight path of the inputs meets a direct singularity after {found.reached:.1%} of "
        f"the way, at {where}"
    )
    return not_closed(system, _pinned(mechanism, found.q, end), why, found.evaluations)


def inverse(
    mechanism: Mechanism,
    pose: pin.SE3 | Sequence[pin.SE3] | np.ndarray,
    guess: ArrayLike | None = None,
    outputs: str | tuple[str, ...] | list[str] | None = None,
) -> Any:
    """Posture with the tip at a pose on the branch of a guess, as ``cc.inverse`` says."""
    problem = posed(mechanism, outputs)
    if not isinstance(pose, pin.SE3):
        return solve_many(problem, _poses(pose), guess)
    end = pin.SE3ToXYZQUAT(pose)
    if not end.dot(end) < LARGEST_SQUARE and not np.isfinite(end).all():
        raise ClosureError(f"pose must be a pin.SE3 of finite numbers, got {pose!r}")
    start = mechanism.home if guess is None else mechanism.configuration(guess)
    found = follower_of(problem).alone(start, None, end)
    if _fine(found):
        return _solution(problem, found)
    tip, names = mechanism.required_task().tip, mechanism.outputs(outputs)
    system = System(mechanism, np.arange(mechanism.model.nv), (goal(mechanism, tip, pose, names),))
    found, start = _again(problem, start, end, found)
    if _good(found) and found.facing >= 0.0:
        return _solution(problem, found)
    if found.reached < 0.0:
        why = "the guess is an inverse singularity: no branch to follow"
        return anywhere(system, start, why, 0, branchless=True)
    why = f"the tip's path meets a singularity after {found.reached:.1%} of the way"
    return anywhere(system, found.q, why, found.evaluations, branchless=False)


def driven(mechanism: Mechanism) -> Problem:
    """Problem with all inputs prescribed, and nothing else."""
    pinned = tuple(int(v) for v in mechanism.input_v)
    found: Problem = mechanism.known.setdefault(DRIVEN, problem_of(mechanism, pinned))
    return found


def posed(
    mechanism: Mechanism, outputs: str | tuple[str, ...] | list[str] | None = None
) -> Problem:
    """Problem with the tip's pose prescribed in some outputs, those of the task by default.

    Raises
    ------
    ClosureError
        No task, unknown outputs.
    """
    key = POSED, tuple(outputs) if isinstance(outputs, list) else outputs
    found: Problem | None = mechanism.known.get(key)
    if found is None:
        names = mechanism.outputs(outputs)
        goals = ((mechanism.required_task().tip, names),)
        found = mechanism.known.setdefault(key, problem_of(mechanism, (), goals))
    return found


def _is_table(values: object) -> bool:
    """Whether it has two axes, as many at once have."""
    if type(values) is np.ndarray:
        return values.ndim == 2
    return not isinstance(values, Mapping) and np.ndim(values) == 2  # type: ignore[arg-type]


def _fine(found: Single) -> bool:
    """Whether a posture is what was asked for, with nothing to be said about it."""
    return _good(found) and found.sense >= 0.0 and found.facing >= 0.0


def _good(found: Single) -> bool:
    return found.code == ARRIVED and found.residual < CLOSED


def _again(
    problem: Problem, start: np.ndarray, end: np.ndarray, found: Single
) -> tuple[Single, np.ndarray]:
    """What a way that did not arrive leads to from a guess closed first, or with other rows."""
    follower = follower_of(problem)
    if found.reached < 0.0:
        closed = closed_near(problem, start)
        if closed is None:
            return found, start
        start = closed
        found = follower.alone(start, None, end)
    if not _good(found) and found.reached >= 0.0:
        place = follower.place.run(start[:, None]).T
        way = follow(problem, start[None], place, end[None])
        found = _checked(follower, way, end)
    return found, start


def _checked(follower: Follower, way: Way, end: np.ndarray) -> Single:
    told = follower.check.run(np.concatenate([way.q[0], end])[:, None])[:, 0]
    reached = float(way.reached[0]) if way.started[0] else -1.0
    numbers = (int(way.codes[0]), float(way.det[0]), int(way.evaluations[0]))
    return Single(way.q[0], reached, *numbers, *told.tolist())


def _pinned(mechanism: Mechanism, q: np.ndarray, values: np.ndarray) -> np.ndarray:
    q = q.copy()
    q[mechanism.input_q] = values
    return q


def _solution(problem: Problem, found: Single) -> Solution:
    nothing_left = problem.square or bool(problem.goals)
    if nothing_left and found.sense >= 0.0 and found.beyond >= -LIMIT_TOLERANCE:
        side = _side(problem, found.det)
        return found_on_branch(
            found.q, found.residual, found.evaluations, side, problem.jacobian_at
        )
    mechanism = problem.mechanism
    beyond = beyond_limits(mechanism, found.q) if found.beyond < -LIMIT_TOLERANCE else ()
    message = f"closed to {found.residual:.1e} on the branch of the guess{limit_note(beyond)}"
    if not nothing_left:
        message += _undriven(problem)
    ending = Ending.ARRIVED
    if found.sense < 0.0:
        flipped = ", ".join(flipped_axes(mechanism, found.q))
        message, ending = f"closes only with a mirrored joint: closure {flipped}", Ending.MIRRORED
    return Solution(
        q=found.q,
        residual=found.residual,
        converged=ending is Ending.ARRIVED,
        iterations=found.evaluations,
        message=message,
        branch=_side(problem, found.det),
        beyond_limits=beyond,
        ending=ending,
        jacobian=problem.jacobian_at,
    )


def _undriven(problem: Problem) -> str:
    """Sentence on freedoms that the inputs leave, idle ones apart; empty where there are none."""
    m = problem.mechanism
    outputs = () if m.task is None else m.task.outputs
    ranks = generic_ranks(m, outputs)
    k = ranks.undriven if outputs else ranks.motions - ranks.inputs.value
    if not k:
        return ""
    what = "freedom is" if k == 1 else "freedoms are"
    return f"; {k} {what} not driven: the posture is one of many with these inputs"


def _contradiction(mechanism: Mechanism, start: np.ndarray, end: np.ndarray) -> str:
    """Sentence on inputs that the loops tie to each other, and what the last ones would have to be.

    The kept rows have a solution on the way from ``start``, the others do not vanish there.
    """
    free, tied = _tied(mechanism, start)
    problem = problem_of(mechanism, [int(v) for v in mechanism.input_v[free]])
    found = follower_of(problem).alone(start, start[problem.pinned_q], end[free])
    if not _good(found) or not tied:
        return "the inputs contradict the loops"
    needed = found.q[mechanism.input_q]
    names = mechanism.inputs
    wanted = ", ".join(f"{names[i]} would have to be {needed[i]:.6g}" for i in tied)
    if not free:
        return f"the loops hold the inputs still: {wanted}"
    given = ", ".join(f"{names[i]}={end[i]:.6g}" for i in free)
    return f"the inputs contradict each other: {wanted} with {given} as given"


def _tied(mechanism: Mechanism, q: np.ndarray) -> tuple[list[int], list[int]]:
    """Inputs that move independently at ``q`` (nq,), the first ones, and those that follow them."""
    motions, _ = null_space(dimensionless_jacobian(mechanism, q))
    free: list[int] = []
    for i, v in enumerate(mechanism.input_v):
        if numerical_rank(motions[[*mechanism.input_v[free], v]]).value > len(free):
            free.append(i)
    return free, [i for i in range(len(mechanism.inputs)) if i not in free]


def _side(problem: Problem, det: float) -> int | None:
    """Sign of a determinant, where there is one: all rows kept, as many as unknowns."""
    return (-1 if det < 0.0 else 1) if problem.sided else None


def solve_many(problem: Problem, end: np.ndarray, guess: ArrayLike | None) -> Solutions:
    """Postures that meet targets (n, prescribed) of a problem, each on the branch of its guess.

    Parameters
    ----------
    end : (n, prescribed) array
        Values of the pinned joints [m or rad], then poses; finite.
    guess : (nq,) or (n, nq) array, optional
        Home by default.

    Raises
    ------
    ClosureError
        A malformed guess.
    """
    mechanism, n = problem.mechanism, len(end)
    start = mechanism.home if guess is None else mechanism.configurations(guess)
    if start.ndim == 2 and len(start) != n:
        raise ClosureError(f"got {n} requests and {len(start)} guesses")
    start = np.broadcast_to(start, (n, mechanism.model.nq))
    follower = follower_of(problem)
    begin = follower.place.run(np.ascontiguousarray(start.T)).T
    way = follow(problem, start, begin, end)
    told = follower.check.run(np.concatenate([way.q.T, end.T]))
    codes = np.where(way.started, way.codes, Ending.OPEN_START.code)
    arrived = codes == ARRIVED
    codes[arrived & ~(told[0] < CLOSED)] = Ending.CONTRADICTION.code
    codes[arrived & (told[1] < 0.0)] = Ending.MIRRORED.code
    codes[arrived & (told[2] < 0.0)] = Ending.REVERSED.code
    return Solutions(
        q=way.q,
        residual=told[0],
        branch=np.sign(way.det).astype(int) * int(problem.sided),
        codes=codes,
        reached=way.reached,
        evaluations=int(way.evaluations.sum()),
        within=told[3],
        iterations=way.evaluations,
    )


def _poses(poses: Sequence[pin.SE3] | np.ndarray) -> np.ndarray:
    """Targets (n, POSE) of poses. Raises ``ClosureError``."""
    if isinstance(poses, np.ndarray) and poses.dtype != object:
        found = real_array(poses, "pose", f"a pin.SE3, or (n, {POSE}) finite numbers")
    elif isinstance(poses, Sequence) and all(isinstance(pose, pin.SE3) for pose in poses):
        found = np.array([pin.SE3ToXYZQUAT(pose) for pose in poses]).reshape(-1, POSE)
    else:
        raise ClosureError(
            f"pose must be a pin.SE3, a sequence of them, or an (n, 7) array; got {poses!r}"
        )
    if found.ndim != 2 or found.shape[1] != POSE or not np.isfinite(found).all():
        raise ClosureError(
            f"pose must be a pin.SE3, or (n, {POSE}) finite numbers; got an array {found.shape}"
        )
    norms = np.linalg.norm(found[:, 3:], axis=1)
    if (abs(norms - 1.0) > 1e-6).any():
        raise ClosureError("poses need unit quaternions x y z w in columns 3 to 6")
    return found
