"""Rows of the closures: slides and dots (see ``kinds``), the fixed closure's log6, couplings.

Each row comes with its exact Jacobian and its drift. Twists are (linear, angular); the frames are
world-aligned at the closure's own frame unless a comment says otherwise.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

from closedchain.closure.kinds import DOTS, SAME_SENSE, SLIDES, Closure, Coupling

WORLD_ALIGNED = pin.LOCAL_WORLD_ALIGNED


def coupling_residual(q: np.ndarray, c: Coupling) -> float:
    """Follower's value less what the leader asks for."""
    return float(q[c.follower_q] - c.ratio * q[c.leader_q] - c.offset)


def axis_residual(data: pin.Data, closure: Closure) -> np.ndarray:
    """Slide rows [m], then dot rows (rows,) of a closure."""
    one = data.oMi[closure.joint1] * closure.placement1
    two = data.oMi[closure.joint2] * closure.placement2
    gap = two.translation - one.translation
    slides = [one.rotation[:, a] @ gap for a in SLIDES[closure.kind]]
    dots = [one.rotation[:, a] @ two.rotation[:, b] for a, b in DOTS[closure.kind]]
    return np.array(slides + dots)


def axis_rows(model: pin.Model, data: pin.Data, closure: Closure) -> tuple[np.ndarray, np.ndarray]:
    """Slide and dot rows with their exact Jacobian, see the module ``kinds``."""
    one = data.oMi[closure.joint1] * closure.placement1
    two = data.oMi[closure.joint2] * closure.placement2
    jac1 = _frame_jacobian(model, data, closure.joint1, closure.placement1)
    jac2 = _frame_jacobian(model, data, closure.joint2, closure.placement2)
    gap = two.translation - one.translation
    gap_rate, spin1, spin = jac2[:3] - jac1[:3], jac1[3:], jac1[3:] - jac2[3:]
    axes = one.rotation[:, SLIDES[closure.kind]].T
    # pin.skew: np.cross costs more than all the rest
    slide_rows = axes @ (gap_rate + pin.skew(gap) @ spin1)
    pairs = [(one.rotation[:, a], two.rotation[:, b]) for a, b in DOTS[closure.kind]]
    dots = [axis1 @ axis2 for axis1, axis2 in pairs]
    dot_axes = np.array([pin.skew(axis1) @ axis2 for axis1, axis2 in pairs])
    rows = np.vstack([slide_rows, dot_axes @ spin]) if pairs else slide_rows
    return np.array([*(axes @ gap), *dots]), rows


def _frame_jacobian(model: pin.Model, data: pin.Data, joint: int, placement: pin.SE3) -> np.ndarray:
    if joint == 0:
        return np.zeros((6, model.nv))
    return pin.getFrameJacobian(model, data, joint, placement, WORLD_ALIGNED)


def axis_drift(model: pin.Model, data: pin.Data, closure: Closure) -> np.ndarray:
    """Second derivative of the slide and dot rows along a motion without joint acceleration."""
    one = data.oMi[closure.joint1] * closure.placement1
    two = data.oMi[closure.joint2] * closure.placement2
    v1, a1 = _point_motion(model, data, closure.joint1, closure.placement1)
    v2, a2 = _point_motion(model, data, closure.joint2, closure.placement2)
    gap = two.translation - one.translation
    rate, acceleration = v2[:3] - v1[:3], a2[:3] - a1[:3]
    w1, w2, alpha1 = v1[3:], v2[3:], a1[3:]
    out = []
    for a in SLIDES[closure.kind]:
        axis = one.rotation[:, a]
        axis_rate = np.cross(w1, axis)
        axis_acceleration = np.cross(alpha1, axis) + np.cross(w1, axis_rate)
        out.append(axis @ acceleration + 2.0 * axis_rate @ rate + axis_acceleration @ gap)
    for a, b in DOTS[closure.kind]:
        axis1, axis2 = one.rotation[:, a], two.rotation[:, b]
        rate1, rate2 = np.cross(w1, axis1), np.cross(w2, axis2)
        acc1 = np.cross(alpha1, axis1) + np.cross(w1, rate1)
        acc2 = np.cross(a2[3:], axis2) + np.cross(w2, rate2)
        out.append(acc1 @ axis2 + 2.0 * rate1 @ rate2 + axis1 @ acc2)
    return np.array(out)


def _point_motion(
    model: pin.Model, data: pin.Data, joint: int, placement: pin.SE3
) -> tuple[np.ndarray, np.ndarray]:
    """Velocity and classical acceleration (6,) (linear, angular) of a frame, world axes."""
    if joint == 0:
        return np.zeros(6), np.zeros(6)
    velocity = pin.getFrameVelocity(model, data, joint, placement, WORLD_ALIGNED)
    acceleration = pin.getFrameClassicalAcceleration(model, data, joint, placement, WORLD_ALIGNED)
    return velocity.vector, acceleration.vector


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
    twist = pin.Motion(in_frame_two @ (anchor.jacobian(model, data, anchor_data) @ v))
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


def axis_senses(data: pin.Data, closure: Closure) -> list[float]:
    """Cosines between the axes that a closed joint has parallel: negative where it is mirrored."""
    one = data.oMi[closure.joint1] * closure.placement1
    two = data.oMi[closure.joint2] * closure.placement2
    axes = SAME_SENSE.get(closure.kind, ())
    return [float(one.rotation[:, a] @ two.rotation[:, a]) for a in axes] or [1.0]
