"""SDF to a description. Nested models are refused by name; what is not kinematics is noted."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from lxml import etree

from closedchain.urdf import elements
from closedchain.urdf.checking import checked, fresh_closures
from closedchain.urdf.description import (
    Coupling,
    Description,
    Inertial,
    Input,
    Joint,
    JointRelation,
    Link,
)
from closedchain.urdf.errors import DescriptionError, known_names
from closedchain.urdf.formats.sdf.drake import BALL, ball_constraints
from closedchain.urdf.formats.sdf.frames import MODEL, WORLD, Frames
from closedchain.urdf.formats.sdf.gearbox import gear_relation
from closedchain.urdf.formats.sdf.graph import Edge, EdgeKind, spanned
from closedchain.urdf.formats.sdf.roles import read_roles
from closedchain.urdf.formats.sdf.shapes import shapes_of_link
from closedchain.urdf.formats.sdf.text_values import (
    NAMESPACE,
    child,
    children,
    direction_of,
    number,
    numbers,
    pose_in,
    word,
)
from closedchain.urdf.formats.substitution import local_name
from closedchain.urdf.poses import inverse, origin_of, vector

if TYPE_CHECKING:
    from lxml.etree import _Element as Element

_KINDS: Mapping[str, EdgeKind] = {
    "revolute": "revolute",
    "continuous": "revolute",
    "prismatic": "prismatic",
    "fixed": "fixed",
    "ball": "ball",
    "universal": "universal",
    "revolute2": "revolute2",
    "screw": "screw",
}
_READ = ("link", "joint", "frame", "pose", "static", "plugin")
_NO_BOUND = 1e9


def read(text: str) -> Description:
    """Read an SDF text that holds one model.

    The posture of the file is home, and closes all loops by itself. The base is the link that is
    fixed to the world, or the world where other joints reach it, else the canonical link.

    Raises
    ------
    DescriptionError
        No model or several, nested models, unknown types and frames, numbers that are none.
    """
    model = _only_model(elements.document(text))
    roles = read_roles(model)
    notes = _read_over(model)
    frames = Frames(model)
    bodies = {
        elements.text(link, "name"): frames.pose(elements.text(link, "name"), link)
        for link in children(model, "link")
    }
    if not bodies:
        raise elements.error(model, "the model has no <link>")
    canonical = _canonical(model, bodies)
    old = _version(model) < (1, 5)
    edges, couplings = _edges(model, frames, canonical, old, notes)
    inputs = roles.inputs or _driven(model, {edge.name for edge in edges})
    driven = {item.joint for item in inputs}
    edges = [replace(edge, driven=edge.name in driven) for edge in edges]
    gears = _gears(model, frames, edges, old, notes)
    root, edges = _base(edges, canonical, notes)
    if root == WORLD:
        bodies[WORLD] = frames.pose(WORLD, model)
    found = spanned(root, bodies, edges, roles.floating)
    notes += found.notes
    inertials = {elements.text(e, "name"): _inertial(e) for e in children(model, "link")}
    links = [replace(link, inertial=inertials.get(link.name)) for link in found.links]
    joints = list(found.joints)
    _add_frames(model, frames, canonical, bodies, links, joints)
    if not inputs:
        notes.append("the file names no motors (plugins with a <joint_name>): there are no inputs")
    shapes = {
        elements.text(link, "name"): shapes_of_link(link, frames, notes)
        for link in children(model, "link")
    }
    description = Description(
        name=elements.text(model, "name"),
        root=root,
        links=tuple(links),
        joints=tuple(joints),
        closures=fresh_closures((*found.closures, *ball_constraints(model, bodies))),
        couplings=tuple(_shifted(c, found.home) for c in couplings),
        relations=(*found.relations, *roles.relations, *_of_tree(gears, joints, notes)),
        inputs=_uncut(inputs, {closure.name for closure in found.closures}, notes),
        task=roles.task,
        home=found.home,
        states=roles.states,
        notes=tuple(notes),
    )
    return checked(description, shapes)


def _only_model(root: Element) -> Element:
    found = [*children(root, "model")]
    for world in children(root, "world"):
        found += children(world, "model")
        for include in children(world, "include"):
            raise elements.error(include, f"the included model {word(include, 'uri', '')!r} is not "
                                          "read; put its text here")  # fmt: skip
    if len(found) != 1:
        names = ", ".join(repr(model.get("name")) for model in found) or "none"
        raise DescriptionError(
            f"an SDF file with one <model> is read; this one has {len(found)} ({names})",
            line=root.sourceline,
            element="sdf",
        )
    model = found[0]
    for inner in children(model, "model"):
        raise elements.error(inner, f"the nested model {inner.get('name')!r} is not read; put its "
                                    "links and joints into the outer one")  # fmt: skip
    for include in children(model, "include"):
        what = word(include, "uri", "") or word(include, "name", "")
        raise elements.error(include, f"the nested model {what!r} (<include>) is not read; put its "
                                      "links and joints here")  # fmt: skip
    return model


def _version(model: Element) -> tuple[int, ...]:
    words = str(model.getroottree().getroot().get("version", "1.12")).split(".")
    return tuple(int(part) for part in words if part.isdigit())


def _read_over(model: Element) -> list[str]:
    tags: dict[str, int] = {}
    for element in model:
        if not isinstance(element.tag, str) or etree.QName(element).namespace == NAMESPACE:
            continue
        local = local_name(element)
        if element.tag not in _READ and local != BALL:
            tag = f"{element.prefix}:{local}" if element.prefix else local
            tags[tag] = tags.get(tag, 0) + 1
    return [
        f"<{tag}> was not read" if count == 1 else f"{count} elements <{tag}> were not read"
        for tag, count in tags.items()
    ]


def _canonical(model: Element, bodies: Mapping[str, np.ndarray]) -> str:
    wanted = model.get("canonical_link")
    if not wanted:
        return next(iter(bodies))
    if wanted not in bodies:
        raise elements.error(model, known_names(wanted, "canonical link", bodies))
    return str(wanted)


def _edges(
    model: Element, frames: Frames, canonical: str, old: bool, notes: list[str]
) -> tuple[list[Edge], list[Coupling]]:
    edges: list[Edge] = []
    couplings: list[Coupling] = []
    for element in children(model, "joint"):
        wanted = elements.text(element, "type")
        if wanted == "gearbox":
            continue
        if wanted not in _KINDS:
            raise elements.error(element, known_names(wanted, "joint type", (*_KINDS, "gearbox")))
        ends = [frames.body(word(element, side), element) for side in ("parent", "child")]
        ends = [canonical if end == MODEL else end for end in ends]
        if ends[0] == ends[1]:
            raise elements.error(element, f"the joint connects the link {ends[0]!r} with itself")
        edges.append(_edge(element, frames, (ends[0], ends[1]), old, notes))
        couplings += _mimic(element)
    return edges, couplings


def _edge(
    element: Element, frames: Frames, ends: tuple[str, str], old: bool, notes: list[str]
) -> Edge:
    name, kind = elements.text(element, "name"), _KINDS[elements.text(element, "type")]
    place = frames.of(element, word(element, "child"))
    axes, lower, upper, home = [], -math.inf, math.inf, 0.0
    resists = (0.0, 0.0)
    for tag in ("axis", "axis2")[
        : {"fixed": 0, "ball": 0, "universal": 2, "revolute2": 2}.get(kind, 1)
    ]:
        axis = child(element, tag)
        if axis is None:
            raise elements.error(element, f"a {kind} joint needs its <{tag}>")
        turned = place[:3, :3].T @ frames.axes(axis, place, old)
        axes.append(vector(turned @ np.array(direction_of(axis))))
        limit = child(axis, "limit")
        if tag == "axis" and limit is not None and elements.text(element, "type") != "continuous":
            lower, upper = _bound(limit, "lower", -math.inf), _bound(limit, "upper", math.inf)
        dynamics = child(axis, "dynamics")
        if dynamics is not None and number(dynamics, "spring_stiffness", 0.0):
            notes.append(f"line {axis.sourceline}: the spring of the joint {name!r} was not read")
        if dynamics is not None and tag == "axis":
            resists = number(dynamics, "damping", 0.0), number(dynamics, "friction", 0.0)
        home = elements.number(axis, f"{{{NAMESPACE}}}home", 0.0) if tag == "axis" else home
    return Edge(
        name=name,
        kind=kind,
        parent=ends[0],
        child=ends[1],
        place=place,
        axes=tuple(axes),
        lower=lower + home,
        upper=upper + home,
        home=home,
        pitch=_pitch(element) if kind == "screw" else 0.0,
        line=element.sourceline,
        damping=resists[0],
        friction=resists[1],
        cut=element.get(f"{{{NAMESPACE}}}cut") == "true",
    )


def _bound(limit: Element, tag: str, without: float) -> float:
    """Bound of a joint; SDF writes 1e16, or inf, where there is none."""
    element = child(limit, tag)
    if element is None or (element.text or "").strip().lstrip("+-").lower() in ("", "inf"):
        return without
    value = numbers(element, 1, largest=math.inf)[0]
    return value if abs(value) < _NO_BOUND else without


def _of_tree(
    gears: list[JointRelation], joints: list[Joint], notes: list[str]
) -> list[JointRelation]:
    """Gears whose hinges are in the tree; a hinge that was cut has no value."""
    names = {joint.name for joint in joints}
    notes += [
        f"line {gear.line}: the gearbox joint {gear.name!r} was not read: one of its hinges was cut"
        for gear in gears
        if not set(gear.joints) <= names
    ]
    return [gear for gear in gears if set(gear.joints) <= names]


def _pitch(element: Element) -> float:
    """Way of a screw in a turn [m]; the older ``thread_pitch`` is in turns back, rad per m."""
    pitch = number(element, "screw_thread_pitch", 0.0)
    old = number(element, "thread_pitch", 0.0)
    if not pitch and not old:
        raise elements.error(element, "a screw joint needs <screw_thread_pitch> [m per turn]")
    return pitch or -2.0 * math.pi / old


def _gears(
    model: Element, frames: Frames, edges: list[Edge], old: bool, notes: list[str]
) -> list[JointRelation]:
    """Relations of the gearbox joints; those whose hinges are not there are noted."""
    found = []
    for element in children(model, "joint"):
        if element.get("type") != "gearbox":
            continue
        relation = gear_relation(element, frames, edges, old)
        if relation is None:
            notes.append(
                f"line {element.sourceline}: the gearbox joint {element.get('name')!r} was not "
                "read: its bodies do not hang on the reference body by hinges about its axes"
            )
        else:
            found.append(relation)
    return found


def _mimic(element: Element) -> list[Coupling]:
    axis = child(element, "axis")
    mimic = None if axis is None else child(axis, "mimic")
    if mimic is None:
        return []
    multiplier = number(mimic, "multiplier", 1.0)
    offset = number(mimic, "offset", 0.0) - multiplier * number(mimic, "reference", 0.0)
    follower, leader = elements.text(element, "name"), elements.text(mimic, "joint")
    return [Coupling(follower, leader, multiplier, offset, line=mimic.sourceline)]


def _shifted(coupling: Coupling, home: Mapping[str, tuple[float, ...]]) -> Coupling:
    """Coupling of values that count from home, as one of the joints' own values."""
    y, x = (home.get(joint, (0.0,))[0] for joint in (coupling.joint, coupling.leader))
    return replace(coupling, offset=coupling.offset + y - coupling.multiplier * x)


