"""Inverse acceleration by the Hessian of the limbs: eqs (27)-(32), as corrected.

The source takes the parallelogram for a slider along the fixed direction e and so leaves out the
term that its curved path brings: [$D, -$G] rho3^2 / b^2 = (-bhat/b; 0) rho3^2, a diagonal entry of
the limb's Hessian. ``printed=True`` computes with the zero diagonal of the source.
"""

from __future__ import annotations

import numpy as np

from closedchain.urdf.errors import ClosureError

from .geometry import FloatArray, Geometry
from .screws import generalized_jacobian, limbs, slider_rates

SINGULAR = 1e-9
"""Smallest singular value of J, relative, below which its pseudo-inverse is refused."""
_PARALLELOGRAM = 2  # column of ta3


def bracket(one: FloatArray, two: FloatArray) -> FloatArray:
    """Lie bracket (..., 6) of two twists (..., 6) in the order (linear; angular), about o'."""
    v1, w1, v2, w2 = one[..., :3], one[..., 3:], two[..., :3], two[..., 3:]
    linear = np.cross(w1, v2) - np.cross(w2, v1)
    return np.concatenate([linear, np.cross(w1, w2)], axis=-1)


def limb_hessians(bhat: FloatArray, geometry: Geometry, *, printed: bool = False) -> FloatArray:
    """Hessians H_i (..., 3, 6, 6, 6) of the limbs, [limb, component, j, k]: eq (29).

    Entry j < k is the bracket of twists j and k (order ta1..ta4, tc1, tc2), entry (ta3, ta3) the
    term (-bhat/b; 0) of the parallelogram; the others vanish.

    Raises
    ------
    ClosureError
        A parallelogram has collapsed.
    """
    twists = limbs(bhat, geometry).twists
    all_pairs = np.moveaxis(bracket(twists[..., :, None, :], twists[..., None, :, :]), -1, -3)
    hessians = np.where(np.triu(np.ones((6, 6), dtype=bool), 1), all_pairs, 0.0)
    if not printed:
        hessians[..., :3, _PARALLELOGRAM, _PARALLELOGRAM] = -bhat / geometry.b
    return hessians


def layers(bhat: FloatArray, geometry: Geometry, *, printed: bool = False) -> FloatArray:
    """Products L (..., 3, 6, 6, 6), [limb, wrench, j, k], of the limbs' wrenches and Hessians.

    Wrench 0 gives L_a1 of the source (there over bhat.s1), wrenches 4 and 5 give L_c1 and L_c2.
    """
    hessians = limb_hessians(bhat, geometry, printed=printed)
    return np.asarray(np.einsum("...wc,...cjk->...wjk", limbs(bhat, geometry).wrenches, hessians))


def hessian(bhat: FloatArray, geometry: Geometry, *, printed: bool = False) -> FloatArray:
    """Hessian H (..., 9, 9, 9) of the manipulator, [layer, j, k]: eq (31).

    Layers as the rows of J: the three actuations, then (wc1, wc2) of limb 1, 2, 3.

    Raises
    ------
    ClosureError
        A rod is horizontal, or the rods are coplanar: J+ J = 1 does not hold.
    """
    jacobian = generalized_jacobian(bhat, geometry).J
    values = np.linalg.svd(jacobian, compute_uv=False)
    if (values[..., -1] < SINGULAR * values[..., 0]).any():
        raise ClosureError("the rods are coplanar: J has no left inverse (type 2 singularity)")
    limb = limbs(bhat, geometry)
    pseudo_inverse = np.linalg.pinv(jacobian)  # J+ J = 1, although J J+ is not
    # J_LP: rates of a limb's joints from the nine rates of J; the dual wrenches invert the twists
    rates = (limb.wrenches / limb.pairings[..., None]) @ pseudo_inverse[..., None, :, :]
    scaled = layers(bhat, geometry, printed=printed) / limb.pairings[..., None, None]
    per_limb = np.einsum("...ja,...wjk,...kb->...wab", rates, scaled, rates, optimize=True)
    batch = bhat.shape[:-2]
    constraints = per_limb[..., 4:, :, :].reshape(*batch, 6, 9, 9)
    return np.concatenate([per_limb[..., 0, :, :], constraints], axis=-3)


def inverse_acceleration(
    bhat: FloatArray,
    geometry: Geometry,
    twist: FloatArray,
    accelerator: FloatArray,
    *,
    printed: bool = False,
) -> FloatArray:
    """Second rates (..., 9) of J's rows, J A - $^T J^T H J $: eq (32).

    The first three are the accelerations of the sliders [m/s^2]; the other six vanish for a motion
    that the manipulator permits.

    Parameters
    ----------
    twist : ndarray (..., 6)
        (v; w) of the platform about o', m/s and rad/s.
    accelerator : ndarray (..., 6)
        (a - w x v; wdot), m/s^2 and rad/s^2.
    """
    jacobian = generalized_jacobian(bhat, geometry).J
    rates = (jacobian @ twist[..., None])[..., 0]
    quadratic = np.einsum(
        "...a,...uab,...b->...u", rates, hessian(bhat, geometry, printed=printed), rates
    )
    return np.asarray((jacobian @ accelerator[..., None])[..., 0] - quadratic)


def slider_accelerations(
    bhat: FloatArray, v: FloatArray, a: FloatArray, geometry: Geometry
) -> FloatArray:
    """Slider accelerations (bhat.a + |v - qdot z|^2 / b) / bhat.z (..., 3) [m/s^2].

    Second derivative of |p - d r_i - q_i z| = b, for velocity v and acceleration a (..., 3) of o'.

    Raises
    ------
    ClosureError
        A rod is horizontal.
    """
    qdot = slider_rates(bhat, v)
    relative = v[..., None, :] - qdot[..., None] * np.array([0.0, 0.0, 1.0])
    centripetal = (relative * relative).sum(axis=-1) / geometry.b
    return np.asarray(((bhat @ a[..., None])[..., 0] + centripetal) / bhat[..., 2])
