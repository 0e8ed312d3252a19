"""Drake's own elements in a URDF: ball constraints close loops, joints stand in the tree::

    <drake:ball_constraint>
      <drake:ball_constraint_body_A name="A"/> <drake:ball_constraint_p_AP value="0 0 .1"/>
      <drake:ball_constraint_body_B name="B"/> <drake:ball_constraint_p_BQ value="0 0 .2"/>
    </drake:ball_constraint>
    <drake:joint name="b" type="ball"> <parent link="A"/> <child link="B"/> </drake:joint>

A ``<drake:linear_bushing_rpy>`` is a spring between two frames: it closes nothing, and is noted.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from lxml import etree

from closedchain.urdf import elements
from closedchain.urdf.description import LoopClosure, Origin, Vector3
from closedchain.urdf.formats.substitution import (
    constraint_element,
    fresh_name,
    local_name,
    named_children,
    replace_by,
)

if TYPE_CHECKING:
    from lxml.etree import _Element as Element

_BALL = "ball_constraint"


def translate(root: Element, notes: list[str]) -> None:
    """Replace Drake's ball constraints by ``<constraint>`` elements and its joints by ``<joint>``.

    Raises
    ------
    DescriptionError
        A ball constraint without its bodies and points.
    """
    for element in named_children(root, _BALL):
        ends = {
            end: (_part(element, f"{_BALL}_body_{end}"), _part(element, f"{_BALL}_p_{point}"))
            for end, point in (("A", "AP"), ("B", "BQ"))
        }
        closure = LoopClosure(
            fresh_name(root, element.get("name") or "ball"),
            "spherical",
            parent=elements.text(ends["A"][0], "name"),
            child=elements.text(ends["B"][0], "name"),
            parent_origin=_point(ends["A"][1]),
            child_origin=_point(ends["B"][1]),
        )
        replace_by(element, constraint_element(closure))
    for element in named_children(root, "joint"):
        if "drake" in (etree.QName(element).namespace or "") and element.prefix is not None:
            element.tag = "joint"
            for child in element:
                if local_name(child) in ("parent", "child", "origin", "axis", "limit"):
                    child.tag = local_name(child)
    for element in named_children(root, "linear_bushing_rpy"):
        notes.append(
            f"line {element.sourceline}: a bushing is a spring and closes no loop; if it stands "
            "for "
            "one, write <constraint>"
        )
        root.remove(element)


def _part(element: Element, tag: str) -> Element:
    for child in named_children(element, tag):
        return child
    raise elements.error(element, f"the element <drake:{tag}> is missing")


def _point(element: Element) -> Origin:
    xyz: Vector3 = elements.vector(element, "value")
    return Origin(xyz)
