"""Equality constraints of a MuJoCo model: closures, and relations of joint values.

A connect holds a point: a ball. Two of them between the same bodies hold a line, which is a hinge,
and three or more a body. Which one it is follows from the points, and is noted.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from closedchain.urdf.description import Coupling, JointRelation, LoopClosure, Origin
from closedchain.urdf.formats.mjcf.compiled import Compiled
from closedchain.urdf.formats.mjcf.tree import Tree
from closedchain.urdf.poses import of_quaternion, origin_of, pose, vector

_APART = 1e-9  # [m] two points nearer than that are one
_ALIKE = 1e-6  # relative: how far a distance may differ between two bodies that share the points


@dataclass
class Equalities:
    """What the equality constraints of a model come to."""

    closures: list[LoopClosure] = field(default_factory=list)
    couplings: list[Coupling] = field(default_factory=list)
    relations: list[JointRelation] = field(default_factory=list)
    held: dict[str, float] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class _Point:
    """A connect: a point of each of two links."""

    name: str
    links: tuple[str, str]
    first: np.ndarray
    second: np.ndarray


def equalities_of(compiled: Compiled, tree: Tree) -> Equalities:
    """Closures, couplings and relations of a model; what cannot be read is noted."""
    model, kinds = compiled.model, compiled.mujoco.mjtEq
    found = Equalities()
    points: list[_Point] = []
    for index in range(model.neq):
        kind = int(model.eq_type[index])
        name = compiled.name("equality", index) or f"equality_{index}"
        if not model.eq_active0[index]:
            found.notes.append(f"the equality {name!r} is not active in the file and was not read")
        elif kind == kinds.mjEQ_CONNECT:
            points.append(_connect(compiled, tree, index, name))
        elif kind == kinds.mjEQ_WELD:
            found.closures.append(_weld(compiled, tree, index, name))
        elif kind == kinds.mjEQ_JOINT:
            _joint(compiled, tree, index, name, found)
        elif kind == kinds.mjEQ_TENDON:
            _tendon(compiled, tree, index, name, found)
        else:
            word = kinds(kind).name.removeprefix("mjEQ_").lower()
            found.notes.append(f"the equality {name!r} of type {word} was not read")
    groups: dict[tuple[str, str], list[_Point]] = {}
    for point in points:
        turned = point.links[::-1] in groups and point.links not in groups
        one = _Point(point.name, point.links[::-1], point.second, point.first) if turned else point
        groups.setdefault(one.links, []).append(one)
    for group in groups.values():
        found.closures += _shared(group, found.notes)
    return found


def _frames(compiled: Compiled, tree: Tree, index: int) -> tuple[tuple[str, str], Any]:
    """Links of an equality, and the poses of its two sites where it is between sites."""
    model = compiled.model
    ids = int(model.eq_obj1id[index]), int(model.eq_obj2id[index])
    if int(model.eq_objtype[index]) != compiled.mujoco.mjtObj.mjOBJ_SITE:
        return (tree.bodies[ids[0]], tree.bodies[ids[1]]), None
    poses = []
    for site in ids:
        place = of_quaternion(model.site_quat[site])
        place[:3, 3] = model.site_pos[site]
        poses.append(place)
    bodies = [int(model.site_bodyid[site]) for site in ids]
    return (tree.bodies[bodies[0]], tree.bodies[bodies[1]]), poses


def _connect(compiled: Compiled, tree: Tree, index: int, name: str) -> _Point:
    links, sites = _frames(compiled, tree, index)
    data = compiled.model.eq_data[index]
    if sites is not None:
        return _Point(name, links, sites[0][:3, 3], sites[1][:3, 3])
    return _Point(name, links, np.array(data[:3]), np.array(data[3:6]))


def _weld(compiled: Compiled, tree: Tree, index: int, name: str) -> LoopClosure:
    """Weld of two frames; between bodies, the data are the second's in both."""
    links, sites = _frames(compiled, tree, index)
    data = compiled.model.eq_data[index]
    if sites is not None:
        first, second = sites
    else:
        first = of_quaternion(data[6:10])
        first[:3, 3] = data[3:6]
        second = pose(translation=data[:3])
    return LoopClosure(name, "fixed", *links, origin_of(first), origin_of(second))


