"""A description as MJCF: the spanning tree as nested bodies, cut joints as pairs of points.

A spherical closure is one pair of points that must coincide, a revolute one two pairs, on its axis.
"""

from __future__ import annotations

from dataclasses import dataclass
from xml.etree import ElementTree as ET

import numpy as np
import pinocchio as pin

from closedchain.urdf.description import Description, Joint, LoopClosure, Origin


@dataclass(frozen=True, eq=False)
class PointPair:
    """Two points that must coincide: links, and positions (3,) [m] in their frames."""

    parent: str
    child: str
    on_parent: np.ndarray
    on_child: np.ndarray


def point_pairs(description: Description, spread: float) -> list[PointPair]:
    """Pairs that hold all cut joints; ``spread`` [m] is the distance from the origin on an axis.

    Raises
    ------
    ValueError
        A cut joint that pairs of points cannot express, or a coupling.
    """
    if description.couplings:
        raise ValueError("couplings are not translated")
    pairs = []
    for closure in description.closures:
        if closure.type not in ("spherical", "revolute"):
            raise ValueError(f"a {closure.type} closure is no pair of points")
        for along in (0.0,) if closure.type == "spherical" else (-spread, spread):
            pairs.append(_pair(closure, along))
    return pairs


def _pair(closure: LoopClosure, along: float) -> PointPair:
    def place(origin: Origin, axis: tuple[float, ...]) -> np.ndarray:
        turn = pin.rpy.rpyToMatrix(*origin.rpy)
        return np.array(origin.xyz) + turn @ (along * np.array(axis))

    return PointPair(
        closure.parent,
        closure.child,
        place(closure.parent_origin, closure.parent_axis),
        place(closure.child_origin, closure.child_axis),
    )


def mjcf(description: Description, pairs: list[PointPair]) -> str:
    """Text of the model; each of ``pairs`` becomes a <connect> between two sites."""
    root = ET.Element("mujoco", model=description.name)
    ET.SubElement(root, "compiler", angle="radian")
    ET.SubElement(root, "option", jacobian="dense")
    bodies = {description.root: ET.SubElement(root, "worldbody")}
    pending = list(description.joints)
    while pending:
        joint = pending.pop(0)
        if joint.parent in bodies:
            bodies[joint.child] = _body(bodies[joint.parent], joint)
        else:
            pending.append(joint)
    equality = ET.SubElement(root, "equality")
    for number, pair in enumerate(pairs):
        for side, link, place in (
            ("1", pair.parent, pair.on_parent),
            ("2", pair.child, pair.on_child),
        ):
            ET.SubElement(bodies[link], "site", name=f"s{number}_{side}", pos=_numbers(place))
        ET.SubElement(equality, "connect", site1=f"s{number}_1", site2=f"s{number}_2")
    return ET.tostring(root, encoding="unicode")


def _body(parent: ET.Element, joint: Joint) -> ET.Element:
    x, y, z, w = pin.Quaternion(pin.rpy.rpyToMatrix(*joint.origin.rpy)).coeffs()
    body = ET.SubElement(
        parent,
        "body",
        name=joint.child,
        pos=_numbers(joint.origin.xyz),
        quat=_numbers((w, x, y, z)),
    )
    # massless bodies are refused: any mass will do, as only positions are asked for
    ET.SubElement(body, "inertial", pos="0 0 0", mass="1", diaginertia="1 1 1")
    if joint.type == "floating":
        ET.SubElement(body, "freejoint", name=joint.name)
    elif joint.type != "fixed":
        kind = "slide" if joint.type == "prismatic" else "hinge"
        ET.SubElement(body, "joint", name=joint.name, type=kind, axis=_numbers(joint.axis))
    return body


def _numbers(values: object) -> str:
    return " ".join(repr(float(v)) for v in np.asarray(values))
