"""Twists, wrenches and the generalised Jacobian: eqs (3)-(26).

Order: six-vectors are (linear; angular) and (force; moment) about o', paired by the plain dot
product. That is the order of eqs (6)-(20); the paper's section 4 announces the opposite one.
Frame O; lengths in metres; everything is vectorised over a leading batch axis of ``bhat``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from closedchain.urdf.errors import ClosureError

from .geometry import AXIS, TANGENT, FloatArray, Geometry

COLLAPSED = 1e-9
"""Sine of the angle between rod and bars below which a parallelogram counts as collapsed."""


@dataclass(frozen=True, eq=False)
class Limbs:
    """Directions and dual bases of the three limbs; arrays (..., 3, ...) over the limbs.

    Attributes
    ----------
    bhat, s, e : ndarray (..., 3, 3)
        Rod, normal of the parallelogram s2 x bhat / |.|, and s x bhat.
    twists : ndarray (..., 3, 6, 6)
        Rows ta1..ta4 (permitted: slider, B, parallelogram, C), then tc1, tc2 (restricted).
    wrenches : ndarray (..., 3, 6, 6)
        Rows wa1..wa4 (actuation), then wc1, wc2 (constraint), dual to the twists.
    """

    bhat: FloatArray
    s: FloatArray
    e: FloatArray
    twists: FloatArray
    wrenches: FloatArray

    @property
    def pairings(self) -> FloatArray:
        """Products (..., 3, 6) of each wrench with its own twist: eqs (23), (24)."""
        return np.asarray((self.twists * self.wrenches).sum(axis=-1))


@dataclass(frozen=True, eq=False)
class Jacobian:
    """The generalised Jacobian J of eq (26), J $t = (qdot; 0).

    Attributes
    ----------
    Jx : ndarray (..., 9, 6)
        Rows wa1 of the three limbs, then (wc1, wc2) of limb 1, 2, 3.
    Ja : ndarray (..., 3)
        Diagonal bhat_i.z of the first block.
    Jc : ndarray (..., 6)
        Diagonal of the second block: 1 and (s x s2).bhat for each limb.
    """

    Jx: FloatArray
    Ja: FloatArray
    Jc: FloatArray

    @property
    def J(self) -> FloatArray:
        """J = diag(Ja, Jc)^-1 Jx (..., 9, 6).

        Raises
        ------
        ClosureError
            A rod is horizontal: eq (26) divides by bhat.z = 0 (type 1 singularity).
        """
        diagonal = np.concatenate([self.Ja, self.Jc], axis=-1)
        if (np.abs(diagonal) < COLLAPSED).any():
            raise ClosureError("a rod is horizontal, bhat.z = 0: J of eq (26) does not exist")
        return np.asarray(self.Jx / diagonal[..., None])


def parallelogram(bhat: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Normals s = s2 x bhat / |.| and e = s x bhat (..., 3, 3) of the parallelograms.

    Raises
    ------
    ClosureError
        A rod is parallel to its bars: the parallelogram has collapsed and has no normal.
    """
    normal = np.cross(TANGENT, bhat)
    size = np.linalg.norm(normal, axis=-1, keepdims=True)
    if (size < COLLAPSED).any():
        raise ClosureError("a rod is parallel to s2: its parallelogram has collapsed")
    s = np.asarray(normal / size)
    return s, np.cross(s, bhat)


def pins(bhat: FloatArray, geometry: Geometry) -> FloatArray:
    """Unit twists (..., 3, 4, 6) of the pins D, E, F, G: eqs (9)-(12)."""
    s, _ = parallelogram(bhat)
    at_b = geometry.C - geometry.b * bhat
    at_c = np.broadcast_to(geometry.C, at_b.shape)
    t = geometry.t * TANGENT
    places = np.stack([at_b + t, at_b - t, at_c - t, at_c + t], axis=-2)
    axes = np.broadcast_to(s[..., None, :], places.shape)
    return np.concatenate([np.cross(places, axes), axes], axis=-1)


