"""The spelling of a ``<constraint>`` between joint values, read and written.

The values of two or more joints add up, each times its multiplier (1 where it is left out)::

    <constraint name="pantograph" type="linear" offset="0.1">
      <joint name="a"/> <joint name="b" multiplier="-2"/> <joint name="c" multiplier="0.5"/>
    </constraint>                                         a - 2 b + 0.5 c = 0.1

A joint follows a polynomial of another joint's value, from the constant coefficient upwards, as
MJCF writes it but of any degree::

    <constraint name="cam" type="polynomial" polycoef="0.02 0 0.3">
      <follower joint="valve"/> <leader joint="shaft"/>
    </constraint>                                         valve = 0.02 + 0.3 shaft^2
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from closedchain.urdf import elements
from closedchain.urdf.description import JointRelation, RelationType

if TYPE_CHECKING:
    from lxml.etree import _Element as Element

ATTRIBUTES: dict[RelationType, tuple[str, ...]] = {
    "linear": ("offset",),
    "polynomial": ("polycoef",),
}
CHILDREN: dict[RelationType, tuple[str, ...]] = {
    "linear": ("joint",),
    "polynomial": ("follower", "leader"),
}
_LONGEST = 32
"""Most coefficients of a polynomial."""


def read_relation(element: Element, kind: RelationType) -> JointRelation:
    """Read one ``<constraint>`` between joint values, whose attributes have been checked.

    Whether its joints exist is for the reader of the whole description to say.

    Raises
    ------
    DescriptionError
        Too few joints, one named twice, a multiplier of zero, or a polynomial that is constant.
    """
    return _linear(element) if kind == "linear" else _polynomial(element)


def _linear(element: Element) -> JointRelation:
    joints: list[str] = []
    factors: list[float] = []
    for part in element.findall("joint"):
        elements.allow(part, ("name", "multiplier"))
        joint = elements.text(part, "name")
        if joint in joints:
            raise elements.error(part, f"the joint {joint!r} is listed twice")
        factor = elements.number(part, "multiplier", 1.0)
        if factor == 0.0:
            raise elements.error(
                part, f"multiplier=0 leaves the joint {joint!r} out; remove it here"
            )
        joints.append(joint)
        factors.append(factor)
    if len(joints) < 2:
        raise elements.error(
            element,
            f"a linear constraint ties two joints or more, <joint name= multiplier=>; it has "
            f"{len(joints)}",
        )
    return JointRelation(
        name=elements.text(element, "name"),
        type="linear",
        joints=tuple(joints),
        coefficients=tuple(factors),
        offset=elements.number(element, "offset", 0.0),
        line=element.sourceline,
    )


def _polynomial(element: Element) -> JointRelation:
    joints = []
    for side in ("follower", "leader"):
        part = elements.required_child(element, side)
        elements.allow(part, ("joint",))
        joints.append(elements.text(part, "joint"))
    if joints[0] == joints[1]:
        raise elements.error(element, f"the joint {joints[0]!r} follows itself")
    coefficients = elements.numbers(element, "polycoef", range(2, _LONGEST + 1))
    if not any(coefficients[1:]):
        raise elements.error(
            element,
            f"polycoef={element.get('polycoef')!r} is constant: the follower would stand still; "
            "give coefficients of the leader's value, its square, ...",
        )
    return JointRelation(
        name=elements.text(element, "name"),
        type="polynomial",
        joints=tuple(joints),
        coefficients=coefficients,
        line=element.sourceline,
    )


def relation_xml(relation: JointRelation) -> str:
    """Write a relation as a ``<constraint>`` element that reads back to the same numbers."""
    name, kind = elements.attribute(relation.name), elements.attribute(relation.type)
    head = f"<constraint name={name} type={kind}"
    if relation.type == "linear":
        lines = [f'{head} offset="{float(relation.offset)!r}">']
        lines += [
            f'  <joint name={elements.attribute(joint)} multiplier="{float(factor)!r}"/>'
            for joint, factor in zip(relation.joints, relation.coefficients, strict=True)
        ]
    else:
        coefficients = " ".join(repr(float(c)) for c in relation.coefficients)
        lines = [f'{head} polycoef="{coefficients}">']
        lines += [
            f"  <{side} joint={elements.attribute(joint)}/>"
            for side, joint in zip(("follower", "leader"), relation.joints, strict=True)
        ]
    return "\n".join([*lines, "</constraint>"])
