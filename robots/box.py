"""Coordinates that are no positions (inputs, angles) shown in a box with axes beside the robot."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from closedchain.closure import Mechanism
from closedchain.robots._recorder import TO_Z, extent
from closedchain.robots.overlays import Painted, Surface, numbers, spots
from closedchain.urdf.errors import ClosureError

_EDGE = 1.0  # edge of a box, in sizes of the robot (half the diagonal of what is drawn of it)
_GAP = 0.25  # between the robot and a box, in the same
_TICK = 0.04  # length of a tick, in edges
_NAME = 0.3  # from an axis to its name, in edges
_TICKS = 5  # at most so many steps along an axis


@dataclass(frozen=True, eq=False)
class Box:
    """Three linear axes along the edges of a box in the world.

    Attributes
    ----------
    names, units : three texts each
        What the axes say; an empty unit for none.
    ranges : (3, 2) array
        Coordinates at the ends of the axes, in their units.
    corner : (3,) array
        World position of the lowest corner [m].
    edges : (3, 3) array
        World vectors [m] along the axes, one a row.
    label : str
        Line of the legend; empty for none.

    Raises
    ------
    ClosureError
        Wrong shapes, numbers that are not finite, ranges that do not rise.
    """

    names: tuple[str, str, str]
    units: tuple[str, str, str]
    ranges: np.ndarray
    corner: np.ndarray
    edges: np.ndarray
    label: str = ""

    def __post_init__(self) -> None:
        for what in ("names", "units"):
            texts = tuple(getattr(self, what))
            if isinstance(getattr(self, what), str) or len(texts) != 3:
                raise ClosureError(f"box: {what} must be three texts, got {getattr(self, what)!r}")
            object.__setattr__(self, what, texts)
        for what, shape in (("ranges", (3, 2)), ("corner", (3,)), ("edges", (3, 3))):
            array = numbers(getattr(self, what), f"box: {what}")
            if array.shape != shape:
                raise ClosureError(f"box: {what} must have shape {shape}, got {array.shape}")
            object.__setattr__(self, what, array)
        for name, (low, high) in zip(self.names, self.ranges, strict=True):
            if low >= high:
                raise ClosureError(f"box: the range of {name} must rise, got {low:g} to {high:g}")
        if np.linalg.matrix_rank(self.edges) < 3:
            raise ClosureError("box: edges must not lie in a plane")

    def place(self, coordinates: ArrayLike) -> np.ndarray:
        """World positions (n, 3) [m] of coordinates (n, 3) in the units of the axes.

        Raises
        ------
        ClosureError
            Wrong shape, or coordinates outside the ranges.
        """
        values = numbers(coordinates, "coordinates")
        if values.ndim != 2 or values.shape[1] != 3:
            raise ClosureError(f"coordinates must have shape (n, 3), got {values.shape}")
        low, high = self.ranges.T
        share = (values - low) / (high - low)
        outside = np.argwhere((share < -1e-9) | (share > 1.0 + 1e-9))
        if len(outside):
            row, axis = outside[0].tolist()
            raise ClosureError(
                f"coordinates: row {row} has {self.names[axis]} = {values[row, axis]:.6g}, outside "
                f"the range {low[axis]:.6g} to {high[axis]:.6g} of the box; widen it or crop"
            )
        return np.asarray(self.corner + share @ self.edges)

    @property
    def corners(self) -> np.ndarray:
        """The eight corners in the world, (8, 3) [m]."""
        return np.asarray(self.corner + np.array(list(product((0.0, 1.0), repeat=3))) @ self.edges)

    def lines(self) -> np.ndarray:
        """Edges and ticks, (k, 2, 3) [m]: begin and end of each."""
        lines = [
            (a, b)
            for a, b in product(product((0.0, 1.0), repeat=3), repeat=2)
            if a < b and sum(x != y for x, y in zip(a, b, strict=True)) == 1
        ]
        for axis in range(3):
            for value in self._ticks(axis):
                spot = self._spot(axis, value)
                lines.append((tuple(spot), tuple(spot + _TICK * _outward(axis))))
        return np.asarray(self.corner + np.array(lines) @ self.edges)

    def labels(self) -> list[tuple[str, np.ndarray]]:
        """Texts along the axes, with their world positions (3,) [m]: numbers, then the names."""
        texts: list[tuple[str, np.ndarray]] = []
        for axis, (name, unit) in enumerate(zip(self.names, self.units, strict=True)):
            for value in self._ticks(axis):
                spot = self._spot(axis, value) + 2.2 * _TICK * _outward(axis)
                texts.append((f"{value:.6g}", self.corner + spot @ self.edges))
            middle = 0.5 * np.eye(3)[axis] + _START[axis] + _NAME * _outward(axis)
            titled = f"{name} [{unit}]" if unit else name
            texts.append((titled, self.corner + middle @ self.edges))
        return texts

    def _ticks(self, axis: int) -> list[float]:
        """Round numbers within a range."""
        low, high = self.ranges[axis]
        finest = (high - low) / _TICKS
        power = 10.0 ** np.floor(np.log10(finest))
        step = next(f * power for f in (1.0, 2.0, 5.0, 10.0) if f * power >= finest * (1 - 1e-9))
        first, last = np.ceil(low / step - 1e-9), np.floor(high / step + 1e-9)
        return [float(np.round(i * step, 12)) + 0.0 for i in np.arange(first, last + 1)]

    def _spot(self, axis: int, value: float) -> np.ndarray:
        low, high = self.ranges[axis]
        return _START[axis] + np.eye(3)[axis] * (value - low) / (high - low)


# where the axes begin, in shares of the edges: in front and below, and the third one on the left
_START = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])


def _outward(axis: int) -> np.ndarray:
    return np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]])[axis]


def boxed(
    overlays: Sequence[Painted],
    names: Sequence[str],
    units: Sequence[str],
    ranges: ArrayLike | None = None,
    *,
    beside: Mechanism,
    q: ArrayLike | None = None,
    up: Literal["x", "y", "z"] = "z",
    side: Literal["right", "left"] = "right",
    label: str = "",
) -> tuple[Box | Painted, ...]:
    """Put overlays whose points are coordinates, not positions, into a box beside the robot.

    Parameters
    ----------
    overlays : polylines, surfaces and markers
        Their points (n, 3) are coordinates in ``units``.
    names, units : three texts each
        What the axes say.
    ranges : (3, 2) array, optional
        Ends of the axes; by default those of the points.
    beside : Mechanism
        The robot that the box stands beside.
    q : (nq,) or (n, nq) array, optional
        Postures of the robot that the box must be clear of; home by default.
    up : "x", "y" or "z"
        World axis that points up on the page; the third coordinate rises along it.
    side : "right" or "left"
        Of the robot, as the page is first seen.
    label : str
        Line of the legend about the box.

    Returns
    -------
    tuple
        The ``Box`` and then the overlays at their places in it, for ``static_page``. The box's
        ``place`` puts further points into it.

    Raises
    ------
    ClosureError
        No overlay and no ranges, wrong shapes, coordinates outside the ranges.
    """
    if up not in TO_Z or side not in ("right", "left"):
        raise ClosureError(f"up must be x, y or z and side right or left, got {up!r}, {side!r}")
    points = [o.vertices if isinstance(o, Surface) else o.points for o in overlays]
    if ranges is None:
        if not points:
            raise ClosureError("boxed: give overlays or ranges")
        ranges = _rounded_out(np.vstack(points))
    postures = np.atleast_2d(np.asarray(beside.home if q is None else q, dtype=float))
    around = extent(beside, np.array([beside.configuration(row) for row in postures]))
    around = around @ TO_Z[up].T
    low, high = around.min(axis=0), around.max(axis=0)
    size = 0.5 * float(np.linalg.norm(high - low)) or beside.length
    edge = _EDGE * size
    # to the right as the page shows it: the camera looks along (-0.55, 0.80, -0.22)
    right = np.array([0.80, 0.55, 0.0]) / np.hypot(0.80, 0.55)
    right = right if side == "right" else -right
    across = float((np.abs(right) * (0.5 * (high - low))).sum() + 0.5 * edge * np.abs(right).sum())
    middle = 0.5 * (low + high) + (across + _GAP * size) * right
    box = Box(
        names=tuple(names),  # type: ignore[arg-type]
        units=tuple(units),  # type: ignore[arg-type]
        ranges=np.asarray(ranges, dtype=float),
        corner=(middle - 0.5 * edge) @ TO_Z[up],
        edges=edge * TO_Z[up],
        label=label,
    )
    placed = [
        replace(o, vertices=box.place(spots(p, "coordinates", 1)))
        if isinstance(o, Surface)
        else replace(o, points=box.place(p))
        for o, p in zip(overlays, points, strict=True)
    ]
    return (box, *placed)


def _rounded_out(points: np.ndarray) -> np.ndarray:
    """Ranges (3, 2) that hold points (n, 3); one that would be empty is widened."""
    low, high = points.min(axis=0), points.max(axis=0)
    flat = high - low <= 1e-9 * np.maximum(1.0, np.abs(high))
    margin = np.where(flat, np.maximum(0.05 * np.abs(high), 0.05), 0.0)
    return np.column_stack([low - margin, high + margin])
