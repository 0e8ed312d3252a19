"""Readers of the elements that say what the joints and links are for.

``<transmission>`` (inputs), ``<task>``, ``<group_state>`` (home and other named postures) and
``<remark>``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from closedchain.urdf import elements
from closedchain.urdf._bodies import ONE_DOF
from closedchain.urdf._dynamics import MOTOR, read_motor
from closedchain.urdf.description import OUTPUTS, Input, Joint, Remark, Task
from closedchain.urdf.errors import known_names

if TYPE_CHECKING:
    from lxml.etree import _Element as Element

_BEYOND = 1e-9  # how far a stated value may lie outside the limits, from rounding
_UNIT = 1e-6  # how far the length of a quaternion may be from one


def read_input(
    element: Element,
    joints: Mapping[str, Joint],
    followers: Mapping[str, str],
    notes: list[str],
) -> Input | None:
    """Read one ``<transmission>``; None, with a note, where no input can be made of it.

    Robots carry transmissions that their controllers use otherwise: over two joints (a
    differential), on joints that were frozen or left out, on joints that follow another.

    Parameters
    ----------
    joints : mapping name -> Joint
    followers : mapping name of a mimic joint -> name of its leader
    notes : list
        What was read over is noted here.
    """
    elements.allow(element, ("name", "type"), ("joint", "actuator", *MOTOR))
    name = elements.text(element, "name")
    of_ros = element.get("type") is not None  # with the class that drives it
    references = element.findall("joint")
    if not references and not of_ros:
        elements.required_child(element, "joint")
    driven = []
    for reference in references:
        elements.allow(reference, ("name",))
        if not of_ros or elements.text(reference, "name") in joints:
            driven.append(_known_joint(reference, joints))
    joint, why = driven[0] if driven else None, ""
    if len(references) > 1:
        listed = ", ".join(str(reference.get("name")) for reference in references)
        why = f"it is over {len(references)} joints, {listed}"
    elif joint is None:
        missing = [repr(reference.get("name")) for reference in references]
        why = f"there is no joint {missing[0]}" if missing else "it names no joint"
    elif joint.type not in ONE_DOF:
        why = f"the joint {joint.name!r} is {joint.type}; an input is one of: {', '.join(ONE_DOF)}"
    elif joint.name in followers:
        why = f"the joint {joint.name!r} follows {followers[joint.name]!r} (mimic)"
    if joint is None or why:
        notes.append(
            f"line {element.sourceline}: <transmission {name!r}> is not taken as an input: {why}"
        )
        return None
    reduction, rotor = read_motor(element)
    return Input(name, joint.name, element.sourceline, reduction, rotor)


def _known_joint(reference: Element, joints: Mapping[str, Joint]) -> Joint:
    wanted = elements.text(reference, "name")
    if wanted not in joints:
        raise elements.error(reference, known_names(wanted, "joint", joints))
    return joints[wanted]


def read_task(element: Element, links: Sequence[str]) -> Task:
    """Read the ``<task>``."""
    elements.allow(element, ("base", "tip", "outputs", "length"))
    ends = [elements.text(element, side) for side in ("base", "tip")]
    for wanted in ends:
        if wanted not in links:
            raise elements.error(element, known_names(wanted, "link", links))
    if ends[0] == ends[1]:
        raise elements.error(element, f"base and tip are the same link {ends[0]!r}")
    if element.get("outputs") is None:
        raise elements.error(
            element, f"the attribute outputs is missing; some of: {_all_outputs()}"
        )
    outputs = tuple(element.get("outputs").split())
    if not outputs:
        raise elements.error(element, f"outputs is empty; some of: {_all_outputs()}")
    for output in outputs:
        if output not in OUTPUTS:
            raise elements.error(element, known_names(output, "output", OUTPUTS))
        if outputs.count(output) > 1:
            raise elements.error(element, f"the output {output!r} appears twice")
    length = None if element.get("length") is None else elements.positive(element, "length")
    return Task(ends[0], ends[1], outputs, length, line=element.sourceline)


def _all_outputs() -> str:
    return " ".join(OUTPUTS)


def read_state(element: Element, joints: Mapping[str, Joint]) -> dict[str, tuple[float, ...]]:
    """Read one ``<group_state>``: values of the joints listed, quaternions normalised."""
    elements.allow(element, ("name", "group"), ("joint",))
    state: dict[str, tuple[float, ...]] = {}
    for reference in element:
        elements.allow(reference, ("name", "value"))
        joint = _known_joint(reference, joints)
        if joint.name in state:
            raise elements.error(reference, "the joint is listed twice")
        state[joint.name] = _state_value(reference, joint)
    return state


def _state_value(reference: Element, joint: Joint) -> tuple[float, ...]:
    if joint.type == "fixed":
        raise elements.error(reference, "a fixed joint has no value; remove it here")
    if joint.type == "floating":
        values = elements.numbers(reference, "value", (7,))
        length = math.hypot(*values[3:])
        if abs(length - 1.0) > _UNIT:
            raise elements.error(
                reference,
                f"the quaternion qx qy qz qw has length {length:g}; it must be 1 within {_UNIT:g}",
            )
        return (*values[:3], *(value / length for value in values[3:]))
    largest = elements.LARGEST if joint.type == "prismatic" else elements.LARGEST_ANGLE
    value = elements.number(reference, "value", largest=largest)
    if not joint.lower - _BEYOND <= value <= joint.upper + _BEYOND:
        raise elements.error(
            reference,
            f"value={value:g} is outside the limits [{joint.lower:g}, {joint.upper:g}]",
        )
    return (value,)


def read_remark(element: Element) -> Remark:
    """Read one ``<remark>``; runs of blanks and line ends become one blank."""
    elements.allow(element, ("about", "source"))
    about = elements.text(element, "about")
    words = " ".join((element.text or "").split())
    if not words:
        raise elements.error(
            element, f"the remark about {about!r} is empty; write a sentence in it"
        )
    return Remark(about=about, text=words, source=" ".join(element.get("source", "").split()))
