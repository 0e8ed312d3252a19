"""Joints of more than one freedom in a tree, as joints of one freedom and closures.

URDF's tree has hinges, slides and floating joints. A ball becomes a floating joint and a cut
spherical joint: together they leave what the ball leaves, in every posture, without the gimbal lock
that three hinges have.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from closedchain.urdf.description import (
    Joint,
    JointRelation,
    JointType,
    Link,
    LoopClosure,
    Origin,
    Vector3,
)
from closedchain.urdf.formats.in_series import in_series
from closedchain.urdf.poses import vector

KINDS = ("ball", "spherical", "universal", "revolute2", "cylindrical", "planar", "screw")
_X: Vector3 = (1.0, 0.0, 0.0)
_HERE = Origin()


@dataclass(frozen=True)
class Composite:
    """A joint to be taken apart.

    Attributes
    ----------
    name, kind, parent, child : str
        ``kind`` is one of ``KINDS``.
    origin : Origin
        In the parent; the child's frame is where the joint is, as in URDF.
    axes : tuple of unit vectors
        In the joint's frame: two for "universal" and "revolute2", one (a normal for "planar") for
        the others, none for a ball.
    pitch : float
        Of a screw [m per turn].
    limits : (lower, upper)
        Of the angle of a screw or a cylindrical joint [rad].
    """

    name: str
    kind: str
    parent: str
    child: str
    origin: Origin = _HERE
    axes: tuple[Vector3, ...] = (_X,)
    pitch: float = 0.0
    limits: tuple[float, float] = (-math.inf, math.inf)


@dataclass(frozen=True)
class Parts:
    """What a joint was taken apart into, and a sentence about it."""

    links: tuple[Link, ...]
    joints: tuple[Joint, ...]
    closures: tuple[LoopClosure, ...] = ()
    relations: tuple[JointRelation, ...] = ()
    note: str = ""


def taken_apart(joint: Composite) -> Parts:
    """Links, joints, closures and relations that move as the joint does."""
    name, kind = joint.name, joint.kind
    if kind in ("ball", "spherical"):
        floating = Joint(name, "floating", joint.parent, joint.child, joint.origin)
        ball = LoopClosure(
            f"{name}_ball", "spherical", joint.parent, joint.child, parent_origin=joint.origin
        )
        note = (
            f"the ball {name!r} of the tree is a floating joint held by the closure {ball.name!r}"
        )
        return Parts((), (floating,), (ball,), (), note)
    first = joint.axes[0]
    if kind in ("universal", "revolute2"):
        steps: list[tuple[str, JointType, Vector3]] = [
            ("_1", "revolute", first),
            ("_2", "revolute", joint.axes[1]),
        ]
    elif kind == "planar":
        across, along = _normals(first)
        steps = [
            ("_x", "prismatic", across),
            ("_y", "prismatic", along),
            ("_turn", "revolute", first),
        ]
    else:  # a cylinder, or a screw: a cylinder whose slide follows its turn
        steps = [("_slide", "prismatic", first), ("_turn", "revolute", first)]
    links = tuple(Link(f"{name}{ending}") for ending, _, _ in steps[:-1])
    ends = [joint.parent, *(link.name for link in links), joint.child]
    named = [(f"{name}{ending}", step, axis) for ending, step, axis in steps]
    lower, upper = joint.limits
    joints = tuple(
        replace(one, lower=lower, upper=upper) if one.name == f"{name}_turn" else one
        for one in in_series(ends, joint.origin, named)
    )
    relations: tuple[JointRelation, ...] = ()
    if kind == "screw":
        per_radian = joint.pitch / (2.0 * math.pi)
        thread = (joints[0].name, joints[1].name)
        relations = (JointRelation(f"{name}_thread", "linear", thread, (1.0, -per_radian)),)
    listed = ", ".join(repr(part.name) for part in joints)
    return Parts(links, joints, (), relations, f"the {kind} joint {name!r} is the joints {listed}")


def _normals(normal: Sequence[float]) -> tuple[Vector3, Vector3]:
    """Two unit vectors that make a right-handed frame with a unit normal as z."""
    n = np.asarray(normal, dtype=float)
    helper = np.eye(3)[int(np.abs(n).argmin())]
    across = np.cross(helper, n)
    across /= np.linalg.norm(across)
    return vector(across), vector(np.cross(n, across))
