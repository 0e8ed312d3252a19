"""A description as MJCF, closed in MuJoCo's own reference posture.

Bodies are written where they are at home, and ``ref`` is the home value of each joint: MuJoCo
starts closed, and its joint values are those of the description. Loops are equality constraints
between pairs of sites, which hold in any posture. A hinge is two connects on its axis.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from lxml import etree

from closedchain.urdf.description import (
    ClosureType,
    Description,
    Inertial,
    Joint,
    Link,
    LoopClosure,
)
from closedchain.urdf.formats.mjcf.collected import Collected, numbers, set_pose
from closedchain.urdf.formats.mjcf.equality_writing import add_equalities
from closedchain.urdf.formats.mjcf.reading import TASK
from closedchain.urdf.formats.mjcf.tree import WORLD
from closedchain.urdf.formats.stubs import without_foreign_closures
from closedchain.urdf.formats.written import Written, listed
from closedchain.urdf.link_poses import moved
from closedchain.urdf.meshes import with_mesh_paths
from closedchain.urdf.poses import pose, pose_of, quaternion_of
from closedchain.urdf.shapes import Shape, Shapes, shapes_of
from closedchain.urdf.writing import UNBOUNDED, document_text, urdf_document

if TYPE_CHECKING:
    from lxml.etree import _Element as Element

_KNOWN: tuple[ClosureType, ...] = ("fixed", "revolute", "spherical", "distance")
_MESHES = (".stl", ".obj", ".msh")
_LEAST_MOMENT = 1e-12  # [kg m^2]
_LEAST_MASS, _LEAST_INERTIA = 1e-3, 1e-6  # of moving bodies that have none [kg, kg m^2]


def write(description: Description) -> Written:
    """MJCF of a description whose home is closed.

    Raises
    ------
    DescriptionError
        A closure that MuJoCo cannot be given.
    """
    text, missing = with_mesh_paths(description)
    shapes, unread = _readable(shapes_of(urdf_document(replace(description, text=text))))
    d, stubs, losses = without_foreign_closures(description, _KNOWN)
    d = replace(d, home=dict(d.home) | {joint.name: (0.0,) for joint in stubs})
    writer = Collected(d, shapes, _balls(d))
    writer.losses += [*losses, *missing, *unread]
    root = etree.Element("mujoco", model=d.name)
    etree.SubElement(
        root, "compiler", angle="radian", autolimits="true", balanceinertia="true"
    ).set("boundinertia", numbers(1e-12))
    asset = etree.SubElement(root, "asset")
    world = etree.SubElement(root, "worldbody")
    _tree(writer, world)
    _assets(writer, asset)
    add_equalities(writer, root)
    actuator = etree.SubElement(root, "actuator")
    for item in d.inputs:
        motor = etree.SubElement(actuator, "motor", name=item.name, joint=item.joint)
        if item.reduction != 1.0:
            motor.set("gear", numbers(item.reduction))
    _postures(writer, root)
    _say_task(d, root)
    for empty in [e for e in root if not len(e) and e.tag in ("asset", "actuator")]:
        root.remove(empty)
    if writer.massless:
        writer.losses.append(
            f"MuJoCo needs masses: the moving links {listed(writer.massless)} have none and got "
            f"{_LEAST_MASS:g} kg"
        )
    if d.remarks:
        writer.losses.append("remarks are not written")
    if any(item.rotor_inertia for item in d.inputs):
        writer.losses.append("rotor inertias are written as the armatures of their joints")
    writer.losses.append("limits of effort and speed and collision shapes are not written")
    return Written(document_text(root), tuple(writer.losses))


def _readable(shapes: Shapes) -> tuple[Shapes, list[str]]:
    """Shapes without the meshes that MuJoCo does not read, and sentences on these."""
    lost = sorted(
        {
            shape.file
            for of_link in shapes.values()
            for shape in of_link
            if shape.kind == "mesh" and not shape.file.lower().endswith(_MESHES)
        }
    )
    kept = {
        link: tuple(shape for shape in of_link if shape.file not in lost)
        for link, of_link in shapes.items()
    }
    return kept, [f"MuJoCo does not read the mesh {file!r}" for file in lost]


def _balls(description: Description) -> dict[str, LoopClosure]:
    """Floating joints that a spherical closure at their own place holds: balls of the tree."""
    found = {}
    for joint in description.joints:
        for closure in description.closures:
            if (
                joint.type == "floating"
                and closure.type == "spherical"
                and (closure.parent, closure.child) == (joint.parent, joint.child)
                and closure.parent_origin.xyz == joint.origin.xyz
                and closure.child_origin.xyz == (0.0, 0.0, 0.0)
            ):
                found[joint.name] = closure
    return found


def _tree(writer: Collected, world: Element) -> None:
    """Bodies, depth first in the order of MuJoCo; points that carry nothing are sites."""
    d = writer.description
    links = {link.name: link for link in d.links}
    children: dict[str, list[Joint]] = {}
    for joint in d.joints:
        children.setdefault(joint.parent, []).append(joint)
    if d.root == WORLD:  # MuJoCo has a body of that name
        writer.bodies[WORLD], writer.places[WORLD] = world, (WORLD, np.eye(4))
        for shape in writer.shapes.get(WORLD, ()):
            _geom(writer, world, shape)
    else:
        _body(writer, world, links[d.root], np.eye(4), None)
    waiting = list(reversed(children.get(d.root, [])))
    while waiting:
        joint = waiting.pop()
        link = links[joint.child]
        place = pose_of(joint.origin) @ moved(joint, d.home.get(joint.name))
        bare = not (children.get(link.name) or writer.shapes.get(link.name) or link.inertial)
        if joint.type == "fixed" and bare:
            owner, offset = writer.places[joint.parent]
            writer.site(joint.parent, place, link.name)
            writer.places[link.name] = owner, offset @ place
            continue
        owner, offset = writer.places[joint.parent]
        free = joint.type == "floating" and joint.name not in writer.balls
        parent = world if free and joint.parent == d.root else writer.bodies[owner]
        _body(writer, parent, link, offset @ place, joint)
        waiting += reversed(children.get(link.name, []))


def _body(
    writer: Collected, parent: Element, link: Link, place: np.ndarray, joint: Joint | None
) -> None:
    body = etree.SubElement(parent, "body", name=link.name)
    set_pose(body, place)
    writer.bodies[link.name] = body
    writer.places[link.name] = link.name, np.eye(4)
    moves = joint is not None and joint.type != "fixed"
    if joint is not None and moves:
        _joint(writer, body, joint, parent.tag == "worldbody")
    if link.inertial is not None and link.inertial.mass > 0.0:
        _inertial(body, link.inertial)
    elif moves:
        etree.SubElement(
            body,
            "inertial",
            pos="0 0 0",
            mass=numbers(_LEAST_MASS),
            diaginertia=numbers(*[_LEAST_INERTIA] * 3),
        )
        writer.massless.append(link.name)
    for shape in writer.shapes.get(link.name, ()):
        _geom(writer, body, shape)


def _joint(writer: Collected, body: Element, joint: Joint, in_world: bool) -> None:
    home = writer.description.home.get(joint.name, (0.0,))
    if joint.type == "floating":
        if joint.name in writer.balls:
            etree.SubElement(body, "joint", name=joint.name, type="ball")
        elif in_world:
            etree.SubElement(body, "freejoint", name=joint.name)
        else:
            for axis, way in zip("xyz", np.eye(3), strict=True):
                name = f"{joint.name}_{axis}"
                etree.SubElement(body, "joint", name=name, type="slide", axis=numbers(*way))
                writer.order.append(name)
            etree.SubElement(body, "joint", name=joint.name, type="ball")
            writer.losses.append(
                f"the floating joint {joint.name!r} is three slides and a ball: in MuJoCo only "
                "children of the world are free"
            )
        writer.order.append(joint.name)
        return
    kind = "slide" if joint.type == "prismatic" else "hinge"
    element = etree.SubElement(body, "joint", name=joint.name, type=kind, axis=numbers(*joint.axis))
    if home[0]:
        element.set("ref", numbers(home[0]))
    rotors = [i for i in writer.description.inputs if i.joint == joint.name]
    turned_along = sum(item.rotor_inertia * item.reduction**2 for item in rotors)
    for key, value in (
        ("damping", joint.damping),
        ("frictionloss", joint.friction),
        ("armature", joint.armature + turned_along),
    ):
        if value:
            element.set(key, numbers(value))
    if joint.lower > -math.inf or joint.upper < math.inf:
        bounds = max(joint.lower, -UNBOUNDED), min(joint.upper, UNBOUNDED)
        element.set("range", numbers(*bounds))
    writer.order.append(joint.name)


def _inertial(body: Element, inertial: Inertial) -> None:
    turned = pose_of(inertial.origin)[:3, :3]
    i = inertial
    tensor = np.array([[i.ixx, i.ixy, i.ixz], [i.ixy, i.iyy, i.iyz], [i.ixz, i.iyz, i.izz]])
    t = turned @ tensor @ turned.T
    if i.principal_moments[0] < _LEAST_MOMENT:  # MuJoCo wants them positive
        moments, axes = np.linalg.eigh(t)
        axes[:, 2] *= np.sign(np.linalg.det(axes))
        etree.SubElement(
            body,
            "inertial",
            pos=numbers(*i.origin.xyz),
            mass=numbers(i.mass),
            quat=numbers(*quaternion_of(pose(axes))),
            diaginertia=numbers(*np.maximum(moments, _LEAST_MOMENT)),
        )
        return
    full = (t[0, 0], t[1, 1], t[2, 2], t[0, 1], t[0, 2], t[1, 2])
    etree.SubElement(
        body,
        "inertial",
        pos=numbers(*inertial.origin.xyz),
        mass=numbers(inertial.mass),
        fullinertia=numbers(*full),
    )


def _geom(writer: Collected, body: Element, shape: Shape) -> None:
    geom = etree.SubElement(body, "geom", type=shape.kind, contype="0", conaffinity="0")
    set_pose(geom, pose_of(shape.origin))
    if shape.kind == "mesh":
        key = shape.file, shape.sizes
        geom.set("mesh", writer.meshes.setdefault(key, f"mesh_{len(writer.meshes) + 1}"))
    elif shape.kind == "box":
        geom.set("size", numbers(*(0.5 * size for size in shape.sizes)))
    elif shape.kind == "sphere":
        geom.set("size", numbers(*shape.sizes))
    else:
        geom.set("size", numbers(shape.sizes[0], 0.5 * shape.sizes[1]))
    if shape.rgba is not None:
        geom.set("rgba", numbers(*shape.rgba))


def _assets(writer: Collected, asset: Element) -> None:
    for (file, scale), name in writer.meshes.items():
        etree.SubElement(asset, "mesh", name=name, file=file, scale=numbers(*scale))


def _postures(writer: Collected, root: Element) -> None:
    d = writer.description
    if not d.states:
        return
    kinds = {joint.name: joint.type for joint in d.joints}
    keyframe = etree.SubElement(root, "keyframe")
    for name, stated in d.states.items():
        values = {**d.home, **stated}
        qpos: list[float] = []
        for joint in writer.order:
            if kinds.get(joint) != "floating":
                qpos += values.get(joint, (0.0,))
                continue
            x, y, z, qx, qy, qz, qw = values.get(joint, (0.0,) * 6 + (1.0,))
            qpos += [qw, qx, qy, qz] if joint in writer.balls else [x, y, z, qw, qx, qy, qz]
        etree.SubElement(keyframe, "key", name=name, qpos=numbers(*qpos))
    if any(f"{name}_x" in writer.order for name, kind in kinds.items() if kind == "floating"):
        root.remove(keyframe)
        writer.losses.append(
            "named postures are not written, since a floating joint is taken apart"
        )


def _say_task(d: Description, root: Element) -> None:
    if d.task is None:
        return
    said = etree.Element("task", base=d.task.base, tip=d.task.tip)
    said.set("outputs", " ".join(d.task.outputs))
    if d.task.length is not None:
        said.set("length", numbers(d.task.length))
    custom = etree.SubElement(root, "custom")
    etree.SubElement(custom, "text", name=TASK, data=etree.tostring(said, encoding="unicode"))
