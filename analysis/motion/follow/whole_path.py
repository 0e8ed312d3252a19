"""The null motion of a whole path at once: sequential linear programming over spline coefficients.

About the postures of the last iterate, sample i may move by N_i z_i along its null space basis,
with z_i = B(t_i) c from a cubic B-spline. Linearised there: the numbers whose smallest is to be
raised, the joints' limits, the speeds between neighbouring samples. The linear programme raises the
smallest number (epigraph form), and with lesser weight the mean of each sample's smallest one, and
keeps the spline from bending needlessly. Each new iterate is corrected onto the task to 1e-12 and
taken only if its true merit is better; the coefficients are kept within a trust region.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from closedchain.analysis.motion.follow.bounding import TOLERANCE, excess
from closedchain.analysis.motion.follow.objectives import InputSpeed, Objective
from closedchain.analysis.motion.follow.postures import Posture
from closedchain.analysis.motion.follow.problem import Problem
from closedchain.analysis.motion.follow.programme import BEND, MEAN, PENALTY, programme
from closedchain.analysis.motion.follow.stepping import Run, corrected, over_bound, run
from closedchain.closure.progress import Progress

_RADIUS, _LARGEST_RADIUS, _SMALLEST_RADIUS = 0.1, 0.4, 1e-3
_EXTENSIONS = 10
_ENOUGH = 1e-5  # gain in merit of an iteration that is not worth another


@dataclass(frozen=True, eq=False)
class _Iterate:
    """Postures at all samples, and how good they are."""

    postures: tuple[Posture, ...]
    smallest: float
    mean: float
    violation: float
    shape: np.ndarray

    def merit(self) -> float:
        """What is raised: the bending of the whole null motion counts as in the programme."""
        bend = float(np.abs(np.diff(self.shape, 2, axis=0)).sum())
        return self.smallest + MEAN * self.mean - BEND * bend - PENALTY * self.violation


def optimise(
    problem: Problem,
    locks: dict[str, float],
    start: np.ndarray,
    objective: Objective,
    gain: float,
    nodes: int,
    iterations: int,
    hold_start: bool,
    report: Progress | None = None,
) -> tuple[Run, str]:
    """Raise the smallest value of the objective along the path.

    Begins with the better one of two paths: that of the gradient, and the one whose null motion is
    at rest. Where neither gets through, the part that is reached is raised by itself and followed
    on from its end, as long as this leads further.

    Returns
    -------
    Run, str
        And a note on the iterations for the message.
    """
    unlimited = replace(problem, enforced=False)
    search = _Search(problem, objective, nodes, hold_start)
    climbed = limited = run(problem, locks, start, objective, gain, report)
    if climbed.blocked is not None:
        climbed = run(unlimited, locks, start, objective, gain)
    tried = [climbed, run(unlimited, locks, start, None, gain)]
    if all(one.blocked is not None for one in tried):
        tried = [max(tried, key=lambda one: len(one.postures))]
        # raise the part that is reached, which turns its end away from what blocks it; go on
        for _ in range(_EXTENSIONS):
            so_far = tried[0].postures
            if len(so_far) < 2:
                break
            raised, _ = search.raised(search.judged(so_far), iterations)
            more = run(unlimited, locks, start, objective, gain, onward=raised.postures)
            tried = [max(more, tried[0], key=lambda one: len(one.postures))]
            if more.blocked is None or len(more.postures) <= len(so_far):
                break
    through = [search.judged(one.postures) for one in tried if one.blocked is None]
    if not through:
        kept = _checked(problem, tried[0])
        return max(kept, limited, key=lambda one: len(one.postures)), ""
    best, done = search.raised(max(through, key=_Iterate.merit), iterations, report)
    return _checked(problem, Run(best.postures, None)), f"; {done} linear programmes"


@dataclass(frozen=True, eq=False)
class _Search:
    """Raising the merit of a path, or of its first samples."""

    problem: Problem
    objective: Objective
    nodes: int
    hold_start: bool

    def judged(self, postures: tuple[Posture, ...]) -> _Iterate:
        """Path as an iterate to begin with."""
        shape = np.zeros((min(self.nodes, len(postures)), self.problem.freedoms))
        return _judged(self.problem, self.objective, postures, shape)

    def raised(
        self, now: _Iterate, iterations: int, report: Progress | None = None
    ) -> tuple[_Iterate, int]:
        """Best iterate found, and the number of programmes solved."""
        spline = _basis(self.problem.times[: len(now.postures)], self.nodes)
        radius, done = _RADIUS, 0
        while done < iterations and radius >= _SMALLEST_RADIUS:
            done += 1
            step = programme(
                self.problem,
                self.objective,
                now.postures,
                now.shape,
                spline,
                radius,
                self.hold_start,
            )
            trial = None
            if step is not None:
                trial = _moved(self.problem, self.objective, now, spline, step)
            better = -np.inf if trial is None else trial.merit() - now.merit()
            if step is not None and trial is not None and better > 0.0:
                full = np.abs(step).max() > 0.9 * radius
                now, radius = trial, min(2.0 * radius, _LARGEST_RADIUS) if full else radius
                if better < _ENOUGH and not now.violation:
                    break
            else:
                radius *= 0.35
            if report is not None:
                report("whole path", done, iterations)
        return now, done


def _checked(problem: Problem, found: Run) -> Run:
    """The samples of a run up to the first bound that it passes."""
    before: np.ndarray | None = None
    for i, p in enumerate(found.postures):
        over = excess(problem, p.q, before, max(i - 1, 0))
        if over is not None:
            return Run(found.postures[:i], over_bound(problem, over, i - 1 if i else None))
        before = p.q
    return found


def _basis(times: np.ndarray, nodes: int) -> np.ndarray:
    """Cubic B-splines (n, nodes) at the samples, clamped at both ends; the identity if fewer."""
    if times.size <= nodes:
        return np.eye(times.size)
    from scipy.interpolate import BSpline

    inner = np.linspace(times[0], times[-1], nodes - 2)
    knots = np.concatenate([[times[0]] * 3, inner, [times[-1]] * 3])
    return np.asarray(BSpline.design_matrix(times, knots, 3).toarray())


def _judged(
    problem: Problem,
    objective: Objective,
    postures: tuple[Posture, ...],
    shape: np.ndarray,
) -> _Iterate:
    if isinstance(objective, InputSpeed):
        values = -_speeds(problem, postures).max(axis=1)
    else:
        values = np.array([objective.value(problem, p) for p in postures])
    violation, before = 0.0, None
    for i, p in enumerate(postures):
        violation = max(violation, _violation(problem, p, before, max(i - 1, 0)))
        before = p.q
    return _Iterate(postures, float(values.min()), float(values.mean()), violation, shape)


def _speeds(problem: Problem, postures: tuple[Posture, ...]) -> np.ndarray:
    """Dimensionless input speeds (n - 1, n_inputs) between the samples."""
    m = problem.mechanism
    inputs = np.array([p.q for p in postures])[:, m.input_q] / m.column_scale[m.input_v]
    return np.asarray(
        np.abs(np.diff(inputs, axis=0)) / np.diff(problem.times[: len(postures)])[:, None]
    )


def _violation(problem: Problem, at: Posture, before: np.ndarray | None, i: int) -> float:
    """Dimensionless excess over limits, and excess way over speed limits, at one sample."""
    b, m = problem.bounds, problem.mechanism
    over = np.maximum(b.lower - at.q[b.in_q], at.q[b.in_q] - b.upper) / m.column_scale[b.in_v]
    worst = float(over.max(initial=0.0)) - 0.5 * TOLERANCE
    if before is not None and b.speeds is not None:
        dt = float(problem.times[i + 1] - problem.times[i])
        most = (1.0 + 0.5 * TOLERANCE) * b.speeds * dt
        way = np.abs((at.q - before)[m.input_q]) - most
        worst = max(worst, float((way / m.column_scale[m.input_v]).max()))
    return max(worst, 0.0)


def _moved(
    problem: Problem, objective: Objective, now: _Iterate, spline: np.ndarray, step: np.ndarray
) -> _Iterate | None:
    """Iterate after a step of the coefficients (nodes, k); None where a sample is lost."""
    ways = spline @ step
    found: list[Posture] = []
    for i, (p, z) in enumerate(zip(now.postures, ways, strict=True)):
        moved = corrected(problem, p, z, i, before=found[-1].basis if found else None)
        if moved is None:
            return None
        found.append(moved)
    return _judged(problem, objective, tuple(found), now.shape + step)
