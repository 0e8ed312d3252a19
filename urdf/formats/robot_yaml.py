"""``robot.yaml`` beside a URDF: loops as pairs of frames, read and written.

The extension of URDF of arXiv 2504.04767, as the robots of Gepetto's example-parallel-robots have
it::

    closed_loop: [[frame_1A, frame_1B], [frame_2A, frame_2B]]
    type: [3d, 6d]                  # 3d: the origins coincide; 6d: the frames do
    name_mot: [motor1, motor2]      # actuated joints
    joint_name: [ankle, hip]        # joints that URDF cannot say ...
    joint_type: [SPHERICAL, UJOINT_XY]   # ... and what they are
    loop_name: [left, right]        # ours: names of the loops, by default those of their frames

A loop between ball and weld does not fit into that. It is written as a 6d pair with an empty link
on a joint of its own before it, which leaves the same freedoms, and read back as one closure.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from lxml import etree

from closedchain.urdf import elements
from closedchain.urdf.constraint_element import CONSTRAINT
from closedchain.urdf.description import (
    ClosureType,
    Description,
    Joint,
    Link,
    LoopClosure,
    Origin,
    Vector3,
)
from closedchain.urdf.errors import DescriptionError, known_names
from closedchain.urdf.formats.stubs import stub_parts, with_stubs
from closedchain.urdf.formats.substitution import (
    constraint_element,
    fresh_name,
    named_children,
)
from closedchain.urdf.formats.written import Written, homes_left_out
from closedchain.urdf.link_poses import link_poses
from closedchain.urdf.poses import inverse
from closedchain.urdf.writing import document_text, joint_element, link_element, urdf_document

if TYPE_CHECKING:
    from lxml.etree import _Element as Element

_TYPES: Mapping[str, ClosureType] = {"3d": "spherical", "6d": "fixed"}
_KEYS = ("closed_loop", "type", "loop_name", "name_mot", "joint_name", "joint_type")
_AXES: Mapping[str, Vector3] = {
    "X": (1.0, 0.0, 0.0),
    "Y": (0.0, 1.0, 0.0),
    "Z": (0.0, 0.0, 1.0),
}
_HINGES: Mapping[str, tuple[Vector3, Vector3]] = {
    f"UJOINT_{first}{second}": (_AXES[first], _AXES[second])
    for first, second in ("XY", "YZ", "ZX", "YX", "ZY", "XZ")
}
_JOINT_TYPES = ("SPHERICAL", "FIXED", *_HINGES)


@dataclass(frozen=True)
class Sidecar:
    """What a ``robot.yaml`` says: loops (name, two frames, type), motors, types of joints."""

    loops: tuple[tuple[str, str, str, str], ...]
    motors: tuple[str, ...]
    joints: Mapping[str, str]
    notes: tuple[str, ...] = ()


def read_sidecar(text: str) -> Sidecar:
    """Read the text of a ``robot.yaml``.

    Raises
    ------
    DescriptionError
        No YAML, lists that do not belong together, unknown types.
    """
    import yaml

    try:
        content = yaml.safe_load(text)
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        line = None if mark is None else mark.line + 1
        raise DescriptionError(
            f"this is no XML, and not well-formed YAML: {getattr(error, 'problem', error)}",
            line=line,
        ) from None
    if not isinstance(content, dict) or not set(_KEYS) & set(content):
        raise DescriptionError(
            f"this is no XML, and no robot.yaml, which has keys of {', '.join(_KEYS)}"
        )
    pairs = _listed(content, "closed_loop")
    types = [str(word).lower() for word in _listed(content, "type")]
    if len(types) != len(pairs):
        raise DescriptionError(
            f"robot.yaml: closed_loop has {len(pairs)} pairs and type {len(types)} words; each "
            "loop needs its type, 3d or 6d"
        )
    called = [str(word) for word in _listed(content, "loop_name")]
    if called and len(called) != len(pairs):
        raise DescriptionError(
            f"robot.yaml: closed_loop has {len(pairs)} pairs and loop_name {len(called)} words"
        )
    loops = []
    for k, (pair, kind) in enumerate(zip(pairs, types, strict=True)):
        if not isinstance(pair, list) or len(pair) != 2:
            raise DescriptionError(f"robot.yaml: {pair!r} in closed_loop is no pair of frames")
        if kind not in _TYPES:
            raise DescriptionError(f"robot.yaml: {known_names(kind, 'type of a loop', _TYPES)}")
        name = called[k] if called else str(pair[0]).removesuffix("_A").removesuffix("_1")
        loops.append((name, str(pair[0]), str(pair[1]), kind))
    names = [str(word) for word in _listed(content, "joint_name")]
    kinds = [str(word) for word in _listed(content, "joint_type")]
    if len(names) != len(kinds):
        raise DescriptionError(
            f"robot.yaml: joint_name has {len(names)} words and joint_type {len(kinds)}"
        )
    for kind in kinds:
        if kind not in _JOINT_TYPES:
            raise DescriptionError(f"robot.yaml: {known_names(kind, 'joint_type', _JOINT_TYPES)}")
    motors = tuple(str(word) for word in _listed(content, "name_mot"))
    notes = tuple(f"robot.yaml: {key} was not read" for key in content if key not in _KEYS)
    return Sidecar(tuple(loops), motors, dict(zip(names, kinds, strict=True)), notes)


def _listed(content: Mapping[str, Any], key: str) -> list[Any]:
    found = content.get(key) or []
    if not isinstance(found, list):
        raise DescriptionError(f"robot.yaml: {key} must be a list, not a {type(found).__name__}")
    for item in found:
        words = item if key == "closed_loop" and isinstance(item, list) else [item]
        if any(not isinstance(word, str | int | float) for word in words):
            raise DescriptionError(f"robot.yaml: {key} must hold words only")
    return found


def with_sidecar(text: str, sidecar: Sidecar) -> tuple[str, tuple[str, ...]]:
    """URDF text with the loops, inputs and joint types of a sidecar in it, and notes.

    Raises
    ------
    DescriptionError
        Frames or joints that the URDF does not have.
    """
    root = elements.document(text)
    notes = list(sidecar.notes)
    joints = {str(joint.get("name")): joint for joint in named_children(root, "joint")}
    for name, kind in sidecar.joints.items():
        if name in joints:
            _change_type(joints[name], kind)
        else:
            unknown = known_names(name, "joint", joints, most=4)
            notes.append(f"robot.yaml: the joint_type {kind} was not read: {unknown}")
    _take_motors(root, sidecar.motors, joints, notes)
    joined = {
        frozenset(str(end.get("link")) for end in named_children(constraint, "parent", "child"))
        for constraint in named_children(root, CONSTRAINT)
    }
    for wanted, first, second, kind in sidecar.loops:
        ends = [_link_of(frame, root, joints) for frame in (first, second)]
        if frozenset(ends) in joined:
            continue  # the URDF itself says this loop, and says it better
        closure = LoopClosure(fresh_name(root, wanted), _TYPES[kind], ends[0], ends[1])
        root.append(constraint_element(_without_stub(root, closure, notes)))
    return etree.tostring(root, encoding="unicode"), tuple(notes)


def _known(name: str, what: str, among: Mapping[str, Element]) -> Element:
    if name not in among:
        raise DescriptionError(f"robot.yaml: {known_names(name, what, among)}")
    return among[name]


def _link_of(frame: str, root: Element, joints: Mapping[str, Element]) -> str:
    """Link of a frame's name: Pinocchio has frames for links and for joints."""
    links = {str(link.get("name")): link for link in named_children(root, "link")}
    if frame in joints and frame not in links:
        return str(elements.required_child(joints[frame], "child").get("link"))
    _known(frame, "frame", links)
    return frame


