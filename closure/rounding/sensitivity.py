"""How closure rows change with the numbers that a mechanism's geometry is written with."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from closedchain.closure.mechanism import Mechanism
from closedchain.closure.responses import link_poses, responses
from closedchain.closure.rounding.number_twists import across, of_origin
from closedchain.closure.tree import se3, z_onto
from closedchain.urdf.description import Joint, LoopClosure, Vector3
from closedchain.urdf.digits import Number

_STEP = 1e-6  # of a difference
_OPPOSED = -1.0 + 1e-6  # z of an axis that is nearly opposite


@dataclass(frozen=True, eq=False)
class _JointNumbers:
    """Numbers of one joint: what they do in its frame before and after its own motion.

    ``origin`` (6, k) are twists of the frame before the motion, ``turn`` (6, l) those of turning
    the axis of a hinge, which act before the motion and back after it, ``slide`` (6, m) those of
    turning the axis of a slider, for a unit of its value.
    """

    joint: Joint
    columns: np.ndarray
    origin: np.ndarray
    turn: np.ndarray
    slide: np.ndarray


class Sensitivity:
    """Derivatives of the dimensionless closure rows by some numbers of a mechanism's geometry.

    A number of a joint moves all that hangs on it, one of a closure its frame. Couplings do not
    depend on the geometry, nor do the sizes of joints count as numbers here.
    """

    def __init__(self, mechanism: Mechanism, numbers: Sequence[Number]) -> None:
        self._mechanism = mechanism
        self._count = len(numbers)
        columns: dict[str, list[int]] = {}
        for i, number in enumerate(numbers):
            columns.setdefault(number.owner, []).append(i)
        description = mechanism.description
        self._joints = [
            _of_joint(joint, columns[joint.name], numbers)
            for joint in description.joints
            if joint.name in columns
        ]
        self._frames = {
            spec.name: (columns[spec.name], *_of_closure(spec, columns[spec.name], numbers))
            for spec in description.closures
            if spec.name in columns
        }

    def at(self, q: np.ndarray) -> np.ndarray:
        """Derivative (rows, n) at ``q`` (nq,), unchecked."""
        m = self._mechanism
        by_joint, by_closure, gaps = responses(m, q)
        poses = link_poses(m, q)
        found = np.zeros((m.rows, self._count))
        for one in self._joints:
            found[:, one.columns] = by_joint[one.joint.name] @ self._twists(one, poses, q)
        for name, (own, first, second) in self._frames.items():
            found[:, own] = by_closure[name] @ (gaps[name].action @ second - first)
        return found / m.row_scale[:, None]

    def _twists(self, one: _JointNumbers, poses: dict[str, pin.SE3], q: np.ndarray) -> np.ndarray:
        """World twists (6, n) of all that hangs on a joint."""
        joint = one.joint
        before = (poses[joint.parent] * se3(joint.origin)).action
        parts = [before @ one.origin]
        if one.turn.shape[1]:
            parts.append((before - poses[joint.child].action) @ one.turn)
        if one.slide.shape[1]:
            model = self._mechanism.model
            value = q[model.joints[model.getJointId(joint.name)].idx_q]
            parts.append(value * (before @ one.slide))
        return np.hstack(parts)


def _of_joint(joint: Joint, columns: Sequence[int], numbers: Sequence[Number]) -> _JointNumbers:
    """Numbers of a joint's origin, then of its axis."""
    origin = [i for i in columns if numbers[i].part == "origin"]
    axis = [i for i in columns if numbers[i].part == "axis"]
    turns = np.array([_turn(joint.axis, numbers[i].index) for i in axis]).reshape(-1, 6).T
    along = np.array(joint.axis)
    slides = np.array([[*across(along, numbers[i].index), 0.0, 0.0, 0.0] for i in axis])
    none, prismatic = np.zeros((6, 0)), joint.type == "prismatic"
    return _JointNumbers(
        joint,
        np.array([*origin, *axis], dtype=int),
        of_origin(joint.origin, [numbers[i].index for i in origin]),
        none if prismatic else turns,
        slides.reshape(-1, 6).T if prismatic else none,
    )


def _of_closure(
    spec: LoopClosure, columns: Sequence[int], numbers: Sequence[Number]
) -> tuple[np.ndarray, np.ndarray]:
    """Twists (6, n) of frame 1 and of frame 2, each in itself, that numbers of a closure give."""
    found = np.zeros((2, 6, len(columns)))
    for k, i in enumerate(columns):
        number = numbers[i]
        side = 0 if number.part.startswith("parent") else 1
        origin = (spec.parent_origin, spec.child_origin)[side]
        axis = (spec.parent_axis, spec.child_axis)[side]
        onto = z_onto(axis).toActionMatrixInverse()
        if number.part.endswith("axis"):
            found[side, :, k] = _of_axis(axis, number.index)
        else:
            found[side, :, k] = onto @ of_origin(origin, [number.index])[:, 0]
    return found[0], found[1]


def _of_axis(axis: Vector3, index: int) -> np.ndarray:
    """Twist (6,) of the frame whose z is taken onto an axis, in itself, by x y z of the axis.

    By differences: the frame turns about its own axis too.
    """
    here = z_onto(axis)
    twist = np.zeros(6)
    if axis[2] < _OPPOSED:  # where that is not continuous, only the least turn counts
        return np.asarray(here.toActionMatrixInverse() @ _turn(axis, index))
    for sign in (1.0, -1.0):
        moved = np.array(axis) + sign * _STEP * np.eye(3)[index]
        x, y, z = moved / np.linalg.norm(moved)
        twist += sign * pin.log6(here.actInv(z_onto((x, y, z)))).vector / (2.0 * _STEP)
    return twist


def _turn(axis: Vector3, index: int) -> np.ndarray:
    """Twist (6,) of turning an axis towards x, y or z."""
    return np.array([0.0, 0.0, 0.0, *np.cross(axis, np.eye(3)[index])])
