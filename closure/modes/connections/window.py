"""The window of a slice: coordinates that are held vary, on a grid through the modes' values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from closedchain.closure.chart import Chart, joint_index
from closedchain.closure.given import real_array
from closedchain.closure.turns import tied, turning
from closedchain.urdf.errors import ClosureError, known_names

RESOLUTION = {1: 400, 2: 60, 3: 16}
"""Cells along an axis, by the number of coordinates."""

MOST_CELLS = 2000  # along an axis
SPAN = 1.0  # half width of ranges that are to be fitted, in characteristic lengths or radians
TURN = 2.0 * np.pi
SAME = 1e-9

Range = tuple[float, float] | None
Over = Mapping[str, Range] | Sequence[str] | str


@dataclass(frozen=True, eq=False)
class Window:
    """Values of the coordinates that vary, around those that the modes have.

    Attributes
    ----------
    chart : Chart
        The coordinates that vary, and those that are held.
    axes : tuple of (n_i,) arrays
        Rising values along each axis [m or rad]; that of the modes is one of them.
    whole : tuple of bool
        Axes that are a whole turn: the first value follows the last one.
    """

    chart: Chart
    axes: tuple[np.ndarray, ...]
    whole: tuple[bool, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """The coordinates that vary."""
        return self.chart.names

    @property
    def shape(self) -> tuple[int, ...]:
        """Grid points along each axis."""
        return tuple(axis.size for axis in self.axes)

    @cached_property
    def at(self) -> np.ndarray:
        """Coordinates (k,) of the modes."""
        return self.chart.values(self.chart.start)

    @cached_property
    def middle(self) -> int:
        """Flat index of the grid point of the modes."""
        nearest = [
            int(np.abs(axis - x).argmin()) for axis, x in zip(self.axes, self.at, strict=True)
        ]
        return int(np.ravel_multi_index(tuple(nearest), self.shape))

    @cached_property
    def ranges(self) -> tuple[tuple[float, float], ...]:
        """Lowest and highest value along each axis; a whole turn from the modes' value on."""
        found = []
        for axis, whole, x in zip(self.axes, self.whole, self.at, strict=True):
            low, high = float(axis[0]), float(axis[-1])
            found.append((float(x) - np.pi, float(x) + np.pi) if whole else (low, high))
        return tuple(found)

    def values(self, points: np.ndarray) -> np.ndarray:
        """Coordinates (n, k) of grid points (n,)."""
        index = np.unravel_index(points, self.shape)
        return np.stack([axis[i] for axis, i in zip(self.axes, index, strict=True)], axis=1)

    @cached_property
    def beside(self) -> np.ndarray:
        """Flat index of each point's neighbours (points, 2 k), down and up each axis; or -1."""
        index = np.arange(int(np.prod(self.shape))).reshape(self.shape)
        found = []
        for axis, whole in enumerate(self.whole):
            for by, edge in ((1, 0), (-1, -1)):
                other = np.roll(index, by, axis=axis)
                if not whole:
                    at = tuple(edge if a == axis else slice(None) for a in range(index.ndim))
                    other[at] = -1
                found.append(other.ravel())
        return np.stack(found, axis=1)

    def onward(self, points: np.ndarray, side: np.ndarray) -> np.ndarray:
        """Coordinates (n, k) of the neighbours of points on a side, beyond a whole turn too."""
        there = self.values(self.beside[points, side])
        here = self.values(points)
        rows, axis, up = np.arange(len(points)), side // 2, side % 2 == 1
        gap = there[rows, axis] - here[rows, axis]
        turned = np.array(self.whole)[axis] & (np.where(up, gap, -gap) <= 0.0)
        there[rows, axis] += np.where(turned, np.where(up, TURN, -TURN), 0.0)
        return there

    @cached_property
    def edge(self) -> np.ndarray:
        """Which grid points lie on the window's edge, (points,) of bool."""
        return np.asarray((self.beside < 0).any(axis=1))

    def lengths(self, change: np.ndarray) -> np.ndarray:
        """Dimensionless lengths (...) of changes (..., k) of the coordinates."""
        return np.asarray(np.linalg.norm(change / self.chart.scale, axis=-1))

    def targets(self, values: np.ndarray) -> np.ndarray:
        """Targets (n, prescribed) of the chart's problem at coordinates (n, k)."""
        return self.chart.targets(values)


@dataclass(frozen=True)
class Wanted:
    """What is asked of a window.

    Attributes
    ----------
    ranges : mapping of coordinate to (lowest, highest), or None where nothing is said
    resolution : int or mapping of coordinate to int, optional
        Cells along axes.
    limits : bool
        Whether ranges that are not given end at joint limits.
    """

    ranges: Mapping[str, Range]
    resolution: int | Mapping[str, int] | None = None
    limits: bool = True


