"""MuJoCo's own answer to what a mechanism says: poses of bodies, openings of constraints."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

import closedchain as cc


def qpos_of(mechanism: cc.Mechanism, model: Any, q: np.ndarray) -> np.ndarray:
    """Configuration of MuJoCo's model, joints matched by name; what is not there stays at qpos0."""
    import mujoco

    qpos = np.array(model.qpos0)
    for index in range(model.njnt):
        name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_JOINT, index)
        start = model.jnt_qposadr[index]
        if not name or not mechanism.model.existJointName(name):
            continue
        joint = mechanism.model.joints[mechanism.model.getJointId(name)]
        values = q[joint.idx_q : joint.idx_q + joint.nq]
        kind = model.jnt_type[index]
        if kind == mujoco.mjtJoint.mjJNT_FREE:
            qpos[start : start + 7] = values[[0, 1, 2, 6, 3, 4, 5]]
        elif kind == mujoco.mjtJoint.mjJNT_BALL:
            qpos[start : start + 4] = values[[6, 3, 4, 5]]
        else:
            qpos[start] = values[0]
    return qpos


def at(model: Any, qpos: np.ndarray) -> Any:
    """MuJoCo's data at a configuration."""
    import mujoco

    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_forward(model, data)
    return data


def opening(data: Any) -> float:
    """Largest violation of the equality constraints [m, rad]."""
    return float(np.abs(data.efc_pos[: data.ne]).max(initial=0.0))


def worst_pose(mechanism: cc.Mechanism, data: Any, q: np.ndarray) -> float:
    """Largest difference between poses of bodies of the same name, in any entry."""
    import mujoco

    worst = 0.0
    for index in range(1, data.model.nbody if hasattr(data, "model") else len(data.xpos)):
        name = mujoco.mj_id2name(data.model, mujoco.mjtObj.mjOBJ_BODY, index)
        if name not in mechanism.frame_ids:
            continue
        here = mechanism.pose(q, name)
        there = pin.SE3(np.array(data.xmat[index]).reshape(3, 3), np.array(data.xpos[index]))
        worst = max(worst, float(np.abs(here.homogeneous - there.homogeneous).max()))
    return worst
