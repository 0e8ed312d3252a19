"""The spelling of ``<constraint>``, read and written: the one place that knows it.

A constraint is a joint that was cut to open a loop. It follows urdfdom_headers PR 108, and stock
URDF parsers skip it::

    <constraint name="c1" type="revolute">
      <parent link="a"/> <parent_origin xyz="0 0 0" rpy="0 0 0"/> <parent_axis xyz="0 0 1"/>
      <child link="b"/>  <child_origin xyz="0 0 0" rpy="0 0 0"/>  <child_axis xyz="0 0 1"/>
    </constraint>

Each axis is in the frame of the origin beside it. ``child_axis`` defaults to ``parent_axis``.
For a prismatic constraint both must be equal, because its two frames stay parallel. The two axes
of a universal joint are its two hinges, so both are required and nothing is assumed about them.
Spherical and fixed constraints have no axis.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING
from xml.sax.saxutils import quoteattr

from closedchain.urdf import _xml
from closedchain.urdf.description import (
    CLOSURE_TYPES,
    ClosureType,
    LoopClosure,
    Origin,
    Vector3,
)
from closedchain.urdf.errors import known_names

if TYPE_CHECKING:
    from lxml.etree import _Element as Element

CONSTRAINT = "constraint"
_WITHOUT_AXIS: tuple[ClosureType, ...] = ("spherical", "fixed")
_CHILDREN = ("parent", "parent_origin", "parent_axis", "child", "child_origin", "child_axis")
_SAME_AXIS = 1e-9  # how far the two axes of a prismatic constraint may differ, from rounding


def read_constraint(element: Element) -> LoopClosure:
    """Read one ``<constraint>`` element.

    Whether its links exist is for the reader of the whole description to say.

    Raises
    ------
    DescriptionError
        Unknown type, attribute or child; missing or superfluous axis; bad numbers.
    """
    _xml.allow(element, ("name", "type"), _CHILDREN)
    name = _xml.text(element, "name")
    kind = _type(element)
    links = []
    for side in ("parent", "child"):
        end = _xml.required_child(element, side)
        _xml.allow(end, ("link",))
        links.append(_xml.text(end, "link"))
    parent_axis, child_axis = _axes(element, kind)
    return LoopClosure(
        name=name,
        type=kind,
        parent=links[0],
        child=links[1],
        parent_origin=_xml.origin(_xml.only_child(element, "parent_origin")),
        child_origin=_xml.origin(_xml.only_child(element, "child_origin")),
        parent_axis=parent_axis,
        child_axis=child_axis,
        line=element.sourceline,
    )


def _type(element: Element) -> ClosureType:
    wanted = _xml.text(element, "type")
    for kind in CLOSURE_TYPES:
        if kind == wanted:
            return kind
    raise _xml.error(element, known_names(wanted, "constraint type", CLOSURE_TYPES))


def _axes(element: Element, kind: ClosureType) -> tuple[Vector3, Vector3]:
    parent = _xml.only_child(element, "parent_axis")
    child = _xml.only_child(element, "child_axis")
    if kind in _WITHOUT_AXIS:
        for axis in (parent, child):
            if axis is not None:
                raise _xml.error(axis, f"a {kind} constraint has no axis; remove <{axis.tag}>")
        return (0.0, 0.0, 1.0), (0.0, 0.0, 1.0)
    if parent is None:
        raise _xml.error(element, f"a {kind} constraint needs <parent_axis>")
    if child is None and kind == "universal":
        raise _xml.error(element, "a universal constraint needs <child_axis>, its second hinge")
    parent_axis = _xml.unit_vector(parent)
    if child is None:
        return parent_axis, parent_axis
    child_axis = _xml.unit_vector(child)
    if kind == "prismatic" and math.dist(parent_axis, child_axis) > _SAME_AXIS:
        raise _xml.error(
            child,
            "the two axes of a prismatic constraint must be equal: its frames stay parallel; "
            "turn an origin instead",
        )
    return parent_axis, child_axis


def constraint_xml(closure: LoopClosure) -> str:
    """Write a closure as a ``<constraint>`` element that reads back to the same numbers.

    Returns
    -------
    str
        The element over several lines, without indentation and without a final line end.
    """
    lines = [f"<{CONSTRAINT} name={quoteattr(closure.name)} type={quoteattr(closure.type)}>"]
    for side, link, origin, axis in (
        ("parent", closure.parent, closure.parent_origin, closure.parent_axis),
        ("child", closure.child, closure.child_origin, closure.child_axis),
    ):
        lines.append(f"  <{side} link={quoteattr(link)}/>")
        if origin != Origin():
            lines.append(
                f'  <{side}_origin xyz="{_plain(origin.xyz)}" rpy="{_plain(origin.rpy)}"/>'
            )
        if closure.type not in _WITHOUT_AXIS:
            lines.append(f'  <{side}_axis xyz="{_plain(axis)}"/>')
    return "\n".join([*lines, f"</{CONSTRAINT}>"])


def _plain(values: Vector3) -> str:
    return " ".join(repr(float(value)) for value in values)
