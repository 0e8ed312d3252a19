"""Drake: Gauss-Newton on point gaps and translational Jacobians of a MultibodyPlant.

It has no call for the Jacobian of a loop, so each pair of points costs two. Needs ``drake``.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import JacobianWrtVariable

import closedchain as cc
from benchmarks.following import gauss_newton, tip_rows
from benchmarks.mjcf import mjcf, point_pairs


class Drake:
    """A mechanism in Drake, at a posture of this package; MJCF without the closures is read."""

    def __init__(self, m: cc.Mechanism, q: np.ndarray) -> None:
        self.plant = MultibodyPlant(0.0)
        Parser(self.plant).AddModelsFromString(mjcf(m.description, []), "xml")
        self.plant.Finalize()
        self.context = self.plant.CreateDefaultContext()
        self.q = np.array(self.plant.GetPositions(self.context))
        root = m.description.root

        def frame(link: str) -> object:
            return self.plant.world_frame() if link == root else self.plant.GetFrameByName(link)

        self.pairs = [
            (frame(p.parent), frame(p.child), p.on_parent[:, None], p.on_child[:, None])
            for p in point_pairs(m.description, 0.1 * m.length)
        ]
        # a floating joint goes by the name of its body
        called = {j.name: j.child if j.type == "floating" else j.name for j in m.description.joints}
        names = list(m.model.names)[1:]
        joint = {name: self.plant.GetJointByName(called[name]) for name in names}
        for name, theirs in joint.items():
            ours = m.model.joints[m.model.getJointId(name)]
            values = q[ours.idx_q : ours.idx_q + ours.nq]
            if ours.nq == 7:
                values = values[[6, 3, 4, 5, 0, 1, 2]]  # Drake's are w x y z, then the position
            start = theirs.position_start()
            self.q[start : start + ours.nq] = values
        driven = {spec.name: spec.joint for spec in m.description.inputs}
        inputs = [joint[driven[name]] for name in m.inputs]
        self.input_q = np.array([j.position_start() for j in inputs])
        velocities = [j.velocity_start() for j in inputs]
        self.passive = np.setdiff1d(np.arange(self.plant.num_velocities()), velocities)
        self.tip_frame = frame(m.required_task().tip)
        self.outputs = m.outputs()
        self.plant.SetPositions(self.context, self.q)

    def evaluate(self) -> tuple[np.ndarray, np.ndarray]:
        """Gaps (rows,) [m] in the frames of the parents, and their Jacobian (rows, nv)."""
        plant, context = self.plant, self.context
        gaps, rows = [], []
        for parent, child, on_parent, on_child in self.pairs:
            gaps.append(plant.CalcPointsPositions(context, child, on_child, parent) - on_parent)
            rows.append(
                plant.CalcJacobianTranslationalVelocity(
                    context, JacobianWrtVariable.kV, child, on_child, parent, parent
                )
            )
        return np.concatenate(gaps)[:, 0], np.concatenate(rows)

    def _move(self, v: np.ndarray) -> None:
        self.q += self.plant.MapVelocityToQDot(self.context, v)
        self._normalise()
        self.plant.SetPositions(self.context, self.q)

    def step(self, target: np.ndarray) -> None:
        self.q[self.input_q] = target
        self.plant.SetPositions(self.context, self.q)
        v = np.zeros(self.plant.num_velocities())

        def passive() -> tuple[np.ndarray, np.ndarray]:
            gaps, jacobian = self.evaluate()
            return gaps, jacobian[:, self.passive]

        def move(x: np.ndarray) -> None:
            v[self.passive] = x
            self._move(v)

        gauss_newton(passive, move)

    def reach(self, target: pin.SE3) -> None:
        plant, context, world = self.plant, self.context, self.plant.world_frame()

        def everything() -> tuple[np.ndarray, np.ndarray]:
            gaps, jacobian = self.evaluate()
            pose = self.tip_frame.CalcPoseInWorld(context)
            here = pin.SE3(pose.rotation().matrix(), pose.translation())
            both = plant.CalcJacobianSpatialVelocity(
                context, JacobianWrtVariable.kV, self.tip_frame, np.zeros(3), world, world
            )  # angular, then linear
            both = np.concatenate([both[3:], both[:3]])
            values, rows = tip_rows(self.outputs, target, here, both)
            return np.concatenate([gaps, values]), np.concatenate([jacobian, rows])

        gauss_newton(everything, self._move)

    def _normalise(self) -> None:
        for body in map(self.plant.get_body, self.plant.GetFloatingBaseBodies()):
            start = body.floating_positions_start()
            self.q[start : start + 4] /= np.linalg.norm(self.q[start : start + 4])

    def residual(self) -> float:
        return float(np.abs(self.evaluate()[0]).max())

    def tip(self) -> np.ndarray:
        plant = self.plant
        return plant.CalcPointsPositions(
            self.context, self.tip_frame, np.zeros((3, 1)), plant.world_frame()
        )[:, 0]
