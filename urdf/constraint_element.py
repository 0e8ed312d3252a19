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
Spherical and fixed constraints have no axis, and those of a point have none on the child's side.
A rod has its length [m]: ``<constraint name="rod" type="distance" length="0.3">``.

Constraints between joint values are spelt in ``relation_element``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Literal

from closedchain.urdf import elements
from closedchain.urdf.description import (
    CLOSURE_TYPES,
    RELATION_TYPES,
    ClosureType,
    JointRelation,
    LoopClosure,
    Origin,
    RelationType,
    Vector3,
)
from closedchain.urdf.errors import known_names
from closedchain.urdf.relation_element import ATTRIBUTES, CHILDREN, read_relation, relation_xml

if TYPE_CHECKING:
    from lxml.etree import _Element as Element

CONSTRAINT = "constraint"
_CHILDREN = ("parent", "parent_origin", "parent_axis", "child", "child_origin", "child_axis")
_SAME_AXIS = 1e-9  # how far the two axes of a prismatic constraint may differ, from rounding


@dataclass(frozen=True)
class Spelling:
    """What a constraint of a type is written with.

    Attributes
    ----------
    parent_axis : bool
        Whether there is an axis on the parent's side.
    child_axis : str
        On the child's side: "none", "optional" (the parent's where it is left out), "equal" (the
        same where both are given) or "required".
    sizes : tuple of str
        Attributes that hold a positive number [m], all required.
    """

    parent_axis: bool
    child_axis: Literal["none", "optional", "equal", "required"]
    sizes: tuple[str, ...] = ()


SPELLINGS: Mapping[ClosureType, Spelling] = MappingProxyType(
    {
        "fixed": Spelling(False, "none"),
        "revolute": Spelling(True, "optional"),
        "prismatic": Spelling(True, "equal"),
        "cylindrical": Spelling(True, "optional"),
        "universal": Spelling(True, "required"),
        "spherical": Spelling(False, "none"),
        "planar": Spelling(True, "optional"),
        "point_on_line": Spelling(True, "none"),
        "in_plane": Spelling(True, "none"),
        "distance": Spelling(False, "none", ("length",)),
    }
)


def read_constraint(element: Element) -> LoopClosure | JointRelation:
    """Read one ``<constraint>`` element: a cut joint, or a relation of joint values.

    Whether its links or joints exist is for the reader of the whole description to say.

    Raises
    ------
    DescriptionError
        Unknown type, attribute or child; missing or superfluous axis or length; bad numbers.
    """
    extra = {name for spelling in SPELLINGS.values() for name in spelling.sizes}
    extra |= {name for names in ATTRIBUTES.values() for name in names}
    elements.allow(
        element,
        ("name", "type", *sorted(extra)),
        (*_CHILDREN, *(child for names in CHILDREN.values() for child in names)),
    )
    name = elements.text(element, "name")
    kind = _type(element)
    if kind == "linear" or kind == "polynomial":
        elements.allow(element, ("name", "type", *ATTRIBUTES[kind]), CHILDREN[kind])
        return read_relation(element, kind)
    sizes = SPELLINGS[kind].sizes
    elements.allow(element, ("name", "type", *sizes), _CHILDREN)
    links = []
    for side in ("parent", "child"):
        end = elements.required_child(element, side)
        elements.allow(end, ("link",))
        links.append(elements.text(end, "link"))
    parent_axis, child_axis = _axes(element, kind)
    return LoopClosure(
        name=name,
        type=kind,
        parent=links[0],
        child=links[1],
        parent_origin=elements.origin(elements.only_child(element, "parent_origin")),
        child_origin=elements.origin(elements.only_child(element, "child_origin")),
        parent_axis=parent_axis,
        child_axis=child_axis,
        sizes=tuple((size, _size(element, kind, size)) for size in sizes),
        line=element.sourceline,
    )


def _size(element: Element, kind: ClosureType, size: str) -> float:
    if element.get(size) is None:
        raise elements.error(element, f'{_a(kind)} constraint needs its {size} [m]: {size}="..."')
    return elements.positive(element, size)


def _type(element: Element) -> ClosureType | RelationType:
    wanted = elements.text(element, "type")
    for kind in (*CLOSURE_TYPES, *RELATION_TYPES):
        if kind == wanted:
            return kind
    known = (*CLOSURE_TYPES, *RELATION_TYPES)
    raise elements.error(element, known_names(wanted, "constraint type", known))


def _axes(element: Element, kind: ClosureType) -> tuple[Vector3, Vector3]:
    parent = elements.only_child(element, "parent_axis")
    child = elements.only_child(element, "child_axis")
    spelling = SPELLINGS[kind]
    z = (0.0, 0.0, 1.0)
    for axis, there in ((parent, spelling.parent_axis), (child, spelling.child_axis != "none")):
        if axis is not None and not there:
            side = f" on the {axis.tag.split('_')[0]}'s side" if spelling.parent_axis else ""
            raise elements.error(
                axis, f"{_a(kind)} constraint has no axis{side}; remove <{axis.tag}>"
            )
    if not spelling.parent_axis:
        return z, z
    if parent is None:
        raise elements.error(element, f"{_a(kind)} constraint needs <parent_axis>")
    if child is None and spelling.child_axis == "required":
        raise elements.error(element, f"{_a(kind)} constraint needs <child_axis>, its second hinge")
    parent_axis = elements.unit_vector(parent)
    if child is None:
        return parent_axis, z if spelling.child_axis == "none" else parent_axis
    child_axis = elements.unit_vector(child)
    if spelling.child_axis == "equal" and math.dist(parent_axis, child_axis) > _SAME_AXIS:
        raise elements.error(
            child,
            f"the two axes of {_a(kind)} constraint must be equal: its frames stay parallel; "
            "turn an origin instead",
        )
    return parent_axis, child_axis


def constraint_xml(constraint: LoopClosure | JointRelation) -> str:
    """Write a closure or relation as a ``<constraint>`` that reads back to the same numbers.

    Returns
    -------
    str
        The element over several lines, without indentation and without a final line end.
    """
    if isinstance(constraint, JointRelation):
        return relation_xml(constraint)
    closure, spelling = constraint, SPELLINGS[constraint.type]
    sizes = "".join(f' {name}="{float(value)!r}"' for name, value in closure.sizes)
    head = f'{CONSTRAINT} name={elements.attribute(closure.name)} type="{closure.type}"{sizes}'
    lines = [f"<{head}>"]
    for side, link, origin, axis, there in (
        ("parent", closure.parent, closure.parent_origin, closure.parent_axis,
         spelling.parent_axis),
        ("child", closure.child, closure.child_origin, closure.child_axis,
         spelling.child_axis != "none"),
    ):  # fmt: skip
        lines.append(f"  <{side} link={elements.attribute(link)}/>")
        if origin != Origin():
            lines.append(
                f'  <{side}_origin xyz="{_plain(origin.xyz)}" rpy="{_plain(origin.rpy)}"/>'
            )
        if there:
            lines.append(f'  <{side}_axis xyz="{_plain(axis)}"/>')
    return "\n".join([*lines, f"</{CONSTRAINT}>"])


def _a(kind: str) -> str:
    return f"an {kind}" if kind[0] in "aeiou" else f"a {kind}"


def _plain(values: Vector3) -> str:
    return " ".join(repr(float(value)) for value in values)
