"""``follow``: a task over time, with what freedoms it leaves put to use."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from closedchain.analysis.first_order import OPEN
from closedchain.analysis.motion.follow.objectives import Measure, objective_of
from closedchain.analysis.motion.follow.problem import Limits, Problem, Speeds, bounds_of, locks_of
from closedchain.analysis.motion.follow.result import Follow, collected
from closedchain.analysis.motion.follow.stepping import run
from closedchain.analysis.motion.follow.task_path import Poses, as_route
from closedchain.analysis.motion.follow.whole_path import optimise
from closedchain.analysis.progress import reporting
from closedchain.closure.constraints import gaps
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.progress import Progress
from closedchain.closure.solve.newton import correct
from closedchain.closure.solve.system import System
from closedchain.urdf.errors import ClosureError, known_names

Method = Literal["gradient", "path"]
METHODS: tuple[Method, ...] = ("gradient", "path")
GAIN = 20.0
NODES = 25
ITERATIONS = 40


def follow(
    mechanism: Mechanism,
    task_path: Poses,
    *,
    times: ArrayLike | None = None,
    objective: Measure = "singularity",
    method: Method = "gradient",
    outputs: str | Sequence[str] | None = None,
    lock: str | Sequence[str] | Mapping[str, float] | None = None,
    limits: Limits | None = None,
    speed_limits: Speeds | None = None,
    start: ArrayLike | None = None,
    hold_start: bool = False,
    gain: float = GAIN,
    nodes: int = NODES,
    iterations: int = ITERATIONS,
    progress: bool | Progress = False,
) -> Follow:
    """Follow a task over time and use the freedoms that it leaves.

    Every sample is closed and on the task to 1e-12, whatever the method.

    Parameters
    ----------
    task_path : TaskPath, sequence of pin.SE3, callable, or tuple of arrays
        Poses of the tip in the world; a callable gives one for each of ``times``. A tuple is
        (times, positions), or (times, positions, tool axes or rotations), as for ``task_path``.
        Between samples the tip moves along a spline.
    times : (n,) array, optional
        Rising [s]; not with a ``TaskPath`` or a tuple, which have their own.
    objective : "singularity", "range", "speed" or callable
        What is to be large: the smaller one of sigma_direct and sigma_inverse (the latter with
        the locked inputs at rest); the distance of the inputs from their limits
        (1 in the middle, 0 at a limit); or what is to be small: the speed of the inputs. A
        callable gives a number, to be large, for a configuration (nq,).
    method : "gradient" or "path"
        "gradient" steps from sample to sample and climbs the objective's gradient projected on
        the null space; for "speed" this is the pseudo-inverse's motion. "path" takes the null
        motion along the whole path as a spline and raises the smallest value of the objective
        (for "speed": lowers the largest speed of an input).
    outputs : str or sequence of str, optional
        Components of the poses that are prescribed; those of the task by default.
    lock : str, sequence of str, or mapping of input to value, optional
        Inputs that stand still, where they are at ``start`` or at the values given.
    limits : mapping of input to (lower, upper), optional
        [m or rad] in place of the mechanism's own. The other joints keep theirs.
    speed_limits : float, mapping of input to float, or (n_inputs,) array, optional
        Largest speeds [m/s or rad/s], as means from sample to sample.
    start : (nq,) array, optional
        Closed posture whose branch is kept; home by default. The tip is led from there to the
        first sample in a straight line.
    hold_start : bool
        Keep "path" from choosing another posture at the first sample than "gradient" begins with.
    gain : float
        Null motion of "gradient", dimensionless per second and slope of the objective.
    nodes, iterations : int
        Of "path": spline coefficients for each freedom, and linear programmes at the most.
    progress : bool or callable
        True for a bar on a terminal, or a function of (what, done, total).

    Returns
    -------
    Follow
        Where the task cannot be followed (out of reach, a singularity, a limit), what was reached,
        ``converged`` False, and a message that says when and why.

    Raises
    ------
    ClosureError
        Malformed task, times, limits or start posture; unknown names; more inputs locked than
        there are freedoms beyond the outputs.

    Examples
    --------
    >>> m = cc.load("d1")
    >>> tips = m.point(m.home, "T") + np.outer([0.0, 0.5, 1.0], [0.0, -0.01, 0.0])
    >>> task = [0.0, 0.5, 1.0], tips
    >>> run = cc.follow(m, task, outputs="x y z rx rz", lock="q3")
    >>> run.converged, float(np.ptp(run.inputs[:, 2]))  # the third leg stands still
    (True, 0.0)
    """
    if method not in METHODS:
        raise ClosureError(known_names(str(method), "method", METHODS))
    if not (np.isfinite(gain) and gain >= 0.0):
        raise ClosureError(f"gain must not be negative, got {gain!r}")
    if nodes < 4 or iterations < 1:
        raise ClosureError(
            f"path needs 4 nodes and 1 iteration at least, got {nodes}, {iterations}"
        )
    names = mechanism.outputs(
        outputs if outputs is None or isinstance(outputs, str) else tuple(outputs)
    )
    measure = objective_of(objective)
    q = _closed(mechanism, mechanism.home if start is None else start)
    locks = locks_of(mechanism, lock, q)
    problem = Problem(
        mechanism,
        names,
        as_route(mechanism, task_path, times, names),
        tuple(locks),
        bounds_of(mechanism, limits, speed_limits),
    )
    spare = mechanism.model.nv - problem.rank
    if spare < 0:
        raise ClosureError(
            f"{' '.join(names)} are {len(names)} outputs; {mechanism.name!r} has "
            f"{spare + len(names)} freedoms"
        )
    if len(locks) > spare:
        raise ClosureError(
            f"{', '.join(locks)} cannot all be locked: the outputs {' '.join(names)} leave "
            f"{spare or 'no'} freedom{'s' * (spare != 1)}"
        )
    with reporting(progress) as report:
        if method == "path" and problem.freedoms:
            found, note = optimise(
                problem, locks, q, measure, gain, nodes, iterations, hold_start, report
            )
            return collected(problem, found, measure, locks, method, note)
        found = run(problem, locks, q, measure, gain, report)
        return collected(problem, found, measure, locks, method)


def _closed(mechanism: Mechanism, start: ArrayLike) -> np.ndarray:
    """Start posture, closed to the last digit where that is possible."""
    q = mechanism.configuration(start)
    residual = mechanism.workspace.residual(q)
    if np.abs(residual).max(initial=0.0) > OPEN:
        name, gap = gaps(mechanism, residual)[0]
        raise ClosureError(
            f"the start posture is not closed: closure {name} is open by {gap:.3g}; close it first "
            "(cc.close, cc.direct or cc.inverse)"
        )
    better = correct(System(mechanism, np.arange(mechanism.model.nv)), q)
    return q if better.refusal is not None else better.q
