"""Rows of cut joints at Pinocchio's gaps, their exact Jacobian and drift; drift of log6.

The rows and their wrenches come from the table of joint kinds. Gaps are poses of frame 2 in frame
1, twists (linear, angular) of frame 2 against frame 1, at the origin and along the axes of frame 1.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

from closedchain.closure.closures import Closure
from closedchain.closure.tape.jets import jets, parts
from closedchain.closure.tape.vectors import add, cross, matmul


def by_columns(matrix: np.ndarray) -> np.ndarray:
    """A matrix of Pinocchio's as such: it hands those of one column over as vectors (rows,)."""
    return matrix if matrix.ndim == 2 else matrix[:, None]


def cut_values(closure: Closure, gap: pin.SE3) -> list[float]:
    """Rows of a cut joint [m], [rad]."""
    kind = closure.joint_kind
    return kind.values(gap.translation.tolist(), gap.rotation.tolist(), closure.sizes)


def cut_rows(closure: Closure, gap: pin.SE3) -> tuple[list[float], np.ndarray]:
    """Rows of a cut joint and their derivative (rows, 6) by the twist of frame 2."""
    p, r = gap.translation.tolist(), gap.rotation.tolist()
    kind = closure.joint_kind
    # the table's wrenches act at frame 2's origin; its velocity is v + w x p
    wrenches = [[*f, *add(m, cross(p, f))] for f, m in kind.wrenches(p, r, closure.sizes)]
    return kind.values(p, r, closure.sizes), np.array(wrenches)


def cut_drift(closure: Closure, gap: pin.SE3, twist: np.ndarray, rate: np.ndarray) -> np.ndarray:
    """Second derivative (rows,) for a twist (6,) and its rate (6,), both seen in frame 1.

    The rates of the wrenches are those of the same algebra, run on jets.
    """
    p, r = gap.translation.tolist(), gap.rotation.tolist()
    v, w = twist[:3].tolist(), twist[3:].tolist()
    v_rate, w_rate = rate[:3].tolist(), rate[3:].tolist()
    velocity = add(v, cross(w, p))
    acceleration = add(add(v_rate, cross(w_rate, p)), cross(w, velocity))
    spin = [[0.0, -w[2], w[1]], [w[2], 0.0, -w[0]], [-w[1], w[0], 0.0]]
    moving_r = [jets(row, rates) for row, rates in zip(r, matmul(spin, r), strict=True)]
    wrenches = closure.joint_kind.wrenches(jets(p, velocity), moving_r, closure.sizes)
    still, moving = np.array(parts([x for f, m in wrenches for x in (*f, *m)])).T
    found: np.ndarray = still.reshape(-1, 6) @ [*acceleration, *w_rate]
    return found + moving.reshape(-1, 6) @ [*velocity, *w]


def least_sense(closure: Closure, gap: pin.SE3) -> float:
    """Least cosine of axes that a closed joint has parallel: negative where it is mirrored."""
    return min((float(gap.rotation[a, a]) for a in closure.joint_kind.senses), default=1.0)


def fixed_drift(
    model: pin.Model,
    data: pin.Data,
    anchor: pin.FrameAnchorConstraintModel,
    anchor_data: Any,
    v: np.ndarray,
) -> np.ndarray:
    """Second derivative of log6(gap) along a motion without joint acceleration.

    With nu the twist of frame 2 against frame 1 in frame 2, d log6 = Jlog6 nu, so the drift is
    Jlog6 nudot + (d/dt Jlog6) nu.
    """
    gap = anchor_data.c1Mc2
    in_frame_two = gap.inverse().action
    relative = by_columns(anchor.jacobian(model, data, anchor_data))
    twist = pin.Motion(in_frame_two @ (relative @ v))
    # The anchor's acceleration error is the derivative of the twist seen in frame 1; seen in
    # frame 2 it gains no term, because a twist does not change along itself.
    rate = in_frame_two @ anchor_data.constraint_acceleration_error
    log_jacobian = pin.Jlog6(gap)
    xi, xi_rate = pin.log6(gap).vector, log_jacobian @ twist.vector
    exp_rate = _right_jacobian_rate(xi, xi_rate)
    return log_jacobian @ (rate - exp_rate @ xi_rate)


def _right_jacobian_rate(xi: np.ndarray, xi_rate: np.ndarray) -> np.ndarray:
    """Time derivative (6, 6) of the right Jacobian of exp6 at ``xi`` moving with ``xi_rate``.

    The right Jacobian is phi(-ad xi), phi(A) = (e^A - 1)/A; the exponential of the block matrix
    [[B, 1], [0, 0]] with B = [[A, Adot], [0, A]] holds phi(B), whose corner is d phi(A)/dt.
    """
    from scipy.linalg import expm

    a = -pin.Motion(xi).action
    block = np.zeros((24, 24))
    block[:6, :6] = block[6:12, 6:12] = a
    block[:6, 6:12] = -pin.Motion(xi_rate).action
    block[:12, 12:] = np.eye(12)
    return np.asarray(expm(block)[:6, 18:24])