def _change_type(joint: Element, kind: str) -> None:
    for tag in ("limit", "mimic", "axis"):
        for child in named_children(joint, tag):
            joint.remove(child)
    joint.set("type", {"SPHERICAL": "spherical", "FIXED": "fixed"}.get(kind, "universal"))
    for tag, axis in zip(("axis", "axis2"), _HINGES.get(kind, ()), strict=False):
        etree.SubElement(joint, tag, xyz=elements.written(axis))


def _take_motors(
    root: Element, motors: Sequence[str], joints: Mapping[str, Element], notes: list[str]
) -> None:
    """Make the motors the inputs; transmissions on other joints are taken out."""
    driven = {}
    for transmission in named_children(root, "transmission"):
        names = [str(joint.get("name")) for joint in named_children(transmission, "joint")]
        if len(names) == 1 and names[0] in motors:
            driven[names[0]] = transmission
        elif motors:
            notes.append(
                f"line {transmission.sourceline}: <transmission {transmission.get('name')!r}> "
                "drives "
                "no motor of robot.yaml and was not read"
            )
            root.remove(transmission)
    for motor in motors:
        _known(motor, "joint", joints)
        if motor not in driven:
            transmission = etree.SubElement(root, "transmission", name=motor)
            etree.SubElement(transmission, "joint", name=motor)


