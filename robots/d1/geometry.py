"""Nominal geometry of D1: three coaxial platforms, rings of joints at 0, -120 and +120 degrees.

Frames: A is fixed to the base (origin O at the centre of the ring R1..R3, y = base normal), B to
the coupler (origin = centroid of S1..S3), C to the end-effector platform (origin = centroid of
S4..S6). All frames are parallel at home. Lengths are in metres.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import sqrt
from types import MappingProxyType
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from closedchain.robots.dimensions import check_dimensions, with_dimensions
from closedchain.urdf.errors import DescriptionError, known_names

FloatArray: TypeAlias = NDArray[np.float64]
Vector3: TypeAlias = tuple[float, float, float]

_HALF_SQRT3 = sqrt(3.0) / 2.0

RADIAL: FloatArray = np.array(
    [[1.0, 0.0, 0.0], [-0.5, 0.0, -_HALF_SQRT3], [-0.5, 0.0, _HALF_SQRT3]]
)
"""Outward unit vectors ``e_i`` (3, 3) of the rings at azimuth 0, -120, +120 degrees about y."""
NORMAL: FloatArray = np.array([0.0, 1.0, 0.0])
"""Normal y of every platform in its own frame."""
TANGENT: FloatArray = np.cross(NORMAL, RADIAL)
"""Revolute axes ``t_i = y x e_i`` (3, 3) of the base (frame A) and of the coupler (frame B)."""
for _constant in (RADIAL, NORMAL, TANGENT):
    _constant.setflags(write=False)

VARIANTS: Mapping[str, Mapping[str, Vector3]] = MappingProxyType(
    {
        "corrected": MappingProxyType({}),
        "printed_u": MappingProxyType(
            {"U1": (0.5, -0.25, 0.0), "U2": (-0.215, -0.25, -0.337), "U3": (-0.215, -0.25, 0.337)}
        ),
        "circle_u": MappingProxyType(
            {"U1": (0.4, -0.25, 0.0), "U2": (-0.215, -0.25, -0.337), "U3": (-0.215, -0.25, 0.337)}
        ),
    }
)
"""Fields that each variant changes: ``printed_u`` takes U1, U2 as printed and mirrors U3, which
the source omits; ``circle_u`` also puts U1 on the circle of the other two."""


_RADII = ("radius_R", "radius_S", "radius_R4", "radius_S4")


@dataclass(frozen=True)
class Geometry:
    """Dimensions of D1, m; the defaults are the corrected numbers of section 6.

    Attributes
    ----------
    radius_R, radius_S, radius_R4, radius_S4 : float
        Ring radii of R1..R3 (base), S1..S3 (coupler), R4..R6 (coupler), S4..S6 (platform).
    U1, U2, U3 : tuple of float
        Universal joints of the UPS legs, frame A.
    height_coupler, height_platform : float
        y of the coupler's and of the platform's centre at home, frame A.
    tip : float
        y of the tool tip, frame C.
    """

    radius_R: float = 0.25
    radius_S: float = 0.10
    radius_R4: float = 0.225
    radius_S4: float = 0.18
    U1: Vector3 = (0.4, -0.25, 0.0)
    U2: Vector3 = (-0.2, -0.25, -0.4 * _HALF_SQRT3)
    U3: Vector3 = (-0.2, -0.25, 0.4 * _HALF_SQRT3)
    height_coupler: float = -0.5
    height_platform: float = -0.75
    tip: float = -0.25

    def __post_init__(self) -> None:
        """Check that every field is finite and every radius positive."""
        check_dimensions(self, "D1", positive=_RADII)

    @property
    def R(self) -> FloatArray:
        """Centres R1..R3 (3, 3) of the base revolutes, m, frame A."""
        return self.radius_R * RADIAL

    @property
    def U(self) -> FloatArray:
        """Universal joints U1..U3 (3, 3), m, frame A."""
        return np.array([self.U1, self.U2, self.U3], dtype=np.float64)

    @property
    def s_B(self) -> FloatArray:
        """Spherical joints S1..S3 (3, 3), m, frame B."""
        return self.radius_S * RADIAL

    @property
    def r_B(self) -> FloatArray:
        """Revolute joints R4..R6 (3, 3), m, frame B."""
        return self.radius_R4 * RADIAL

    @property
    def c_C(self) -> FloatArray:
        """Spherical joints S4..S6 (3, 3), m, frame C."""
        return self.radius_S4 * RADIAL

    @property
    def tip_C(self) -> FloatArray:
        """Tool tip (3,), m, frame C."""
        return self.tip * NORMAL

    @property
    def sides_S(self) -> FloatArray:
        """Sides ``|S1 S2|, |S2 S3|, |S3 S1|`` (3,), m (eq. 4)."""
        return np.full(3, sqrt(3.0) * self.radius_S)

    @property
    def sides_S4(self) -> FloatArray:
        """Sides ``|S4 S5|, |S5 S6|, |S6 S4|`` (3,), m (eq. 7)."""
        return np.full(3, sqrt(3.0) * self.radius_S4)

    @property
    def home_coupler(self) -> Pose:
        """Home pose of the coupler, frame A."""
        return Pose(np.eye(3), self.height_coupler * NORMAL)

    @property
    def home_platform(self) -> Pose:
        """Home pose of the end-effector platform, frame A."""
        return Pose(np.eye(3), self.height_platform * NORMAL)


@dataclass(frozen=True, eq=False)
class Pose:
    """Pose of a body frame in frame A; leading axes, if any, are a batch.

    Attributes
    ----------
    rotation : ndarray (..., 3, 3)
        Columns are the body axes in frame A.
    position : ndarray (..., 3)
        Origin of the body frame, m, frame A.
    """

    rotation: FloatArray
    position: FloatArray

    def points(self, body_points: FloatArray) -> FloatArray:
        """Points (n, 3) of the body frame, m, mapped to frame A: (..., n, 3)."""
        moved = body_points @ np.swapaxes(self.rotation, -1, -2)
        return np.asarray(moved + self.position[..., None, :], dtype=np.float64)


def geometry(variant: str = "corrected", **overrides: float | Vector3) -> Geometry:
    """Geometry of a variant, with single fields replaced.

    Parameters
    ----------
    variant : str
        A key of :data:`VARIANTS`.
    **overrides : float or tuple of float
        Fields of :class:`Geometry`, m.

    Raises
    ------
    DescriptionError
        Unknown variant or field, or an impossible value.
    """
    if variant not in VARIANTS:
        raise DescriptionError(known_names(variant, "D1 variant", VARIANTS))
    return with_dimensions(Geometry, "D1", {**VARIANTS[variant], **overrides})


def rotation_from_quaternion(quaternion: FloatArray) -> FloatArray:
    """Rotation (3, 3) of a quaternion (w, x, y, z) of any norm but 0."""
    w, x, y, z = quaternion / np.linalg.norm(quaternion)
    return np.array(
        [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
            [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
            [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
        ]
    )


def quaternion_from_rotation(rotation: FloatArray) -> FloatArray:
    """Unit quaternion (w, x, y, z) of a rotation (3, 3); its largest part is positive."""
    r = rotation
    # 4 q q^T, of which the row with the largest diagonal entry is the best conditioned
    outer = np.array(
        [
            [1 + r[0, 0] + r[1, 1] + r[2, 2], r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], 0.0],
            [0.0, 1 + r[0, 0] - r[1, 1] - r[2, 2], r[0, 1] + r[1, 0], r[0, 2] + r[2, 0]],
            [0.0, 0.0, 1 - r[0, 0] + r[1, 1] - r[2, 2], r[1, 2] + r[2, 1]],
            [r[1, 0] - r[0, 1], 0.0, 0.0, 1 - r[0, 0] - r[1, 1] + r[2, 2]],
        ]
    )
    outer[0, 3] = outer[3, 0]
    outer = np.triu(outer) + np.triu(outer, 1).T
    row = outer[int(np.argmax(np.diag(outer)))]
    return np.asarray(row / np.linalg.norm(row), dtype=np.float64)
