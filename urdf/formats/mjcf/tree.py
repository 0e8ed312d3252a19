"""Bodies and joints of a MuJoCo model, as links and joints of a description.

A body's pose in the file is the one at the reference values of its joints (``ref``), and its joints
act one after the other, each about its own anchor. A joint here starts at its anchor, turned or
shifted back by ``ref``, so that its value is MuJoCo's ``qpos``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from closedchain.urdf.description import (
    Inertial,
    Joint,
    Link,
    LoopClosure,
    Origin,
)
from closedchain.urdf.formats.mjcf.compiled import TINY_MASS, Compiled
from closedchain.urdf.poses import of_quaternion, origin_of, pose, turn, vector

WORLD = "world"


@dataclass
class Tree:
    """Links, joints and balls of a model while they are collected.

    ``joints`` of MuJoCo have names in ``joint_names``, by index; ``bodies`` are names of links.
    """

    links: list[Link] = field(default_factory=list)
    joints: list[Joint] = field(default_factory=list)
    closures: list[LoopClosure] = field(default_factory=list)
    bodies: list[str] = field(default_factory=list)
    joint_names: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)


def tree_of(compiled: Compiled) -> Tree:
    """Spanning tree of a model. Balls are floating joints, each held by a closure of its own."""
    model = compiled.model
    tree = Tree()
    taken: set[str] = set()
    tree.bodies = [
        WORLD if body == 0 else _fresh(compiled.name("body", body) or f"body_{body}", taken)
        for body in range(model.nbody)
    ]
    owners = [tree.bodies[body] for body in model.jnt_bodyid]
    used: set[str] = set()
    tree.joint_names = [
        _fresh(compiled.name("joint", joint) or f"{owners[joint]}_joint", used)
        for joint in range(model.njnt)
    ]
    tree.links.append(Link(WORLD))
    for body in range(1, model.nbody):
        _add_body(compiled, tree, body)
    _add_sites(compiled, tree, taken, used)
    return tree


def _add_sites(compiled: Compiled, tree: Tree, links: set[str], joints: set[str]) -> None:
    """Named sites are points of their bodies, but for those at the ends of a loop."""
    model = compiled.model
    ends: set[int] = set()
    for index in range(model.neq):
        if int(model.eq_objtype[index]) == compiled.mujoco.mjtObj.mjOBJ_SITE:
            ends |= {int(model.eq_obj1id[index]), int(model.eq_obj2id[index])}
    for wrap in range(model.nwrap):
        if int(model.wrap_type[wrap]) == compiled.mujoco.mjtWrap.mjWRAP_SITE:
            ends.add(int(model.wrap_objid[wrap]))
    for site in range(model.nsite):
        name = compiled.name("site", site)
        if site in ends or not name:
            continue
        place = of_quaternion(model.site_quat[site])
        place[:3, 3] = model.site_pos[site]
        point = _fresh(name, links)
        tree.links.append(Link(point))
        owner = tree.bodies[int(model.site_bodyid[site])]
        fixed = _fresh(f"{point}_fixed", joints)
        tree.joints.append(Joint(fixed, "fixed", owner, point, origin_of(place)))


def _fresh(wanted: str, taken: set[str]) -> str:
    name, k = wanted, 2
    while name in taken or name in (WORLD, "universe"):
        name, k = f"{wanted}_{k}", k + 1
    taken.add(name)
    return name


def _add_body(compiled: Compiled, tree: Tree, body: int) -> None:
    model, name = compiled.model, tree.bodies[body]
    parent = tree.bodies[int(model.body_parentid[body])]
    start = of_quaternion(model.body_quat[body])
    start[:3, 3] = model.body_pos[body]
    first, count = int(model.body_jntadr[body]), int(model.body_jntnum[body])
    if model.body_mocapid[body] >= 0:
        tree.notes.append(f"the mocap body {name!r} is fixed where the file has it")
    at = np.zeros(3)  # where the frame of the last link is in the body
    for joint in range(first, first + count):
        kind = int(model.jnt_type[joint])
        kinds = compiled.mujoco.mjtJoint
        if kind == kinds.mjJNT_FREE:
            tree.joints.append(Joint(tree.joint_names[joint], "floating", WORLD, name))
            tree.links.append(Link(name, _inertial(compiled, body)))
            return
        anchor = np.array(model.jnt_pos[joint])
        start = start @ pose(translation=anchor - at)
        at = anchor
        ends_here = joint == first + count - 1 and not anchor.any()
        child = name if ends_here else f"{name}_on_{tree.joint_names[joint]}"
        tree.links.append(Link(child, _inertial(compiled, body) if ends_here else None))
        if kind == kinds.mjJNT_BALL:
            _add_ball(tree, tree.joint_names[joint], (parent, child), origin_of(start))
        else:
            slides = kind == kinds.mjJNT_SLIDE
            tree.joints.append(_joint(compiled, tree, joint, (parent, child), start, slides))
        parent, start = child, np.eye(4)
        if ends_here:
            return
    tree.links.append(Link(name, _inertial(compiled, body)))
    fixed = origin_of(start @ pose(translation=-at))
    tree.joints.append(Joint(f"{name}_fixed", "fixed", parent, name, fixed))


def _add_ball(tree: Tree, name: str, ends: tuple[str, str], origin: Origin) -> None:
    tree.joints.append(Joint(name, "floating", ends[0], ends[1], origin))
    tree.closures.append(
        LoopClosure(f"{name}_ball", "spherical", ends[0], ends[1], parent_origin=origin)
    )
    tree.notes.append(
        f"the ball {name!r} of the tree is a floating joint held by the closure '{name}_ball'"
    )


def _joint(
    compiled: Compiled,
    tree: Tree,
    joint: int,
    ends: tuple[str, str],
    start: np.ndarray,
    slides: bool,
) -> Joint:
    model = compiled.model
    axis = np.array(model.jnt_axis[joint])
    dof = int(model.jnt_dofadr[joint])
    reference = float(model.qpos0[model.jnt_qposadr[joint]])
    back = pose(translation=-reference * axis) if slides else turn(axis, -reference)
    lower, upper = -math.inf, math.inf
    if model.jnt_limited[joint]:
        lower, upper = (float(bound) for bound in model.jnt_range[joint])
    return Joint(
        name=tree.joint_names[joint],
        type="prismatic" if slides else "revolute",
        parent=ends[0],
        child=ends[1],
        origin=origin_of(start @ back if reference else start),
        axis=vector(axis),
        lower=lower,
        upper=upper,
        damping=_first(model.dof_damping, dof),
        friction=_first(model.dof_frictionloss, dof),
        armature=_first(model.dof_armature, dof),
    )


def _first(of_dofs: np.ndarray, dof: int) -> float:
    """A number of a freedom; of a polynomial, its linear term."""
    return float(np.ravel(of_dofs[dof])[0])


def _inertial(compiled: Compiled, body: int) -> Inertial | None:
    model = compiled.model
    mass = float(model.body_mass[body])
    if mass <= TINY_MASS:
        return None
    place = of_quaternion(model.body_iquat[body])
    place[:3, 3] = model.body_ipos[body]
    ixx, iyy, izz = (float(moment) for moment in model.body_inertia[body])
    return Inertial(origin_of(place), mass, ixx, 0.0, 0.0, iyy, 0.0, izz)
