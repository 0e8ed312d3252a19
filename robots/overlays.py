"""What may be drawn with a robot: polylines, surfaces and markers, in world coordinates [m]."""

from __future__ import annotations

import re
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike

from closedchain.closure.given import real_array
from closedchain.closure.singularity_kinds import COMBINED, KINDS
from closedchain.urdf.errors import ClosureError, known_names

#: Colours of the kinds of singularity, told apart by colour-blind readers (Okabe and Ito).
PALETTE = MappingProxyType({kind.name: kind.colour for kind in (*KINDS.values(), COMBINED)})
#: Dashes and gaps of the kinds, in widths of a line: kinds differ without their colours too.
DASHES = MappingProxyType({kind.name: kind.dashes for kind in (*KINDS.values(), COMBINED)})
_HEX = re.compile(r"#[0-9a-fA-F]{6}")
_FARTHEST = 1e6  # [m]; the browser draws in single precision


@dataclass(frozen=True, eq=False)
class Polyline:
    """A line through points, drawn as a thin tube.

    Attributes
    ----------
    points : (n, 3) array, n >= 2
        World coordinates [m].
    colour : str
        ``"#rrggbb"`` or a kind of ``PALETTE``. Not used where there are ``values``.
    label : str
        Line of the legend, or heading of the colour bar; empty for none.
    values : (n,) array, optional
        Number at each point, shown by colour (cividis), with a colour bar.
    unit : str
        Unit of the values, for the colour bar.
    limits : (lowest, highest), optional
        Values at the ends of the colour bar; those of the values by default.
    width : float, optional
        Diameter of the tube [m]; by default in proportion to the robot.
    closed : bool
        Whether a last piece joins the last point to the first.
    dashes : sequence of float, optional
        Lengths of dashes and gaps in turn, in widths; by default those of a kind that is given as
        the colour (``DASHES``), else none. Not used where there are ``values``.

    Raises
    ------
    ClosureError
        Wrong shapes, numbers that are not finite, unknown colours.
    """

    points: np.ndarray
    colour: str = "#000000"
    label: str = ""
    values: np.ndarray | None = None
    unit: str = ""
    limits: tuple[float, float] | None = None
    width: float | None = None
    closed: bool = False
    dashes: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        what = _called("polyline", self.label)
        _keep(self, "points", spots(self.points, f"{what}: points", 2))
        _check_paint(self, what, len(self.points))
        _check_positive(self.width, f"{what}: width")
        dashes = DASHES.get(self.colour, ()) if self.dashes is None else tuple(self.dashes)
        if len(dashes) % 2 or not all(np.isfinite(x) and x > 0.0 for x in dashes):
            raise ClosureError(f"{what}: dashes must be pairs of positive lengths, got {dashes}")
        _keep(self, "dashes", dashes if self.values is None else ())


@dataclass(frozen=True, eq=False)
class Surface:
    """A triangle mesh; both sides are drawn.

    Attributes
    ----------
    vertices : (n, 3) array
        World coordinates [m].
    triangles : (t, 3) array of int
        Indices of vertices.
    colour, label, values, unit, limits
        As for ``Polyline``; ``values`` are at the vertices.
    opacity : float
        0 < opacity <= 1. What is below 1 lets the robot and other surfaces show through.

    Raises
    ------
    ClosureError
        Wrong shapes, numbers that are not finite, triangles that name no vertex, unknown colours.
    """

    vertices: np.ndarray
    triangles: np.ndarray
    colour: str = "#000000"
    opacity: float = 0.45
    label: str = ""
    values: np.ndarray | None = None
    unit: str = ""
    limits: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        what = _called("surface", self.label)
        _keep(self, "vertices", spots(self.vertices, f"{what}: vertices", 3))
        _keep(self, "triangles", _triangles(self.triangles, what, len(self.vertices)))
        _check_paint(self, what, len(self.vertices))
        if not 0.0 < self.opacity <= 1.0:
            raise ClosureError(f"{what}: opacity must be in (0, 1], got {self.opacity!r}")


