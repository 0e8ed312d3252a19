"""From URDF text to a checked `Description`.

Nothing is dropped silently: what belongs to other programs is noted in ``Description.notes``,
what is wrong or unknown is refused with its line, element and name.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import TYPE_CHECKING

from lxml import etree

from closedchain.urdf import elements
from closedchain.urdf._bodies import ONE_DOF, read_joint, read_link
from closedchain.urdf._checks import (
    check_closures,
    check_relations,
    known_couplings,
    refuse_duplicates,
    root_of,
    without_second_drives,
)
from closedchain.urdf._dynamics import what_dynamics_read
from closedchain.urdf._foreign import set_aside
from closedchain.urdf._notes import merged
from closedchain.urdf._roles import read_input, read_remark, read_state, read_task
from closedchain.urdf.constraint_element import CONSTRAINT, read_constraint
from closedchain.urdf.description import (
    Description,
    Joint,
    JointRelation,
    LoopClosure,
    ParameterValue,
    Task,
)
from closedchain.urdf.errors import DescriptionError
from closedchain.urdf.expansion import expand
from closedchain.urdf.formats.dialects import translate_dialects
from closedchain.urdf.formats.missing_loops import are_loops_missing
from closedchain.urdf.solid_links import solid_links, solids_note

if TYPE_CHECKING:
    from lxml.etree import _Element as Element

_NONE: Mapping[str, ParameterValue] = MappingProxyType({})
_HOME = "home"
_ROOT_ELEMENTS = (
    *("link", "joint", "material", CONSTRAINT),
    *("transmission", "task", "group_state", "remark"),
)


def load_description(
    source: str | os.PathLike[str],
    parameters: Mapping[str, ParameterValue] = _NONE,
    *,
    xacro: bool = True,
) -> Description:
    """Read a closed-chain URDF or xacro file, or its text.

    Parameters
    ----------
    source, parameters, xacro
        As for `expand`. Line numbers in errors about the description count lines of the
        expanded text; without xacro these are the lines of the file.

    Raises
    ------
    DescriptionError
        Whatever is wrong with it.
    """
    expansion = expand(source, parameters, xacro=xacro)
    found = read(expansion.text, parameters=expansion.parameters)
    if not expansion.parameters:
        return found
    name = os.fsdecode(source)
    text = name.lstrip("\ufeff \t\r\n").startswith("<")
    return replace(found, source=name if text else os.path.abspath(name))


def read(text: str, *, parameters: Mapping[str, ParameterValue] = _NONE) -> Description:
    """Read URDF text that holds no xacro.

    Parameters
    ----------
    text : str
        The document.
    parameters : mapping
        What it was expanded with; kept in the description.

    Returns
    -------
    Description
        Links, joints, closures and inputs in document order.

    Raises
    ------
    DescriptionError
        Whatever is wrong with it.
    """
    root = elements.document(text)
    if etree.QName(root).localname != "robot":
        raise DescriptionError(
            "the root element must be <robot>; cc.load_file reads MJCF and SDF too",
            line=root.sourceline,
            element=str(root.tag),
        )
    notes = [*translate_dialects(root), *set_aside(root)]
    elements.allow(root, ("name", "version"), _ROOT_ELEMENTS)
    name = elements.text(root, "name")

    links = tuple(read_link(element, notes) for element in root.findall("link"))
    pairs = [read_joint(element, notes) for element in root.findall("joint")]
    joints = tuple(joint for joint, _ in pairs)
    constraints = tuple(read_constraint(element) for element in root.findall(CONSTRAINT))
    closures = tuple(c for c in constraints if isinstance(c, LoopClosure))
    relations = tuple(c for c in constraints if isinstance(c, JointRelation))
    refuse_duplicates(links, "link")
    refuse_duplicates(joints, "joint")
    refuse_duplicates(constraints, CONSTRAINT)
    top = root_of(name, root.sourceline, links, joints)
    by_name = {joint.name: joint for joint in joints}
    mimics = [coupling for _, coupling in pairs if coupling is not None]
    couplings = known_couplings(mimics, by_name, ONE_DOF, notes)
    check_relations(relations, by_name, ONE_DOF)
    check_closures(closures, links, joints)

    followers = {coupling.joint: coupling.leader for coupling in couplings}
    read_inputs = [
        read_input(element, by_name, followers, notes) for element in root.findall("transmission")
    ]
    driven = without_second_drives([item for item in read_inputs if item is not None], notes)
    refuse_duplicates(driven, "transmission")
    states = _states(root, by_name)
    links = solid_links(root, links, top)
    notes += [told for told in (solids_note(root, links),) if told]
    notes += what_dynamics_read(joints, driven)
    notes += are_loops_missing(links, joints, couplings, bool(closures or relations))
    return Description(
        name=name,
        root=top,
        links=links,
        joints=joints,
        closures=closures,
        couplings=couplings,
        relations=relations,
        inputs=driven,
        task=_task(root, [link.name for link in links]),
        home=states.pop(_HOME, {}),
        states=states,
        remarks=tuple(read_remark(element) for element in root.findall("remark")),
        notes=merged(notes),
        parameters=parameters,
        text=text,
    )


def _task(root: Element, links: list[str]) -> Task | None:
    element = elements.only_child(root, "task")
    return None if element is None else read_task(element, links)


def _states(root: Element, joints: Mapping[str, Joint]) -> dict[str, dict[str, tuple[float, ...]]]:
    """Every named posture, home among them, in document order."""
    states: dict[str, dict[str, tuple[float, ...]]] = {}
    lines: dict[str, int | None] = {}
    for element in root.findall("group_state"):
        name = elements.text(element, "name")
        if name in states:
            raise elements.error(
                element, f"there are two {name} postures; the first is at line {lines[name]}"
            )
        states[name], lines[name] = read_state(element, joints), element.sourceline
    return states
