"""MuJoCo's dynamics of a robot as ``cc.export`` writes it: inverse, forward, and a step in time.

Its closures are soft and its inverse has an effort at every joint, so it solves another problem:
times stand beside ours, numbers do not. Needs ``mujoco``.
"""

from __future__ import annotations

from collections.abc import Callable

import mujoco
import numpy as np

import closedchain as cc


def calls(m: cc.Mechanism, q: np.ndarray, tau: np.ndarray) -> dict[str, Callable[[], None]]:
    """``mj_inverse``, ``mj_forward`` and ``mj_step`` (Runge-Kutta, four stages) at a posture."""
    model = mujoco.MjModel.from_xml_string(cc.export(m, "mjcf")[0])
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
    model.opt.timestep = 1e-4
    data = mujoco.MjData(model)
    for name, ours in list(zip(m.model.names, m.model.joints, strict=True))[1:]:
        values = q[ours.idx_q : ours.idx_q + ours.nq]
        if ours.nq == 7:
            values = values[[0, 1, 2, 6, 3, 4, 5]]  # MuJoCo's quaternions are w x y z
        start = model.joint(name).qposadr[0]
        data.qpos[start : start + ours.nq] = values
    by_name = {spec.name: spec.joint for spec in m.description.inputs}
    for name, effort in zip(m.inputs, tau, strict=True):
        data.qfrc_applied[model.joint(by_name[name]).dofadr[0]] = effort
    mujoco.mj_forward(model, data)
    start = np.array(data.qpos)

    def step() -> None:
        data.qpos[:], data.qvel[:] = start, 0.0
        mujoco.mj_step(model, data)

    return {
        "MuJoCo mj_inverse": lambda: mujoco.mj_inverse(model, data),
        "MuJoCo mj_forward": lambda: mujoco.mj_forward(model, data),
        "MuJoCo mj_step": step,
    }
