"""A floating body that one closure of any kind holds, with frames in general position."""

from __future__ import annotations

import math

import numpy as np
import pinocchio as pin

import closedchain as cc
from closedchain.closure import mechanism_from_description
from closedchain.closure.joint_kinds import JOINT_KINDS
from closedchain.urdf import Description, Joint, Link, LoopClosure, Origin, Task
from closedchain.urdf.checking import checked
from closedchain.urdf.constraint_element import SPELLINGS

ROD = 0.7


def allowed(kind: str) -> pin.SE3:
    """Pose of frame 2 in frame 1, both with the joint's axis as z, that the joint allows."""
    turn, general = pin.rpy.rpyToMatrix(0, 0, 0.4), pin.rpy.rpyToMatrix(0.3, -0.5, 0.8)
    still, along, across = np.zeros(3), np.array([0, 0, 0.2]), np.array([0.3, -0.1, 0])
    return {
        "fixed": pin.SE3.Identity(),
        "revolute": pin.SE3(turn, still),
        "prismatic": pin.SE3(np.eye(3), along),
        "cylindrical": pin.SE3(turn, along),
        "universal": pin.SE3(turn @ pin.rpy.rpyToMatrix(math.pi / 2, 0, 0), still),
        "spherical": pin.SE3(general, still),
        "planar": pin.SE3(turn, across),
        "point_on_line": pin.SE3(general, along),
        "in_plane": pin.SE3(general, across),
        "distance": pin.SE3(general, ROD * np.array([2, -1, 2]) / 3),
    }[kind]


def description(kind: str) -> Description:
    """Base, body, closure of a kind; closed at home."""
    first = Origin((0.1, 0.2, 0.3), (0.4, -0.7, 1.1))
    second = Origin((-0.3, 0.1, 0.05), (-0.2, 0.6, 0.9))
    spelling = SPELLINGS[kind]
    axis1 = (0.6, 0.0, 0.8) if spelling.parent_axis else (0.0, 0.0, 1.0)
    axis2 = (0.0, 0.8, 0.6)
    if spelling.child_axis == "equal":
        axis2 = axis1
    elif spelling.child_axis == "none":
        axis2 = (0.0, 0.0, 1.0)
    z = np.array([0.0, 0.0, 1.0])
    onto = [
        pin.SE3(pin.Quaternion.FromTwoVectors(z, np.array(axis)).matrix(), np.zeros(3))
        for axis in (axis1, axis2)
    ]
    frames = [pin.SE3(pin.rpy.rpyToMatrix(*o.rpy), np.array(o.xyz)) for o in (first, second)]
    body = frames[0] * onto[0] * allowed(kind) * (frames[1] * onto[1]).inverse()
    pose = pin.SE3ToXYZQUAT(body)
    closure = LoopClosure(
        "c", kind, "base", "body", first, second, axis1, axis2,
        sizes=(("length", ROD),) if kind == "distance" else (),
    )  # fmt: skip
    return Description(
        name="one",
        root="base",
        links=(Link("base"), Link("body"), Link("tip")),
        joints=(
            Joint("free", "floating", "base", "body"),
            Joint("tip_point", "fixed", "body", "tip", Origin((0.1, 0.2, 0.3))),
        ),
        closures=(closure,),
        task=Task("base", "tip", ("x", "y", "z"), 0.5),
        home={"free": tuple(float(x) for x in pose)},
    )


def mechanism(kind: str) -> cc.Mechanism:
    """The mechanism; its mobility is that of the kind."""
    found = mechanism_from_description(checked(description(kind)))
    assert cc.mobility(found).mobility == JOINT_KINDS[kind].freedoms
    return found
