"""What a survey looks at when it is not told: slices, ranges, numbers of points."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from closedchain.analysis.singularity.maps.grid import OK
from closedchain.analysis.singularity.maps.mapping import singularity_map
from closedchain.closure.chart import Chart, joint_index
from closedchain.closure.charting import chart_of
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.modes.choosing import by_pose, mode_posture
from closedchain.urdf.errors import ClosureError

if TYPE_CHECKING:
    import xarray as xr

RESOLUTION = {1: 401, 2: 101, 3: 25}
"""Points along an axis, by the number of coordinates of a slice."""
MOST_POINTS = 5000
SPAN = 1.0
"""Half width of a range, in characteristic lengths or radians, clipped to the joint limits."""
WIDEST_TILT = np.radians(100.0)
"""Default range of the tilt: singularities with the tool level are well inside."""

_COARSE = {1: 41, 2: 15, 3: 9}  # points along an axis of the map that ranges are fitted with
_GROWN = 1.7  # by which a range is widened in which nothing ends
_GROWTHS = 5  # times: to fourteen characteristic lengths, or all the way round
_SHRUNK = 0.6  # a range is fitted where the branch takes less than this share of it
_ROUNDS = 4

Names = tuple[str, ...]
Range = tuple[float, float]


@dataclass(frozen=True)
class Wanted:
    """What is asked of the axes of all slices.

    Attributes
    ----------
    ranges : mapping of coordinate to (lowest, highest) [m or rad]
    resolution : int, mapping of coordinate to int, or None
        Points along axes; ``RESOLUTION`` where nothing is said.
    span : float or None
        Half width of ranges not given, around the start; None fits them to the branch.
    """

    ranges: Mapping[str, Range] = field(default_factory=dict)
    resolution: int | Mapping[str, int] | None = None
    span: float | None = None


def default_slices(mechanism: Mechanism, outputs: Names) -> list[Names]:
    """Slices of input space, then of the workspace.

    The first two inputs and, with four or more, the two that begin the second half; the first two
    positions among the outputs, and tilt and azimuth where there are two rotations or more.
    """
    inputs = mechanism.inputs
    slices = [inputs[:2]] if inputs else []
    if len(inputs) >= 4:
        half = len(inputs) // 2
        slices.append((inputs[half], inputs[half + 1]))
    linear = tuple(n for n in outputs if n in "xyz")[:2]
    angular = tuple(n for n in outputs if n not in "xyz")
    if linear:
        slices.append(linear)
    if len(angular) >= 2:
        slices.append(("tilt", "azimuth"))
    elif not linear and angular:
        slices.append(angular)
    return slices


def check_slices(slices: Sequence[Names]) -> None:
    """Refuse slices that are none. Raises ``ClosureError``."""
    for names in slices:
        if not 1 <= len(names) <= 3 or len(set(names)) < len(names):
            raise ClosureError(
                f"a slice needs one to three different coordinates, got {' '.join(names)}"
            )
    if len({frozenset(names) for names in slices}) < len(slices):
        raise ClosureError("the same slice is asked for twice")


def axes_of_slice(
    mechanism: Mechanism,
    names: Names,
    at: Mapping[str, float],
    wanted: Wanted,
    *,
    outputs: Names,
    mode: str | None = None,
) -> dict[str, np.ndarray]:
    """Values along each axis of a slice [m or rad].

    Ranges that are neither given nor of a given span are widened until a coarse map shows a
    singular set, or the branch's end or a limit, and shrunk to where it finds the branch.

    Raises
    ------
    ClosureError
        Unknown coordinates or mode, bad ranges or numbers of points, a start from which the slice
        cannot be followed.
    """
    working = by_pose(mechanism, names)
    start = None if mode is None else mode_posture(mechanism, mode, working=working)
    chart = chart_of(mechanism, names, dict(at) or None, outputs, start=start)
    points = {name: _points(wanted.resolution, name, len(names)) for name in names}
    span = SPAN if wanted.span is None else wanted.span
    if not (np.isfinite(span) and span > 0.0):
        raise ClosureError(f"span must be finite and above zero, got {span:g}")
    centre = dict(zip(names, chart.values(chart.start).tolist(), strict=True))
    ranges = {
        name: _given(name, wanted.ranges[name])
        if name in wanted.ranges
        else _around(chart, name, centre[name], span, fitted=wanted.span is None)
        for name in names
    }
    free = [name for name in names if name not in wanted.ranges and name not in ("tilt", "azimuth")]
    if wanted.span is None and free:
        coarse = _Coarse(chart, dict(at), outputs, mode)
        ranges = _fitted(coarse, _grown(coarse, ranges, free, centre), free, centre)
    return {name: np.linspace(*ranges[name], points[name]) for name in names}


def _points(resolution: int | Mapping[str, int] | None, name: str, k: int) -> int:
    n = resolution.get(name) if isinstance(resolution, Mapping) else resolution
    n = RESOLUTION[k] if n is None else n
    if not 3 <= n <= MOST_POINTS:
        raise ClosureError(f"{name} must have between 3 and {MOST_POINTS} points, got {n}")
    return n


def _given(name: str, given: Range) -> Range:
    low, high = map(float, given)
    if not (np.isfinite([low, high]).all() and low < high):
        raise ClosureError(f"range of {name} must rise and be finite, got {low:g} to {high:g}")
    return low, high


def _around(chart: Chart, name: str, centre: float, span: float, *, fitted: bool) -> Range:
    """Range around the start, clipped to what the coordinate can be."""
    if name == "azimuth":
        return -np.pi, np.pi
    if name == "tilt":
        return 0.0, min(np.pi, centre + WIDEST_TILT if fitted else centre + span)
    half = span * (chart.mechanism.length if chart.unit(name) == "m" else 1.0)
    low, high = centre - half, centre + half
    if name in chart.joints:
        index = joint_index(chart.mechanism, name)[0]
        low = max(low, float(chart.mechanism.limits[0][index]))
        high = min(high, float(chart.mechanism.limits[1][index]))
    elif chart.unit(name) == "rad":
        low, high = max(low, -np.pi), min(high, np.pi)
    if chart.unit(name) == "rad":  # once round is all there is
        low, high = max(low, centre - np.pi), min(high, centre + np.pi)
    if not low < high:
        raise ClosureError(
            f"{name} starts at {centre:g}, beyond its joint limits: give its range, {name}=lo:hi"
        )
    return low, high


@dataclass(frozen=True, eq=False)
class _Coarse:
    """Coarse maps that ranges are fitted with."""

    chart: Chart
    at: dict[str, float]
    outputs: Names
    mode: str | None

    def over(self, ranges: Mapping[str, Range]) -> xr.Dataset | None:
        """Map over ranges, or None: no coarse cell near the start can be reached."""
        axes = {name: np.linspace(*ends, _COARSE[len(ranges)]) for name, ends in ranges.items()}
        try:
            return singularity_map(
                self.chart.mechanism, axes, self.at or None,
                mode=self.mode, outputs=self.outputs, progress=False,
            )  # fmt: skip
        except ClosureError:
            return None


def _grown(
    coarse: _Coarse, ranges: dict[str, Range], free: list[str], centre: Mapping[str, float]
) -> dict[str, Range]:
    """Ranges of the free coordinates widened until something is to be seen in them."""
    span = SPAN
    for _ in range(_GROWTHS):
        found = coarse.over(ranges)
        if found is None or _shows(found):
            break
        span *= _GROWN
        wider = ranges | {
            name: _around(coarse.chart, name, centre[name], span, fitted=True) for name in free
        }
        if wider == ranges:
            break
        ranges = wider
    return ranges


def _shows(found: xr.Dataset) -> bool:
    """Whether a map has cells off the branch, or a sign change of a determinant on it."""
    ok = found["status"].to_numpy() == OK
    if not ok.all():
        return True
    for name in ("det_direct", "det_inverse"):
        if name in found:
            signs = np.sign(found[name].to_numpy())
            if signs.min() < signs.max():
                return True
    return False


def _fitted(
    coarse: _Coarse, ranges: dict[str, Range], free: list[str], centre: Mapping[str, float]
) -> dict[str, Range]:
    """Ranges of the free coordinates shrunk around the start to where the branch is."""
    for _ in range(_ROUNDS):
        found = coarse.over(ranges)
        if found is None:  # the start may lie in a narrow region
            ranges = _narrowed(ranges, centre, dict.fromkeys(free, 0.3))
            continue
        ok = np.argwhere(found["status"].to_numpy() == OK)
        shares = {}
        for i, name in enumerate(ranges):
            axis = found[name].to_numpy()
            if name in free:
                reach = float(np.abs(axis[ok[:, i]] - centre[name]).max()) + (axis[1] - axis[0])
                share = reach / max(axis[-1] - centre[name], centre[name] - axis[0])
                if share < _SHRUNK:
                    shares[name] = share
        if not shares:
            break
        ranges = _narrowed(ranges, centre, shares)
    return ranges


def _narrowed(
    ranges: dict[str, Range], centre: Mapping[str, float], shares: Mapping[str, float]
) -> dict[str, Range]:
    found = dict(ranges)
    for name, share in shares.items():
        low, high = ranges[name]
        half = share * max(high - centre[name], centre[name] - low)
        found[name] = max(low, centre[name] - half), min(high, centre[name] + half)
    return found