def _base(edges: list[Edge], canonical: str, notes: list[str]) -> tuple[str, list[Edge]]:
    """The base, and the edges that are left: a joint that only fixes the base is none."""
    on_world = [edge for edge in edges if WORLD in (edge.parent, edge.child)]
    if not on_world:
        notes.append(f"no joint holds the model to the world: the link {canonical!r} is its base")
        return canonical, edges
    if len(on_world) == 1 and on_world[0].kind == "fixed":
        edge = on_world[0]
        return (edge.child if edge.parent == WORLD else edge.parent), [
            e for e in edges if e is not edge
        ]
    return WORLD, edges


def _inertial(link: Element) -> Inertial | None:
    element = child(link, "inertial")
    if element is None:
        return None
    inertia = child(element, "inertia")
    moments = {
        key: number(inertia, key, 1.0 if key in ("ixx", "iyy", "izz") else 0.0)
        if inertia is not None
        else (1.0 if key in ("ixx", "iyy", "izz") else 0.0)
        for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    }
    place = pose_in(child(element, "pose"))
    mass = number(element, "mass", 1.0)
    if mass < 0.0:
        raise elements.error(element, f"the mass {mass:g} must not be negative")
    return Inertial(origin_of(place), mass, **moments)


def _add_frames(
    model: Element,
    frames: Frames,
    canonical: str,
    bodies: Mapping[str, np.ndarray],
    links: list[Link],
    joints: list[Joint],
) -> None:
    """Named frames are points of the links that they are attached to."""
    for element in children(model, "frame"):
        name = elements.text(element, "name")
        body = frames.body(name, element)
        body = canonical if body == MODEL else body
        if body not in bodies:
            continue
        place = inverse(bodies[body]) @ frames.pose(name, element)
        links.append(Link(name))
        joints.append(Joint(f"{name}_fixed", "fixed", body, name, origin_of(place)))


def _uncut(inputs: tuple[Input, ...], cut: set[str], notes: list[str]) -> tuple[Input, ...]:
    """Inputs whose joints were not cut: those that were have no value to give."""
    notes += [
        f"the input {item.name!r} is left out: its joint {item.joint!r} closes a loop and was cut"
        for item in inputs
        if item.joint in cut
    ]
    return tuple(item for item in inputs if item.joint not in cut)


def _driven(model: Element, joints: set[str]) -> tuple[Input, ...]:
    """Joints that plugins move, in the order of the file."""
    found: list[Input] = []
    for plugin in children(model, "plugin"):
        for element in plugin.iter():
            if isinstance(element.tag, str) and element.tag in ("joint_name", "jointName"):
                name = (element.text or "").strip()
                if name in joints and name not in {item.name for item in found}:
                    found.append(Input(name, name))
    return tuple(found)
