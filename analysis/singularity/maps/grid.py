"""The grid of a map: coordinates of a chart, their values, and what a cell can be found to be."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from closedchain.closure.chart import Chart, joint_index
from closedchain.closure.charting import At, chart_of
from closedchain.closure.given import by_name, real_array
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.modes.choosing import by_pose, mode_posture
from closedchain.urdf.errors import ClosureError

STATUSES = (
    "ok",
    "none found",
    "other branch",
    "joint limit",
    "not converged",
    "behind a limit",
)
OK, NONE_FOUND, OTHER_BRANCH, JOINT_LIMIT, NOT_CONVERGED, BEHIND_LIMIT = range(6)
UNSEEN = -1

MOST_COORDINATES = 6

_TURNS = {  # allowed values of the tip's rotation [rad], and how to say so
    **dict.fromkeys(("rx", "ry", "rz", "torsion"), (-np.pi, np.pi, "within -pi to pi")),
    "tilt": (0.0, np.pi, "within 0 to pi (use azimuth to lean the other way)"),
    "azimuth": (-2.0 * np.pi, 2.0 * np.pi, "within -2 pi to 2 pi"),
}
_ROUNDING = 1e-9  # that a value may lie beyond the end of its range


@dataclass(frozen=True, eq=False)
class Grid:
    """Values of some coordinates, the others held.

    Attributes
    ----------
    names : tuple of str
        Coordinates that vary, one an axis.
    values : tuple of (n_i,) arrays
        Rising values along each axis [m or rad].
    base : (n_inputs,) array
        Values of all inputs at the start.
    start : (nq,) array
        Closed posture whose branch is followed.
    chart : Chart
        What the coordinates mean, and what is held.
    mode : str
        Named posture that the branch was asked for by, home where only values are held elsewhere;
        empty where there was none.
    """

    names: tuple[str, ...]
    values: tuple[np.ndarray, ...]
    base: np.ndarray
    start: np.ndarray
    chart: Chart
    mode: str = ""

    @property
    def shape(self) -> tuple[int, ...]:
        """Cells along each axis."""
        return tuple(v.size for v in self.values)

    @property
    def size(self) -> int:
        """Number of cells, a Python integer: it may be beyond what fits an array."""
        size = 1
        for n in self.shape:
            size *= n
        return size

    def columns(self, mechanism: Mechanism) -> list[int]:
        """Position of each varying input among the inputs (grids of inputs only)."""
        return [mechanism.inputs.index(name) for name in self.names]

    def inputs(self, mechanism: Mechanism, cell: tuple[int, ...]) -> np.ndarray:
        """Input values (n_inputs,) of a cell (grids of inputs only)."""
        target = self.base.copy()
        target[self.columns(mechanism)] = [v[i] for v, i in zip(self.values, cell, strict=True)]
        return target

    def coordinates(self, cells: np.ndarray) -> np.ndarray:
        """Coordinates (n, k) [m or rad] of cells (n, k), given by their index along each axis."""
        return np.stack([v[cells[:, i]] for i, v in enumerate(self.values)], axis=1)


def grid_of(
    mechanism: Mechanism,
    over: Mapping[str, ArrayLike],
    at: At = None,
    *,
    outputs: str | Sequence[str] | None = None,
    mode: str | int | None = None,
) -> Grid:
    """Check what is asked for and find the posture to start from.

    Parameters
    ----------
    over : mapping of coordinate to rising values [m or rad]
    at : mapping of coordinate to value, or (nq,) array, optional
        What is held, or a closed posture on the branch that is meant; home by default.
    mode : str or int, optional
        Named posture or mode to start from, in the place of home, as ``cc.direct`` takes it; where
        tip coordinates vary, as ``cc.inverse`` does.

    Raises
    ------
    ClosureError
        Unknown coordinates or modes, values that do not rise or lie where no posture can be, held
        values that cannot be reached.
    """
    over = by_name(over, "over", "{'q1': np.linspace(0.1, 0.2, 50)}")
    names = tuple(str(name) for name in over)
    if len(names) > MOST_COORDINATES:
        raise ClosureError(
            f"a map varies at most {MOST_COORDINATES} coordinates, got {len(names)}: "
            f"{' '.join(names)}; hold some of them with at="
        )
    working = by_pose(mechanism, names)
    start = None if mode is None else mode_posture(mechanism, mode, working=working)
    if start is not None and at is not None and not isinstance(at, Mapping):
        raise ClosureError("give either a posture (at=) or a mode to start from, not both")
    values = tuple(_axis(name, v) for name, v in zip(names, over.values(), strict=True))
    for name, axis in zip(names, values, strict=True):
        _check_turn(mechanism, name, axis)
    for name, value in at.items() if isinstance(at, Mapping) else ():
        held = real_array(value, f"the value of {str(name)!r}", "a number")
        _check_turn(mechanism, str(name), np.atleast_1d(held))
    if start is None:
        chart = chart_of(mechanism, names, at, outputs)
    else:
        chart = chart_of(mechanism, names, at, outputs, start=start)
    for name, axis in zip(names, values, strict=True):
        _check_limits(chart, name, axis)
    inputs = chart.start[mechanism.input_q]
    asked = "home" if mode is None and isinstance(at, Mapping) else mode
    return Grid(names, values, inputs, chart.start, chart, "" if asked is None else str(asked))


def _axis(name: str, values: ArrayLike) -> np.ndarray:
    wanted = "at least two finite, rising numbers, such as np.linspace(0.1, 0.2, 50)"
    axis = real_array(values, f"values of {name!r}", wanted)
    if axis.ndim != 1 or axis.size < 2 or not np.isfinite(axis).all() or (np.diff(axis) <= 0).any():
        raise ClosureError(f"values of {name!r} must be {wanted}")
    return axis


def _check_turn(mechanism: Mechanism, name: str, values: np.ndarray) -> None:
    """Refuse rotations of the tip that would say again what smaller ones say."""
    if name not in _TURNS or name in mechanism.inputs:
        return
    low, high, allowed = _TURNS[name]
    outside = values[(values < low - _ROUNDING) | (values > high + _ROUNDING)]
    if outside.size:
        raise ClosureError(f"{name!r} must be {allowed} rad, got {outside[0]:g}")


def _check_limits(chart: Chart, name: str, values: np.ndarray) -> None:
    if name not in chart.joints:
        return
    index = joint_index(chart.mechanism, name)[0]
    low, high = (float(limit[index]) for limit in chart.mechanism.limits)
    if values[-1] < low or values[0] > high:
        unit = chart.unit(name)
        raise ClosureError(
            f"all values of {name!r}, {values[0]:g} to {values[-1]:g} {unit}, lie beyond its joint "
            f"limits {low:g} to {high:g} {unit}"
        )
