"""The spanning tree of a description as a Pinocchio model, with a frame for every link."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from closedchain.urdf.description import Description, Inertial, Joint, Link, Origin
from closedchain.urdf.errors import DescriptionError

_SLIGHT = 0.1
"""Share of the largest principal moment that the least may be below zero, by careless measuring."""


@dataclass(frozen=True, eq=False)
class Tree:
    """A model and, for each link, the joint that carries it and the link's place on it."""

    model: pin.Model
    supports: Mapping[str, tuple[int, pin.SE3]]


def se3(origin: Origin) -> pin.SE3:
    """Pose of a URDF origin."""
    return pin.SE3(pin.rpy.rpyToMatrix(*origin.rpy), np.array(origin.xyz))


def z_onto(axis: tuple[float, float, float]) -> pin.SE3:
    """Rotation by the least angle that takes z onto ``axis``; half a turn about x for -z."""
    target = np.array(axis)
    if target[2] < -1.0 + 1e-12:
        return pin.SE3(np.diag([1.0, -1.0, -1.0]), np.zeros(3))
    quaternion = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), target)
    return pin.SE3(quaternion.matrix(), np.zeros(3))


def build_tree(description: Description) -> Tree:
    """Build the model: joints in document order, depth first; fixed joints only place frames.

    A frame is added for every joint too, because ``pin.buildReducedModel`` crashes without them.
    """
    model = pin.Model()
    model.name = description.name
    supports: dict[str, tuple[int, pin.SE3]] = {}
    links = {link.name: link for link in description.links}
    children: dict[str, list[Joint]] = {}
    for joint in description.joints:
        children.setdefault(joint.parent, []).append(joint)

    def place(link: str, joint_id: int, placement: pin.SE3, previous_frame: int) -> None:
        supports[link] = (joint_id, placement)
        frame = model.addBodyFrame(link, joint_id, placement, previous_frame)
        inertial = links[link].inertial
        if inertial is not None and joint_id > 0:
            model.appendBodyToJoint(joint_id, inertia_of(links[link], inertial), placement)
        pending.extend((joint, int(frame)) for joint in reversed(children.get(link, [])))

    pending: list[tuple[Joint, int]] = []
    place(description.root, 0, pin.SE3.Identity(), 0)
    while pending:
        joint, frame = pending.pop()
        parent_id, parent_placement = supports[joint.parent]
        placement = parent_placement * se3(joint.origin)
        if joint.type == "fixed":
            fixed = pin.Frame(joint.name, parent_id, frame, placement, pin.FrameType.FIXED_JOINT)
            place(joint.child, parent_id, placement, int(model.addFrame(fixed)))
            continue
        joint_id = _add_joint(model, joint, parent_id, placement)
        joint_frame = model.addJointFrame(joint_id, frame)
        place(joint.child, joint_id, pin.SE3.Identity(), int(joint_frame))
    return Tree(model, supports)


def _add_joint(model: pin.Model, joint: Joint, parent: int, placement: pin.SE3) -> int:
    if joint.type == "floating":
        return int(model.addJoint(parent, pin.JointModelFreeFlyer(), placement, joint.name))
    axis = np.array(joint.axis)
    # a tilt below 1e-8 leaves 1.0 as it is
    aligned = np.flatnonzero((axis == 1.0) & (np.count_nonzero(axis) == 1))
    prismatic = joint.type == "prismatic"
    if aligned.size:  # Pinocchio's aligned joints are faster than the general ones
        kinds = (
            (pin.JointModelPX, pin.JointModelPY, pin.JointModelPZ)
            if prismatic
            else (pin.JointModelRX, pin.JointModelRY, pin.JointModelRZ)
        )
        joint_model = kinds[int(aligned[0])]()
    elif prismatic:
        joint_model = pin.JointModelPrismaticUnaligned(axis)
    else:
        # a continuous joint is a revolute without limits: one number in q, not (cos, sin)
        joint_model = pin.JointModelRevoluteUnaligned(axis)
    no_effort, no_speed = np.full(1, np.inf), np.full(1, np.inf)
    lower, upper = np.full(1, joint.lower), np.full(1, joint.upper)
    return int(
        model.addJoint(
            parent, joint_model, placement, joint.name, no_effort, no_speed, lower, upper
        )
    )


def weighed_anew(model: pin.Model, description: Description) -> pin.Model:
    """Copy of a model of ``build_tree`` with the inertias of a description of the same links."""
    found = model.copy()
    for i in range(1, found.njoints):
        found.inertias[i] = pin.Inertia.Zero()
    frames = {f.name: f for f in found.frames if f.type == pin.FrameType.BODY}
    for link in description.links:
        frame = frames[link.name]
        if link.inertial is not None and frame.parentJoint:
            inertia = inertia_of(link, link.inertial)
            found.appendBodyToJoint(frame.parentJoint, inertia, frame.placement)
    return found


def inertia_of(link: Link, inertial: Inertial) -> pin.Inertia:
    """Inertia of a link in its frame. Raises ``DescriptionError`` where it is none of a body."""
    about_centre = np.array(
        [
            [inertial.ixx, inertial.ixy, inertial.ixz],
            [inertial.ixy, inertial.iyy, inertial.iyz],
            [inertial.ixz, inertial.iyz, inertial.izz],
        ]
    )
    moments, axes = np.linalg.eigh(about_centre)
    if inertial.mass < 0.0 or moments[0] < -_SLIGHT * abs(moments[-1]) - 1e-15:
        raise DescriptionError(
            f"mass {inertial.mass:g} with principal moments {moments[0]:.3g} to {moments[-1]:.3g} "
            "is no inertia of a body: they must not be negative",
            line=link.line,
            element="link",
            name=link.name,
        )
    pose = se3(inertial.origin)
    axes = pose.rotation @ axes
    rotated = (axes * np.maximum(moments, 0.0)) @ axes.T
    # Pinocchio refuses a diagonal that rounding made negative
    np.fill_diagonal(rotated, np.maximum(rotated.diagonal(), 0.0))
    rotated = 0.5 * (rotated + rotated.T)
    return pin.Inertia(inertial.mass, pose.translation, rotated)
