"""The outcome of following a task: postures, inputs and measures over time, and their export."""

from __future__ import annotations

import csv
import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from closedchain.analysis.motion.follow.objectives import Objective
from closedchain.analysis.motion.follow.problem import Problem
from closedchain.analysis.motion.follow.rates import joint_rates
from closedchain.analysis.motion.follow.stepping import Run
from closedchain.analysis.structure.mobility import generic_rank
from closedchain.closure.solve.outcome import Ending
from closedchain.closure.task import goal, goal_rows
from closedchain.urdf.errors import ClosureError
from closedchain.urdf.extras import require

if TYPE_CHECKING:
    import xarray as xr


@dataclass(frozen=True, eq=False)
class Follow:
    """A task followed, as far as it could be.

    Attributes
    ----------
    times : (reached,) array
        Of the samples reached, from the first on [s].
    q : (reached, nq) array
    inputs, input_speeds : (reached, n_inputs) arrays
        [m or rad] and [m/s or rad/s]; speeds by the velocity equation, the null motion's part by
        differences between samples.
    sigma_direct, sigma_inverse, sigma_constraint : (reached,) arrays
        Dimensionless singular values that vanish at singularities, as ``cc.classify`` gives them.
    sigma_driven : (reached,) array
        The inverse one of the mechanism with its locks; ``sigma_inverse`` where nothing is locked.
    measure : (reached,) array
        The objective; with an objective "speed" the negative dimensionless input speed.
    residual, task_error : (reached,) arrays
        Largest row of the closures, and of the tip against the task [m or rad].
    converged : bool
        Every sample was reached within the limits.
    stopped : float or None
        Time at which a sample could not be reached, or a limit not be kept.
    ending : Ending
        Why it ended, in a word.
    message : str
    locked : mapping of input to value
        Inputs that were locked [m or rad].
    objective, method : str

    Examples
    --------
    >>> m = cc.load("d1")
    >>> tips = m.point(m.home, "T") + np.outer([0.0, 0.5, 1.0], [0.0, -0.01, 0.0])
    >>> run = cc.follow(m, ([0.0, 0.5, 1.0], tips), outputs="x y z rx rz")
    >>> run.inputs.shape, bool(run.task_error.max() < 1e-12)
    ((3, 6), True)
    >>> run.smallest > 0.1  # least distance to a singularity on the way
    True
    """

    times: np.ndarray
    q: np.ndarray
    inputs: np.ndarray
    input_speeds: np.ndarray
    sigma_direct: np.ndarray
    sigma_inverse: np.ndarray
    sigma_constraint: np.ndarray
    sigma_driven: np.ndarray
    measure: np.ndarray
    residual: np.ndarray
    task_error: np.ndarray
    converged: bool
    stopped: float | None
    ending: Ending
    message: str
    locked: dict[str, float]
    objective: str
    method: str
    problem: Problem = field(repr=False)

    def __post_init__(self) -> None:
        """Write-protect the arrays."""
        for value in vars(self).values():
            if isinstance(value, np.ndarray):
                value.setflags(write=False)

    @property
    def reached(self) -> int:
        """Number of samples reached."""
        return len(self.times)

    @property
    def distance(self) -> np.ndarray:
        """Smaller one of ``sigma_direct`` and ``sigma_driven`` (reached,): 0 at a singularity."""
        return np.minimum(self.sigma_direct, self.sigma_driven)

    @property
    def smallest(self) -> float:
        """Least distance to a singularity along what was reached; 0 if nothing was."""
        return float(self.distance.min()) if self.reached else 0.0

    def raise_if_failed(self) -> Follow:
        """Return the result itself, or raise ``ClosureError`` with its message."""
        if not self.converged:
            raise ClosureError(self.message)
        return self

    def to_dataset(self) -> xr.Dataset:
        """Everything over time as an ``xarray.Dataset`` with units."""
        require("a dataset is made with xarray", "maps")
        import xarray as xr

        m = self.problem.mechanism
        per_input = {"units": " ".join(m.input_units)}
        found = xr.Dataset(
            {
                "inputs": (("time", "input"), self.inputs.copy(), per_input),
                "input_speeds": (
                    ("time", "input"),
                    self.input_speeds.copy(),
                    {"units": " ".join(f"{u}/s" for u in m.input_units)},
                ),
                "q": (("time", "configuration"), self.q.copy()),
                **{
                    name: ("time", getattr(self, name).copy(), {"units": "1"})
                    for name in (
                        "sigma_direct",
                        "sigma_inverse",
                        "sigma_constraint",
                        "sigma_driven",
                        "measure",
                    )
                },
                **{
                    name: ("time", getattr(self, name).copy(), {"units": "m or rad"})
                    for name in ("residual", "task_error")
                },
            },
            coords={"time": ("time", self.times.copy(), {"units": "s"}), "input": list(m.inputs)},
            attrs={
                "mechanism": m.name,
                "outputs": " ".join(self.problem.outputs),
                "objective": self.objective,
                "method": self.method,
                "locked": " ".join(self.locked),
                "converged": int(self.converged),
                "message": self.message,
            },
        )
        return found

    def to_csv(self, path: str | os.PathLike[str]) -> Path:
        """Write one row a sample: time, place of the tip, inputs, speeds, measures.

        Raises ``OSError``.
        """
        m = self.problem.mechanism
        units = dict(zip(m.inputs, m.input_units, strict=True))
        tip = np.array([m.pose(q).translation for q in self.q]).reshape(-1, 3)
        columns = {
            "t [s]": self.times,
            **{f"{n} [m]": tip[:, i] for i, n in enumerate("xyz")},
            **{f"{n} [{u}]": self.inputs[:, i] for i, (n, u) in enumerate(units.items())},
            **{f"d{n} [{u}/s]": self.input_speeds[:, i] for i, (n, u) in enumerate(units.items())},
            "sigma_direct": self.sigma_direct,
            "sigma_inverse": self.sigma_inverse,
            "sigma_constraint": self.sigma_constraint,
            "sigma_driven": self.sigma_driven,
            "measure": self.measure,
            "residual": self.residual,
            "task_error": self.task_error,
        }
        target = Path(path)
        with target.open("w", newline="") as file:
            writer = csv.writer(file)
            writer.writerow(columns)
            writer.writerows([float(x) for x in row] for row in zip(*columns.values(), strict=True))
        return target