@dataclass(frozen=True, eq=False)
class Markers:
    """Balls at points.

    Attributes
    ----------
    points : (n, 3) array, n >= 1
        World coordinates [m].
    colour, label, values, unit, limits
        As for ``Polyline``.
    size : float, optional
        Diameter [m]; by default in proportion to the robot.

    Raises
    ------
    ClosureError
        Wrong shapes, numbers that are not finite, unknown colours.
    """

    points: np.ndarray
    colour: str = "#000000"
    size: float | None = None
    label: str = ""
    values: np.ndarray | None = None
    unit: str = ""
    limits: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        what = _called("markers", self.label)
        _keep(self, "points", spots(self.points, f"{what}: points", 1))
        _check_paint(self, what, len(self.points))
        _check_positive(self.size, f"{what}: size")


Painted = Polyline | Surface | Markers


def css_colour(colour: str) -> str:
    """``"#rrggbb"`` of a colour or a kind of ``PALETTE``. Raises ``ClosureError``."""
    if isinstance(colour, str) and _HEX.fullmatch(colour):
        return colour.lower()
    if colour in PALETTE:
        return PALETTE[colour].lower()
    raise ClosureError(f"{known_names(str(colour), 'colour', PALETTE)}, or '#rrggbb'")


def limits_of(overlay: Painted) -> tuple[float, float]:
    """Values at the ends of the colour bar of an overlay with values."""
    assert overlay.values is not None
    if overlay.limits is not None:
        return overlay.limits
    return float(overlay.values.min()), float(overlay.values.max())


def numbers(values: ArrayLike, what: str) -> np.ndarray:
    """Array of finite numbers, not writeable. Raises ``ClosureError``."""
    array = real_array(values, what, "an array of numbers")
    if not np.isfinite(array).all():
        first = np.argwhere(~np.isfinite(array))[0].tolist()
        raise ClosureError(f"{what} must be finite; entry {first} is {array[tuple(first)]}")
    array.setflags(write=False)
    return array


def series(values: ArrayLike, size: int, what: str) -> np.ndarray:
    """Array (size,) of finite numbers. Raises ``ClosureError``."""
    array = numbers(values, what)
    if array.shape != (size,):
        raise ClosureError(f"{what} must have shape ({size},), got {array.shape}")
    return array


def spots(points: ArrayLike, what: str, least: int) -> np.ndarray:
    """Array (n, 3) of at least ``least`` points [m]. Raises ``ClosureError``."""
    array = numbers(points, what)
    if array.ndim != 2 or array.shape[1] != 3:
        raise ClosureError(f"{what} must have shape (n, 3), got {array.shape}")
    if len(array) < least:
        raise ClosureError(f"{what}: at least {least} are needed, got {len(array)}")
    if np.abs(array).max() > _FARTHEST:
        raise ClosureError(f"{what} must be within {_FARTHEST:g} m of the origin")
    return array


def _triangles(triangles: ArrayLike, what: str, vertices: int) -> np.ndarray:
    array = np.array(triangles)
    if array.ndim != 2 or array.shape[1] != 3 or not len(array) or array.dtype.kind not in "iu":
        raise ClosureError(
            f"{what}: triangles must be integers of shape (t, 3), t >= 1, "
            f"got {array.dtype} {array.shape}"
        )
    wrong = np.argwhere((array < 0) | (array >= vertices))
    if len(wrong):
        row, column = wrong[0].tolist()
        raise ClosureError(
            f"{what}: triangle {row} names vertex {array[row, column]}; "
            f"there are vertices 0 to {vertices - 1}"
        )
    array.setflags(write=False)
    return array


def _called(what: str, label: str) -> str:
    return f"{what} {label!r}" if label else what


def _keep(overlay: object, name: str, value: object) -> None:
    object.__setattr__(overlay, name, value)


def _check_paint(overlay: Painted, what: str, size: int) -> None:
    try:
        css_colour(overlay.colour)
    except ClosureError as error:
        raise ClosureError(f"{what}: {error}") from None
    if overlay.limits is not None:
        low, high = series(overlay.limits, 2, f"{what}: limits").tolist()
        if low >= high:
            raise ClosureError(f"{what}: limits must rise, got {low:g} and {high:g}")
        _keep(overlay, "limits", (low, high))
    if overlay.values is not None:
        _keep(overlay, "values", series(overlay.values, size, f"{what}: values"))


def _check_positive(value: float | None, what: str) -> None:
    if value is not None and not (np.isfinite(value) and value > 0.0):
        raise ClosureError(f"{what} must be positive [m], got {value!r}")
