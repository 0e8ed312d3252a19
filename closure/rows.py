"""Rows of the closures: slides and dots (see ``kinds``), the fixed closure's log6, couplings.

Each row comes with its exact Jacobian and its drift. Twists are (linear, angular).
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

from closedchain.closure.kinds import DOTS, SAME_SENSE, SLIDES, Closure, Coupling


def coupling_residual(q: np.ndarray, c: Coupling) -> float:
    """Follower's value less what the leader asks for."""
    return float(q[c.follower_q] - c.ratio * q[c.leader_q] - c.offset)


class AxisRows:
    """Slide and dot rows of one closure from its gap, the pose (R, p) of frame 2 in frame 1.

    A slide is an entry of p, a dot one of R. A twist (v, w) of frame 2 against frame 1, at the
    origin and along the axes of frame 1, changes them by dp = v + w x p and dR = [w] R, which is
    linear in v, w and in (p, R): only that product is left to be done at a posture.
    """

    def __init__(self, closure: Closure) -> None:
        """Lay out the rows."""
        slides, dots = SLIDES[closure.kind], DOTS[closure.kind]
        # entries of (p, R), R row by row
        self.entries = np.array([*slides, *(3 + 3 * a + b for a, b in dots)])
        self.senses = np.array([3 + 4 * a for a in SAME_SENSE.get(closure.kind, ())], dtype=int)
        self.linear = np.zeros((self.entries.size, 3))
        self.linear[range(len(slides)), slides] = 1.0
        turns = np.zeros((self.entries.size, 3, 12))  # d row / d w, for each entry of (p, R)
        for row, a in enumerate(slides):
            turns[row, :, :3] = -pin.skew(np.eye(3)[a])  # e_a . (w x p) = w . (p x e_a)
        for row, (a, b) in enumerate(dots, len(slides)):
            turns[row][:, 3 + b :: 3] = -pin.skew(np.eye(3)[a])  # the same with column b of R
        self.turns = turns.reshape(-1, 12)

    def values(self, gap: pin.SE3) -> np.ndarray:
        """Rows (rows,) [m], [rad]."""
        return _flat(gap)[self.entries]

    def evaluate(self, gap: pin.SE3, twists: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Rows (rows,) and their Jacobian (rows, nv), with the Jacobian (6, nv) of the twist."""
        flat = _flat(gap)
        angular = (self.turns @ flat).reshape(-1, 3)
        return flat[self.entries], self.linear @ twists[:3] + angular @ twists[3:]

    def drift(self, gap: pin.SE3, twist: np.ndarray, rate: np.ndarray) -> np.ndarray:
        """Second derivative (rows,) for a twist (6,) and its rate (6,), both seen in frame 1."""
        v, w, p, r = twist[:3], pin.skew(twist[3:]), gap.translation, gap.rotation
        moving = np.concatenate([v + w @ p, (w @ r).ravel()])
        angular = (self.turns @ _flat(gap)).reshape(-1, 3)
        angular_rate = (self.turns @ moving).reshape(-1, 3)
        return self.linear @ rate[:3] + angular @ rate[3:] + angular_rate @ twist[3:]

    def least_sense(self, gap: pin.SE3) -> float:
        """Least cosine of axes that a closed joint has parallel: negative where it is mirrored."""
        return float(_flat(gap)[self.senses].min(initial=1.0))


def _flat(gap: pin.SE3) -> np.ndarray:
    return np.concatenate([gap.translation, gap.rotation.ravel()])


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
