"""A task over time: poses of the tip at given instants, from positions, tool axes or rotations."""

from __future__ import annotations

import csv
import math
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from closedchain.analysis.motion.track.routes import Route, route
from closedchain.closure.given import real_array
from closedchain.closure.mechanism import Mechanism
from closedchain.urdf.description import OUTPUTS
from closedchain.urdf.errors import ClosureError

_COLUMNS = ("t", "x", "y", "z")
_AXIS_COLUMNS = ("ax", "ay", "az")


@dataclass(frozen=True, eq=False)
class TaskPath:
    """Poses of the tip over time.

    Attributes
    ----------
    times : (n,) array
        Rising [s].
    poses : tuple of pin.SE3
        Of the tip in the world. Components that are no outputs are not used.
    name : str

    Examples
    --------
    >>> m = cc.load("linear_delta")
    >>> task = cc.task_path(m, [0.0, 1.0], [[0.0, 0.0, -0.6], [0.05, 0.0, -0.6]])
    >>> task.positions.shape, len(task.poses)
    ((2, 3), 2)
    """

    times: np.ndarray
    poses: tuple[pin.SE3, ...]
    name: str = "task"

    def __post_init__(self) -> None:
        """Write-protect the times."""
        times = np.array(self.times, dtype=float)
        times.setflags(write=False)
        object.__setattr__(self, "times", times)

    @property
    def positions(self) -> np.ndarray:
        """Tip positions (n, 3) [m], world."""
        return np.array([pose.translation for pose in self.poses]).reshape(-1, 3)


Poses = TaskPath | Sequence[pin.SE3] | Callable[[float], Any] | tuple[ArrayLike, ...]


def task_path(
    mechanism: Mechanism,
    times: ArrayLike,
    positions: ArrayLike,
    *,
    axes: ArrayLike | None = None,
    rotations: ArrayLike | None = None,
    outputs: str | tuple[str, ...] | list[str] | None = None,
    name: str = "task",
) -> TaskPath:
    """Task from positions of the tip, with its tool axis or rotation.

    Parameters
    ----------
    times : (n,) array
        Rising [s].
    positions : (n, 3) array
        Of the tip's origin in the world [m].
    axes : (n, 3) or (3,) array, optional
        Directions in the world of the tool axis: the tip axis that the outputs do not turn about,
        such as y for "x y z rx rz". The tip is turned there from home by the shortest way.
    rotations : (n, 3, 3) or (3, 3) array, optional
        Of the tip in the world; that of home where neither is given.
    outputs : str, optional
        Of the task; those of the description by default. They say which axis is the tool's.

    Raises
    ------
    ClosureError
        Malformed numbers, both axes and rotations, or axes for outputs without a tool axis.

    Examples
    --------
    >>> m = cc.load("linear_delta")
    >>> times = np.linspace(0.0, 1.0, 11)
    >>> line = np.array([0.0, 0.0, -0.6]) + np.outer(times, [0.05, 0.0, 0.0])
    >>> cc.follow(m, cc.task_path(m, times, line)).converged
    True
    """
    places = _numbers(positions, "positions", (3,))
    instants = np.atleast_1d(real_array(times, "times"))
    if axes is not None and rotations is not None:
        raise ClosureError("give axes or rotations of the tip, not both")
    home = mechanism.pose(mechanism.home).rotation
    if rotations is not None:
        turns = _numbers(rotations, "rotations", (3, 3), len(places))
        if np.abs(turns @ turns.swapaxes(1, 2) - np.eye(3)).max() > 1e-6:
            raise ClosureError("rotations must be rotation matrices (3, 3)")
    elif axes is not None:
        k = tool_axis(mechanism, outputs)
        wanted = _numbers(axes, "axes", (3,), len(places))
        turns = np.array([_turned(home, k, axis) for axis in wanted])
    else:
        turns = np.broadcast_to(home, (len(places), 3, 3))
    poses = tuple(pin.SE3(np.array(r), p) for r, p in zip(turns, places, strict=True))
    route(mechanism, list(poses), instants, None, None)  # checks the times
    return TaskPath(instants, poses, name)


def read_task_path(
    mechanism: Mechanism,
    path: str | os.PathLike[str],
    *,
    outputs: str | tuple[str, ...] | list[str] | None = None,
) -> TaskPath:
    """Task from a CSV file with columns t, x, y, z and, if wanted, ax, ay, az (tool axis).

    Raises
    ------
    ClosureError
        Missing columns, rows that are no numbers, or what ``task_path`` refuses.

    Examples
    --------
    >>> m = cc.load("linear_delta")
    >>> import pathlib, tempfile
    >>> file = pathlib.Path(tempfile.mkdtemp(), "line.csv")
    >>> rows = [[0.0, 0.0, 0.0, -0.6], [1.0, 0.05, 0.0, -0.6]]
    >>> np.savetxt(file, rows, delimiter=",", header="t,x,y,z", comments="")
    >>> cc.read_task_path(m, file).times.tolist()
    [0.0, 1.0]
    """
    with Path(path).open(newline="") as file:
        reader = csv.DictReader(file, skipinitialspace=True)
        found = tuple(reader.fieldnames or ())
        missing = [n for n in _COLUMNS if n not in found]
        if missing:
            raise ClosureError(
                f"{path}: no column {', '.join(missing)}; expected t x y z and, for a tool axis, "
                "ax ay az"
            )
        axis = [n for n in _AXIS_COLUMNS if n in found]
        if 0 < len(axis) < len(_AXIS_COLUMNS):
            raise ClosureError(f"{path}: a tool axis takes ax ay az, and only {axis} is there")
        names = (*_COLUMNS, *axis)
        rows = []
        for line in reader:
            where = f"{path}, line {reader.line_num}"
            rows.append([_number(line[n], f"{where}: {{}} in column {n}") for n in names])
    if not rows:
        raise ClosureError(f"{path}: no rows")
    table = np.array(rows)
    try:
        return task_path(
            mechanism,
            table[:, 0],
            table[:, 1:4],
            axes=table[:, 4:] if table.shape[1] > 4 else None,
            outputs=outputs,
            name=Path(path).stem,
        )
    except ClosureError as error:
        raise ClosureError(f"{path}: {error}") from None


