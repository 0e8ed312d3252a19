"""From a graph of bodies and joints to a spanning tree and what closes its loops.

In SDF a loop is simply a joint on a link that other joints hold already. Joints that are driven or
cannot be cut go into the tree first, then hinges and slides in the order of the file. Balls are
always cut: a part that hangs on balls alone is placed by a floating joint, which they then hold.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from closedchain.urdf.description import (
    Joint,
    JointRelation,
    Link,
    LoopClosure,
    Vector3,
)
from closedchain.urdf.errors import DescriptionError
from closedchain.urdf.formats.composite import Composite, taken_apart
from closedchain.urdf.poses import (
    direction,
    inverse,
    origin_of,
    pose,
    quaternion_of,
    turn,
    vector,
)

EdgeKind = Literal["fixed", "revolute", "prismatic", "universal", "ball", "screw", "revolute2"]
CUT: dict[str, str] = {
    "fixed": "fixed",
    "revolute": "revolute",
    "prismatic": "prismatic",
    "universal": "universal",
    "ball": "spherical",
}
"""Closure of each kind of joint that a loop can be cut at."""


@dataclass(frozen=True)
class Edge:
    """A joint between two bodies.

    Attributes
    ----------
    place : (4, 4) array
        Pose of the joint in the model, at the posture of the file.
    axes : tuple of unit vectors
        In the joint's frame.
    lower, upper, home : float
        Bounds, and value at the posture of the file.
    pitch : float
        Of a screw [m per turn].
    driven, cut : bool
        Whether a motor moves it, so that it should be in the tree; whether the file says that it
        closes a loop.
    damping, friction : float
        What opposes the motion, as of ``Joint``.
    line : int or None
    """

    name: str
    kind: EdgeKind
    parent: str
    child: str
    place: np.ndarray
    axes: tuple[Vector3, ...] = ()
    lower: float = float("-inf")
    upper: float = float("inf")
    home: float = 0.0
    pitch: float = 0.0
    line: int | None = None
    damping: float = 0.0
    friction: float = 0.0
    driven: bool = False
    cut: bool = False


@dataclass
class Spanned:
    """Tree and closures of a graph."""

    links: list[Link] = field(default_factory=list)
    joints: list[Joint] = field(default_factory=list)
    closures: list[LoopClosure] = field(default_factory=list)
    relations: list[JointRelation] = field(default_factory=list)
    home: dict[str, tuple[float, ...]] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)


def spanned(
    root: str,
    bodies: dict[str, np.ndarray],
    edges: Sequence[Edge],
    floating: dict[str, tuple[str, str]],
) -> Spanned:
    """Spanning tree of the bodies (name and pose (4, 4)) that starts at ``root``.

    Parameters
    ----------
    floating : mapping of child to (joint name, parent)
        Floating joints that the file itself asks for.

    Raises
    ------
    DescriptionError
        A loop that only closes at joints that cannot be cut.
    """
    tree, cut = _chosen(edges, [(child, parent) for child, (_, parent) in floating.items()])
    found = Spanned()
    reached = {root}
    _grow(found, root, bodies, tree, reached)
    for edge in cut:
        found.closures.append(_closure(edge, bodies))
    while left := [body for body in bodies if body not in reached]:
        ready = [body for body in left if body in floating and floating[body][1] in reached]
        if ready:
            name, parent = floating[ready[0]]
            start = ready[0]
            _float(found, name, parent, start, bodies)
        else:
            start = _hang(found, left[0], bodies, tree, cut, reached) or left[0]
        if start not in {joint.child for joint in found.joints}:
            _float(found, f"{start}_floating", root, start, bodies)
            if not any(set(_part(start, tree)) & {e.parent, e.child} for e in cut):
                found.notes.append(f"the link {start!r} is held by no joint: it moves freely")
        reached.add(start)
        _grow(found, start, bodies, tree, reached)
    return found


def _chosen(
    edges: Sequence[Edge], joined: Sequence[tuple[str, str]]
) -> tuple[list[Edge], list[Edge]]:
    """Edges of the tree and edges that are cut; some bodies are ``joined`` already."""
    body: dict[str, str] = {}

    def find(name: str) -> str:
        while body.get(name, name) != name:
            name = body[name]
        return name

    def rank(edge: Edge) -> int:
        if edge.cut:
            return 3
        return 1 if edge.driven else {"fixed": 0, "screw": 1, "revolute2": 1}.get(edge.kind, 2)

    for one, other in joined:
        body[find(one)] = find(other)
    tree: list[Edge] = []
    cut: list[Edge] = []
    for edge in sorted(edges, key=rank):
        ends = find(edge.parent), find(edge.child)
        if edge.kind == "ball" or ends[0] == ends[1]:
            if edge.kind not in CUT:
                raise DescriptionError(
                    f"it closes a loop and cannot be cut there; cut joints are {', '.join(CUT)}",
                    line=edge.line,
                    element="joint",
                    name=edge.name,
                )
            cut.append(edge)
        else:
            body[ends[1]] = ends[0]
            tree.append(edge)
    order = {id(edge): k for k, edge in enumerate(edges)}
    return sorted(tree, key=lambda e: order[id(e)]), sorted(cut, key=lambda e: order[id(e)])


def _part(body: str, tree: Sequence[Edge]) -> list[str]:
    """Bodies that edges of the tree join to one, itself first."""
    part = [body]
    for reached in part:
        for edge in tree:
            for here, there in ((edge.parent, edge.child), (edge.child, edge.parent)):
                if here == reached and there not in part:
                    part.append(there)
    return part


def _hang(
    found: Spanned,
    body: str,
    bodies: dict[str, np.ndarray],
    tree: Sequence[Edge],
    cut: Sequence[Edge],
    reached: set[str],
) -> str | None:
    """Place a part that one ball alone holds at that ball; the body there, or None."""
    part = set(_part(body, tree))
    holding = [edge for edge in cut if len(part & {edge.parent, edge.child}) == 1]
    if len(holding) != 1:
        return None
    edge = holding[0]
    inside, outside = (edge.child, edge.parent) if edge.child in part else (edge.parent, edge.child)
    if outside not in reached or outside not in bodies:
        return None
    _float(found, f"{edge.name}_floating", outside, inside, bodies)
    return inside


def _float(
    found: Spanned, name: str, parent: str, child: str, bodies: dict[str, np.ndarray]
) -> None:
    """Floating joint in the parent's frame, its home the pose of the file."""
    found.links.append(Link(child))
    found.joints.append(Joint(name, "floating", parent, child))
    found.home[name] = _seven(inverse(bodies[parent]) @ bodies[child])


