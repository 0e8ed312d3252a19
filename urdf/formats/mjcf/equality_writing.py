"""Closures and relations as MuJoCo's equality constraints and tendons."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from lxml import etree

from closedchain.urdf.description import JointRelation, LoopClosure
from closedchain.urdf.formats.mjcf.collected import Collected, numbers
from closedchain.urdf.link_poses import link_poses
from closedchain.urdf.poses import direction, pose, pose_of

if TYPE_CHECKING:
    from lxml.etree import _Element as Element

_ON_AXIS = 0.1  # [m] between the two connects of a hinge


def add_equalities(writer: Collected, root: Element) -> None:
    """Write closures, couplings and relations; the tree must be written before."""
    d = writer.description
    tendons = etree.SubElement(root, "tendon")
    equality = etree.SubElement(root, "equality")
    balls = {closure.name for closure in writer.balls.values()}
    for closure in d.closures:
        if closure.name not in balls:
            _closure(writer, closure, tendons, equality)
    for coupling in d.couplings:
        x, y = (d.home.get(joint, (0.0,))[0] for joint in (coupling.leader, coupling.joint))
        open_by = coupling.multiplier * x + coupling.offset - y
        element = etree.SubElement(
            equality, "joint", name=f"{coupling.joint}_mimic", joint1=coupling.joint
        )
        element.set("joint2", coupling.leader)
        element.set("polycoef", numbers(open_by, coupling.multiplier, 0.0, 0.0, 0.0))
    for relation in d.relations:
        _relation(writer, relation, tendons, equality)
    for empty in (tendons, equality):
        if not len(empty):
            root.remove(empty)


def _relation(
    writer: Collected, relation: JointRelation, tendons: Element, equality: Element
) -> None:
    home = writer.description.home
    values = [home.get(joint, (0.0,))[0] for joint in relation.joints]
    if relation.type == "linear":
        fixed = etree.SubElement(tendons, "fixed", name=relation.name)
        for joint, factor in zip(relation.joints, relation.coefficients, strict=True):
            etree.SubElement(fixed, "joint", joint=joint, coef=numbers(factor))
        now = float(np.dot(relation.coefficients, values))
        _hold_tendon(equality, relation.name, relation.offset - now)
        return
    if len(relation.coefficients) > 5:
        writer.losses.append(
            f"the relation {relation.name!r} is of degree {len(relation.coefficients) - 1}; "
            "MuJoCo has polynomials of degree 4: it is left out"
        )
        return
    y, x = values
    of_step = np.polynomial.Polynomial(relation.coefficients)(np.polynomial.Polynomial([x, 1.0]))
    coefficients = [float(c) for c in of_step.coef] + [0.0] * (5 - len(of_step.coef))
    coefficients[0] -= y
    element = etree.SubElement(equality, "joint", name=relation.name)
    element.set("joint1", relation.joints[0])
    element.set("joint2", relation.joints[1])
    element.set("polycoef", numbers(*coefficients))


def _closure(writer: Collected, closure: LoopClosure, tendons: Element, equality: Element) -> None:
    """Pairs of sites, and what holds them together."""
    name = closure.name
    sides = (
        ("1", closure.parent, closure.parent_origin, closure.parent_axis),
        ("2", closure.child, closure.child_origin, closure.child_axis),
    )
    sites = [writer.site(link, pose_of(origin), f"{name}_{end}") for end, link, origin, _ in sides]
    if closure.type == "distance":
        spatial = etree.SubElement(tendons, "spatial", name=name)
        for site in sites:
            etree.SubElement(spatial, "site", site=site)
        places = link_poses(writer.description)
        ends = [(places[link] @ pose_of(origin))[:3, 3] for _, link, origin, _ in sides]
        now = float(np.linalg.norm(ends[1] - ends[0]))
        _hold_tendon(equality, name, dict(closure.sizes)["length"] - now)
        return
    tag = "weld" if closure.type == "fixed" else "connect"
    etree.SubElement(equality, tag, name=name, site1=sites[0], site2=sites[1])
    if closure.type == "revolute":
        on_axis = []
        for end, link, origin, axis in sides:
            place = pose_of(origin)
            along = pose(translation=_ON_AXIS * np.array(direction(place, axis)))
            on_axis.append(writer.site(link, along @ place, f"{name}_axis_{end}"))
        second = etree.SubElement(equality, "connect", name=f"{name}_axis")
        second.set("site1", on_axis[0])
        second.set("site2", on_axis[1])


def _hold_tendon(equality: Element, name: str, longer: float) -> None:
    element = etree.SubElement(equality, "tendon", name=name, tendon1=name)
    element.set("polycoef", numbers(longer, 0.0, 0.0, 0.0, 0.0))