def _without_stub(root: Element, closure: LoopClosure, notes: list[str]) -> LoopClosure:
    """A weld behind an empty link on a hinge or slide of its own is that hinge or slide, cut."""
    if closure.type != "fixed":
        return closure
    links = {str(link.get("name")): link for link in named_children(root, "link")}
    for stub, other in ((closure.parent, closure.child), (closure.child, closure.parent)):
        carrier = None if len(links[stub]) else _only_joint(root, stub)
        if carrier is None:
            continue
        kind: ClosureType = "prismatic" if carrier.get("type") == "prismatic" else "revolute"
        axis = elements.unit_vector(elements.required_child(carrier, "axis"))
        root.remove(carrier)
        root.remove(links[stub])
        notes.append(
            f"the empty link {stub!r} on the joint {carrier.get('name')!r} with a 6d loop behind "
            "it "
            f"was read as the closure {closure.name!r} of type {kind}"
        )
        return LoopClosure(
            closure.name,
            kind,
            parent=elements.text(elements.required_child(carrier, "parent"), "link"),
            child=other,
            parent_origin=elements.origin(elements.only_child(carrier, "origin")),
            parent_axis=axis,
            child_axis=axis,
        )
    return closure


def _only_joint(root: Element, link: str) -> Element | None:
    """Joint that carries a link which carries nothing itself, neither joint, input nor posture."""
    carrier = None
    for joint in named_children(root, "joint"):
        if any(end.get("link") == link for end in named_children(joint, "parent")):
            return None
        if any(end.get("link") == link for end in named_children(joint, "child")):
            carrier = joint
    kinds = ("revolute", "continuous", "prismatic")
    if carrier is None or carrier.get("type") not in kinds:
        return None
    for said in named_children(root, "transmission", "group_state"):
        if any(joint.get("name") == carrier.get("name") for joint in said.iter("joint")):
            return None
    return carrier


def write(description: Description) -> Written:
    """``robot.yaml``, the ``robot.urdf`` beside it, and what they do not say."""
    root = urdf_document(description)
    for constraint in named_children(root, CONSTRAINT):
        root.remove(constraint)
    places = link_poses(description)
    losses: list[str] = []
    loops: list[tuple[str, str, str]] = []
    for closure in description.closures:
        between = inverse(places[closure.parent]) @ places[closure.child]
        first, second, kind, sentence = _frames(root, closure, between)
        loops.append((first, second, "3d" if kind == "spherical" else "6d"))
        losses += [sentence] if sentence else []
    for relation in description.relations:
        root.append(constraint_element(relation))
        losses.append(
            f"the relation {relation.name!r} of joint values is only in the URDF, as a <constraint>"
        )
    losses += [
        f"the coupling of the joint {coupling.joint!r} is only in the URDF, as a <mimic>"
        for coupling in description.couplings
    ]
    losses += homes_left_out(description)
    motors = [item.joint for item in description.inputs]
    pairs = ", ".join(f"[{_word(a)}, {_word(b)}]" for a, b, _ in loops)
    lines = [
        f"closed_loop: [{pairs}]",
        f"type: [{', '.join(kind for _, _, kind in loops)}]",
        f"loop_name: [{', '.join(_word(closure.name) for closure in description.closures)}]",
        f"name_mot: [{', '.join(map(_word, motors))}]",
        "joint_name: []",
        "joint_type: []",
    ]
    beside = {"robot.urdf": document_text(root)}
    return Written("\n".join(lines) + "\n", tuple(losses), beside)


def _word(name: str) -> str:
    """Name as a quoted scalar of YAML."""
    return "'" + name.replace("'", "''") + "'"


def _frames(
    root: Element, closure: LoopClosure, between: np.ndarray
) -> tuple[str, str, ClosureType, str]:
    """Add what a pair of frames needs; names and type of the pair, and what was changed."""
    stubs = with_stubs(closure, between, ("fixed", "spherical"))
    end, sentence = closure, ""
    if stubs is not None:
        links, joints = stub_parts(stubs, closure.parent)
        for link in links:
            root.append(link_element(link))
        for joint in joints:
            root.append(joint_element(joint))
        end = stubs.closure
        what = "an empty link on a joint" if len(links) == 1 else "empty links on joints"
        sentence = (
            f"the {closure.type} closure {closure.name!r} is a pair of frames behind {what} of "
            "its own"
        )
    first = _frame(root, end.parent, end.parent_origin, f"{closure.name}_A")
    second = _frame(root, end.child, end.child_origin, f"{closure.name}_B")
    return first, second, end.type, sentence


def _frame(root: Element, link: str, origin: Origin, name: str) -> str:
    """Name of a link at an origin in a link: the link itself where it is there already."""
    if origin == Origin():
        return link
    root.append(link_element(Link(name)))
    root.append(joint_element(Joint(f"{name}_fixed", "fixed", link, name, origin)))
    return name