def limbs(bhat: FloatArray, geometry: Geometry) -> Limbs:
    """Dual bases of the three limbs: eqs (6)-(8), (15), (16)-(20) and the twists of restriction.

    Parameters
    ----------
    bhat : ndarray (..., 3, 3)
        Unit rod vectors, frame O (see ``position.rods``).

    Raises
    ------
    ClosureError
        A parallelogram has collapsed.
    """
    s, e = parallelogram(bhat)
    shape = bhat.shape
    zero = np.zeros(shape)
    s1, s2 = np.broadcast_to(AXIS, shape), np.broadcast_to(TANGENT, shape)
    c = np.broadcast_to(geometry.C, shape)
    foot = c - geometry.b * bhat
    # e is never along s1: a horizontal rod leaves it horizontal
    e34 = np.cross(s1, e)
    e34 = e34 / np.linalg.norm(e34, axis=-1, keepdims=True)

    def six(linear: FloatArray, angular: FloatArray) -> FloatArray:
        return np.concatenate([linear, angular], axis=-1)

    twists = [
        six(s1, zero),  # (6)
        six(np.cross(foot, s2), s2),  # (7)
        six(e, zero),  # (15)
        six(np.cross(c, s2), s2),  # (8)
        six(np.cross(c, s), s),  # tc1
        six(np.cross(c, bhat), bhat),  # tc2
    ]
    wrenches = [
        six(bhat, np.cross(c, bhat)),  # wa1
        six(e34, np.cross(c, e34)),  # (18)
        six(s2, np.cross(c, s2)),  # (19)
        six(e34, np.cross(foot, e34)),  # (20)
        six(zero, s),  # (16)
        six(zero, np.cross(s, s2)),  # (17)
    ]
    return Limbs(bhat, s, e, np.stack(twists, axis=-2), np.stack(wrenches, axis=-2))


def generalized_jacobian(bhat: FloatArray, geometry: Geometry) -> Jacobian:
    """J_x, J_a and J_c of eqs (25), (26).

    Raises
    ------
    ClosureError
        A parallelogram has collapsed.
    """
    limb = limbs(bhat, geometry)
    w, pairing = limb.wrenches, limb.pairings
    batch = bhat.shape[:-2]
    constraints = w[..., 4:, :].reshape(*batch, 6, 6)
    return Jacobian(
        Jx=np.concatenate([w[..., 0, :], constraints], axis=-2),
        Ja=pairing[..., 0],
        Jc=pairing[..., 4:].reshape(*batch, 6),
    )


def limb_rates(bhat: FloatArray, geometry: Geometry, twist: FloatArray) -> FloatArray:
    """Joint rates rho_i (..., 3, 6) of each limb for a platform twist (..., 6): eq (22).

    (qdot [m/s], rate at B [rad/s], b times the parallelogram's rate [m/s], rate at C [rad/s], and
    two intensities of restriction, zero for a motion that the limb permits).

    Raises
    ------
    ClosureError
        A pairing vanishes: a rod is horizontal (type 1 singularity).
    """
    limb = limbs(bhat, geometry)
    pairing = limb.pairings
    if (np.abs(pairing) < COLLAPSED).any():
        raise ClosureError("a rod is horizontal, bhat.z = 0: the limb's rates are not determined")
    return np.asarray((limb.wrenches @ twist[..., None, :, None])[..., 0] / pairing)


def slider_rates(bhat: FloatArray, v: FloatArray) -> FloatArray:
    """Slider rates qdot_i = bhat_i.v / bhat_i.z (..., 3) [m/s] for a velocity v (..., 3) of o'.

    Raises
    ------
    ClosureError
        A rod is horizontal: the slider does not follow (type 1 singularity).
    """
    if (np.abs(bhat[..., 2]) < COLLAPSED).any():
        raise ClosureError("a rod is horizontal, bhat.z = 0: its slider's rate is not determined")
    return np.asarray((bhat @ v[..., None])[..., 0] / bhat[..., 2])
