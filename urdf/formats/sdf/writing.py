"""A description as SDF: links where they are at home, and every joint, cut or not, as a joint.

Loops close by themselves, since a joint of SDF is where the file puts it together. Joint values
count from home there; ours go along in an attribute of a namespace of our own, and so does what SDF
has no words for.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from lxml import etree

from closedchain.urdf import elements
from closedchain.urdf.description import (
    ClosureType,
    Coupling,
    Description,
    Joint,
    Link,
    LoopClosure,
    Vector3,
)
from closedchain.urdf.formats.sdf.roles import say_roles
from closedchain.urdf.formats.sdf.text_values import NAMESPACE
from closedchain.urdf.formats.stubs import without_foreign_closures
from closedchain.urdf.formats.written import Written, listed
from closedchain.urdf.link_poses import link_poses
from closedchain.urdf.poses import direction, inverse, origin_of, pose_of
from closedchain.urdf.shapes import Shape, shapes_of
from closedchain.urdf.writing import document_text, urdf_document

if TYPE_CHECKING:
    from lxml.etree import _Element as Element

_VERSION = "1.11"
_KNOWN: dict[ClosureType, str] = {
    "fixed": "fixed",
    "revolute": "revolute",
    "prismatic": "prismatic",
    "universal": "universal",
    "spherical": "ball",
}


def write(description: Description) -> Written:
    """SDF of a description whose home is closed.

    Raises
    ------
    DescriptionError
        A closure that has no words in SDF, even with empty links.
    """
    shapes = shapes_of(urdf_document(description))
    description = _without_world(description)
    shapes = {_not_world(link): of_link for link, of_link in shapes.items()}
    d, _, losses = without_foreign_closures(description, tuple(_KNOWN))
    d, renamed = _with_distinct_names(d)
    if renamed:
        losses.append(
            f"SDF wants joints, closures and links to differ in name: {listed(renamed)} got _joint "
            "added"
        )
    root = etree.Element("sdf", nsmap={"closedchain": NAMESPACE}, version=_VERSION)
    model = etree.SubElement(root, "model", name=d.name, canonical_link=d.root)
    places = link_poses(d)
    _links(model, d, places, shapes)
    base = etree.SubElement(model, "joint", name=f"{d.root}_to_world", type="fixed")
    etree.SubElement(base, "parent").text = "world"
    etree.SubElement(base, "child").text = d.root
    couplings = {coupling.joint: coupling for coupling in d.couplings}
    points = _points(d, shapes)
    for joint in d.joints:
        if joint.type != "floating" and joint.child not in points:
            _joint(model, d, joint, couplings.get(joint.name))
    for closure in d.closures:
        _closure(model, closure, places)
    say_roles(model, d)
    if any(link.name == "world_link" for link in d.links):
        losses.append("the link 'world' is called 'world_link', since SDF's world is no link")
    if d.relations:
        losses.append(
            f"the relations of joint values {listed(r.name for r in d.relations)} are written for "
            "closedchain only: SDF has none"
        )
    if d.inputs:
        losses.append("inputs are written for closedchain only: in SDF motors belong to plugins")
    if d.remarks:
        losses.append("remarks are not written")
    losses.append("limits of effort and speed, armatures and collision shapes are not written")
    return Written(document_text(root), tuple(losses))


def _not_world(link: str) -> str:
    """Name of a link in SDF, where the world is no link."""
    return f"{link}_link" if link == "world" else link


def _without_world(d: Description) -> Description:
    """Description in which no link is called as SDF's world is."""
    if all(link.name != "world" for link in d.links):
        return d

    task = d.task
    if task is not None:
        task = replace(task, base=_not_world(task.base), tip=_not_world(task.tip))
    return replace(
        d,
        root=_not_world(d.root),
        links=tuple(replace(link, name=_not_world(link.name)) for link in d.links),
        joints=tuple(
            replace(j, parent=_not_world(j.parent), child=_not_world(j.child)) for j in d.joints
        ),
        closures=tuple(
            replace(c, parent=_not_world(c.parent), child=_not_world(c.child)) for c in d.closures
        ),
        task=task,
    )


def _with_distinct_names(d: Description) -> tuple[Description, list[str]]:
    """Description in which no joint and no closure is called as a link or as another of them."""
    taken = {link.name for link in d.links}

    def fresh(name: str) -> str:
        found = name
        while found in taken:
            found += "_joint"
        taken.add(found)
        return found

    joints = [replace(joint, name=fresh(joint.name)) for joint in d.joints]
    new = {old.name: joint.name for old, joint in zip(d.joints, joints, strict=True)}
    closures = [replace(closure, name=fresh(closure.name)) for closure in d.closures]
    renamed = [name for name, other in new.items() if name != other]
    renamed += [
        old.name for old, one in zip(d.closures, closures, strict=True) if old.name != one.name
    ]
    if not renamed:
        return d, []
    found = replace(
        d,
        joints=tuple(joints),
        closures=tuple(closures),
        couplings=tuple(replace(c, joint=new[c.joint], leader=new[c.leader]) for c in d.couplings),
        relations=tuple(
            replace(r, joints=tuple(new[joint] for joint in r.joints)) for r in d.relations
        ),
        inputs=tuple(replace(item, joint=new[item.joint]) for item in d.inputs),
        home={new[joint]: values for joint, values in d.home.items()},
        states={
            name: {new[joint]: values for joint, values in state.items()}
            for name, state in d.states.items()
        },
    )
    return found, renamed


