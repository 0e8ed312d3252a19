"""Joints of several freedoms in the tree of a URDF: planar, ball, universal, cylindrical, screw.

Of these stock URDF has only the planar joint; others write the rest in its manner. They become
joints of one freedom, or a floating joint with a closure: see ``composite``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from lxml import etree

from closedchain.urdf import elements
from closedchain.urdf.description import Vector3
from closedchain.urdf.formats.composite import KINDS, Composite, taken_apart
from closedchain.urdf.formats.substitution import (
    constraint_element,
    named_children,
    replace_by,
)
from closedchain.urdf.writing import joint_element, link_element

if TYPE_CHECKING:
    from lxml.etree import _Element as Element

_SECOND: Vector3 = (0.0, 1.0, 0.0)


def translate(root: Element, notes: list[str]) -> None:
    """Replace such joints of the root by what moves as they do, with a note for each.

    Raises
    ------
    DescriptionError
        A screw without its pitch, links or numbers that are missing.
    """
    for element in named_children(root, "joint"):
        kind = (element.get("type") or "").lower()
        if kind not in KINDS:
            continue
        element.tag = "joint"
        parts = taken_apart(_composite(element, kind))
        made: list[Element] = [link_element(link) for link in parts.links]
        made += [joint_element(joint) for joint in parts.joints]
        made += [constraint_element(closure) for closure in parts.closures]
        made += [constraint_element(relation) for relation in parts.relations]
        notes.append(f"line {element.sourceline}: {parts.note}")
        if elements.only_child(element, "limit") is not None and kind != "screw":
            notes.append(f"line {element.sourceline}: bounds of the {kind} joint were not read")
        replace_by(element, *made)


def _composite(element: Element, kind: str) -> Composite:
    ends = [
        elements.text(elements.required_child(element, side), "link")
        for side in ("parent", "child")
    ]
    axis = elements.only_child(element, "axis")
    first = (1.0, 0.0, 0.0) if axis is None else elements.unit_vector(axis)
    axis2 = elements.only_child(element, "axis2")
    second = _SECOND if axis2 is None else elements.unit_vector(axis2)
    pitch = 0.0
    if kind == "screw":
        thread = next(
            (e for e in element if etree.QName(e).localname in ("screw_thread_pitch", "pitch")),
            None,
        )
        if thread is None:
            raise elements.error(
                element, '<screw_thread_pitch value="..."/> [m per turn] is missing'
            )
        pitch = elements.number(thread, "value")
    return Composite(
        name=elements.text(element, "name"),
        kind=kind,
        parent=ends[0],
        child=ends[1],
        origin=elements.origin(elements.only_child(element, "origin")),
        axes=(first, second),
        pitch=pitch,
    )
