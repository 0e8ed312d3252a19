"""States in the order and conventions of MuJoCo, and the names of all columns."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from closedchain.closure.mechanism import Mechanism
from closedchain.urdf.errors import ClosureError, known_names

_POSE = ("x", "y", "z", "qx", "qy", "qz", "qw")
_TWIST = ("vx", "vy", "vz", "wx", "wy", "wz")


def column_names(mechanism: Mechanism, *, of_q: bool) -> list[str]:
    """Name of each number of q, or of v: the joint's, for floating joints with its component."""
    model = mechanism.model
    found: list[str] = []
    for i in range(1, model.njoints):
        parts = _POSE if of_q else _TWIST
        single = model.nvs[i] == 1
        found += [model.names[i]] if single else [f"{model.names[i]} {part}" for part in parts]
    return found


def arranged(
    mechanism: Mechanism, q: np.ndarray, v: np.ndarray, joints: Sequence[str] | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Positions (n, .) and velocities (n, .) of named joints, as MuJoCo has qpos and qvel.

    Parameters
    ----------
    q, v : (n, nq), (n, nv) arrays
    joints : sequence of str, optional
        In the order wanted; all joints of the tree by default.

    Raises
    ------
    ClosureError
        An unknown joint, or a floating body that does not float in the world.
    """
    model = mechanism.model
    known = list(model.names)[1:]
    positions, velocities = [], []
    wanted = known if joints is None else [joints] if isinstance(joints, str) else joints
    for name in wanted:
        if name not in known:
            raise ClosureError(known_names(name, "joint", known))
        joint = model.joints[model.getJointId(name)]
        own_q = q[:, joint.idx_q : joint.idx_q + joint.nq]
        own_v = v[:, joint.idx_v : joint.idx_v + joint.nv]
        if joint.nv == 6:
            own_q, own_v = _floating(mechanism, name, own_q, own_v)
        positions.append(own_q)
        velocities.append(own_v)
    empty = np.zeros((len(q), 0))
    return np.hstack([empty, *positions]), np.hstack([empty, *velocities])


def _floating(
    mechanism: Mechanism, name: str, q: np.ndarray, v: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    model = mechanism.model
    i = model.getJointId(name)
    if model.parents[i]:
        raise ClosureError(
            f"the body of joint {name!r} floats in another body; MuJoCo's bodies float in the world"
        )
    placement = model.jointPlacements[i]
    poses, rates = np.empty_like(q), np.empty_like(v)
    for k, (one, rate) in enumerate(zip(q, v, strict=True)):
        pose = placement * pin.XYZQUATToSE3(one)
        x, y, z, qx, qy, qz, qw = pin.SE3ToXYZQUAT(pose)
        poses[k] = x, y, z, qw, qx, qy, qz
        rates[k] = [*(pose.rotation @ rate[:3]), *rate[3:]]
    return poses, rates
