"""Closures that a format lacks, as empty links on joints before a closure that it has.

A cut cylindrical joint, say, is a slide, an empty link and a cut hinge: the same motions are left
free. The empty links are where the other side is at home, so that their joints are at zero there.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np

from closedchain.urdf.description import (
    ClosureType,
    Description,
    Joint,
    JointType,
    Link,
    LoopClosure,
    Origin,
    Vector3,
)
from closedchain.urdf.errors import DescriptionError
from closedchain.urdf.formats.in_series import in_series
from closedchain.urdf.formats.written import listed
from closedchain.urdf.link_poses import link_poses
from closedchain.urdf.poses import direction, inverse, origin_of, pose, pose_of, vector, z_along

_Z: Vector3 = (0.0, 0.0, 1.0)
Step = tuple[str, JointType, Vector3]


@dataclass(frozen=True)
class Stubs:
    """Joints in a row from the parent's frame, and the closure at their end.

    Attributes
    ----------
    steps : tuple of (ending, type, axis)
        Endings of the joints' names, their types and axes; the first joint is at ``origin``, the
        others where the one before is.
    origin : Origin
        In the parent link.
    closure : LoopClosure
        Between the last empty link (its parent, named by ``stub_name``) and the child.
    """

    steps: tuple[Step, ...]
    origin: Origin
    closure: LoopClosure


def with_stubs(
    closure: LoopClosure, between: np.ndarray, known: Collection[ClosureType]
) -> Stubs | None:
    """Stubs for a closure, or None for one that the format has.

    Parameters
    ----------
    between : (4, 4) array
        Pose of the child link in the parent link at home.
    known : closure types of the format
        "fixed" or "revolute", and "spherical", must be among them.

    Raises
    ------
    DescriptionError
        A universal joint or a rod in a posture in which it is singular.
    """
    if closure.type in known:
        return None
    first = pose_of(closure.parent_origin) @ z_along(closure.parent_axis)
    second = pose_of(closure.child_origin) @ z_along(closure.child_axis)
    gap = inverse(first) @ between @ second
    steps, last = _steps(closure, gap)
    if last == "revolute" and "revolute" not in known:
        axis = direction(gap, _Z) if closure.type == "universal" else _Z
        steps, last = (*steps, ("hinge", "revolute", axis)), "fixed"
    start, place, seat, axis = first, Origin(), closure.child_origin, _Z
    if closure.type == "distance":
        place = Origin(vector(gap[:3, 3]))  # the far end of the rod
    elif last == "spherical":
        start = first @ pose(translation=_allowed(closure.type, gap)[:3, 3])  # at the ball
    else:  # the last empty link is at frame 1, and the child meets it there
        seat = origin_of(second @ inverse(_allowed(closure.type, gap)))
        axis = direction(gap, _Z) if (closure.type, last) == ("universal", "revolute") else _Z
    link = stub_name(closure.name, steps[-1])
    end = LoopClosure(closure.name, last, link, closure.child, place, seat, axis, axis)
    return Stubs(steps, origin_of(start), end)


def stub_name(closure: str, step: Step) -> str:
    """Name of the empty link behind a step."""
    return f"{closure}_{step[0]}_link"


def _steps(closure: LoopClosure, gap: np.ndarray) -> tuple[tuple[Step, ...], ClosureType]:
    """Joints along the axes of frame 1 and the closure behind them."""
    slide: Step = ("slide", "prismatic", _Z)
    table: dict[str, tuple[tuple[Step, ...], ClosureType]] = {
        "revolute": ((), "revolute"),
        "prismatic": ((slide,), "fixed"),
        "cylindrical": ((slide,), "revolute"),
        "planar": ((("x", "prismatic", (1.0, 0.0, 0.0)), ("y", "prismatic", (0.0, 1.0, 0.0))),
                   "revolute"),
        "universal": ((("cross", "revolute", _Z),), "revolute"),
        "point_on_line": ((slide,), "spherical"),
        "in_plane": ((("x", "prismatic", (1.0, 0.0, 0.0)), ("y", "prismatic", (0.0, 1.0, 0.0))),
                     "spherical"),
    }  # fmt: skip
    if closure.type == "distance":
        along = gap[:3, 3] / np.linalg.norm(gap[:3, 3])
        across = np.cross(np.eye(3)[int(np.abs(along).argmin())], along)
        across /= np.linalg.norm(across)
        swing: Step = ("swing", "revolute", vector(across))
        return (swing, ("tilt", "revolute", vector(np.cross(along, across)))), "spherical"
    if closure.type not in table:
        raise DescriptionError(f"the {closure.type} closure {closure.name!r} has no stubs")
    return table[closure.type]


def _allowed(kind: ClosureType, gap: np.ndarray) -> np.ndarray:
    """Gap at home without what the joint does not allow, which is only rounding there."""
    turned = pose(_about_z(gap[:3, :3]))
    if kind == "revolute":
        return turned
    if kind == "prismatic":
        return pose(translation=(0.0, 0.0, gap[2, 3]))
    if kind == "cylindrical":
        return pose(turned[:3, :3], (0.0, 0.0, gap[2, 3]))
    if kind == "planar":
        return pose(turned[:3, :3], (gap[0, 3], gap[1, 3], 0.0))
    if kind == "universal":
        return pose(gap[:3, :3])
    if kind == "point_on_line":
        return pose(gap[:3, :3], (0.0, 0.0, gap[2, 3]))
    if kind == "in_plane":
        return pose(gap[:3, :3], (gap[0, 3], gap[1, 3], 0.0))
    return gap


def _about_z(rotation: np.ndarray) -> np.ndarray:
    """Rotation about z nearest to one that is about z up to rounding."""
    size = float(np.hypot(rotation[0, 0] + rotation[1, 1], rotation[1, 0] - rotation[0, 1]))
    c = (rotation[0, 0] + rotation[1, 1]) / size
    s = (rotation[1, 0] - rotation[0, 1]) / size
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def without_foreign_closures(
    description: Description, known: Collection[ClosureType]
) -> tuple[Description, tuple[Joint, ...], list[str]]:
    """Description whose closures are all of the known types, its new joints, and what was changed.

    Types as for ``with_stubs``.
    """
    places = link_poses(description)
    links, joints = list(description.links), list[Joint]()
    closures, losses = [], []
    for closure in description.closures:
        between = inverse(places[closure.parent]) @ places[closure.child]
        stubs = with_stubs(closure, between, known)
        if stubs is None:
            closures.append(closure)
            continue
        more, carried = stub_parts(stubs, closure.parent)
        links += more
        joints += carried
        closures.append(stubs.closure)
        losses.append(
            f"the {closure.type} closure {closure.name!r} is written as joints of "
            f"{listed(link.name for link in more)}, which are empty, and a {stubs.closure.type} one"
        )
    found = replace(
        description,
        links=tuple(links),
        joints=(*description.joints, *joints),
        closures=tuple(closures),
    )
    return found, tuple(joints), losses


def stub_parts(stubs: Stubs, parent: str) -> tuple[tuple[Link, ...], tuple[Joint, ...]]:
    """Empty links and joints of stubs that start in the link ``parent``."""
    name = stubs.closure.name
    links = tuple(Link(stub_name(name, step)) for step in stubs.steps)
    ends = (parent, *(link.name for link in links))
    steps = [(f"{name}_{ending}", kind, axis) for ending, kind, axis in stubs.steps]
    return links, in_series(ends, stubs.origin, steps)
