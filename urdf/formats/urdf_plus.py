"""URDF+ (arXiv 2411.19753): loops, couplings and independent joints, read and written::

    <joint name="j1" type="revolute" independent="true"> ... </joint>
    <loop name="p1" type="revolute">
      <predecessor link="rod"><origin xyz="1 0 0"/></predecessor>
      <successor link="link_2"><origin xyz="0 1 0"/></successor>
      <axis xyz="0 0 1"/>
    </loop>
    <coupling name="belt">
      <predecessor link="knee"/> <successor link="rotor"/> <ratio value="6"/>
    </coupling>

A coupling ties the two ways that lead from the nearest common ancestor to its links: the ratio
times the sum of the joint values towards the predecessor is the sum towards the successor.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from lxml import etree

from closedchain.urdf import elements
from closedchain.urdf.constraint_element import SPELLINGS
from closedchain.urdf.description import (
    CLOSURE_TYPES,
    Description,
    JointRelation,
    LoopClosure,
)
from closedchain.urdf.errors import known_names
from closedchain.urdf.formats.substitution import (
    constraint_element,
    fresh_name,
    named_children,
    replace_by,
)
from closedchain.urdf.formats.tree_at_zero import parents_of, path_up
from closedchain.urdf.formats.written import Written, homes_left_out
from closedchain.urdf.poses import origin_of, pose_of, z_along
from closedchain.urdf.writing import document_text, urdf_document

if TYPE_CHECKING:
    from lxml.etree import _Element as Element


def translate(root: Element, notes: list[str]) -> None:
    """Replace loops and couplings by ``<constraint>`` elements, independent joints by inputs.

    Raises
    ------
    DescriptionError
        A type that no closure has, links that no way leads to, a ratio of zero.
    """
    for element in named_children(root, "loop"):
        element.tag = "loop"
        replace_by(element, constraint_element(_loop(root, element, notes)))
    for element in named_children(root, "coupling"):
        element.tag = "coupling"
        replace_by(element, constraint_element(_coupling(root, element)))
    _independent(root, notes)


def _loop(root: Element, element: Element, notes: list[str]) -> LoopClosure:
    wanted = element.get("type", "revolute")
    kind = {"continuous": "revolute", "ball": "spherical"}.get(wanted, wanted)
    if kind not in CLOSURE_TYPES:
        raise elements.error(element, known_names(wanted, "type of a loop", CLOSURE_TYPES))
    name = fresh_name(root, element.get("name") or "loop")
    links, origins = [], []
    for side in ("predecessor", "successor"):
        end = elements.required_child(element, side)
        links.append(elements.text(end, "link"))
        origins.append(elements.origin(elements.only_child(end, "origin")))
    axis = (0.0, 0.0, 1.0)
    written = elements.only_child(element, "axis")
    second = elements.only_child(element, "axis2")
    if written is not None:
        axis = elements.unit_vector(written)
    elif SPELLINGS[kind].parent_axis:
        axis = (1.0, 0.0, 0.0)
        notes.append(
            f"line {element.sourceline}: the loop {name!r} has no <axis>: x of its two frames was "
            "taken, as for a joint of URDF"
        )
    return LoopClosure(
        name=name,
        type=kind,
        parent=links[0],
        child=links[1],
        parent_origin=origins[0],
        child_origin=origins[1],
        parent_axis=axis,
        child_axis=axis if second is None else elements.unit_vector(second),
        sizes=tuple((size, elements.positive(element, size)) for size in SPELLINGS[kind].sizes),
    )


def _coupling(root: Element, element: Element) -> JointRelation:
    ends = [
        elements.text(elements.required_child(element, s), "link")
        for s in ("predecessor", "successor")
    ]
    ratio = elements.number(elements.required_child(element, "ratio"), "value")
    if ratio == 0.0:
        raise elements.error(element, "<ratio value=0> would hold the successor still")
    paths = [path_up(root, end) for end in ends]
    common = next((link for link in paths[0] if link in paths[1]), None)
    if common is None:
        raise elements.error(
            element, f"the links {ends[0]!r} and {ends[1]!r} are in no common tree"
        )
    above = parents_of(root)
    names: list[str] = []
    factors: list[float] = []
    for path, factor in zip(paths, (ratio, -1.0), strict=True):
        for link in path[: path.index(common)][::-1]:
            joint = above[link][0]
            if joint.get("type") != "fixed":
                names.append(str(joint.get("name")))
                factors.append(factor)
    if len(names) < 2:
        raise elements.error(
            element,
            f"it ties {len(names)} joints; between {common!r} and its links there must be two or "
            "more",
        )
    name = fresh_name(root, element.get("name") or "coupling")
    return JointRelation(name, "linear", tuple(names), tuple(factors))


def _independent(root: Element, notes: list[str]) -> None:
    """Take joints that are said to be independent as inputs, where the file has none."""
    chosen = []
    for joint in named_children(root, "joint"):
        word = joint.attrib.pop("independent", None)
        if word is not None and word.strip().lower() == "true":
            chosen.append(joint)
    if not chosen or any(True for _ in named_children(root, "transmission")):
        return
    for joint in chosen:
        transmission = etree.SubElement(root, "transmission", name=str(joint.get("name")))
        etree.SubElement(transmission, "joint", name=str(joint.get("name")))
        for part in transmission.iter():
            part.sourceline = joint.sourceline
    notes.append(
        f'the file names no motors: its {len(chosen)} joints with independent="true" were taken as '
        "inputs"
    )


def write(description: Description) -> Written:
    """URDF+ of a description, and what that does not say, one sentence each."""
    root = urdf_document(description)
    losses: list[str] = []
    for element in list(named_children(root, "constraint")):
        root.remove(element)
    for closure in description.closures:
        root.append(_loop_element(closure))
        if closure.type not in ("fixed", "revolute", "prismatic", "spherical"):
            losses.append(
                f"the loop {closure.name!r} is written with the type {closure.type!r}, which "
                "programs "
                "for URDF+ may not know"
            )
    for relation in description.relations:
        coupling = _coupling_element(description, relation)
        if coupling is not None:
            root.append(coupling)
            continue
        root.append(constraint_element(relation))
        losses.append(
            f"the relation {relation.name!r} of joint values stays a <constraint>, which URDF+ "
            "does "
            "not have"
        )
    driven = {item.joint for item in description.inputs}
    for joint in named_children(root, "joint"):
        if joint.get("type") != "fixed":
            joint.set("independent", "true" if joint.get("name") in driven else "false")
    losses += homes_left_out(description)
    return Written(document_text(root), tuple(losses))


def _loop_element(closure: LoopClosure) -> Element:
    """``<loop>`` whose frames have the axis as z, so that one axis serves both sides."""
    loop = etree.Element("loop", name=closure.name, type=closure.type)
    spelling = SPELLINGS[closure.type]
    sides = (
        ("predecessor", closure.parent, closure.parent_origin, closure.parent_axis),
        ("successor", closure.child, closure.child_origin, closure.child_axis),
    )
    for tag, link, origin, axis in sides:
        end = etree.SubElement(loop, tag, link=link)
        turned = spelling.parent_axis and axis != (0.0, 0.0, 1.0)
        end.append(
            elements.origin_element(
                origin_of(pose_of(origin) @ z_along(axis)) if turned else origin
            )
        )
    if spelling.parent_axis:
        etree.SubElement(loop, "axis", xyz="0.0 0.0 1.0")
    for size, value in closure.sizes:
        loop.set(size, elements.written((value,)))
    return loop


def _coupling_element(description: Description, relation: JointRelation) -> Element | None:
    """``<coupling>`` of a relation that is one: sums along two ways from a common ancestor."""
    if relation.type != "linear" or relation.offset != 0.0:
        return None
    factors = dict(zip(relation.joints, relation.coefficients, strict=True))
    above = {joint.child: joint for joint in description.joints}
    ends = {joint.name: joint.child for joint in description.joints if joint.name in factors}
    chains: dict[str, list[str]] = {}
    for name, link in ends.items():
        chains[name] = []
        while link in above:
            if above[link].type != "fixed":
                chains[name].insert(0, above[link].name)
            link = above[link].parent
    for first, towards in chains.items():
        for second, onwards in chains.items():
            shared = [joint for joint in towards if joint in onwards]
            ways = [[j for j in chain if j not in shared] for chain in (towards, onwards)]
            sums = [{factors.get(joint) for joint in way} for way in ways]
            if set(ways[0] + ways[1]) != set(factors) or any(len(values) > 1 for values in sums):
                continue
            if not ways[1] or not ways[0]:
                continue
            element = etree.Element("coupling", name=relation.name)
            etree.SubElement(element, "predecessor", link=ends[first])
            etree.SubElement(element, "successor", link=ends[second])
            ratio = -factors[first] / factors[second]
            etree.SubElement(element, "ratio", value=elements.written((ratio,)))
            return element
    return None
