"""What redundancy gains on a task: every lock beside the ways that use the freedoms."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from closedchain.analysis.motion.follow.following import METHODS, Method, follow
from closedchain.analysis.motion.follow.result import Follow
from closedchain.analysis.motion.follow.task_path import Poses
from closedchain.analysis.progress import reporting
from closedchain.analysis.redundancy import redundancy
from closedchain.closure.given import real_array
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.progress import Progress
from closedchain.urdf.errors import ClosureError


@dataclass(frozen=True)
class ComparisonRow:
    """One way to do a task.

    Attributes
    ----------
    name : str
        "q3 locked", "gradient", "path".
    locked : mapping of input to value
    converged : bool
    smallest : float
        Least distance to a singularity of the mechanism as it is driven: the smaller one of the two
        next; 0 unless the task is done.
    sigma_direct, sigma_driven : float
        Least values over the samples reached.
    sigma_inverse : float
        The same with all inputs moving: the measure that does not know of locks.
    reached : float
        Time up to which the task was done [s]; that of the start if it was not begun.
    fastest : float
        Largest input speed in units of its own [m/s or rad/s].
    message : str

    Examples
    --------
    >>> m = cc.load("d1")
    >>> tips = m.point(m.home, "T") + np.outer([0.0, 0.5, 1.0], [0.0, -0.01, 0.0])
    >>> table = cc.compare(m, ([0.0, 0.5, 1.0], tips), outputs="x y z rx rz", methods=["gradient"])
    >>> row = table.row("q3 locked")
    >>> list(row.locked), row.converged, row.smallest > 0.0
    (['q3'], True, True)
    """

    name: str
    locked: Mapping[str, float]
    converged: bool
    smallest: float
    sigma_direct: float
    sigma_driven: float
    sigma_inverse: float
    reached: float
    fastest: float
    message: str


@dataclass(frozen=True, eq=False)
class Comparison:
    """Rows of a comparison, and the runs behind them in the same order.

    Examples
    --------
    >>> m = cc.load("d1")
    >>> tips = m.point(m.home, "T") + np.outer([0.0, 0.5, 1.0], [0.0, -0.01, 0.0])
    >>> table = cc.compare(m, ([0.0, 0.5, 1.0], tips), outputs="x y z rx rz", methods=["gradient"])
    >>> table.row("gradient").converged
    True
    >>> table.best_free >= table.best_locked
    True
    """

    rows: tuple[ComparisonRow, ...]
    follows: tuple[Follow, ...]

    @property
    def best_locked(self) -> float:
        """Largest ``smallest`` of the rows with locked inputs; 0 if none did the task."""
        return max((r.smallest for r in self.rows if r.locked), default=0.0)

    @property
    def best_free(self) -> float:
        """Largest ``smallest`` of the rows without; 0 if none did the task."""
        return max((r.smallest for r in self.rows if not r.locked), default=0.0)

    @property
    def gain(self) -> float:
        """What using the redundancy adds to the least distance to a singularity."""
        return self.best_free - self.best_locked

    def row(self, name: str) -> ComparisonRow:
        """Row by name. Raises ``KeyError``."""
        return {r.name: r for r in self.rows}[name]

    @property
    def text(self) -> str:
        """The table."""
        width = max(len(r.name) for r in self.rows)
        head = f"{'':{width}}  smallest  direct  driven  inverse  speed   reached"
        lines = [head]
        for r in self.rows:
            numbers = (
                f"{r.smallest:8.4f}  {r.sigma_direct:6.4f}  {r.sigma_driven:6.4f}  "
                f"{r.sigma_inverse:7.4f}  {r.fastest:6.4f}  {r.reached:.4g} s"
            )
            lines.append(f"{r.name:{width}}  {numbers}" + ("" if r.converged else " (stopped)"))
        lines.append(
            f"least distance to a singularity: {self.best_free:.4f} with the redundancy, "
            f"{self.best_locked:.4f} with the best lock"
        )
        return "\n".join(lines)


def compare(
    mechanism: Mechanism,
    task_path: Poses,
    *,
    outputs: str | Sequence[str] | None = None,
    start: ArrayLike | None = None,
    methods: Sequence[Method] = METHODS,
    lock_values: Mapping[str, ArrayLike] | None = None,
    progress: bool | Progress = False,
    **options: Any,
) -> Comparison:
    """Follow a task with every admissible number of inputs locked, and with none.

    Parameters
    ----------
    methods : sequence of str
        Of ``follow``, for the rows with nothing locked.
    lock_values : mapping of input to (k,) array, optional
        More values [m or rad] at which to lock an input by itself; each input is locked at its
        value at ``start`` in any case.
    progress : bool or callable
        True for a bar on a terminal, or a function of (what, done, total).
    options
        As for ``follow``: times, objective, limits, speed_limits, ...

    Raises
    ------
    ClosureError
        As ``follow`` does, and where there is no freedom to compare locks of.

    Examples
    --------
    >>> m = cc.load("d1")
    >>> tips = m.point(m.home, "T") + np.outer([0.0, 0.5, 1.0], [0.0, -0.01, 0.0])
    >>> table = cc.compare(m, ([0.0, 0.5, 1.0], tips), outputs="x y z rx rz", methods=["gradient"])
    >>> [row.name for row in table.rows]
    ['q1 locked', 'q2 locked', 'q3 locked', 'q4 locked', 'q5 locked', 'q6 locked', 'gradient']
    """
    names = mechanism.outputs(
        outputs if outputs is None or isinstance(outputs, str) else tuple(outputs)
    )
    found = redundancy(mechanism, mechanism.home if start is None else start, names)
    if not found.locks:
        why = (
            f"{found.surplus} of its inputs are redundant as actuators, not as motions"
            if found.surplus > 0
            else "nothing is left to be locked"
        )
        raise ClosureError(
            f"{mechanism.name!r} has no redundant motion for outputs {' '.join(names)}: {why}"
        )
    ways: dict[str, dict[str, Any]] = {
        f"{' '.join(choice)} locked": {"lock": choice} for choice in found.locks
    }
    for name, values in (lock_values or {}).items():
        for value in np.atleast_1d(real_array(values, f"values of {name}")):
            ways[f"{name} = {value:.4g}"] = {"lock": {name: float(value)}}
    ways |= {method: {"method": method} for method in methods}
    common: dict[str, Any] = {"outputs": names, "start": start, **options}
    runs: dict[str, Follow] = {}
    with reporting(progress) as report:
        for name, way in ways.items():
            each = report is not None and _prefixed(report, name)
            runs[name] = follow(mechanism, task_path, progress=each, **way, **common)
    rows = tuple(_row(name, run) for name, run in runs.items())
    return Comparison(rows, tuple(runs.values()))


def _prefixed(report: Progress, name: str) -> Progress:
    """Progress of one run among several."""
    return lambda what, done, total: report(f"{name}: {what}", done, total)


def _row(name: str, run: Follow) -> ComparisonRow:
    least = {
        key: float(getattr(run, key).min()) if run.reached else 0.0
        for key in ("sigma_direct", "sigma_driven", "sigma_inverse")
    }
    times = run.problem.times
    return ComparisonRow(
        name=name,
        locked=run.locked,
        converged=run.converged,
        smallest=run.smallest if run.converged else 0.0,
        reached=float(times[max(run.reached - 1, 0)]),
        fastest=float(np.abs(run.input_speeds).max(initial=0.0)),
        message=run.message,
        **least,
    )
