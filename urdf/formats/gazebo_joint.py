"""Joints in the ``<gazebo>`` block of a URDF, in SDF's words: they close loops.

URDF has no place for a second joint on a link; SDF has, and Gazebo reads it from this block::

    <gazebo>
      <joint name="jD" type="revolute">
        <parent>link_CD</parent> <child>link_AB</child>
        <pose>0 0 .1 0 0 0</pose> <axis><xyz>0 0 1</xyz></axis>
      </joint>
    </gazebo>

The joint's place is written in the child link; in the parent it is where it lies in the zero
posture, in which Gazebo puts the model together.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from lxml import etree

from closedchain.urdf import elements
from closedchain.urdf.description import ClosureType, LoopClosure, Origin, Vector3
from closedchain.urdf.errors import known_names
from closedchain.urdf.formats.substitution import (
    constraint_element,
    fresh_name,
    named_children,
    replace_by,
)
from closedchain.urdf.formats.tree_at_zero import zero_pose
from closedchain.urdf.poses import inverse, origin_of, pose_of, vector

if TYPE_CHECKING:
    from lxml.etree import _Element as Element

KINDS: dict[str, ClosureType] = {
    "revolute": "revolute",
    "continuous": "revolute",
    "hinge": "revolute",
    "prismatic": "prismatic",
    "ball": "spherical",
    "universal": "universal",
    "revolute2": "universal",
    "fixed": "fixed",
}
"""Closure of each of SDF's joint types that a loop can be cut at."""


def translate(root: Element, notes: list[str]) -> None:
    """Move joints out of the ``<gazebo>`` blocks of the root, as ``<constraint>`` elements.

    Raises
    ------
    DescriptionError
        A type or link that is unknown, a missing axis, numbers that are none.
    """
    for block in named_children(root, "gazebo"):
        joints = list(named_children(block, "joint"))
        for joint in joints:
            closure = _closure(root, joint)
            made = constraint_element(closure)
            root.insert(root.index(block), made)
            for part in made.iter():
                part.sourceline = joint.sourceline
            block.remove(joint)
            notes.append(
                f"line {joint.sourceline}: the joint {closure.name!r} of <gazebo> closes a loop; "
                "in "
                f"{closure.parent!r} it is where it lies in the zero posture"
            )
        if joints and not len(block):
            replace_by(block)


def _closure(root: Element, joint: Element) -> LoopClosure:
    wanted = joint.get("type", "")
    if wanted not in KINDS:
        raise elements.error(joint, known_names(wanted, "type of a loop joint", KINDS))
    kind = KINDS[wanted]
    parent, child = (_word(joint, tag) for tag in ("parent", "child"))
    in_child = pose_of(_pose(joint))
    place = zero_pose(root, child, joint) @ in_child
    in_parent = inverse(zero_pose(root, parent, joint)) @ place
    z = (0.0, 0.0, 1.0)
    rotation = place[:3, :3]
    first = z if kind in ("spherical", "fixed") else _axis(joint, "axis", rotation)
    second = _axis(joint, "axis2", rotation) if kind == "universal" else first
    return LoopClosure(
        name=fresh_name(root, joint.get("name") or "gazebo_joint"),
        type=kind,
        parent=parent,
        child=child,
        parent_origin=origin_of(in_parent),
        child_origin=origin_of(in_child),
        parent_axis=first,
        child_axis=second,
        line=joint.sourceline,
    )


def _child(element: Element, tag: str) -> Element | None:
    return next(named_children(element, tag), None)


def _word(joint: Element, tag: str) -> str:
    found = _child(joint, tag)
    if found is None or not (found.text or "").strip():
        raise elements.error(joint, f"the element <{tag}> with the name of a link is missing")
    return str(found.text).strip()


def _numbers(element: Element, count: int) -> tuple[float, ...]:
    """Numbers that an element holds as its text."""
    probe = etree.Element(element.tag, value=" ".join((element.text or "").split()))
    probe.sourceline = element.sourceline
    return elements.numbers(probe, "value", (count,))


def _pose(joint: Element) -> Origin:
    found = _child(joint, "pose")
    if found is None or not (found.text or "").strip():
        return Origin()
    if found.get("relative_to") or found.get("rotation_format"):
        raise elements.error(
            joint, "<pose>: in a URDF it is read as x y z roll pitch yaw in the child"
        )
    x, y, z, roll, pitch, yaw = _numbers(found, 6)
    return Origin((x, y, z), (roll, pitch, yaw))


def _axis(joint: Element, tag: str, rotation: np.ndarray) -> Vector3:
    """Axis in the joint's frame, whose rotation (3, 3) in the model is given."""
    axis = _child(joint, tag)
    xyz = None if axis is None else _child(axis, "xyz")
    if xyz is None:
        raise elements.error(joint, f"the axis is missing: <{tag}><xyz>...</xyz></{tag}>")
    x, y, z = _numbers(xyz, 3)
    length = math.hypot(x, y, z)
    if not 1e-12 < length < math.inf:
        raise elements.error(joint, f"<{tag}>: {xyz.text!r} is no direction")
    unit = np.array([x, y, z]) / length
    in_model = None if axis is None else _child(axis, "use_parent_model_frame")
    if in_model is not None and (in_model.text or "").strip() in ("1", "true"):
        unit = rotation.T @ unit
    return vector(unit)
