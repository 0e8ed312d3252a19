"""MuJoCo: Gauss-Newton on the equality rows of its own model, efc_pos and efc_J.

Its simulation keeps equalities softly, its model states them exactly. Needs ``mujoco``.
"""

from __future__ import annotations

import mujoco
import numpy as np
import pinocchio as pin

import closedchain as cc
from benchmarks.following import gauss_newton, tip_rows
from benchmarks.mjcf import mjcf, point_pairs


class MuJoCo:
    """A mechanism in MuJoCo, at a posture of this package."""

    def __init__(self, m: cc.Mechanism, q: np.ndarray) -> None:
        text = mjcf(m.description, point_pairs(m.description, 0.1 * m.length))
        self.model = mujoco.MjModel.from_xml_string(text)
        self.data = mujoco.MjData(self.model)
        joint = {name: self.model.joint(name).id for name in list(m.model.names)[1:]}
        for name, j in joint.items():
            ours = m.model.joints[m.model.getJointId(name)]
            values = q[ours.idx_q : ours.idx_q + ours.nq]
            if ours.nq == 7:
                values = values[[0, 1, 2, 6, 3, 4, 5]]  # MuJoCo's quaternions are w x y z
            start = self.model.jnt_qposadr[j]
            self.data.qpos[start : start + ours.nq] = values
        driven = {spec.name: spec.joint for spec in m.description.inputs}
        inputs = [joint[driven[name]] for name in m.inputs]
        self.input_q = self.model.jnt_qposadr[inputs]
        self.passive = np.setdiff1d(np.arange(self.model.nv), self.model.jnt_dofadr[inputs])
        self.tip_body = self.model.body(m.required_task().tip).id
        self.outputs = m.outputs()
        self.tip_jacobian = np.zeros((6, self.model.nv))

    def evaluate(self) -> tuple[np.ndarray, np.ndarray]:
        """Gaps (rows,) [m] and their Jacobian (rows, nv)."""
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_comPos(self.model, self.data)
        mujoco.mj_makeConstraint(self.model, self.data)
        return self.data.efc_pos, self.data.efc_J.reshape(-1, self.model.nv)

    def step(self, target: np.ndarray) -> None:
        self.data.qpos[self.input_q] = target
        v = np.zeros(self.model.nv)

        def passive() -> tuple[np.ndarray, np.ndarray]:
            gaps, jacobian = self.evaluate()
            return gaps, jacobian[:, self.passive]

        def move(x: np.ndarray) -> None:
            v[self.passive] = x
            mujoco.mj_integratePos(self.model, self.data.qpos, v, 1.0)

        gauss_newton(passive, move)

    def reach(self, target: pin.SE3) -> None:
        data, tip, both = self.data, self.tip_body, self.tip_jacobian

        def everything() -> tuple[np.ndarray, np.ndarray]:
            gaps, jacobian = self.evaluate()
            mujoco.mj_jacBody(self.model, data, both[:3], both[3:], tip)
            here = pin.SE3(data.xmat[tip].reshape(3, 3), data.xpos[tip])
            values, rows = tip_rows(self.outputs, target, here, both)
            return np.concatenate([gaps, values]), np.concatenate([jacobian, rows])

        gauss_newton(everything, lambda x: mujoco.mj_integratePos(self.model, data.qpos, x, 1.0))

    def residual(self) -> float:
        return float(np.abs(self.evaluate()[0]).max())

    def tip(self) -> np.ndarray:
        mujoco.mj_kinematics(self.model, self.data)
        return np.array(self.data.xpos[self.tip_body])