def _seven(place: np.ndarray) -> tuple[float, ...]:
    w, x, y, z = quaternion_of(place)
    return (*vector(place[:3, 3]), x, y, z, w)


def _grow(
    found: Spanned,
    start: str,
    bodies: dict[str, np.ndarray],
    tree: Sequence[Edge],
    reached: set[str],
) -> None:
    """Add all bodies that edges of the tree join to ``start``, nearest first."""
    if start not in {link.name for link in found.links}:
        found.links.append(Link(start))
    waiting = [start]
    while waiting:
        here = waiting.pop(0)
        for edge in tree:
            for near, far, forward in (
                (edge.parent, edge.child, True),
                (edge.child, edge.parent, False),
            ):
                if near == here and far not in reached:
                    _add(found, edge, (near, far), forward, bodies)
                    reached.add(far)
                    waiting.append(far)


def _add(
    found: Spanned,
    edge: Edge,
    ends: tuple[str, str],
    forward: bool,
    bodies: dict[str, np.ndarray],
) -> None:
    """Joint of the tree from one body to the next; backwards its axes are turned around.

    Where the next body's frame is not at the joint, an empty link stands between.
    """
    near, far = ends
    origin = inverse(bodies[near]) @ edge.place
    offset = inverse(edge.place) @ bodies[far]
    axes = edge.axes if forward else tuple(vector(-np.array(a)) for a in reversed(edge.axes))
    at_joint = bool(np.abs(offset - np.eye(4)).max() < 1e-15)
    if edge.kind == "fixed":
        found.links.append(Link(far))
        found.joints.append(Joint(edge.name, "fixed", near, far, origin_of(origin @ offset)))
        return
    child = far if at_joint else f"{far}_at_{edge.name}"
    if edge.kind in ("revolute", "prismatic"):
        axis = axes[0]
        slides = edge.kind == "prismatic"
        if edge.home:
            back = (
                pose(translation=-edge.home * np.array(axis)) if slides else turn(axis, -edge.home)
            )
            origin = origin @ back
        kind: Literal["prismatic", "revolute"] = "prismatic" if slides else "revolute"
        found.joints.append(
            Joint(
                edge.name,
                kind,
                near,
                child,
                origin_of(origin),
                axis,
                edge.lower,
                edge.upper,
                damping=edge.damping,
                friction=edge.friction,
            )
        )
        found.home[edge.name] = (edge.home,)
    else:
        parts = taken_apart(
            Composite(edge.name, edge.kind, near, child, origin_of(origin), axes, edge.pitch)
        )
        found.links += parts.links
        found.joints += parts.joints
        found.relations += parts.relations
        found.notes.append(parts.note)
    if not at_joint:
        found.links.append(Link(child))
        found.joints.append(Joint(f"{child}_fixed", "fixed", child, far, origin_of(offset)))
    found.links.append(Link(far))


def _closure(edge: Edge, bodies: dict[str, np.ndarray]) -> LoopClosure:
    """A joint that was cut: both its frames are where the joint is."""
    origins = [origin_of(inverse(bodies[body]) @ edge.place) for body in (edge.parent, edge.child)]
    kind = CUT[edge.kind]
    z: Vector3 = (0.0, 0.0, 1.0)
    first = edge.axes[0] if kind in ("revolute", "prismatic", "universal") else z
    second = edge.axes[1] if kind == "universal" else first
    return LoopClosure(
        edge.name,
        kind,  # type: ignore[arg-type]
        edge.parent,
        edge.child,
        origins[0],
        origins[1],
        direction(np.eye(4), first),
        direction(np.eye(4), second),
        line=edge.line,
    )
