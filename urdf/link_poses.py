"""Where the links of a description are in a posture: what writers of other formats need."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from closedchain.urdf.description import Description, Joint
from closedchain.urdf.poses import of_quaternion, pose, pose_of, turn

Values = Mapping[str, tuple[float, ...]]
"""Values of joints by name, as in ``Description.home``; those not named are at zero."""


def moved(joint: Joint, values: tuple[float, ...] | None) -> np.ndarray:
    """Pose (4, 4) that a joint gives its child in the joint's frame; values as in a home."""
    if values is None or joint.type == "fixed":
        return np.eye(4)
    if joint.type == "floating":
        x, y, z, qx, qy, qz, qw = values
        return pose(of_quaternion((qw, qx, qy, qz))[:3, :3], (x, y, z))
    if joint.type == "prismatic":
        return pose(translation=np.asarray(joint.axis) * values[0])
    return turn(joint.axis, values[0])


def link_poses(description: Description, values: Values | None = None) -> dict[str, np.ndarray]:
    """Pose (4, 4) of every link in the root link, at home by default."""
    values = description.home if values is None else values
    children: dict[str, list[Joint]] = {}
    for joint in description.joints:
        children.setdefault(joint.parent, []).append(joint)
    found = {description.root: np.eye(4)}
    waiting = [description.root]
    while waiting:
        link = waiting.pop()
        for joint in children.get(link, []):
            place = pose_of(joint.origin) @ moved(joint, values.get(joint.name))
            found[joint.child] = found[link] @ place
            waiting.append(joint.child)
    return found
