"""States in the order and conventions of MuJoCo, and the names of all columns."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from closedchain.closure.closures import Closure
from closedchain.closure.mechanism import Mechanism
from closedchain.urdf.errors import ClosureError, known_names

_MUJOCO_POSE = ("x", "y", "z", "qw", "qx", "qy", "qz")
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

    Balls of the tree, floating joints that a spherical closure holds where they are, have their
    quaternion w x y z and the angular velocity along the body's axes.

    Raises
    ------
    ClosureError
        An unknown joint, or a floating body that does not float in the world.
    """
    model = mechanism.model
    positions, velocities = [], []
    for name in _wanted(mechanism, joints):
        joint = model.joints[model.getJointId(name)]
        own_q = q[:, joint.idx_q : joint.idx_q + joint.nq]
        own_v = v[:, joint.idx_v : joint.idx_v + joint.nv]
        if _is_ball(mechanism, name):
            own_q, own_v = own_q[:, [6, 3, 4, 5]], own_v[:, 3:]
        elif joint.nv == 6:
            own_q, own_v = _floating(mechanism, name, own_q, own_v)
        positions.append(own_q)
        velocities.append(own_v)
    empty = np.zeros((len(q), 0))
    return np.hstack([empty, *positions]), np.hstack([empty, *velocities])


def arranged_names(
    mechanism: Mechanism, joints: Sequence[str] | None = None
) -> tuple[list[str], list[str]]:
    """Name of each column of what ``arranged`` gives. Errors alike."""
    positions, velocities = [], []
    for name in _wanted(mechanism, joints):
        ball = _is_ball(mechanism, name)
        if mechanism.model.nvs[mechanism.model.getJointId(name)] == 1:
            positions.append(name)
            velocities.append(name)
        else:
            positions += [f"{name} {part}" for part in _MUJOCO_POSE[3 if ball else 0 :]]
            velocities += [f"{name} {part}" for part in _TWIST[3 if ball else 0 :]]
    return positions, velocities


def _wanted(mechanism: Mechanism, joints: Sequence[str] | None) -> list[str]:
    known = list(mechanism.model.names)[1:]
    wanted = known if joints is None else [joints] if isinstance(joints, str) else list(joints)
    for name in wanted:
        if name not in known:
            raise ClosureError(known_names(name, "joint", known))
    return wanted


def _is_ball(mechanism: Mechanism, name: str) -> bool:
    """Whether a joint is floating and held at its own origin by a spherical closure."""
    model = mechanism.model
    i = model.getJointId(name)
    return model.nvs[i] == 6 and any(
        isinstance(c, Closure)
        and c.kind == "spherical"
        and (c.joint1, c.joint2) == (model.parents[i], i)
        and c.placement1.isApprox(model.jointPlacements[i])
        and not c.placement2.translation.any()
        for c in mechanism.closures
    )


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