def _shared(group: Sequence[_Point], notes: list[str]) -> list[LoopClosure]:
    """Joint of two bodies that share these points."""
    links = group[0].links
    distinct = [group[0]]
    for point in group[1:]:
        if all(np.linalg.norm(point.first - other.first) > _APART for other in distinct):
            distinct.append(point)
    balls = [
        LoopClosure(p.name, "spherical", *links, _at(p.first), _at(p.second)) for p in distinct
    ]
    if len(distinct) < len(group):
        notes.append(f"connects of {links[0]!r} and {links[1]!r} that repeat a point were left out")
    if len(distinct) == 1 or not _alike(distinct):
        return balls
    names = ", ".join(repr(p.name) for p in distinct)
    axes = [_unit(distinct[1].first - distinct[0].first)]
    axes.append(_unit(distinct[1].second - distinct[0].second))
    off = [np.cross(axes[0], p.first - distinct[0].first) for p in distinct[2:]]
    normal = max(off, key=lambda c: float(np.linalg.norm(c)), default=np.zeros(3))
    if float(np.linalg.norm(normal)) <= _APART:
        notes.append(f"the connects {names} hold a line: they were read as one hinge")
        return [
            LoopClosure(
                distinct[0].name, "revolute", *links, _at(distinct[0].first),
                _at(distinct[0].second), vector(axes[0]), vector(axes[1]),
            )
        ]  # fmt: skip
    third = next(p for p, c in zip(distinct[2:], off, strict=True) if c is normal)
    notes.append(f"the connects {names} hold a body: they were read as one weld")
    frames = []
    for axis, start, end in (
        (axes[0], distinct[0].first, third.first),
        (axes[1], distinct[0].second, third.second),
    ):
        z = _unit(np.cross(axis, end - start))
        frames.append(pose(np.column_stack([axis, np.cross(z, axis), z]), start))
    first, second = map(origin_of, frames)
    return [LoopClosure(distinct[0].name, "fixed", *links, first, second)]


def _alike(points: Sequence[_Point]) -> bool:
    """Whether the points are equally far from each other in both bodies."""
    for k, one in enumerate(points):
        for other in points[:k]:
            here = float(np.linalg.norm(one.first - other.first))
            there = float(np.linalg.norm(one.second - other.second))
            if abs(here - there) > _ALIKE * here:
                return False
    return True


def _at(point: np.ndarray) -> Origin:
    return Origin(vector(point))


def _unit(along: np.ndarray) -> np.ndarray:
    return along / np.linalg.norm(along)


def _joint(compiled: Compiled, tree: Tree, index: int, name: str, found: Equalities) -> None:
    """y - y0 = a0 + a1 (x - x0) + ..., with x0 and y0 the reference values."""
    model = compiled.model
    follower, leader = int(model.eq_obj1id[index]), int(model.eq_obj2id[index])
    coefficients = [float(c) for c in model.eq_data[index][:5]]
    y0 = float(model.qpos0[model.jnt_qposadr[follower]])
    if leader < 0:
        found.held[tree.joint_names[follower]] = y0 + coefficients[0]
        return
    x0 = float(model.qpos0[model.jnt_qposadr[leader]])
    shifted = np.polynomial.Polynomial(coefficients)(np.polynomial.Polynomial([-x0, 1.0])).coef
    expanded = [float(c) for c in shifted] + [0.0] * (5 - len(shifted))
    expanded[0] += y0
    names = tree.joint_names[follower], tree.joint_names[leader]
    driven = {coupling.joint for coupling in found.couplings}
    if not any(coefficients[2:]) and names[0] not in driven and coefficients[1] != 0.0:
        found.couplings.append(Coupling(names[0], names[1], expanded[1], expanded[0]))
    elif any(coefficients[1:]):
        while expanded[-1] == 0.0:
            expanded.pop()
        found.relations.append(JointRelation(name, "polynomial", names, tuple(expanded)))
    else:
        found.held[names[0]] = y0 + coefficients[0]


def _tendon(compiled: Compiled, tree: Tree, index: int, name: str, found: Equalities) -> None:
    """Length of one tendon held: a sum of joint values, or the distance of two points."""
    model, kinds = compiled.model, compiled.mujoco.mjtWrap
    tendon, other = int(model.eq_obj1id[index]), int(model.eq_obj2id[index])
    start, count = int(model.tendon_adr[tendon]), int(model.tendon_num[tendon])
    wraps = [int(model.wrap_type[k]) for k in range(start, start + count)]
    objects = [int(model.wrap_objid[k]) for k in range(start, start + count)]
    length = float(model.tendon_length0[tendon]) + float(model.eq_data[index][0])
    if other < 0 and all(kind == kinds.mjWRAP_JOINT for kind in wraps):
        factors = tuple(float(model.wrap_prm[k]) for k in range(start, start + count))
        joints = tuple(tree.joint_names[joint] for joint in objects)
        found.relations.append(JointRelation(name, "linear", joints, factors, length))
    elif other < 0 and wraps == [kinds.mjWRAP_SITE] * 2 and length > 0.0:
        links = [tree.bodies[int(model.site_bodyid[site])] for site in objects]
        ends = [_at(model.site_pos[site]) for site in objects]
        found.closures.append(
            LoopClosure(
                name,
                "distance",
                links[0],
                links[1],
                ends[0],
                ends[1],
                sizes=(("length", length),),
            )
        )
    else:
        found.notes.append(f"the equality {name!r} of tendons was not read")
