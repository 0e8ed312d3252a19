"""Readers of the elements that plain URDF has: ``<link>`` and ``<joint>``."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from closedchain.urdf import elements
from closedchain.urdf._dynamics import read_dynamics
from closedchain.urdf.description import (
    JOINT_TYPES,
    Coupling,
    Inertial,
    Joint,
    JointType,
    Link,
    Vector3,
)
from closedchain.urdf.errors import known_names

if TYPE_CHECKING:
    from lxml.etree import _Element as Element

_SHAPES = {
    "box": ("size",),
    "cylinder": ("radius", "length"),
    "capsule": ("radius", "length"),
    "sphere": ("radius",),
    "mesh": ("filename", "scale"),
}
_MOMENTS = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
ONE_DOF = ("revolute", "continuous", "prismatic")


def read_link(element: Element, notes: list[str]) -> Link:
    """Read one ``<link>``; shapes are checked and counted, not kept.

    Shapes that URDF does not have are taken out, with a note in ``notes``.
    """
    elements.allow(element, ("name", "type"), ("inertial", "visual", "collision"))
    name = _name(element)
    inertial = elements.only_child(element, "inertial")
    for shape in (*element.findall("visual"), *element.findall("collision")):
        if shape.find("geometry") is not None and not len(shape.find("geometry")):
            notes.append(f"line {shape.sourceline}: <{shape.tag}> in <link {name!r}> has no shape")
            element.remove(shape)
        else:
            _check_shape(shape)
    return Link(
        name=name,
        inertial=None if inertial is None else _inertial(inertial, notes),
        visuals=len(element.findall("visual")),
        line=element.sourceline,
    )


def _name(element: Element) -> str:
    name = elements.text(element, "name")
    if name == "universe":
        raise elements.error(element, "the name 'universe' is taken: it is Pinocchio's fixed world")
    return name


def _inertial(element: Element, notes: list[str]) -> Inertial:
    elements.allow(element, (), ("origin", "mass", "inertia"))
    mass = elements.required_child(element, "mass")
    elements.allow(mass, ("value",))
    inertia = elements.required_child(element, "inertia")
    elements.allow(inertia, _MOMENTS)
    value = elements.number(mass, "value")
    moments = {key: elements.number(inertia, key) for key in _MOMENTS}
    if value < 0.0:
        raise elements.error(mass, f"value={value:g} must not be negative")
    for key in ("ixx", "iyy", "izz"):
        if moments[key] < -1e-12:  # exporters round zero to either side
            raise elements.error(inertia, f"{key}={moments[key]:g} must not be negative")
    found = Inertial(elements.origin(elements.only_child(element, "origin")), value, **moments)
    least = found.principal_moments[0]
    if least < 0.0:
        notes.append(
            f"line {inertia.sourceline}: the inertia of <link {element.getparent().get('name')!r}> "
            f"has the principal moment {least:.3g}, which no body has: it was taken as zero"
        )
    return found


def _check_shape(element: Element) -> None:
    elements.allow(element, ("name", "group"), ("origin", "geometry", "material"))
    elements.origin(elements.only_child(element, "origin"))
    geometry = elements.required_child(element, "geometry")
    elements.allow(geometry, (), _SHAPES)
    if len(geometry) != 1:
        raise elements.error(
            geometry, f"{len(geometry)} shapes; expected one of {', '.join(_SHAPES)}"
        )
    shape = geometry[0]
    elements.allow(shape, _SHAPES[shape.tag])
    if shape.tag == "mesh":
        elements.text(shape, "filename")
        scale = elements.vector(shape, "scale", (1.0, 1.0, 1.0))
        if min(map(abs, scale)) < elements.SHORTEST:
            raise elements.error(
                shape,
                f"scale={shape.get('scale')!r} makes the mesh flat; scales are "
                f"{elements.SHORTEST:g} or more in size",
            )
    elif shape.tag == "box":
        if min(elements.vector(shape, "size")) < elements.SHORTEST:
            raise elements.error(
                shape,
                f"size={shape.get('size')!r} must be greater than zero: sides are "
                f"{elements.SHORTEST:g} m or more",
            )
    else:
        for attribute in _SHAPES[shape.tag]:
            elements.positive(shape, attribute)


def read_joint(element: Element, notes: list[str]) -> tuple[Joint, Coupling | None]:
    """Read one ``<joint>``, and its ``<mimic>`` if it has one.

    Bounds that the type does not have, or that are left out, are noted in ``notes``.
    """
    elements.allow(
        element,
        ("name", "type"),
        ("parent", "child", "origin", "axis", "limit", "mimic", "dynamics"),
    )
    name = _name(element)
    kind = _type(element)
    links = []
    for side in ("parent", "child"):
        end = elements.required_child(element, side)
        elements.allow(end, ("link",))
        links.append(elements.text(end, "link"))
    lower, upper = _limits(element, kind, notes)
    joint = Joint(
        name=name,
        type=kind,
        parent=links[0],
        child=links[1],
        origin=elements.origin(elements.only_child(element, "origin")),
        axis=_axis(element, kind),
        lower=lower,
        upper=upper,
        line=element.sourceline,
        **read_dynamics(element, kind in ONE_DOF, notes),
    )
    if joint.parent == joint.child:
        raise elements.error(element, f"the joint connects the link {joint.child!r} with itself")
    return joint, _mimic(element, joint, notes)


def _type(element: Element) -> JointType:
    wanted = elements.text(element, "type")
    for kind in JOINT_TYPES:
        if kind == wanted:
            return kind
    raise elements.error(element, known_names(wanted, "joint type", JOINT_TYPES))


def _axis(element: Element, kind: JointType) -> Vector3:
    axis = elements.only_child(element, "axis")
    if axis is None:
        return (1.0, 0.0, 0.0)
    if kind not in ONE_DOF:  # it means nothing; exporters write "0 0 0" here
        elements.allow(axis, ("xyz",))
        elements.vector(axis, "xyz")
        return (1.0, 0.0, 0.0)
    return elements.unit_vector(axis)


def _limits(element: Element, kind: JointType, notes: list[str]) -> tuple[float, float]:
    """Bounds of the joint value, rad or m.

    As in URDF, a bound left out is zero. With both left out the joint would not move: exporters
    write that for a joint without bounds, and so it is read.
    """
    free = float("-inf"), float("inf")
    limit = elements.only_child(element, "limit")
    bounded = kind in ("revolute", "prismatic")
    if limit is None:
        if bounded:
            raise elements.error(
                element,
                f"a {kind} joint needs <limit lower= upper= effort= velocity=>",
            )
        return free
    elements.allow(limit, ("lower", "upper", "effort", "velocity"))
    lower = elements.number(limit, "lower", 0.0, largest=math.inf)
    upper = elements.number(limit, "upper", 0.0, largest=math.inf)
    for attribute in ("effort", "velocity"):
        default = None if kind in ONE_DOF else 0.0
        if elements.number(limit, attribute, default, largest=math.inf) < 0.0:
            raise elements.error(
                limit, f"{attribute}={limit.get(attribute)!r} must not be negative"
            )
    if bounded and limit.get("lower") is None and limit.get("upper") is None:
        notes.append(
            f"line {limit.sourceline}: <limit> in <joint {element.get('name')!r}> has neither "
            "lower nor upper: the joint was taken as one without bounds"
        )
        return free
    if not bounded:
        given = [key for key in ("lower", "upper") if limit.get(key) is not None]
        if given or kind not in ONE_DOF:
            what = f"{' and '.join(given)} of <limit>" if given else "<limit>"
            notes.append(
                f"line {limit.sourceline}: {what} in <joint {element.get('name')!r}> was not "
                f"read: a {kind} joint has no bounds"
            )
        return free
    if lower > upper:
        raise elements.error(limit, f"lower={lower:g} is greater than upper={upper:g}")
    return _bound(limit, "lower", lower, notes), _bound(limit, "upper", upper, notes)


def _bound(limit: Element, side: str, value: float, notes: list[str]) -> float:
    """A bound; one so large that it only says "none", as exporters write it, is none."""
    if abs(value) <= elements.LARGEST:
        return value
    if (value < 0.0) != (side == "lower"):
        raise elements.error(
            limit,
            f"{side}={value:g} leaves no value of less than {elements.LARGEST:g} in size (rad, m)",
        )
    notes.append(f"line {limit.sourceline}: {side}={value:g} of <limit> was read as no bound")
    return math.copysign(math.inf, value)


def _mimic(element: Element, joint: Joint, notes: list[str]) -> Coupling | None:
    mimic = elements.only_child(element, "mimic")
    if mimic is None:
        return None
    elements.allow(mimic, ("joint", "multiplier", "offset"))
    if joint.type not in ONE_DOF:
        notes.append(
            f"line {mimic.sourceline}: <mimic> in <joint {joint.name!r}> was not read: a "
            f"{joint.type} joint follows none"
        )
        return None
    return Coupling(
        joint=joint.name,
        leader=elements.text(mimic, "joint"),
        multiplier=elements.number(mimic, "multiplier", 1.0),
        offset=elements.number(mimic, "offset", 0.0),
        line=mimic.sourceline,
    )