def _points(d: Description, shapes: dict[str, tuple[Shape, ...]]) -> set[str]:
    """Links that are only points of others: fixed, empty, and carrying nothing."""
    carrying = {joint.parent for joint in d.joints}
    empty = {link.name for link in d.links if link.inertial is None and not shapes.get(link.name)}
    return {j.child for j in d.joints if j.type == "fixed"} & empty - carrying


def _links(
    model: Element,
    d: Description,
    places: dict[str, np.ndarray],
    shapes: dict[str, tuple[Shape, ...]],
) -> None:
    points = _points(d, shapes)
    holders = {joint.child: joint for joint in d.joints}
    for link in d.links:
        if link.name in points:
            continue
        element = etree.SubElement(model, "link", name=link.name)
        _pose(element, places[link.name])
        _inertial(element, link)
        for k, shape in enumerate(shapes.get(link.name, ())):
            _visual(element, shape, f"{link.name}_visual_{k + 1}")
    for link in d.links:
        if link.name in points:
            owner = holders[link.name]
            frame = etree.SubElement(model, "frame", name=link.name, attached_to=owner.parent)
            _pose(frame, pose_of(owner.origin))


def _pose(element: Element, place: np.ndarray) -> None:
    if (place != np.eye(4)).any():
        origin = origin_of(place)
        etree.SubElement(element, "pose").text = elements.written((*origin.xyz, *origin.rpy))


def _inertial(element: Element, link: Link) -> None:
    if link.inertial is None:
        return
    inertial = etree.SubElement(element, "inertial")
    _pose(inertial, pose_of(link.inertial.origin))
    etree.SubElement(inertial, "mass").text = elements.written((link.inertial.mass,))
    inertia = etree.SubElement(inertial, "inertia")
    for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"):
        etree.SubElement(inertia, key).text = elements.written((getattr(link.inertial, key),))


def _visual(element: Element, shape: Shape, name: str) -> None:
    visual = etree.SubElement(element, "visual", name=name)
    _pose(visual, pose_of(shape.origin))
    kind = etree.SubElement(etree.SubElement(visual, "geometry"), shape.kind)
    if shape.kind == "mesh":
        etree.SubElement(kind, "uri").text = shape.file.replace("package://", "model://", 1)
        etree.SubElement(kind, "scale").text = elements.written(shape.sizes)
    elif shape.kind == "box":
        etree.SubElement(kind, "size").text = elements.written(shape.sizes)
    else:
        for tag, size in zip(("radius", "length"), shape.sizes, strict=False):
            etree.SubElement(kind, tag).text = elements.written((size,))
    if shape.rgba is not None:
        material = etree.SubElement(visual, "material")
        for tag in ("ambient", "diffuse"):
            etree.SubElement(material, tag).text = elements.written(shape.rgba)


def _joint(model: Element, d: Description, joint: Joint, coupling: Coupling | None) -> None:
    kind = "revolute" if joint.type == "continuous" else joint.type
    element = _named(model, joint.name, kind, joint.parent, joint.child)
    if joint.type == "fixed":
        return
    home = d.home.get(joint.name, (0.0,))[0]
    axis = _axis(element, "axis", joint.axis)
    if home:
        axis.set(f"{{{NAMESPACE}}}home", elements.written((home,)))
    if joint.lower > -math.inf or joint.upper < math.inf:
        limit = etree.SubElement(axis, "limit")
        for tag, bound in (("lower", joint.lower), ("upper", joint.upper)):
            if math.isfinite(bound):
                etree.SubElement(limit, tag).text = elements.written((bound - home,))
    dynamics = [("damping", joint.damping), ("friction", joint.friction)]
    if joint.damping or joint.friction:
        element = etree.SubElement(axis, "dynamics")
        for tag, value in dynamics:
            etree.SubElement(element, tag).text = elements.written((value,))
    if coupling is not None:
        leader = d.home.get(coupling.leader, (0.0,))[0]
        offset = coupling.offset + coupling.multiplier * leader - home
        mimic = etree.SubElement(axis, "mimic", joint=coupling.leader)
        etree.SubElement(mimic, "multiplier").text = elements.written((coupling.multiplier,))
        etree.SubElement(mimic, "offset").text = elements.written((offset,))
        etree.SubElement(mimic, "reference").text = "0"


def _named(model: Element, name: str, kind: str, parent: str, child: str) -> Element:
    element = etree.SubElement(model, "joint", name=name, type=kind)
    etree.SubElement(element, "parent").text = parent
    etree.SubElement(element, "child").text = child
    return element


def _axis(element: Element, tag: str, axis: Vector3) -> Element:
    found = etree.SubElement(element, tag)
    etree.SubElement(found, "xyz").text = elements.written(axis)
    return found


def _closure(model: Element, closure: LoopClosure, places: dict[str, np.ndarray]) -> None:
    """Joint in the child's frame of the closure; the parent's is there too, at home."""
    kind = _KNOWN[closure.type]
    element = _named(model, closure.name, kind, closure.parent, closure.child)
    element.set(f"{{{NAMESPACE}}}cut", "true")
    in_child = pose_of(closure.child_origin)
    _pose(element, in_child)
    if closure.type in ("fixed", "spherical"):
        return
    if closure.type != "universal":
        _axis(element, "axis", closure.child_axis)
        return
    in_parent = places[closure.parent] @ pose_of(closure.parent_origin)
    first = direction(inverse(places[closure.child] @ in_child) @ in_parent, closure.parent_axis)
    _axis(element, "axis", first)
    _axis(element, "axis2", closure.child_axis)
