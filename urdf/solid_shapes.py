"""Masses and inertias of links from the shapes that they are drawn with."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from closedchain.urdf.description import Inertial, Origin
from closedchain.urdf.poses import pose_of
from closedchain.urdf.shapes import Shape


def volume(shape: Shape) -> float:
    """Volume [m^3]; zero for a mesh, whose file is not read."""
    s = shape.sizes
    if shape.kind == "box":
        return s[0] * s[1] * s[2]
    if shape.kind == "sphere":
        return 4.0 / 3.0 * math.pi * s[0] ** 3
    if shape.kind == "cylinder":
        return math.pi * s[0] ** 2 * s[1]
    if shape.kind == "capsule":
        return math.pi * s[0] ** 2 * s[1] + 4.0 / 3.0 * math.pi * s[0] ** 3
    return 0.0


def moments(shape: Shape) -> tuple[float, float, float]:
    """Moments of inertia about the centre along the shape's axes, by density [m^5]."""
    s, v = shape.sizes, volume(shape)
    if shape.kind == "box":
        x, y, z = (v / 12.0 * side * side for side in s)
        return y + z, x + z, x + y
    if shape.kind == "sphere":
        one = 0.4 * v * s[0] ** 2
        return one, one, one
    if shape.kind == "cylinder":
        across = v * (3.0 * s[0] ** 2 + s[1] ** 2) / 12.0
        return across, across, 0.5 * v * s[0] ** 2
    if shape.kind == "capsule":
        r, h = s
        middle, caps = math.pi * r * r * h, 4.0 / 3.0 * math.pi * r**3
        # a half ball has its centre 3 r / 8 from its plane
        across = middle * (3.0 * r * r + h * h) / 12.0
        across += caps * (0.4 * r * r + h * h / 4.0 + 3.0 * h * r / 8.0)
        return across, across, 0.5 * middle * r * r + 0.4 * caps * r * r
    return 0.0, 0.0, 0.0


def inertial_of(shapes: Sequence[Shape], density: float | None = None) -> Inertial | None:
    """Inertia of solid shapes, added up; None where there is no mass.

    Of one density [kg/m^3], or each of its material's. What lies in two shapes counts twice.
    """
    mass, first, second = 0.0, np.zeros(3), np.zeros((3, 3))
    for shape in shapes:
        dense = shape.density if density is None else density
        own = dense * volume(shape)
        place, turn = np.array(shape.origin.xyz), pose_of(shape.origin)[:3, :3]
        about = dense * turn @ np.diag(moments(shape)) @ turn.T
        mass, first = mass + own, first + own * place
        second += about + own * ((place @ place) * np.eye(3) - np.outer(place, place))
    if mass == 0.0:
        return None
    centre = first / mass
    about = second - mass * ((centre @ centre) * np.eye(3) - np.outer(centre, centre))
    entries = {f"i{a}{b}": float(about["xyz".index(a), "xyz".index(b)]) for a, b in _PAIRS}
    x, y, z = (float(c) for c in centre)
    return Inertial(Origin((x, y, z)), float(mass), **entries)


_PAIRS = (("x", "x"), ("x", "y"), ("x", "z"), ("y", "y"), ("y", "z"), ("z", "z"))
