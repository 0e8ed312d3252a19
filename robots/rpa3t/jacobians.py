"""Jacobians of the loop equations, their determinants, and the factors of these.

``A = df/dq`` and ``B = df/dtheta`` of ``f_i = |B_i C_i|^2 - l4^2`` with q = (x_C1, z_C1, beta), so
that ``A qdot + B thetadot = 0``. The output P follows by ``D = dP/dq``. Units: A [m, m, m^2/rad],
B [m^2/rad]. Everything is vectorised over leading axes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from closedchain.urdf.errors import ClosureError

from .geometry import FloatArray, Geometry, points, split, stack

SINGULAR = 1e-12
"""Share of the product of row norms below which det A counts as zero in :func:`twist_map`."""


@dataclass(frozen=True, eq=False)
class Factors:
    """Factors of the determinants, batch (...).

    Attributes
    ----------
    sin_beta, kappa, M : ndarray (...)
        ``det A = 8 l7 sin(beta) kappa M``: direct singularities. kappa [m] vanishes where C3 leaves
        beta undetermined, M [m^2] where rods 1 and 2 are parallel in the plane xz.
    s1, s2, s3 : ndarray (...)
        ``det B = -8 l3^3 s1 s2 s3`` [m]: arm i and rod i, projected on the arm's plane, align.
    cos_beta : ndarray (...)
        ``det dP/dq = -l7 cos(beta)``: P cannot move along y. Neither in det A nor in det B.
    drop : ndarray (...)
        z_C1 - z_B1 [m]. Where it is zero the rods of leg 1 are horizontal and link 3' may turn
        about y: a constraint singularity that the three loop equations do not know.
    """

    sin_beta: FloatArray
    kappa: FloatArray
    M: FloatArray
    s1: FloatArray
    s2: FloatArray
    s3: FloatArray
    cos_beta: FloatArray
    drop: FloatArray


def factors(q: FloatArray, theta: FloatArray, g: Geometry) -> Factors:
    """Singularity factors of postures ``q`` (..., 3) and arm angles ``theta`` (..., 3)."""
    x, z, beta = split(q)
    t1, t2, t3 = split(theta)
    x2, x3 = x - 2.0 * g.l5 + g.l1, x + g.l7 * np.cos(beta) + 2.0 * g.l2 - g.l1
    drop1, drop2 = z - g.l3 * np.sin(t1), z - g.l3 * np.sin(t2)
    return Factors(
        sin_beta=np.sin(beta),
        kappa=g.l1 - 2.0 * g.l2 + g.l3 * np.cos(t3) - x,
        M=x * drop2 - drop1 * (x2 - g.l3 * np.cos(t2)),
        s1=g.l1 * np.sin(t1) + z * np.cos(t1),
        s2=-x2 * np.sin(t2) + z * np.cos(t2),
        s3=-x3 * np.sin(t3) + (z + g.l6) * np.cos(t3),
        cos_beta=np.cos(beta),
        drop=drop1,
    )


def parallel_jacobian(q: FloatArray, theta: FloatArray, g: Geometry) -> FloatArray:
    """A (..., 3, 3), derivative of the loop equations by q."""
    found = points(q, theta, g)
    rod1, rod2, rod3 = (2.0 * (found[f"C{i}"] - found[f"B{i}"]) for i in (1, 2, 3))
    beta = split(q)[2]
    zero = np.zeros_like(beta)
    swing = g.l7 * (np.cos(beta) * rod3[..., 1] - np.sin(beta) * rod3[..., 0])
    rows = [stack(r[..., 0], r[..., 2], s) for r, s in ((rod1, zero), (rod2, zero), (rod3, swing))]
    return np.stack(np.broadcast_arrays(*rows), axis=-2)


def serial_jacobian(q: FloatArray, theta: FloatArray, g: Geometry) -> FloatArray:
    """B (..., 3, 3), derivative of the loop equations by theta: diagonal, -2 l3 s_i."""
    f = factors(q, theta, g)
    return np.asarray(-2.0 * g.l3 * stack(f.s1, f.s2, f.s3)[..., None] * np.eye(3))


def output_jacobian(q: FloatArray, g: Geometry) -> FloatArray:
    """D = dP/dq (..., 3, 3), rows x y z [1, 1, m/rad]."""
    beta = split(q)[2]
    sine, cosine = g.l7 * np.sin(beta), g.l7 * np.cos(beta)
    rows = [stack(1.0, 0.0, -sine), stack(0.0, 0.0, cosine), stack(0.0 * beta, 1.0, 0.0)]
    return np.stack(np.broadcast_arrays(*rows), axis=-2)


def det_parallel(q: FloatArray, theta: FloatArray, g: Geometry) -> FloatArray:
    """``det A = 8 l7 sin(beta) kappa M`` (...), m^4/rad (corrects eq. (16))."""
    f = factors(q, theta, g)
    return np.asarray(8.0 * g.l7 * f.sin_beta * f.kappa * f.M)


def det_serial(q: FloatArray, theta: FloatArray, g: Geometry) -> FloatArray:
    """``det B = -8 l3^3 s1 s2 s3`` (...), m^6/rad^3 (corrects eq. (17))."""
    f = factors(q, theta, g)
    return np.asarray(-8.0 * g.l3**3 * f.s1 * f.s2 * f.s3)


def twist_map(q: FloatArray, theta: FloatArray, g: Geometry) -> FloatArray:
    """dP/dtheta (..., 3, 3), m/rad, rows x y z.

    Raises
    ------
    ClosureError
        A posture is a direct singularity, where the inputs do not determine the motion.
    """
    a = parallel_jacobian(q, theta, g)
    size = np.linalg.norm(a, axis=-1).prod(axis=-1)
    if (np.abs(np.linalg.det(a)) <= SINGULAR * size).any():
        raise ClosureError("direct singularity: the inputs do not determine the motion of P")
    b = serial_jacobian(q, theta, g)
    return np.asarray(-output_jacobian(q, g) @ np.linalg.solve(a, b))
