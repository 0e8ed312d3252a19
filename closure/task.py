"""Where the tip is to be and how it moves: pose goals and task Jacobians, with exact derivatives.

Components follow ``TaskFrame``: x y z are displacements of the frame's origin along the world's
axes. Rotations: all three are the rotation vector from the target to the frame (goal) or the
angular velocity along the world's axes (Jacobian); two of them fix the direction of the third axis
of the frame; one of them is the rotation about that axis of the frame.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from closedchain.closure.mechanism import Mechanism
from closedchain.closure.rows import by_columns
from closedchain.urdf.description import OUTPUTS

WORLD_ALIGNED = pin.LOCAL_WORLD_ALIGNED


@dataclass(frozen=True, eq=False)
class Goal:
    """A frame of the mechanism and the pose wanted of it, in the components ``outputs``."""

    frame: str
    joint: int
    placement: pin.SE3
    target: pin.SE3
    outputs: tuple[str, ...]

    @property
    def translational(self) -> np.ndarray:
        """Which rows are lengths, (rows,) of bool."""
        return np.array([name in "xyz" for name in self.outputs])


def goal(
    mechanism: Mechanism, frame: str, target: pin.SE3, outputs: Sequence[str] = OUTPUTS
) -> Goal:
    """Goal for a named frame; ``outputs`` in the order x y z rx ry rz."""
    f = mechanism.model.frames[mechanism.frame_id(frame)]
    ordered = tuple(sorted(outputs, key=OUTPUTS.index))
    return Goal(frame, f.parentJoint, f.placement, target, ordered)


def goal_rows(mechanism: Mechanism, g: Goal) -> tuple[np.ndarray, np.ndarray]:
    """Residual (rows,) and Jacobian (rows, nv) of a goal; joint Jacobians must be up to date."""
    data = mechanism.workspace.data
    here = data.oMi[g.joint] * g.placement
    jacobian = _jacobian(mechanism, g.joint, g.placement)
    wanted = g.target.rotation
    linear, angular = _split(g.outputs)
    values = [(here.translation - g.target.translation)[linear]]
    rows = [jacobian[linear]]
    if len(angular) in (1, 3):
        relative = wanted.T @ here.rotation
        log_rows = (pin.Jlog3(relative) @ here.rotation.T) @ jacobian[3:]
        values.append(pin.log3(relative)[angular])
        rows.append(log_rows[angular])
    elif len(angular) == 2:
        (third,) = {0, 1, 2} - set(angular)
        axis = here.rotation[:, third]
        values.append(wanted[:, angular].T @ axis)
        rows.append(np.cross(axis, wanted[:, angular].T) @ jacobian[3:])
    return np.concatenate(values), np.vstack(rows)


def faces_away(mechanism: Mechanism, q: np.ndarray, g: Goal) -> bool:
    """Whether a two-rotation goal is met by the opposite direction: its rows vanish there too."""
    _, angular = _split(g.outputs)
    if len(angular) != 2:
        return False
    (third,) = {0, 1, 2} - set(angular)
    here = mechanism.pose(q, g.frame)
    return bool(here.rotation[:, third] @ g.target.rotation[:, third] < 0.0)


def task_jacobian(
    mechanism: Mechanism, q: np.ndarray, outputs: str | tuple[str, ...] | list[str] | None = None
) -> np.ndarray:
    """Task Jacobian J (d, nv) at ``q`` (nq,): rates of the outputs, order x y z rx ry rz.

    [m/s, rad/s] per unit of v; components as ``TaskFrame`` says.

    Raises
    ------
    ClosureError
        Malformed ``q``, unknown outputs, or no task.
    """
    names = mechanism.outputs(outputs)
    q = mechanism.configuration(q)
    data = mechanism.workspace.data
    pin.computeJointJacobians(mechanism.model, data, q)
    tip = mechanism.model.frames[mechanism.frame_id(mechanism.required_task().tip)]
    jacobian = _jacobian(mechanism, tip.parentJoint, tip.placement)
    linear, angular = _split(names)
    if len(angular) == 3:
        return jacobian[[*linear, 3, 4, 5]]
    here = data.oMi[tip.parentJoint] * tip.placement
    return np.vstack([jacobian[linear], (here.rotation.T @ jacobian[3:])[angular]])


def _split(outputs: Sequence[str]) -> tuple[list[int], list[int]]:
    indices = [OUTPUTS.index(name) for name in outputs]
    return [i for i in indices if i < 3], [i - 3 for i in indices if i >= 3]


def _jacobian(mechanism: Mechanism, joint: int, placement: pin.SE3) -> np.ndarray:
    if joint == 0:
        return np.zeros((6, mechanism.model.nv))
    data = mechanism.workspace.data
    found = pin.getFrameJacobian(mechanism.model, data, joint, placement, WORLD_ALIGNED)
    return by_columns(np.array(found))
