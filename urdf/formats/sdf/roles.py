"""Roles that SDF has no words for, in elements of a namespace of our own.

Inputs, task, named postures, relations of joint values and the names of floating joints. Other
programs read over them, as SDF asks for.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from lxml import etree

from closedchain.urdf import elements
from closedchain.urdf.description import (
    OUTPUTS,
    RELATION_TYPES,
    Description,
    Input,
    JointRelation,
    Task,
)
from closedchain.urdf.errors import known_names
from closedchain.urdf.formats.sdf.text_values import NAMESPACE

if TYPE_CHECKING:
    from lxml.etree import _Element as Element


@dataclass
class Roles:
    """What the elements of our own say."""

    inputs: tuple[Input, ...] = ()
    task: Task | None = None
    states: dict[str, dict[str, tuple[float, ...]]] = field(default_factory=dict)
    relations: tuple[JointRelation, ...] = ()
    floating: dict[str, tuple[str, str]] = field(default_factory=dict)


def read_roles(model: Element) -> Roles:
    """Read the elements of our own in a model."""
    found = Roles()
    for element in model.iterchildren(f"{{{NAMESPACE}}}*"):
        tag = etree.QName(element).localname
        if tag == "input":
            item = Input(elements.text(element, "name"), elements.text(element, "joint"))
            found.inputs = (*found.inputs, item)
        elif tag == "task":
            found.task = _task(element)
        elif tag == "posture":
            found.states[elements.text(element, "name")] = {
                elements.text(part, "joint"): elements.numbers(part, "value", (1, 7))
                for part in element
            }
        elif tag == "relation":
            found.relations = (*found.relations, _relation(element))
        elif tag == "floating":
            found.floating[elements.text(element, "child")] = (
                elements.text(element, "name"),
                elements.text(element, "parent"),
            )
    return found


def _task(element: Element) -> Task:
    outputs = tuple(elements.text(element, "outputs").split())
    for output in outputs:
        if output not in OUTPUTS:
            raise elements.error(element, known_names(output, "output", OUTPUTS))
    length = None if element.get("length") is None else elements.positive(element, "length")
    return Task(elements.text(element, "base"), elements.text(element, "tip"), outputs, length)


def _relation(element: Element) -> JointRelation:
    kind = elements.text(element, "type")
    if kind not in RELATION_TYPES:
        raise elements.error(element, known_names(kind, "relation", RELATION_TYPES))
    joints = tuple(elements.text(part, "name") for part in element)
    return JointRelation(
        elements.text(element, "name"),
        kind,
        joints,
        elements.numbers(element, "coefficients", range(1, 33)),
        elements.number(element, "offset", 0.0),
    )


def say_roles(model: Element, description: Description) -> None:
    """Write what a description says beyond SDF."""
    d = description

    def add(tag: str, under: Element = model, **attributes: str) -> Element:
        return etree.SubElement(under, f"{{{NAMESPACE}}}{tag}", attributes)

    for joint in d.joints:
        if joint.type == "floating":
            add("floating", name=joint.name, parent=joint.parent, child=joint.child)
    for item in d.inputs:
        add("input", name=item.name, joint=item.joint)
    if d.task is not None:
        task = add("task", base=d.task.base, tip=d.task.tip, outputs=" ".join(d.task.outputs))
        if d.task.length is not None:
            task.set("length", elements.written((d.task.length,)))
    for relation in d.relations:
        said = add("relation", name=relation.name, type=relation.type)
        said.set("coefficients", elements.written(relation.coefficients))
        said.set("offset", elements.written((relation.offset,)))
        for name in relation.joints:
            add("joint", said, name=name)
    for name, values in d.states.items():
        posture = add("posture", name=name)
        for joint_name, numbers in values.items():
            add("joint", posture, joint=joint_name, value=elements.written(numbers))
