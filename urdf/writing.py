"""A description as URDF: a tree that stock parsers load, and beside it what closes the loops.

Where a description comes from URDF text, that text is kept: colours, collision shapes, limits of
effort and all that this program does not read go along.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING

from lxml import etree

from closedchain.urdf import elements
from closedchain.urdf.constraint_element import CONSTRAINT, constraint_xml
from closedchain.urdf.description import (
    Coupling,
    Description,
    Inertial,
    Input,
    Joint,
    Link,
    Origin,
)
from closedchain.urdf.formats.substitution import local_name, named_children
from closedchain.urdf.shapes import Shape, Shapes, visual_element

if TYPE_CHECKING:
    from lxml.etree import _Element as Element

UNBOUNDED = 1e6
"""Written for the missing one of two bounds [m or rad]."""
_BEYOND = 1e-9  # as for the reader of postures
_NO_SHAPES: Shapes = MappingProxyType({})
_SAID_ANEW = (
    CONSTRAINT,
    "task",
    "group_state",
    "loop_joint",
    "loop",
    "coupling",
    "ball_constraint",
)
"""Elements of our own and of other dialects that the description says."""


def urdf_text(description: Description, shapes: Shapes = _NO_SHAPES) -> str:
    """URDF of a description, made of it alone and of the shapes given."""
    return _text(_built(description, shapes))


def urdf_document(description: Description) -> Element:
    """Element tree of the URDF that a description comes from, brought up to date.

    Closures, relations, inputs, task and named postures are those of the description, and so are
    inertias of links that follow from their shapes. What other
    dialects said about loops is not repeated; what belongs to other programs otherwise stays.
    """
    root = _original(description)
    if root is None:
        root = _built(description, _NO_SHAPES)
        return root
    followers = {coupling.joint for coupling in description.couplings}
    joints = {joint.name: joint for joint in description.joints}
    links = {link.name: link for link in description.links}
    inputs = {item.name for item in description.inputs}
    for element in list(root):
        tag = local_name(element)
        if tag in _SAID_ANEW:
            root.remove(element)
        elif tag == "gazebo":
            for loop in named_children(element, "joint"):
                element.remove(loop)
        elif element.tag == "link":
            link = links[str(element.get("name"))]
            if link.inertial is not None and element.find("inertial") is None:
                element.insert(0, inertial_element(link.inertial))
        elif element.tag == "joint":
            element.attrib.pop("independent", None)
            if element.get("name") not in followers:
                _remove_all(element, "mimic")
            _bring_up_to_date(element, joints[str(element.get("name"))])
        elif element.tag == "transmission":
            inputs.discard(element.get("name"))
    missing = [item for item in description.inputs if item.name in inputs]
    _say_roles(root, description, missing)
    return root


def document_text(root: Element) -> str:
    """Text of an element tree, with indentation."""
    return _text(root)


def _text(root: Element) -> str:
    etree.indent(root, "  ")
    return etree.tostring(root, encoding="unicode") + "\n"


def _original(description: Description) -> Element | None:
    """Text of the description as a tree without namespaces, if it says the same tree."""
    if not description.text:
        return None
    parser = etree.XMLParser(resolve_entities=False, no_network=True, remove_comments=True)
    root = etree.fromstring(description.text.encode("utf-8"), parser)
    if etree.QName(root).localname != "robot":
        return None
    home = etree.QName(root).namespace
    for element in root.iter():
        if home is not None and etree.QName(element).namespace == home:
            element.tag = etree.QName(element).localname
    etree.cleanup_namespaces(root)
    links = [str(element.get("name")) for element in root.findall("link")]
    joints = [(str(e.get("name")), str(e.get("type"))) for e in root.findall("joint")]
    same = links == [link.name for link in description.links]
    return root if same and joints == [(j.name, j.type) for j in description.joints] else None


def _bring_up_to_date(element: Element, joint: Joint) -> None:
    """Write origin and axis where the description has others: rounded ones made exact."""
    if elements.origin(element.find("origin")) != joint.origin:
        _remove_all(element, "origin")
        element.append(elements.origin_element(joint.origin))
    axis = element.find("axis")
    if joint.type in ("fixed", "floating"):
        return
    written = (1.0, 0.0, 0.0) if axis is None else elements.unit_vector(axis)
    if written != joint.axis:
        _remove_all(element, "axis")
        etree.SubElement(element, "axis", xyz=elements.written(joint.axis))


def _remove_all(element: Element, tag: str) -> None:
    for child in element.findall(tag):
        element.remove(child)


def _built(description: Description, shapes: Shapes) -> Element:
    root = etree.Element("robot", name=description.name)
    for link in description.links:
        root.append(link_element(link, shapes.get(link.name, ())))
    couplings = {coupling.joint: coupling for coupling in description.couplings}
    for joint in description.joints:
        root.append(joint_element(joint, couplings.get(joint.name)))
    for remark in description.remarks:
        element = etree.SubElement(root, "remark", about=remark.about)
        if remark.source:
            element.set("source", remark.source)
        element.text = remark.text
    _say_roles(root, description, description.inputs)
    return root


def _say_roles(root: Element, description: Description, inputs: Iterable[Input]) -> None:
    """Append closures, relations, inputs, task and postures."""
    for closure in description.closures:
        root.append(etree.fromstring(constraint_xml(closure)))
    for relation in description.relations:
        root.append(etree.fromstring(constraint_xml(relation)))
    for item in inputs:
        _say_input(root, item)
    task = description.task
    if task is not None:
        element = etree.SubElement(root, "task", base=task.base, tip=task.tip)
        element.set("outputs", " ".join(task.outputs))
        if task.length is not None:
            element.set("length", elements.written((task.length,)))
    outside = set(unstated(description))
    for name, values in (("home", description.home), *description.states.items()):
        told = {joint: numbers for joint, numbers in values.items() if joint not in outside}
        if name == "home":  # joints not listed are at zero
            told = {joint: numbers for joint, numbers in told.items() if any(numbers[:6])}
        if told or name != "home":
            _say_posture(root, name, told)


def _say_input(root: Element, item: Input) -> None:
    transmission = etree.SubElement(root, "transmission", name=item.name)
    etree.SubElement(transmission, "joint", name=item.joint)
    if (item.reduction, item.rotor_inertia) == (1.0, 0.0):
        return
    actuator = etree.SubElement(transmission, "actuator", name=item.name)
    for tag, value in (
        ("mechanicalReduction", item.reduction),
        ("rotorInertia", item.rotor_inertia),
    ):
        etree.SubElement(actuator, tag).text = elements.written((value,))


def unstated(description: Description) -> tuple[str, ...]:
    """Joints whose home lies outside their limits: a URDF may not state it."""
    return tuple(
        joint.name
        for joint in description.joints
        if joint.type in ("revolute", "prismatic")
        and joint.name in description.home
        and not joint.lower - _BEYOND <= description.home[joint.name][0] <= joint.upper + _BEYOND
    )


def _say_posture(root: Element, name: str, values: Mapping[str, tuple[float, ...]]) -> None:
    state = etree.SubElement(root, "group_state", name=name, group="all")
    for joint, numbers in values.items():
        etree.SubElement(state, "joint", name=joint, value=elements.written(numbers))


def link_element(link: Link, shapes: Iterable[Shape] = ()) -> Element:
    """``<link>`` with its inertia and shapes."""
    element = etree.Element("link", name=link.name)
    if link.inertial is not None:
        element.append(inertial_element(link.inertial))
    for shape in shapes:
        element.append(visual_element(shape))
    return element


def inertial_element(inertial: Inertial) -> Element:
    """``<inertial>`` of a link."""
    element = etree.Element("inertial")
    if inertial.origin != Origin():
        element.append(elements.origin_element(inertial.origin))
    etree.SubElement(element, "mass", value=elements.written((inertial.mass,)))
    inertia = etree.SubElement(element, "inertia")
    for name in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"):
        inertia.set(name, elements.written((getattr(inertial, name),)))
    return element


def joint_element(joint: Joint, coupling: Coupling | None = None) -> Element:
    """``<joint>`` with its bounds, and with its ``<mimic>`` if it follows another."""
    free = joint.lower == -math.inf and joint.upper == math.inf
    kind = "continuous" if joint.type == "revolute" and free else joint.type
    element = etree.Element("joint", name=joint.name, type=kind)
    etree.SubElement(element, "parent", link=joint.parent)
    etree.SubElement(element, "child", link=joint.child)
    if joint.origin != Origin():
        element.append(elements.origin_element(joint.origin))
    if kind in ("revolute", "continuous", "prismatic"):
        etree.SubElement(element, "axis", xyz=elements.written(joint.axis))
    if kind in ("revolute", "prismatic"):
        limit = etree.SubElement(element, "limit")
        if not free:
            limit.set("lower", elements.written((max(joint.lower, -UNBOUNDED),)))
            limit.set("upper", elements.written((min(joint.upper, UNBOUNDED),)))
        limit.set("effort", "0")
        limit.set("velocity", "0")
    dynamics = {"damping": joint.damping, "friction": joint.friction, "armature": joint.armature}
    said = {name: elements.written((value,)) for name, value in dynamics.items() if value}
    if said:
        etree.SubElement(element, "dynamics", said)
    if coupling is not None:
        mimic = etree.SubElement(element, "mimic", joint=coupling.leader)
        mimic.set("multiplier", elements.written((coupling.multiplier,)))
        mimic.set("offset", elements.written((coupling.offset,)))
    return element