def collected(
    problem: Problem,
    run: Run,
    objective: Objective,
    locks: dict[str, float],
    method: str,
    note: str = "",
) -> Follow:
    """Result of a run."""
    m, reached = problem.mechanism, len(run.postures)
    times = np.array(problem.times[:reached])
    q = np.array([p.q for p in run.postures]).reshape(reached, m.model.nq)
    inputs = q[:, m.input_q]
    speeds = joint_rates(problem, run.postures)[:, m.input_v]
    measure = np.array([objective.value(problem, p) for p in run.postures])
    if objective.name == "speed":
        measure = -np.linalg.norm(speeds / m.column_scale[m.input_v], axis=1)
    gaps = [_gaps(problem, p.q, i) for i, p in enumerate(run.postures)]
    blocked = run.blocked
    held = f", {' '.join(locks)} locked" if locks else ""
    if blocked is None:
        worst = min((p.sigmas.smallest for p in run.postures), default=0.0)
        done = f"all {reached} samples" if reached > 1 else f"{reached} sample"
        message = f"{done} reached{held}; least distance to a singularity {worst:.4g}"
        message += _idle(problem)
    else:
        message = f"{blocked.message}; {reached} of {problem.route.size} samples reached{held}"
    return Follow(
        times=times,
        q=q,
        inputs=inputs,
        input_speeds=speeds,
        sigma_direct=np.array([p.sigmas.direct for p in run.postures]),
        sigma_inverse=np.array([p.sigmas.inverse for p in run.postures]),
        sigma_constraint=np.array([p.sigmas.constraint for p in run.postures]),
        sigma_driven=np.array([p.sigmas.driven for p in run.postures]),
        measure=measure,
        residual=np.array([gap[0] for gap in gaps]),
        task_error=np.array([gap[1] for gap in gaps]),
        converged=blocked is None,
        stopped=None if blocked is None else blocked.time,
        ending=Ending.ARRIVED if blocked is None else blocked.ending,
        message=message + note,
        locked=dict(locks),
        objective=objective.name,
        method=method,
        problem=problem,
    )


def _idle(problem: Problem) -> str:
    """Say so where the objective has no freedom to act on."""
    if problem.freedoms or problem.locked:
        return ""
    m = problem.mechanism
    surplus = len(m.inputs) - (m.model.nv - generic_rank(m))
    if surplus > 0:
        return (
            f"; the outputs leave no freedom: {len(m.inputs)} inputs for "
            f"{len(m.inputs) - surplus} freedoms are redundancy of actuation, which the objective "
            "cannot use"
        )
    return "; the outputs leave no freedom for the objective"


def _gaps(problem: Problem, q: np.ndarray, i: int) -> tuple[float, float]:
    """Largest row of the closures and of the task."""
    m = problem.mechanism
    loops = m.workspace.evaluate(q)[0]
    tip = m.required_task().tip
    rows, _ = goal_rows(m, goal(m, tip, problem.route.sample(i), problem.outputs))
    return float(np.abs(loops).max(initial=0.0)), float(np.abs(rows).max())
