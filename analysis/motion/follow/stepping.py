"""Following a task sample by sample: particular motion, then a step along the null motion.

The step climbs the gradient of the objective projected on the null space [Liegeois1977]_, is
cut down to the limits, and the posture is corrected onto the task to 1e-12.

[Liegeois1977]_ A. Liegeois, Automatic supervisory control of the configuration and behavior of
multibody mechanisms, IEEE Trans. Systems, Man and Cybernetics 7(12), 1977.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from closedchain.analysis.motion.follow.bounding import Excess, excess, within
from closedchain.analysis.motion.follow.objectives import InputSpeed, Objective, joint_rows
from closedchain.analysis.motion.follow.postures import Posture, posture
from closedchain.analysis.motion.follow.problem import Problem
from closedchain.analysis.singularity.classify import SINGULAR
from closedchain.closure.progress import Progress
from closedchain.closure.solve.continuation import follow as continued
from closedchain.closure.solve.control import CLOSED
from closedchain.closure.solve.newton import Corrected, correct
from closedchain.closure.solve.outcome import Ending
from closedchain.closure.solve.system import System
from closedchain.closure.task import faces_away

_SHORTEST = 1e-4  # share of the way between two samples: the shortest step
_LONGEST_CLIMB = 0.2  # dimensionless way along the null motion in one step
_HALVINGS = 6
_NEAR = 0.02  # of a singular value: what a message calls near


@dataclass(frozen=True)
class Blocked:
    """Where (time) and why a task could not be followed."""

    time: float
    message: str
    ending: Ending


@dataclass(frozen=True, eq=False)
class Run:
    """Postures at the samples from the first on, and what ended the run, if anything did."""

    postures: tuple[Posture, ...]
    blocked: Blocked | None


def run(
    problem: Problem,
    locks: dict[str, float],
    start: np.ndarray,
    objective: Objective | None,
    gain: float,
    report: Progress | None = None,
    onward: tuple[Posture, ...] = (),
) -> Run:
    """Follow the task from posture ``start``; without an objective the null motion stays at rest.

    Parameters
    ----------
    onward : tuple of Posture
        Postures of the first samples, to go on from.
    gain : float
        Null motion per second and slope of the objective, both dimensionless.
    """
    found = list(onward)
    for step in _steps(problem, locks, start, objective, gain, onward):
        if isinstance(step, Blocked):
            return Run(tuple(found), step)
        found.append(step)
        if report is not None:
            report("follow", len(found), problem.route.size)
    return Run(tuple(found), None)


def _steps(
    problem: Problem,
    locks: dict[str, float],
    start: np.ndarray,
    objective: Objective | None,
    gain: float,
    onward: tuple[Posture, ...],
) -> Iterator[Posture | Blocked]:
    here: Posture | Blocked = onward[-1] if onward else begin(problem, locks, start)
    if isinstance(here, Blocked):
        yield here
        return
    if not onward:
        yield here
    for i in range(max(len(onward) - 1, 0), problem.route.size - 1):
        there = advance(problem, here, i)
        if isinstance(there, Blocked):
            yield there
            return
        if problem.freedoms:
            there = _climb(problem, here, there, i, objective, gain)
        over = excess(problem, there.q, here.q, i)
        if over is not None:
            yield over_bound(problem, over, i)
            return
        yield there
        here = there


def begin(problem: Problem, locks: dict[str, float], start: np.ndarray) -> Posture | Blocked:
    """Posture at the first sample: locked inputs and tip move there from ``start`` together."""
    m, time = problem.mechanism, float(problem.times[0])
    index = [int(m.input_q[m.inputs.index(n)]) for n in locks]
    target, before = np.array(list(locks.values())), start[index]
    first, last = m.pose(start), problem.pose(0, time)
    looked = posture(problem, start, 0.0, slopes=False)
    if looked.sigmas.driven < SINGULAR:
        message = f"not to be begun from the start posture: {_dead(problem, looked)}"
        return Blocked(time, message, Ending.SINGULAR_START)

    def at(q: np.ndarray, t: float) -> tuple[System, np.ndarray]:
        pose = last if t == 1.0 else _between(first, last, t)
        q = q.copy()
        q[index] = target if t == 1.0 else before + t * (target - before)
        return problem.held(pose, start, looked.basis), q

    opened = correct(*at(start, 0.0))
    if opened.refusal is not None:
        message = "not to be begun from the start posture: no branch through it"
        return Blocked(time, message, Ending.SINGULAR_START)
    way = continued(at, opened, _SHORTEST, 0.25)
    if way.refusal is not None or way.last.residual > CLOSED:
        return Blocked(
            time,
            f"the first sample is not reached from the start posture: the way there ends after "
            f"{way.reached:.1%}{_evidence(problem, way.last.q)}",
            Ending.UNREACHED,
        )
    found = posture(problem, way.last.q, way.last.residual, looked.basis)
    if looked.left.shape[0] == looked.left.shape[1] and found.crossed_from(looked):
        message = "a direct singularity lies between the start and the first sample"
        return Blocked(time, message, Ending.SINGULARITY)
    over = excess(problem, found.q, None, 0)
    if over is not None and not problem.freedoms:
        return over_bound(problem, over, None)
    return found


def advance(problem: Problem, here: Posture, i: int) -> Posture | Blocked:
    """Posture at sample i + 1 with the null motion at rest."""
    begin_time, end = float(problem.times[i]), float(problem.times[i + 1])
    here_goal = problem.held(problem.pose(i, begin_time), here.q, here.basis)

    def at(q: np.ndarray, t: float) -> tuple[System, np.ndarray]:
        u = end if t == 1.0 else begin_time + t * (end - begin_time)
        return problem.held(problem.pose(i, u), here.q, here.basis), q

    opened = correct(here_goal, here.q)
    if opened.refusal is not None:
        opened = Corrected(here.q, here.residual, None, 1)
    way = continued(at, opened, _SHORTEST)
    if way.refusal is not None:
        time = begin_time + way.reached * (end - begin_time)
        what = "the task cannot be followed on"
        message = f"{what} after t = {time:.6g} s{_evidence(problem, way.last.q)}"
        return Blocked(time, message, Ending.FOLD)
    equations = at(way.last.q, 1.0)[0]
    if any(faces_away(problem.mechanism, way.last.q, g) for g in equations.goals):
        return Blocked(end, f"the tool would point backwards at t = {end:.6g} s", Ending.REVERSED)
    there = posture(problem, way.last.q, way.last.residual, here.basis)
    if there.crossed_from(here):
        return Blocked(
            begin_time,
            f"the task meets a direct singularity between t = {begin_time:.6g} s and {end:.6g} s "
            f"(singular value {here.sigmas.direct:.3g} before, {there.sigmas.direct:.3g} after)",
            Ending.SINGULARITY,
        )
    return there


def corrected(
    problem: Problem,
    here: Posture,
    z: np.ndarray,
    sample: int,
    before: np.ndarray | None = None,
) -> Posture | None:
    """Posture of the same sample after a way z (k,) along the basis; None off the branch.

    ``before`` is the basis to be continued, that of ``here`` by default.
    """
    if not here.basis.shape[1]:
        return here
    pose = problem.route.sample(sample)
    anchor = problem.moved(here.q, here.basis @ z)
    closed = correct(problem.held(pose, anchor, here.basis), anchor)
    if closed.refusal is not None or closed.residual > CLOSED:
        return None
    found = posture(problem, closed.q, closed.residual, here.basis if before is None else before)
    return None if found.crossed_from(here) else found


def _climb(
    problem: Problem,
    here: Posture,
    base: Posture,
    i: int,
    objective: Objective | None,
    gain: float,
) -> Posture:
    """Step along the null motion, within limits, that does not lower the objective."""
    dt = float(problem.times[i + 1] - problem.times[i])
    wanted = _wanted(problem, here, base, objective, gain * dt)
    best = base
    for halving in range(_HALVINGS):
        z = wanted * 0.5**halving
        trial = _bounded(problem, here, base, z, i)
        if trial is None:
            continue
        best = trial
        if objective is None or isinstance(objective, InputSpeed) or not z.any():
            break
        if objective.value(problem, trial) >= objective.value(problem, base):
            break
        if excess(problem, base.q, here.q, i) is None:
            best = base
    return best


def _wanted(
    problem: Problem, here: Posture, base: Posture, objective: Objective | None, share: float
) -> np.ndarray:
    k = problem.freedoms
    if objective is None:
        return np.zeros(k)
    if isinstance(objective, InputSpeed):
        m = problem.mechanism
        unit = m.column_scale[m.input_v]
        rows = joint_rows(problem, m.input_v, base.basis) / unit[:, None]
        change = (base.q - here.q)[m.input_q] / unit
        return np.asarray(-np.linalg.lstsq(rows, change, rcond=1e-9)[0])
    z = share * objective.ascent(problem, base)
    return np.asarray(z * min(1.0, _LONGEST_CLIMB / max(float(np.linalg.norm(z)), 1e-300)))


def _bounded(
    problem: Problem, here: Posture, base: Posture, wanted: np.ndarray, i: int
) -> Posture | None:
    """Posture nearest to the wanted step within the bounds, as near to them as it gets."""
    z, now = wanted, base
    for _ in range(6):
        step = within(problem, now, z, here.q, i)
        moved = None if step is None else corrected(problem, now, step, i + 1)
        if moved is None:
            return None
        now, z = moved, np.zeros(problem.freedoms)
        if excess(problem, now.q, here.q, i) is None:
            break
    return now


def _between(begin_pose: pin.SE3, end: pin.SE3, t: float) -> pin.SE3:
    turn = pin.log3(begin_pose.rotation.T @ end.rotation)
    return pin.SE3(
        begin_pose.rotation @ pin.exp3(t * turn),
        (1.0 - t) * begin_pose.translation + t * end.translation,
    )


def _dead(problem: Problem, at: Posture) -> str:
    if at.sigmas.inverse > SINGULAR and problem.locked:
        return (
            f"with {' '.join(problem.locked)} locked the other inputs do not produce all outputs "
            f"there (singular value {at.sigmas.driven:.3g})"
        )
    return f"it is an inverse singularity (singular value {at.sigmas.inverse:.3g})"


def _evidence(problem: Problem, q: np.ndarray) -> str:
    """What the last posture says about why it did not go on."""
    sigmas = posture(problem, q, 0.0, slopes=False).sigmas
    if sigmas.driven < _NEAR:
        locked = f" with {' '.join(problem.locked)} locked" if problem.locked else ""
        return (
            f": an inverse singularity{locked}, the edge of what is in reach on this branch "
            f"(singular value {sigmas.driven:.3g})"
        )
    return f" (singular values: direct {sigmas.direct:.3g}, inverse {sigmas.driven:.3g})"


def over_bound(problem: Problem, over: Excess, i: int | None) -> Blocked:
    """Say which bound is passed at sample i + 1, or at the first one."""
    at = float(problem.times[0 if i is None else i + 1])
    unit = "rad" if over.angle else "m"
    if over.speed:
        message = (
            f"the speed limit of {over.name} cannot be kept up to t = {at:.6g} s: it would take "
            f"{over.value:.6g} {unit}/s, allowed {over.limit:.6g}"
        )
        return Blocked(at, message, Ending.SPEED)
    message = (
        f"{over.name} would leave its limits at t = {at:.6g} s: {over.value:.6g} {unit}, "
        f"allowed {over.limit:.6g}"
    )
    return Blocked(at, message, Ending.LIMIT)
