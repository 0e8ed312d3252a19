"""Position kinematics of D1, stage by stage, with all solutions (section 4 of the source).

Forward: two problems of three points on three circles, 16 complex solutions each. Inverse: one
binary cubic per pair of operation modes, 12 complex solutions, found from this argument. By eq. (2)
a 3-RPS stage satisfies ``R_xz = R_zx``, that is ``w q_y = 0`` for the quaternion (w, q_x, q_y, q_z)
of its relative rotation, and its lateral offset is a quadratic of that quaternion. Both stage
conditions are linear in the coupler's quaternion once its mode is chosen, so it lies on a line;
the closure of the positions along the one direction that neither stage can move in,
``m = y x n_B``, is a cubic on that line.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from closedchain.robots.elimination import CircleSolutions, eliminant, three_points_on_circles

from .geometry import (
    NORMAL,
    RADIAL,
    TANGENT,
    FloatArray,
    Geometry,
    Pose,
    quaternion_from_rotation,
    rotation_from_quaternion,
)
from .selfmotion import vertical_tool_quaternions

Mode: TypeAlias = Literal["ZT", "HT", "ZT+HT"]
"""Zero torsion (q_y = 0), half turn (w = 0), or both at once."""
ModePair: TypeAlias = tuple[Mode, Mode]

MODE_PAIRS: tuple[ModePair, ...] = (("ZT", "ZT"), ("ZT", "HT"), ("HT", "ZT"), ("HT", "HT"))
"""Modes of (coupler relative to base, platform relative to coupler)."""


@dataclass(frozen=True, eq=False)
class StageSolutions:
    """All solutions of one stage.

    Attributes
    ----------
    poses : tuple of Pose
        Real platform poses, frame A.
    modes : tuple of Mode
        Operation mode of each, of the rotation relative to the stage's own base.
    points : ndarray (k, 3, 3)
        S1..S3 or S4..S6 of each, m, frame A.
    complex_modes : tuple of Mode
        Mode of every complex solution, in the order of ``circles.angles``.
    circles : CircleSolutions
        Angles, counts and status of the elimination.
    """

    poses: tuple[Pose, ...]
    modes: tuple[Mode, ...]
    points: FloatArray
    complex_modes: tuple[Mode, ...]
    circles: CircleSolutions

    @property
    def complex_count(self) -> int:
        """Number of distinct complex solutions."""
        return self.circles.complex_count


@dataclass(frozen=True, eq=False)
class Assembly:
    """One real assembly: both poses in frame A, their modes, and q (6,), m."""

    coupler: Pose
    platform: Pose
    modes: ModePair
    q: FloatArray


@dataclass(frozen=True, eq=False)
class ForwardSolutions:
    """All real assemblies for given lengths; ``stage2[i]`` belongs to ``stage1.poses[i]``."""

    assemblies: tuple[Assembly, ...]
    stage1: StageSolutions
    stage2: tuple[StageSolutions, ...]


@dataclass(frozen=True, eq=False)
class SelfMotion:
    """A one-parameter family of assemblies with the same platform pose and the same q4..q6.

    Attributes
    ----------
    kind : str
        ``"tool_vertical"``: the platform is parallel to the base (R_AC = I); ``"half_turn"``: it
        is turned by 180 degrees about the base normal; ``"untilted_coupler"``: the coupler is
        parallel to the base (n_B = +-y) and slides along y.
    modes : tuple of ModePair
        Mode pairs that hold the family.
    platform : Pose
        The common platform pose, frame A.
    """

    kind: str
    modes: tuple[ModePair, ...]
    platform: Pose
    geometry: Geometry
    quaternion: FloatArray | None = None

    def members(self, height: float) -> tuple[Assembly, ...]:
        """Assemblies whose coupler centre is at ``y = height`` (m, frame A).

        Complete for the ZT-ZT family of a vertical tool and for an untilted coupler; empty for
        ``"half_turn"`` and for the other mode pairs, which are only reported.
        """
        if self.quaternion is not None:
            quaternions = [self.quaternion]
        elif self.kind == "tool_vertical":
            g = self.geometry
            quaternions = vertical_tool_quaternions(
                self.platform.position, height, g.radius_S, g.radius_S4
            )
        else:
            return ()
        found: list[Assembly] = []
        for quaternion in quaternions:
            rotation = rotation_from_quaternion(quaternion)
            position = -self.geometry.radius_S * _drift(rotation) + height * NORMAL
            found.append(_assembly(Pose(rotation, position), self.platform, self.geometry))
        return tuple(found)


@dataclass(frozen=True, eq=False)
class InverseSolutions:
    """All isolated solutions for a platform pose, and the families that are not isolated.

    Attributes
    ----------
    assemblies : tuple of Assembly
        Real isolated solutions.
    complex_count : int
        Roots of the cubics of the mode pairs that have isolated solutions, with multiplicity:
        12 for a generic pose. It includes the roots that lie in ``self_motions`` or at infinity.
    self_motions : tuple of SelfMotion
        Families of solutions; not empty for a vertical tool (R_AC = I).
    at_infinity : int
        Real roots dropped because they put the coupler at infinity (untilted, y centre unbounded).
    """

    assemblies: tuple[Assembly, ...]
    complex_count: int
    self_motions: tuple[SelfMotion, ...]
    at_infinity: int


def _rotations(points: NDArray[np.complex128], radius: float) -> NDArray[np.complex128]:
    """Complex orthogonal matrices (n, 3, 3) of equilateral triangles (n, 3, 3)."""
    x = (points[:, 0] - points.mean(axis=1)) / radius
    z = (points[:, 2] - points[:, 1]) / (np.sqrt(3.0) * radius)
    return np.stack([x, np.cross(z, x), z], axis=-1)


def _modes(relative: NDArray[np.complex128]) -> tuple[Mode, ...]:
    """Operation mode of relative rotations (n, 3, 3), real or complex: which of w, q_y is 0."""
    d = np.diagonal(relative, axis1=-2, axis2=-1)
    w = np.abs(1.0 + d[:, 0] + d[:, 1] + d[:, 2])  # 4 w^2
    y = np.abs(1.0 - d[:, 0] + d[:, 1] - d[:, 2])  # 4 q_y^2
    both = np.maximum(w, y) < 1e-10
    return tuple("ZT+HT" if b else "ZT" if t else "HT" for b, t in zip(both, y <= w, strict=True))


def _stage(circles: CircleSolutions, radius: float, base: FloatArray) -> StageSolutions:
    rotations = _rotations(circles.complex_points, radius)
    modes = _modes(base.T @ rotations)
    poses: list[Pose] = []
    for points in circles.points:
        left, _, right = np.linalg.svd(_rotations(points[None].astype(complex), radius)[0].real)
        poses.append(Pose(left @ right, points.mean(axis=0)))  # eqs (5), (6)
    return StageSolutions(
        poses=tuple(poses),
        modes=tuple(m for m, real in zip(modes, circles.real, strict=True) if real),
        points=circles.points,
        complex_modes=modes,
        circles=circles,
    )


def _checked_lengths(q: ArrayLike, size: int) -> FloatArray:
    lengths = np.asarray(q, dtype=np.float64)
    if lengths.shape != (size,) or not np.all(np.isfinite(lengths)):
        raise ValueError(f"expected {size} finite leg lengths in m, got {q!r}")
    return lengths


def stage1(q123: ArrayLike, geometry: Geometry) -> StageSolutions:
    """Solve all coupler poses for the lengths of the base legs, eqs (2)-(6).

    Parameters
    ----------
    q123 : array_like (3,)
        Lengths ``|S_i - R_i|``, m.
    geometry : Geometry
        Dimensions.
    """
    lengths = _checked_lengths(q123, 3)
    up = np.tile(NORMAL, (3, 1))
    circles = three_points_on_circles(geometry.R, RADIAL, up, lengths, geometry.sides_S)
    return _stage(circles, geometry.radius_S, np.eye(3))


def stage2(coupler: Pose, q456: ArrayLike, geometry: Geometry) -> StageSolutions:
    """Solve all platform poses for a coupler pose and the lengths of the UPS legs, eqs (7), (8).

    ``S_{i+3}`` lies on the sphere about ``U_i`` and in the plane of the passive leg through
    ``R_{i+3}``. Where the sphere misses the plane, the status is ``"unreachable"`` and there is
    no real solution. Modes refer to the rotation relative to the coupler.

    Parameters
    ----------
    coupler : Pose
        Coupler in frame A.
    q456 : array_like (3,)
        Lengths ``|S_{i+3} - U_i|``, m.
    geometry : Geometry
        Dimensions.
    """
    lengths = _checked_lengths(q456, 3)
    axes = RADIAL @ coupler.rotation.T
    normals = TANGENT @ coupler.rotation.T
    up = np.tile(coupler.rotation @ NORMAL, (3, 1))
    distance = ((geometry.U - coupler.points(geometry.r_B)) * normals).sum(axis=1)
    centres = geometry.U - distance[:, None] * normals
    radii = np.sqrt((lengths**2 - distance**2).astype(np.complex128))
    circles = three_points_on_circles(centres, axes, up, radii, geometry.sides_S4)
    return _stage(circles, geometry.radius_S4, coupler.rotation)


def forward(q: ArrayLike, geometry: Geometry) -> ForwardSolutions:
    """All real assemblies for six leg lengths ``q`` (6,), m, eqs (2)-(8)."""
    lengths = _checked_lengths(q, 6)
    first = stage1(lengths[:3], geometry)
    second = tuple(stage2(pose, lengths[3:], geometry) for pose in first.poses)
    found = [
        Assembly(coupler, platform, (mode, relative), lengths)
        for coupler, mode, stage in zip(first.poses, first.modes, second, strict=True)
        for platform, relative in zip(stage.poses, stage.modes, strict=True)
    ]
    return ForwardSolutions(tuple(found), first, second)


def leg_lengths(coupler: Pose, platform: Pose, geometry: Geometry) -> FloatArray:
    """Leg lengths (..., 6), m, of batches of poses, eq. (11)."""
    feet = coupler.points(geometry.s_B) - geometry.R
    arms = platform.points(geometry.c_C) - geometry.U
    return np.asarray(np.linalg.norm(np.concatenate([feet, arms], axis=-2), axis=-1))


def stage1_polynomial(q123: ArrayLike, geometry: Geometry) -> FloatArray:
    """Eliminant of stage 1 in ``t_1^2``, ``t_1 = tan(b_1 / 2)``, monic, descending powers (9,).

    The base is a plane of symmetry, so the eliminant in ``z_1 = exp(j b_1)`` reads the same
    backwards: it is a Chebyshev series of degree 8 in ``cos b_1 = (1 - t^2) / (1 + t^2)``. Not
    monic-scalable only if ``b_1 = pi`` solves it; the zero leading coefficients are then dropped.
    """
    up = np.tile(NORMAL, (3, 1))
    z = eliminant(geometry.R, RADIAL, up, _checked_lengths(q123, 3), geometry.sides_S)
    series = z[8:] + z[8::-1]
    series[0] = z[8]
    series = (series / series[np.argmax(np.abs(series))]).real
    cosine = np.polynomial.chebyshev.cheb2poly(series)
    minus, plus = np.polynomial.Polynomial([1.0, -1.0]), np.polynomial.Polynomial([1.0, 1.0])
    total = np.polynomial.Polynomial([0.0])
    for k, c in enumerate(cosine):
        total = total + c * minus**k * plus ** (8 - k)
    descending = np.pad(total.coef, (0, 9 - len(total.coef)))[::-1]
    first = int(np.argmax(np.abs(descending) > 1e-14 * np.abs(descending).max()))
    return np.asarray(descending[first:] / descending[first], dtype=np.float64)


def _drift(rotation: FloatArray) -> FloatArray:
    """Lateral offset of a stage per unit ring radius: ``t_i . (drift - R e_i) = 0`` (eq. 2)."""
    along = (TANGENT * (RADIAL @ rotation.T)).sum(axis=1)
    return np.asarray(2.0 / 3.0 * along @ TANGENT, dtype=np.float64)


def _assembly(coupler: Pose, platform: Pose, geometry: Geometry) -> Assembly:
    rotations = np.stack([coupler.rotation, coupler.rotation.T @ platform.rotation])
    modes = _modes(rotations.astype(np.complex128))
    return Assembly(
        coupler, platform, (modes[0], modes[1]), leg_lengths(coupler, platform, geometry)
    )


def _pencil(pair: ModePair, platform_quaternion: FloatArray) -> FloatArray | None:
    """Orthonormal basis (2, 4) of the coupler quaternions of a mode pair; None: not a line."""
    w, x, y, z = platform_quaternion
    # y component and scalar part of conj(q_B) q_C, linear in q_B
    form = np.array([y, z, -w, -x]) if pair[1] == "ZT" else np.array([w, x, y, z])
    form = np.delete(form, 2 if pair[0] == "ZT" else 0)
    if np.linalg.norm(form) < 1e-9:
        return None
    kernel = np.linalg.svd(form[None])[2][1:]
    return np.insert(kernel, 2 if pair[0] == "ZT" else 0, 0.0, axis=1)


def _closure(
    quaternion: FloatArray, pair: ModePair, platform: Pose, geometry: Geometry
) -> tuple[float, FloatArray, FloatArray]:
    """Cubic form, coupler rotation, gap ``p_C - p_B - R_B d`` without the two free heights."""
    rotation = rotation_from_quaternion(quaternion)
    lateral = -geometry.radius_S * _drift(rotation)
    relative = -geometry.radius_S4 * _drift(rotation.T @ platform.rotation)
    gap = platform.position - lateral - rotation @ relative
    _, x, _, z = quaternion
    m = np.array([x, 0.0, z]) if pair[0] == "ZT" else np.array([z, 0.0, -x])
    return float(m @ gap), rotation, gap


def _cubic_roots(values: FloatArray, angles: FloatArray) -> tuple[float, ...]:
    """Real zeros (angles modulo pi) of a binary cubic in (cos, sin) sampled at >= 4 angles."""
    pivot = float(angles[int(np.argmax(np.abs(values)))])
    c, s = np.cos(angles - pivot), np.sin(angles - pivot)
    matrix = np.stack([c**3, c**2 * s, c * s**2, s**3], axis=-1)
    cubic = np.polynomial.Polynomial(np.linalg.lstsq(matrix, values, rcond=None)[0][::-1])
    roots = cubic.roots()  # of cot(angle - pivot); the leading coefficient is the largest sample
    found: list[float] = []
    for root in roots[np.abs(roots.imag) < 1e-7].real:
        slope = cubic.deriv()(root)
        better = float(root - cubic(root) / slope) if abs(slope) > 1e-6 else float(root)
        if all(abs(better - other) > 1e-7 for other in found):
            found.append(better)
    return tuple(pivot + float(np.arctan2(1.0, root)) for root in found)


def inverse(platform: Pose, geometry: Geometry) -> InverseSolutions:
    """All assemblies that hold a platform pose: eqs (9)-(11) with a rigid coupler.

    Eq. (10) itself is degenerate for this robot (``|S_i R_{i+3}|`` is at its minimum over the
    rotations of one ring in the other), so the coupler is taken as one rigid body instead.

    Parameters
    ----------
    platform : Pose
        Pose of frame C in frame A.
    geometry : Geometry
        Dimensions.

    Returns
    -------
    InverseSolutions
        Up to three real solutions per mode pair. Families (R_AC = I, a half turn about y, an
        untilted coupler) are reported in ``self_motions`` instead of as numbers.
    """
    target = quaternion_from_rotation(platform.rotation)
    angles = np.pi * np.arange(8) / 8
    found: list[Assembly] = []
    families: list[SelfMotion] = []
    whole: list[ModePair] = []
    count = dropped = 0
    for pair in MODE_PAIRS:
        basis = _pencil(pair, target)
        if basis is None:
            whole.append(pair)
            continue
        quaternions = np.stack([np.cos(angles), np.sin(angles)], axis=-1) @ basis
        values = np.array([_closure(q, pair, platform, geometry)[0] for q in quaternions])
        count += 3
        for angle in _cubic_roots(values, angles):
            quaternion = np.array([np.cos(angle), np.sin(angle)]) @ basis
            _, rotation, gap = _closure(quaternion, pair, platform, geometry)
            normal = rotation @ NORMAL
            if np.linalg.norm(np.cross(NORMAL, normal)) > 1e-6:
                free = np.stack([NORMAL, normal], axis=-1)
                height = np.linalg.lstsq(free, gap, rcond=None)[0][0]
                position = -geometry.radius_S * _drift(rotation) + height * NORMAL
                found.append(_assembly(Pose(rotation, position), platform, geometry))
            elif np.hypot(gap[0], gap[2]) < 1e-9:
                families.append(
                    SelfMotion("untilted_coupler", (pair,), platform, geometry, quaternion)
                )
            else:
                dropped += 1
    if whole:
        kind = "tool_vertical" if ("ZT", "ZT") in whole else "half_turn"
        families.insert(0, SelfMotion(kind, tuple(whole), platform, geometry))
    return InverseSolutions(tuple(found), count, tuple(families), dropped)
