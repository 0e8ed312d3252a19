"""Values of SDF elements, which stand in their text."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
from lxml import etree

from closedchain.urdf import elements
from closedchain.urdf.description import Origin, Vector3
from closedchain.urdf.poses import of_quaternion, pose_of

if TYPE_CHECKING:
    from lxml.etree import _Element as Element

NAMESPACE = "urn:closedchain"
"""Of the elements in which roles are written that SDF has no words for."""


def children(element: Element, tag: str) -> Iterator[Element]:
    """Child elements of SDF's own with that tag."""
    for child in element:
        if isinstance(child.tag, str) and child.tag == tag:
            yield child


def child(element: Element, tag: str) -> Element | None:
    """First child with that tag, or None."""
    return next(children(element, tag), None)


def word(element: Element, tag: str, default: str | None = None) -> str:
    """Text of a child, without the blanks around it; required where there is no default."""
    found = child(element, tag)
    text = "" if found is None else (found.text or "").strip()
    if text:
        return text
    if default is None:
        raise elements.error(element, f"the element <{tag}> is missing or empty")
    return default


def numbers(element: Element, *counts: int, largest: float = elements.LARGEST) -> tuple[float, ...]:
    """Numbers in the text of an element, up to the ``largest``."""
    probe = etree.Element(element.tag, value=" ".join((element.text or "").split()))
    probe.sourceline = element.sourceline
    parent = element.getparent()
    if parent is not None and parent.get("name"):
        probe.set("name", str(parent.get("name")))
    return elements.numbers(probe, "value", counts, largest)


def number(element: Element, tag: str, default: float) -> float:
    """Number in the text of a child."""
    found = child(element, tag)
    if found is None or not (found.text or "").strip():
        return default
    return numbers(found, 1)[0]


def direction_of(axis: Element) -> Vector3:
    """Unit vector in the ``<xyz>`` of an axis; z where there is none, as in SDF."""
    xyz = child(axis, "xyz")
    if xyz is None:
        return (0.0, 0.0, 1.0)
    x, y, z = numbers(xyz, 3)
    length = math.hypot(x, y, z)
    if not 1e-12 < length < math.inf:
        raise elements.error(axis, f"<xyz>{xyz.text}</xyz> is no direction")
    return x / length, y / length, z / length


def pose_in(element: Element | None) -> np.ndarray:
    """Pose (4, 4) in the text of a ``<pose>``: roll pitch yaw, or a quaternion."""
    if element is None or not (element.text or "").strip():
        return np.eye(4)
    if element.get("rotation_format", "euler_rpy") == "quat_xyzw":
        x, y, z, qx, qy, qz, qw = numbers(element, 7)
        if not math.hypot(qx, qy, qz, qw) > 1e-12:
            raise elements.error(element, "the quaternion is zero")
        found = of_quaternion((qw, qx, qy, qz))
        found[:3, 3] = x, y, z
        return found
    x, y, z, roll, pitch, yaw = numbers(element, 6)
    scale = math.pi / 180.0 if element.get("degrees", "false") in ("true", "1") else 1.0
    return pose_of(Origin((x, y, z), (scale * roll, scale * pitch, scale * yaw)))