def names_and_ranges(over: Over) -> dict[str, Range]:
    """Coordinates that vary, with their ranges where these are given. Raises ``ClosureError``."""
    if isinstance(over, str):
        over = over.split()
    if isinstance(over, Mapping):
        found = {str(name): _range(str(name), given) for name, given in over.items()}
    else:
        found = {str(name): None for name in over}
        if len(found) < len(over):
            raise ClosureError(f"a coordinate varies twice: {' '.join(map(str, over))}")
    if not 1 <= len(found) <= 3:
        raise ClosureError(
            "connections are sought over one to three of the coordinates that are held, got "
            f"{' '.join(found) or 'none'}"
        )
    return found


def _range(name: str, given: Range) -> Range:
    if given is None:
        return None
    ends = real_array(given, f"the range of {name!r}", "(lowest, highest)")
    if ends.shape != (2,):
        raise ClosureError(f"the range of {name!r} must be (lowest, highest), got {given!r}")
    low, high = ends.tolist()
    if not (np.isfinite(ends).all() and low < high):
        raise ClosureError(
            f"the range of {name!r} must rise and be finite, got {low:g} to {high:g}"
        )
    return low, high


def window_of(chart: Chart, wanted: Wanted) -> Window:
    """Window of a chart around its start.

    Raises
    ------
    ClosureError
        A range that does not hold the modes' value, a resolution that is none or of what does not
        vary.
    """
    if isinstance(wanted.resolution, Mapping):
        for name in wanted.resolution:
            if name not in chart.names:
                raise ClosureError(known_names(str(name), "coordinate that varies", chart.names))
    axes, whole = [], []
    for name, x in zip(chart.names, chart.values(chart.start).tolist(), strict=True):
        cells = _cells(wanted.resolution, name, len(chart.names))
        given = wanted.ranges[name]
        low, high = given if given is not None else around(chart, name, wanted)
        if not low - SAME <= x <= high + SAME:
            raise ClosureError(
                f"the range of {name!r}, {low:g} to {high:g}, must hold the value that the modes "
                f"have, {x:.6g}"
            )
        turned = _turns(chart, name, wanted) and abs(high - low - TURN) < SAME
        whole.append(turned)
        axes.append(_turn(x, cells) if turned else _axis(low, x, high, cells))
    return Window(chart, tuple(axes), tuple(whole))


def _cells(resolution: int | Mapping[str, int] | None, name: str, k: int) -> int:
    n = resolution.get(name) if isinstance(resolution, Mapping) else resolution
    n = RESOLUTION[k] if n is None else n
    number = np.asarray(n)
    if number.dtype.kind not in "iuf" or number.ndim or number != number.round():
        raise ClosureError(f"{name} must have a whole number of cells, got {n!r}")
    if not 2 <= number <= MOST_CELLS:
        raise ClosureError(f"{name} must have between 2 and {MOST_CELLS} cells, got {n}")
    return int(number)


def _axis(low: float, x: float, high: float, cells: int) -> np.ndarray:
    """Values from ``low`` to ``high`` with ``x`` among them."""
    below = round(cells * (x - low) / (high - low))
    below = min(max(below, int(x > low + SAME)), cells - int(x < high - SAME))
    parts = [np.linspace(low, x, below + 1)[:-1], np.linspace(x, high, cells - below + 1)]
    return np.concatenate(parts)


def _turn(x: float, cells: int) -> np.ndarray:
    """Values of a whole turn, ``x`` in their middle, the last one a step short of it."""
    return np.asarray(x + TURN * (np.arange(cells) - cells // 2) / cells)


def _turns(chart: Chart, name: str, wanted: Wanted) -> bool:
    """Whether a coordinate may turn on and on, and whole turns leave everything as it was."""
    if name not in chart.joints:
        return False
    m, v = chart.mechanism, joint_index(chart.mechanism, name)[1]
    free = bool(np.isinf(_bounds(chart, name, wanted)).all())
    return bool(turning(m)[v] and not tied(m)[v]) and free


def around(chart: Chart, name: str, wanted: Wanted, span: float = SPAN) -> tuple[float, float]:
    """Range around the modes' value, within limits: a whole turn where there are none.

    Raises
    ------
    ClosureError
        There is no room.
    """
    x = float(chart.values(chart.start)[chart.names.index(name)])
    bounds = _bounds(chart, name, wanted)
    if _turns(chart, name, wanted):
        return x - np.pi, x + np.pi
    half = span * chart.mechanism.length if chart.unit(name) == "m" else min(span, np.pi)
    low, high = max(x - half, min(bounds[0], x)), min(x + half, max(bounds[1], x))
    if not low < high:
        raise ClosureError(f"{name!r} has no room to vary around {x:.6g}: give its range")
    return low, high


def _bounds(chart: Chart, name: str, wanted: Wanted) -> tuple[float, float]:
    """What a coordinate can be at most: limits of a joint, what says a rotation once."""
    if name in chart.joints:
        if not wanted.limits:
            return -np.inf, np.inf
        index = joint_index(chart.mechanism, name)[0]
        lower, upper = chart.mechanism.limits
        return float(lower[index]), float(upper[index])
    if chart.unit(name) == "rad":
        return (0.0, np.pi) if name == "tilt" else (-np.pi, np.pi)
    return -np.inf, np.inf
