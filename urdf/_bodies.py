"""Readers of the elements that plain URDF has: ``<link>`` and ``<joint>``."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from closedchain.urdf import _xml
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

_TYPE_HINTS = {
    "planar": "write two prismatic joints and a revolute one, or cut it: "
    '<constraint type="planar">',
    "spherical": 'spherical joints are cut: <constraint type="spherical">',
    "ball": 'spherical joints are cut: <constraint type="spherical">',
    "universal": "write two revolute joints about a cross link, or cut it: "
    '<constraint type="universal">',
    "cylindrical": "write a revolute and a prismatic joint, or cut it: "
    '<constraint type="cylindrical">',
    "screw": "write a revolute joint and a prismatic one with <mimic>",
}
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
    _xml.allow(element, ("name", "type"), ("inertial", "visual", "collision"))
    name = _name(element)
    inertial = _xml.only_child(element, "inertial")
    for shape in (*element.findall("visual"), *element.findall("collision")):
        if shape.find("geometry") is not None and not len(shape.find("geometry")):
            notes.append(f"line {shape.sourceline}: <{shape.tag}> in <link {name!r}> has no shape")
            element.remove(shape)
        else:
            _check_shape(shape)
    return Link(
        name=name,
        inertial=None if inertial is None else _inertial(inertial),
        visuals=len(element.findall("visual")),
        line=element.sourceline,
    )


def _name(element: Element) -> str:
    name = _xml.text(element, "name")
    if name == "universe":
        raise _xml.error(element, "the name 'universe' is taken: it is Pinocchio's fixed world")
    return name


def _inertial(element: Element) -> Inertial:
    _xml.allow(element, (), ("origin", "mass", "inertia"))
    mass = _xml.required_child(element, "mass")
    _xml.allow(mass, ("value",))
    inertia = _xml.required_child(element, "inertia")
    _xml.allow(inertia, _MOMENTS)
    value = _xml.number(mass, "value")
    moments = {key: _xml.number(inertia, key) for key in _MOMENTS}
    if value < 0.0:
        raise _xml.error(mass, f"value={value:g} must not be negative")
    for key in ("ixx", "iyy", "izz"):
        if moments[key] < -1e-12:  # exporters round zero to either side
            raise _xml.error(inertia, f"{key}={moments[key]:g} must not be negative")
    return Inertial(_xml.origin(_xml.only_child(element, "origin")), value, **moments)


def _check_shape(element: Element) -> None:
    _xml.allow(element, ("name", "group"), ("origin", "geometry", "material"))
    _xml.origin(_xml.only_child(element, "origin"))
    geometry = _xml.required_child(element, "geometry")
    _xml.allow(geometry, (), _SHAPES)
    if len(geometry) != 1:
        raise _xml.error(geometry, f"{len(geometry)} shapes; expected one of {', '.join(_SHAPES)}")
    shape = geometry[0]
    _xml.allow(shape, _SHAPES[shape.tag])
    if shape.tag == "mesh":
        _xml.text(shape, "filename")
        scale = _xml.vector(shape, "scale", (1.0, 1.0, 1.0))
        if min(map(abs, scale)) < _xml.SHORTEST:
            raise _xml.error(shape, f"scale={shape.get('scale')!r} makes the mesh flat; scales are "
                                    f"{_xml.SHORTEST:g} or more in size")  # fmt: skip
    elif shape.tag == "box":
        if min(_xml.vector(shape, "size")) < _xml.SHORTEST:
            raise _xml.error(shape, f"size={shape.get('size')!r} must be greater than zero: sides "
                                    f"are {_xml.SHORTEST:g} m or more")  # fmt: skip
    else:
        for attribute in _SHAPES[shape.tag]:
            _xml.positive(shape, attribute)


def read_joint(element: Element, notes: list[str]) -> tuple[Joint, Coupling | None]:
    """Read one ``<joint>``, and its ``<mimic>`` if it has one.

    Bounds that the type does not have, or that are left out, are noted in ``notes``.
    """
    _xml.allow(
        element,
        ("name", "type"),
        ("parent", "child", "origin", "axis", "limit", "mimic"),
    )
    name = _name(element)
    kind = _type(element)
    links = []
    for side in ("parent", "child"):
        end = _xml.required_child(element, side)
        _xml.allow(end, ("link",))
        links.append(_xml.text(end, "link"))
    lower, upper = _limits(element, kind, notes)
    joint = Joint(
        name=name,
        type=kind,
        parent=links[0],
        child=links[1],
        origin=_xml.origin(_xml.only_child(element, "origin")),
        axis=_axis(element, kind),
        lower=lower,
        upper=upper,
        line=element.sourceline,
    )
    if joint.parent == joint.child:
        raise _xml.error(element, f"the joint connects the link {joint.child!r} with itself")
    return joint, _mimic(element, joint, notes)


def _type(element: Element) -> JointType:
    wanted = _xml.text(element, "type")
    for kind in JOINT_TYPES:
        if kind == wanted:
            return kind
    hint = _TYPE_HINTS.get(wanted.lower(), "")
    message = known_names(wanted, "joint type", JOINT_TYPES) + (f"; {hint}" if hint else "")
    raise _xml.error(element, message)


def _axis(element: Element, kind: JointType) -> Vector3:
    axis = _xml.only_child(element, "axis")
    if axis is None:
        return (1.0, 0.0, 0.0)
    if kind not in ONE_DOF:  # it means nothing; exporters write "0 0 0" here
        _xml.allow(axis, ("xyz",))
        _xml.vector(axis, "xyz")
        return (1.0, 0.0, 0.0)
    return _xml.unit_vector(axis)


def _limits(element: Element, kind: JointType, notes: list[str]) -> tuple[float, float]:
    """Bounds of the joint value, rad or m.

    As in URDF, a bound left out is zero. With both left out the joint would not move: exporters
    write that for a joint without bounds, and so it is read.
    """
    free = float("-inf"), float("inf")
    limit = _xml.only_child(element, "limit")
    bounded = kind in ("revolute", "prismatic")
    if limit is None:
        if bounded:
            raise _xml.error(
                element,
                f"a {kind} joint needs <limit lower= upper= effort= velocity=>",
            )
        return free
    _xml.allow(limit, ("lower", "upper", "effort", "velocity"))
    lower = _xml.number(limit, "lower", 0.0, largest=math.inf)
    upper = _xml.number(limit, "upper", 0.0, largest=math.inf)
    for attribute in ("effort", "velocity"):
        default = None if kind in ONE_DOF else 0.0
        if _xml.number(limit, attribute, default, largest=math.inf) < 0.0:
            raise _xml.error(limit, f"{attribute}={limit.get(attribute)!r} must not be negative")
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
        raise _xml.error(limit, f"lower={lower:g} is greater than upper={upper:g}")
    return _bound(limit, "lower", lower, notes), _bound(limit, "upper", upper, notes)


def _bound(limit: Element, side: str, value: float, notes: list[str]) -> float:
    """A bound; one so large that it only says "none", as exporters write it, is none."""
    if abs(value) <= _xml.LARGEST:
        return value
    if (value < 0.0) != (side == "lower"):
        raise _xml.error(limit, f"{side}={value:g} leaves no value of less than {_xml.LARGEST:g} "
                                "in size (rad, m)")  # fmt: skip
    notes.append(f"line {limit.sourceline}: {side}={value:g} of <limit> was read as no bound")
    return math.copysign(math.inf, value)


def _mimic(element: Element, joint: Joint, notes: list[str]) -> Coupling | None:
    mimic = _xml.only_child(element, "mimic")
    if mimic is None:
        return None
    _xml.allow(mimic, ("joint", "multiplier", "offset"))
    if joint.type not in ONE_DOF:
        notes.append(
            f"line {mimic.sourceline}: <mimic> in <joint {joint.name!r}> was not read: a "
            f"{joint.type} joint follows none"
        )
        return None
    return Coupling(
        joint=joint.name,
        leader=_xml.text(mimic, "joint"),
        multiplier=_xml.number(mimic, "multiplier", 1.0),
        offset=_xml.number(mimic, "offset", 0.0),
        line=mimic.sourceline,
    )
