"""Gearbox joints of SDF: they tie the angles of two hinges on a common reference body.

With theta1 the angle from the reference body to the gearbox's parent about ``<axis>``, and theta2
that to its child about ``<axis2>``, theta2 = -ratio theta1 (SDF's specification of
``gearbox_ratio`` and ``gearbox_reference_body``).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from closedchain.urdf import elements
from closedchain.urdf.description import JointRelation
from closedchain.urdf.formats.sdf.frames import Frames
from closedchain.urdf.formats.sdf.graph import Edge
from closedchain.urdf.formats.sdf.text_values import child, direction_of, number, word

if TYPE_CHECKING:
    from lxml.etree import _Element as Element

_PARALLEL = 1.0 - 1e-6


def gear_relation(
    element: Element, frames: Frames, edges: Sequence[Edge], old: bool
) -> JointRelation | None:
    """Relation of the two hinges of a gearbox; None where they are not there or not parallel.

    ``old`` as for ``Frames.axes``.
    """
    reference = frames.body(word(element, "gearbox_reference_body"), element)
    ratio = number(element, "gearbox_ratio", 1.0)
    place = frames.of(element, word(element, "child"))
    names: list[str] = []
    factors: list[float] = []
    offset = 0.0
    for side, tag, factor in (("child", "axis2", 1.0), ("parent", "axis", ratio)):
        body = frames.body(word(element, side), element)
        axis = child(element, tag)
        if axis is None or factor == 0.0:
            return None
        about = frames.axes(axis, place, old) @ np.array(direction_of(axis))
        found = _hinge(edges, reference, body, about)
        if found is None:
            return None
        edge, sense = found
        names.append(edge.name)
        factors.append(factor * sense)
        offset += factor * sense * edge.home
    name = elements.text(element, "name")
    return JointRelation(name, "linear", tuple(names), tuple(factors), offset, element.sourceline)


def _hinge(
    edges: Sequence[Edge], reference: str, body: str, about: np.ndarray
) -> tuple[Edge, float] | None:
    """Hinge between two bodies about an axis (3,) in the model, and in which sense it turns."""
    for edge in edges:
        if edge.kind != "revolute" or {edge.parent, edge.child} != {reference, body}:
            continue
        along = float(edge.place[:3, :3] @ np.array(edge.axes[0]) @ about)
        if abs(along) >= _PARALLEL:
            return edge, float(np.sign(along)) * (1.0 if edge.parent == reference else -1.0)
    return None
