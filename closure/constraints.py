"""Residual of the loop closures, its exact Jacobian, and its drift term."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from closedchain.closure.mechanism import Mechanism


def residual(mechanism: Mechanism, q: ArrayLike) -> np.ndarray:
    """Gaps of all loop closures.

    Parameters
    ----------
    q : (nq,) array

    Returns
    -------
    (rows,) array
        In the order of ``mechanism.closures``: lengths [m] along the axes of frame 1, then angles
        [rad] (cosines of angles that must be right; for a fixed closure log6 of the gap, where the
        table of joint kinds has a Rodrigues vector that agrees with it to first order).

    Raises
    ------
    ClosureError
        Malformed ``q``.

    Examples
    --------
    >>> m = cc.load("linear_delta")
    >>> bool(np.abs(cc.residual(m, m.home)).max() < 1e-12)
    True
    >>> open_by = cc.residual(m, cc.direct(m, [-0.1, -0.1, -0.1]).q + 0.01)
    >>> bool(np.abs(open_by).max() > 1e-3)
    True
    """
    return mechanism.workspace.residual(mechanism.configuration(q))


def constraint_jacobian(mechanism: Mechanism, q: ArrayLike) -> np.ndarray:
    """Jacobian K of the residual, exact on and off closure.

    Parameters
    ----------
    q : (nq,) array

    Returns
    -------
    (rows, nv) array
        Derivative of ``residual`` along the tangent of ``q`` (``pin.integrate``).

    Raises
    ------
    ClosureError
        Malformed ``q``.

    Examples
    --------
    >>> m = cc.load("linear_delta")
    >>> K = cc.constraint_jacobian(m, m.home)
    >>> K.shape, int(np.linalg.matrix_rank(K))  # rows that repeat others: parallelograms
    ((25, 16), 13)
    """
    return mechanism.workspace.evaluate(mechanism.configuration(q))[1]


def constraint_drift(mechanism: Mechanism, q: ArrayLike, v: ArrayLike) -> np.ndarray:
    """Drift Kdot v: second time derivative of the residual at zero joint acceleration.

    Parameters
    ----------
    q : (nq,) array
    v : (nv,) array
        Joint velocities [m/s, rad/s].

    Returns
    -------
    (rows,) array
        [m/s^2 or rad/s^2]

    Raises
    ------
    ClosureError
        Malformed ``q`` or ``v``.

    Examples
    --------
    >>> m = cc.load("linear_delta")
    >>> v = cc.acceleration(m, m.home, [0.1, 0.0, 0.0], [0.0, 0.0, 0.0])
    >>> K = cc.constraint_jacobian(m, m.home)
    >>> bool(np.abs(K @ v.qddot + cc.constraint_drift(m, m.home, v.qdot)).max() < 1e-12)
    True
    """
    return mechanism.workspace.drift(mechanism.configuration(q), mechanism.tangent(v))


def gaps(mechanism: Mechanism, values: np.ndarray) -> list[tuple[str, float]]:
    """Description and largest absolute row of each closure, worst first."""
    found = [
        (closure.describe(), float(np.max(np.abs(values[where]))))
        for closure, where in zip(mechanism.closures, mechanism.row_slices, strict=True)
    ]
    return sorted(found, key=lambda item: -item[1])


def flipped_axes(mechanism: Mechanism, q: np.ndarray) -> list[str]:
    """Closures whose axes are opposed: the rows vanish there too, yet the joint is mirrored."""
    return mechanism.workspace.flipped(q)
