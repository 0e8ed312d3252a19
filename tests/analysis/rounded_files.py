"""The same mechanism in random frames, with every number rounded: what a CAD export would say."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pinocchio as pin

from closedchain.closure.tree import se3
from closedchain.urdf import Description, Origin, constraint_xml
from closedchain.urdf.relation_element import relation_xml


def rounded_urdf(
    description: Description,
    decimals: int,
    rng: np.random.Generator | None = None,
    home: Mapping[str, tuple[float, ...]] | None = None,
) -> str:
    """URDF text with every link's frame turned at random (without ``rng``: as it is), rounded.

    ``home`` are the joint values, those of the description by default.
    """
    turns = {link.name: np.eye(3) for link in description.links}
    if rng is not None:
        turns = {
            name: turns[name] if name == description.root else random_rotation(rng)
            for name in turns
        }
    parts = [f'<link name="{link.name}"/>' for link in description.links]
    stated = dict(description.home if home is None else home)
    mimics = {
        one.joint: f'<mimic joint="{one.leader}" multiplier="{one.multiplier!r}" '
        f'offset="{one.offset!r}"/>'
        for one in description.couplings
    }
    for joint in description.joints:
        one, two = turns[joint.parent], turns[joint.child]
        origin = se3(joint.origin)
        after = np.eye(3) if joint.type == "floating" else two
        place = _origin(pin.SE3(one.T @ origin.rotation @ after, one.T @ origin.translation))
        axis = _words(two.T @ joint.axis, decimals)
        limit = '<limit lower="-20" upper="20" effort="1" velocity="1"/>'
        parts.append(
            f'<joint name="{joint.name}" type="{joint.type}"><parent link="{joint.parent}"/>'
            f'<child link="{joint.child}"/>{_origin_xml("origin", place, decimals)}'
            + ("" if joint.type in {"fixed", "floating"} else f'<axis xyz="{axis}"/>')
            + (limit if joint.type in {"revolute", "prismatic"} else "")
            + mimics.get(joint.name, "")
            + "</joint>"
        )
        if joint.type == "floating" and joint.name in stated:
            x = stated[joint.name]
            turned = pin.XYZQUATToSE3(np.array(x)) * pin.SE3(two, np.zeros(3))
            stated[joint.name] = tuple(pin.SE3ToXYZQUAT(turned))
    for spec in description.closures:
        own = random_rotation(rng) if rng is not None else np.eye(3)
        head = "".join(f' {name}="{value:.{decimals}f}"' for name, value in spec.sizes)
        lines = [f'<constraint name="{spec.name}" type="{spec.type}"{head}>']
        written = constraint_xml(spec)
        for side, link, before, axis_ in (
            ("parent", spec.parent, spec.parent_origin, spec.parent_axis),
            ("child", spec.child, spec.child_origin, spec.child_axis),
        ):
            turn, origin = turns[link], se3(before)
            place = _origin(pin.SE3(turn.T @ origin.rotation @ own, turn.T @ origin.translation))
            lines.append(f'<{side} link="{link}"/>{_origin_xml(f"{side}_origin", place, decimals)}')
            if f"<{side}_axis" in written:
                axis = _words(own.T @ np.array(axis_), decimals)
                lines.append(f'<{side}_axis xyz="{axis}"/>')
        parts.append("".join([*lines, "</constraint>"]))
    parts += [relation_xml(relation) for relation in description.relations]
    parts += [
        f'<transmission name="{spec.name}"><joint name="{spec.joint}"/></transmission>'
        for spec in description.inputs
    ]
    task = description.task
    if task is not None:
        outputs = " ".join(task.outputs)
        parts.append(f'<task base="{task.base}" tip="{task.tip}" outputs="{outputs}"/>')
    values = "".join(
        f'<joint name="{name}" value="{_state(value, decimals)}"/>'
        for name, value in stated.items()
    )
    parts.append(f'<group_state name="home" group="all">{values}</group_state>')
    return f'<robot name="{description.name}">' + "\n".join(parts) + "</robot>"


def random_rotation(rng: np.random.Generator) -> np.ndarray:
    """Rotation (3, 3) from all alike."""
    x = rng.standard_normal(4)
    return np.asarray(pin.Quaternion(*(x / np.linalg.norm(x))).matrix())


def _origin(pose: pin.SE3) -> Origin:
    x, y, z = pose.translation
    roll, pitch, yaw = pin.rpy.matrixToRpy(pose.rotation)
    return Origin((x, y, z), (roll, pitch, yaw))


def _origin_xml(tag: str, origin: Origin, decimals: int) -> str:
    xyz, rpy = _words(origin.xyz, decimals), _words(origin.rpy, decimals)
    return f'<{tag} xyz="{xyz}" rpy="{rpy}"/>'


def _state(value: tuple[float, ...], decimals: int) -> str:
    if len(value) == 7:  # a quaternion has to be of unit length
        return " ".join(repr(float(x)) for x in value)
    return _words(value, decimals)


def _words(values: object, decimals: int) -> str:
    return " ".join(f"{float(x):.{decimals}f}" for x in values)  # type: ignore[attr-defined]
