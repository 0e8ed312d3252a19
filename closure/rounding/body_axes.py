"""Axes of joints on the bodies that they belong to, and how they move with the written numbers."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from closedchain.closure.joint_kinds import (
    JOINT_KINDS,
    TREE_KINDS,
    JointKind,
    Screw,
    Slide,
    X,
    Y,
    Z,
)
from closedchain.closure.rounding.number_twists import across, of_origin
from closedchain.closure.tree import se3
from closedchain.urdf.constraint_element import SPELLINGS
from closedchain.urdf.description import Description, Origin, Vector3
from closedchain.urdf.digits import Number, Part

Place = tuple[str, Part]  # owner of an origin, and which of its origins
Way = tuple[tuple[Place, bool], ...]  # origins one after the other, and which are inverted


@dataclass(frozen=True)
class BodyAxis:
    """An axis of a joint on one of its two bodies.

    Attributes
    ----------
    body : str
        First link of the body: links that fixed joints and closures join are one.
    owner : str
        The joint or closure.
    way : tuple
        Origins that lead from the body's first link to the frame that the axis is written in.
    part : str
        Where it is written in its owner.
    placed : bool
        Whether it is a line; else it is a direction.
    """

    body: str
    owner: str
    way: Way
    part: Part
    placed: bool


@dataclass(frozen=True)
class Line:
    """An axis in its body.

    Attributes
    ----------
    line : (6,) array
        A point [m] on it, and its direction.
    columns : (m,) array of int
        Numbers that these depend on.
    slopes : (6, m) array
        Their derivative by these.
    """

    line: np.ndarray
    columns: np.ndarray
    slopes: np.ndarray


def body_axes(description: Description) -> Iterator[BodyAxis]:
    """Axes of joints on both of their bodies, and those of closures."""
    places = _places(description)
    for joint in description.joints:
        if joint.type in {"fixed", "floating"}:
            continue
        placed = _is_line(TREE_KINDS[joint.type])
        body, way = places[joint.parent]
        own: tuple[Place, bool] = ((joint.name, "origin"), False)
        yield BodyAxis(body, joint.name, (*way, own), "axis", placed)
        body, way = places[joint.child]
        yield BodyAxis(body, joint.name, way, "axis", placed)
    for spec in description.closures:
        spelling, placed = SPELLINGS[spec.type], _is_line(JOINT_KINDS[spec.type])
        if spelling.parent_axis:
            body, way = places[spec.parent]
            own = ((spec.name, "parent_origin"), False)
            yield BodyAxis(body, spec.name, (*way, own), "parent_axis", placed)
        if spelling.child_axis != "none":
            body, way = places[spec.child]
            own = ((spec.name, "child_origin"), False)
            yield BodyAxis(body, spec.name, (*way, own), "child_axis", placed)


def _is_line(kind: JointKind) -> bool:
    return {Slide(X), Slide(Y)} <= set(kind.equations) and Screw("R", Z) in kind.screws


def _places(description: Description) -> dict[str, tuple[str, Way]]:
    """Body that each link belongs to, and the way from its first link to that link."""
    ways: dict[str, list[tuple[str, Way]]] = {}

    def join(one: str, two: str, way: Way) -> None:
        back = tuple((place, not inverted) for place, inverted in reversed(way))
        ways.setdefault(one, []).append((two, way))
        ways.setdefault(two, []).append((one, back))

    for joint in description.joints:
        if joint.type == "fixed":
            join(joint.parent, joint.child, (((joint.name, "origin"), False),))
    for spec in description.closures:
        if spec.type == "fixed":
            over: Way = (((spec.name, "parent_origin"), False), ((spec.name, "child_origin"), True))
            join(spec.parent, spec.child, over)
    found: dict[str, tuple[str, Way]] = {}
    for link in (link.name for link in description.links):
        pending: list[tuple[str, Way]] = [(link, ())]
        while pending:
            here, way = pending.pop()
            if here not in found:
                found[here] = (link, way)
                pending += [(there, (*way, *more)) for there, more in ways.get(here, [])]
    return found


def lines(
    description: Description, axes: Sequence[BodyAxis], numbers: Sequence[Number]
) -> list[Line]:
    """Axes of a description in their bodies, and how they depend on its numbers."""
    columns: dict[tuple[str, str], list[int]] = {}
    for i, number in enumerate(numbers):
        columns.setdefault((number.owner, number.part), []).append(i)
    origins, directions = _written(description)
    return [_line(axis, origins, directions, numbers, columns) for axis in axes]


def _line(
    axis: BodyAxis,
    origins: Mapping[Place, Origin],
    directions: Mapping[Place, Vector3],
    numbers: Sequence[Number],
    columns: Mapping[tuple[str, str], Sequence[int]],
) -> Line:
    own: list[int] = []
    pose, twists = pin.SE3.Identity(), [np.zeros((6, 0))]
    for place, inverted in axis.way:
        origin, mine = origins[place], columns.get(place, ())
        turned = of_origin(origin, [numbers[i].index for i in mine])
        before = pose
        pose = before * (se3(origin).inverse() if inverted else se3(origin))
        twists.append(-before.action @ turned if inverted else pose.action @ turned)
        own += mine
    point, written = pose.translation, np.array(directions[axis.owner, axis.part])
    along = pose.rotation @ written
    twist = np.hstack(twists)
    turned = twist[3:].T
    slopes = [np.vstack([twist[:3] + np.cross(turned, point).T, np.cross(turned, along).T])]
    for i in columns.get((axis.owner, axis.part), ()):
        turn = pose.rotation @ across(written, numbers[i].index)
        slopes.append(np.array([[0.0, 0.0, 0.0, *turn]]).T)
        own.append(i)
    return Line(np.concatenate([point, along]), np.array(own, dtype=int), np.hstack(slopes))


def _written(
    description: Description,
) -> tuple[dict[Place, Origin], dict[Place, Vector3]]:
    origins: dict[Place, Origin] = {}
    directions: dict[Place, Vector3] = {}
    for joint in description.joints:
        origins[joint.name, "origin"] = joint.origin
        directions[joint.name, "axis"] = joint.axis
    for spec in description.closures:
        origins[spec.name, "parent_origin"] = spec.parent_origin
        origins[spec.name, "child_origin"] = spec.child_origin
        directions[spec.name, "parent_axis"] = spec.parent_axis
        directions[spec.name, "child_axis"] = spec.child_axis
    return origins, directions
