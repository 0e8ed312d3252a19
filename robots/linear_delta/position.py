"""Position problems in closed form: eight working modes of the inverse, two assembly modes.

With d = a - c, the loop equation (2) reads p + (c - a) r_i - q_i z = b bhat_i: C_i lies on the
sphere of radius b about B_i, or o' on the sphere of radius b about S_i = d r_i + q_i z.

A leg's side is +1 where its slider is above the platform (bhat.z < 0) and -1 where it is below.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np

from closedchain.urdf.errors import ClosureError

from .geometry import AXIS, RADIAL, TANGENT, FloatArray, Geometry, points

MODES: FloatArray = np.array(list(product((1.0, -1.0), repeat=3)))
"""Sides (8, 3) of the three legs in each working mode; the first has all sliders above."""
MODES.setflags(write=False)
ROUNDING = 1e-14
"""Share of b^2 by which a square may be negative at a double root (horizontal or coplanar rods)."""


@dataclass(frozen=True, eq=False)
class DirectSolutions:
    """The two assembly modes for given sliders.

    Attributes
    ----------
    p : ndarray (..., 2, 3)
        Platform centres o', m, frame O; the first below the plane of the S_i, the second above:
        mirror images of each other in that plane.
    sides : ndarray (..., 2, 3)
        Sides of the legs there: the working mode; 0 for a horizontal rod.
    height : ndarray (...)
        Distance of both from the plane, m; 0 where they meet in a double root.
    """

    p: FloatArray
    sides: FloatArray
    height: FloatArray


def margins(p: FloatArray, geometry: Geometry) -> FloatArray:
    """Squared vertical extent (b bhat_i.z)^2 (..., 3) [m^2] of each rod with o' at ``p`` (..., 3).

    Negative where leg i does not reach; zero where its rod is horizontal. Independent of p_z.
    """
    p = points(p, (3,), "p")
    flat = p[..., None, :2] - geometry.d * RADIAL[:, :2]
    return np.asarray(geometry.b**2 - (flat * flat).sum(axis=-1))


def sliders(p: FloatArray, geometry: Geometry, sides: FloatArray) -> FloatArray:
    """Slider heights q (..., 3) [m] of one working mode: eq (2) solved for q_i.

    Parameters
    ----------
    p : ndarray (..., 3)
        Platform centre o', m, frame O.
    sides : ndarray (3,) or (..., 3)
        +1 or -1 for each leg.

    Raises
    ------
    ClosureError
        A pose out of reach, with the leg that does not reach it; sides that are not +1 or -1.
    """
    p = points(p, (3,), "p")
    sides = points(sides, (3,), "sides")
    if (np.abs(sides) != 1.0).any():
        raise ClosureError(f"sides of the legs must be +1 or -1, got {sides.tolist()}")
    squares = margins(p, geometry)
    beyond = squares < -ROUNDING * geometry.b**2
    if beyond.any():
        where = tuple(int(i) for i in np.argwhere(beyond)[0])
        needed = np.sqrt(geometry.b**2 - squares[where])
        raise ClosureError(
            f"p = {p[where[:-1]].tolist()} is out of reach of leg {where[-1] + 1}: it needs a "
            f"rod of {needed:.6g} m, b = {geometry.b} m"
        )
    return np.asarray(p[..., 2:] + sides * np.sqrt(np.maximum(squares, 0.0)))


def inverse(p: FloatArray, geometry: Geometry) -> FloatArray:
    """Slider heights of all eight working modes: q (..., 8, 3) [m], in the order of ``MODES``.

    Raises
    ------
    ClosureError
        A pose out of reach.
    """
    return sliders(np.asarray(p, dtype=np.float64)[..., None, :], geometry, MODES)


def direct(q: FloatArray, geometry: Geometry) -> DirectSolutions:
    """Platform centres for slider heights ``q`` (..., 3) [m]: three spheres of equal radius b.

    o' lies on the normal of the triangle S_1 S_2 S_3 through its circumcentre.

    Raises
    ------
    ClosureError
        The spheres do not meet; or a = c, where their centres are on one line.
    """
    if geometry.d == 0.0:
        raise ClosureError("a = c: the direct problem has no solution or a whole circle of them")
    q = points(q, (3,), "q")
    centres = geometry.d * RADIAL + q[..., None] * AXIS
    u, v = centres[..., 1, :] - centres[..., 0, :], centres[..., 2, :] - centres[..., 0, :]
    n = np.cross(u, v)  # its z component is 3 sqrt(3)/2 d^2 > 0, whatever q is
    nn = (n * n).sum(axis=-1, keepdims=True)
    uu, vv = (u * u).sum(axis=-1, keepdims=True), (v * v).sum(axis=-1, keepdims=True)
    to_centre = np.cross(uu * v - vv * u, n) / (2.0 * nn)
    square = geometry.b**2 - (to_centre * to_centre).sum(axis=-1)
    beyond = square < -ROUNDING * geometry.b**2
    if beyond.any():
        where = tuple(int(i) for i in np.argwhere(beyond)[0])
        raise ClosureError(f"no platform position has the sliders at q = {q[where].tolist()} m")
    height = np.sqrt(np.maximum(square, 0.0))
    normal = height[..., None] * n / np.sqrt(nn)
    centre = centres[..., 0, :] + to_centre
    p = np.stack([centre - normal, centre + normal], axis=-2)
    return DirectSolutions(p, np.sign(q[..., None, :] - p[..., 2:]), height)


def rods(p: FloatArray, q: FloatArray, geometry: Geometry) -> FloatArray:
    """Unit vectors bhat_i (..., 3, 3) from B_i to C_i, frame O: eq (2) over b.

    Raises
    ------
    ClosureError
        The rods would not have length b: p and q do not belong together.
    """
    p, q = points(p, (3,), "p"), points(q, (3,), "q")
    loops = p[..., None, :] - geometry.d * RADIAL - q[..., None] * AXIS
    error = np.abs(np.linalg.norm(loops, axis=-1) - geometry.b).max(initial=0.0)
    if error > 1e-6 * geometry.b:
        raise ClosureError(
            f"p and q do not close the loops: a rod is off its length by {error:.3g} m"
        )
    return np.asarray(loops / geometry.b)


def leg_angles(bhat: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Swing and tilt (..., 3) [rad] of each leg, in its frame x = r_i, y = s2_i, z.

    bhat = Ry(swing) Rx(tilt) (-z). The revolute at B turns by swing, the one at C by -swing; the
    parallelogram's pins D and E by tilt, G and F by -tilt. The slider is above the platform where
    |swing| < pi/2.
    """
    x = (bhat * RADIAL).sum(axis=-1)
    y = (bhat * TANGENT).sum(axis=-1)
    return np.arctan2(-x, -bhat[..., 2]), np.arcsin(np.clip(y, -1.0, 1.0))