def _number(text: str | None, message: str) -> float:
    """A finite number. Raises ``ClosureError``, with what is wrong put into the message."""
    try:
        value = float(text or "")
    except ValueError:
        raise ClosureError(f"{message.format('not a number')}: {text or ''!r}") from None
    if not math.isfinite(value):
        raise ClosureError(f"{message.format('not a finite number')}: {text!r}")
    return value


def tool_axis(
    mechanism: Mechanism, outputs: str | tuple[str, ...] | list[str] | None = None
) -> int:
    """Number (0, 1, 2) of the tip axis whose direction the outputs prescribe.

    Raises
    ------
    ClosureError
        Outputs without exactly two rotations.
    """
    names = mechanism.outputs(outputs)
    turning = {OUTPUTS.index(n) - 3 for n in names if n in OUTPUTS[3:]}
    if len(turning) != 2:
        raise ClosureError(
            f"outputs {' '.join(names)} have no tool axis: that takes two rotations, such as rx rz"
        )
    return ({0, 1, 2} - turning).pop()


def as_route(
    mechanism: Mechanism,
    path: Poses,
    times: ArrayLike | None,
    outputs: str | tuple[str, ...] | list[str] | None = None,
) -> Route:
    """Route of a task, which must have times. Raises ``ClosureError``."""
    if isinstance(path, tuple) and not any(isinstance(p, pin.SE3) for p in path):
        path = _from_arrays(mechanism, path, outputs)
    if isinstance(path, TaskPath):
        if times is not None:
            raise ClosureError("this task has its own times; give times= with a list of poses only")
        found = route(mechanism, list(path.poses), path.times, None, None)
    else:
        if times is None:
            raise ClosureError("a task needs times: give times= [s], or a task_path")
        found = route(mechanism, path, times, None, None)
    if found.inputs is not None:
        raise ClosureError("a task is a path of poses of the tip; for one of inputs use cc.track")
    return found


def _from_arrays(
    mechanism: Mechanism,
    arrays: tuple[Any, ...],
    outputs: str | tuple[str, ...] | list[str] | None,
) -> TaskPath:
    """Task from (times, positions) or (times, positions, axes or rotations)."""
    if len(arrays) not in (2, 3):
        raise ClosureError(
            "a task as a tuple is (times, positions), or (times, positions, tool axes or "
            f"rotations); got {len(arrays)} entries"
        )
    if len(arrays) == 2:
        return task_path(mechanism, *arrays)
    times, positions, turns = arrays
    shape, n = np.shape(turns), np.size(times)
    if len(shape) == 3 or (shape == (3, 3) and n != 3):
        return task_path(mechanism, times, positions, rotations=turns)
    return task_path(mechanism, times, positions, axes=turns, outputs=outputs)


def _turned(home: np.ndarray, k: int, axis: np.ndarray) -> np.ndarray:
    """Home's rotation, turned the shortest way so that its column ``k`` points along ``axis``."""
    size = float(np.linalg.norm(axis))
    if not size > 0.0:
        raise ClosureError("axes: a direction of length zero")
    u, a = home[:, k], axis / size
    across = np.cross(u, a)
    sine = float(np.linalg.norm(across))
    if sine < 1e-15:
        if u @ a > 0.0:
            return home
        return np.asarray(pin.exp3(np.pi * home[:, (k + 1) % 3]) @ home)
    return np.asarray(pin.exp3(np.arctan2(sine, u @ a) * across / sine) @ home)


def _numbers(values: ArrayLike, what: str, tail: tuple[int, ...], n: int | None = None) -> Any:
    """Check an (n, *tail) array of finite numbers; (tail) stands for all n rows."""
    table = real_array(values, what, "an array of numbers")
    if n is not None and table.shape == tail:
        table = np.broadcast_to(table, (n, *tail))
    if (
        table.shape[1:] != tail
        or table.ndim != 1 + len(tail)
        or (n is not None and len(table) != n)
    ):
        shape = ", ".join(map(str, ("n" if n is None else n, *tail)))
        raise ClosureError(f"{what} must have shape ({shape}), got {table.shape}")
    if not np.isfinite(table).all():
        raise ClosureError(f"{what} has entries that are not finite")
    return table
