"""The drawing of the bodies of a mechanism: visuals or sticks, and how postures move them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from closedchain.closure import Closure, Mechanism
from closedchain.robots._visuals import read_visuals

_STICK, _JOINT, _CLOSURE, _GAP = 0x5A5E66, 0xE3BF58, 0x6B3D6B, 0xD0021B
_GROUND = 0xB9C0CA  # of sticks in a base that has shapes: they say what it carries, and are no rods
_OPEN = 1e-6  # [m, rad] that a closure which is drawn as open is open by

Fixed = tuple[int, np.ndarray]  # a point (3,) [m] in the frame of a Pinocchio joint


@dataclass(frozen=True, eq=False)
class Part:
    """A drawn thing that a joint carries.

    ``placement`` (4, 4), in the frame of the joint, may contain a scale.
    """

    path: str
    joint: int
    placement: np.ndarray


@dataclass(frozen=True, eq=False)
class Stick:
    """A drawn cylinder between two points; ``length`` [m] is that of the cylinder unstretched."""

    path: str
    begin: Fixed
    end: Fixed
    length: float


@dataclass(frozen=True, eq=False)
class Bodies:
    """What was drawn.

    ``extent`` (n, 3) are points [m] that a picture must show, over all postures; ``size`` [m] is
    half the diagonal of the box around joints and points, over all postures too. ``notes`` say what
    is not drawn, and which closures are open.
    """

    parts: tuple[Part | Stick, ...]
    extent: np.ndarray
    size: float
    notes: tuple[str, ...]


def joint_poses(mechanism: Mechanism, postures: np.ndarray) -> np.ndarray:
    """Poses of all joints in the world, (n, njoints, 4, 4), at postures (n, nq), unchecked."""
    model, data = mechanism.model, mechanism.model.createData()
    poses = np.empty((len(postures), model.njoints, 4, 4))
    for row, q in zip(poses, postures, strict=True):
        pin.forwardKinematics(model, data, q)
        for joint in range(model.njoints):
            row[joint] = data.oMi[joint].homogeneous
    return poses


def positions(mechanism: Mechanism, postures: np.ndarray, point: Fixed) -> np.ndarray:
    """World positions (n, 3) of a point of a body at postures (n, nq), unchecked."""
    model, data = mechanism.model, mechanism.model.createData()
    joint, local = point
    found = np.empty((len(postures), 3))
    for row, q in zip(found, postures, strict=True):
        pin.forwardKinematics(model, data, q)
        row[:] = data.oMi[joint].act(local)
    return found


def in_world(poses: np.ndarray, point: Fixed) -> np.ndarray:
    """World positions (n, 3) of a point of a body, from ``joint_poses``."""
    joint, local = point
    return np.asarray(poses[:, joint, :3, :3] @ local + poses[:, joint, :3, 3])


def frame_point(mechanism: Mechanism, name: str) -> Fixed:
    """Origin of a link or named point. Raises ``ClosureError`` where it is unknown."""
    frame = mechanism.model.frames[mechanism.frame_id(name)]
    return frame.parentJoint, np.array(frame.placement.translation)


def draw_bodies(view: Any, mechanism: Mechanism, postures: np.ndarray) -> Bodies:
    """Draw the first of the postures (n, nq) with what is needed to show the others."""
    poses = joint_poses(mechanism, postures)
    visuals, notes = read_visuals(mechanism)
    parts, extent = _sticks(view, mechanism, poses, visuals)
    gaps, open_ = _gaps(view, mechanism, poses, mechanism.workspace.residual(postures[0]))
    parts += gaps
    size = 0.5 * float(np.linalg.norm(np.ptp(extent.reshape(-1, 3), axis=0))) or mechanism.length
    everything = [extent.reshape(-1, 3)]
    if visuals is not None:
        shapes, corners = _show_visuals(view, mechanism, visuals, postures[0])
        parts += shapes
        everything += [in_world(poses, corner) for corner in corners]
    return Bodies(tuple(parts), np.vstack(everything), size, (*notes, *open_))


def _show_visuals(
    view: Any, mechanism: Mechanism, visuals: pin.GeometryModel, q: np.ndarray
) -> tuple[list[Part | Stick], list[Fixed]]:
    """Draw the shapes; return them and the corners of their boxes."""
    from pinocchio.visualize import MeshcatVisualizer

    display = MeshcatVisualizer(mechanism.model, None, visuals)
    display.initViewer(viewer=view, open=False, loadModel=False)
    display.loadViewerModel("bodies")
    display.display(q)
    parts: list[Part | Stick] = []
    corners: list[Fixed] = []
    for shape in visuals.geometryObjects:
        name = display.getViewerNodeName(shape, pin.GeometryType.VISUAL)
        placement = shape.placement.homogeneous @ np.diag([*shape.meshScale, 1.0])
        parts.append(Part(view[name].path.lower(), shape.parentJoint, placement))
        shape.geometry.computeLocalAABB()
        box = shape.geometry.aabb_local
        ends = np.array([box.min_, box.max_])
        for x, y, z in np.ndindex(2, 2, 2):
            corner = placement @ [ends[x, 0], ends[y, 1], ends[z, 2], 1.0]
            corners.append((shape.parentJoint, corner[:3]))
    return parts, corners


def _sticks(
    view: Any, mechanism: Mechanism, poses: np.ndarray, visuals: pin.GeometryModel | None
) -> tuple[list[Part | Stick], np.ndarray]:
    """Draw straight sticks in the bodies without visuals and in the base: joint to joint.

    Without any visuals the joints are drawn too. Returns what was drawn, and all joints and
    points in the world, (n, m, 3) [m].
    """
    import meshcat.geometry as shapes

    spots = {name: frame_point(mechanism, name) for name in mechanism.frame_ids}
    shaped = set() if visuals is None else {o.parentJoint for o in visuals.geometryObjects}
    dressed = shaped - {0}
    joints = [j for j in mechanism.description.joints if j.type != "floating"]
    sticks = [(spots[j.parent], spots[j.child]) for j in joints]
    rods: list[tuple[Fixed, Fixed]] = []
    closed: list[Fixed] = []
    for closure in mechanism.closures:
        if isinstance(closure, Closure):
            ends = _closure_points(closure)
            closed += ends
            own = spots[closure.parent], spots[closure.child]
            sticks += zip(own, ends, strict=True)
            if closure.joint_kind.is_rod:
                rods.append((ends[0], ends[1]))
    every = np.stack([in_world(poses, p) for p in (*spots.values(), *closed)], axis=1)
    radius = 0.5 * float(np.linalg.norm(np.ptp(every.reshape(-1, 3), axis=0))) or mechanism.length
    width = radius * (0.011 if visuals is None else 0.005)
    parts: list[Part | Stick] = []
    # a rod is no body: whatever its ends are on, it is drawn
    drawn = [(stick, _GROUND if stick[0][0] in shaped else _STICK) for stick in sticks
             if stick[0][0] not in dressed] + [(rod, _STICK) for rod in rods]  # fmt: skip
    for i, ((begin, end), colour) in enumerate(drawn):
        begins, ends_ = in_world(poses, begin), in_world(poses, end)
        # a prismatic joint lengthens its stick from posture to posture
        longest = float(np.linalg.norm(ends_ - begins, axis=1).max())
        if longest > 1e-6 * radius:
            node = view["sticks"][str(i)]
            material = shapes.MeshLambertMaterial(color=colour)
            node.set_object(shapes.Cylinder(longest, width), material)
            node.set_transform(_along(begins[0], ends_[0], longest))
            parts.append(Stick(node.path.lower(), begin, end, longest))
    if visuals is None:
        balls = [(spots[j.child], _JOINT) for j in joints if j.type != "fixed"]
        balls += [(spot, _CLOSURE) for spot in closed]
        for i, (spot, colour) in enumerate(balls):
            node = view["joints"][str(i)]
            node.set_object(shapes.Sphere(2.2 * width), shapes.MeshLambertMaterial(color=colour))
            node.set_transform(at(in_world(poses[:1], spot)[0]))
            parts.append(Part(node.path.lower(), spot[0], at(spot[1])))
    return parts, every


def _gaps(
    view: Any, mechanism: Mechanism, poses: np.ndarray, rows: np.ndarray
) -> tuple[list[Part | Stick], tuple[str, ...]]:
    """Draw what is missing of closures that are open at the first posture; a sentence for each."""
    import meshcat.geometry as shapes

    parts: list[Part | Stick] = []
    notes = []
    material = shapes.MeshLambertMaterial(color=_GAP)
    for closure, where in zip(mechanism.closures, mechanism.row_slices, strict=True):
        open_by = float(np.abs(rows[where]).max(initial=0.0))
        if open_by <= _OPEN:
            continue
        notes.append(f"open: closure {closure.describe()} by {open_by:.3g}, drawn in red")
        if not isinstance(closure, Closure):
            continue
        ends = _closure_points(closure)
        begins, ends_ = (in_world(poses, end) for end in ends)
        longest = float(np.linalg.norm(ends_ - begins, axis=1).max())
        if longest > 0.0:
            node = view["gaps"][closure.name]
            node.set_object(shapes.Cylinder(longest, 0.02 * mechanism.length), material)
            node.set_transform(_along(begins[0], ends_[0], longest))
            parts.append(Stick(node.path.lower(), *ends, longest))
    return parts, tuple(notes)


def _closure_points(closure: Closure) -> tuple[Fixed, Fixed]:
    """Both ends of a closure."""
    return (
        (closure.joint1, np.array(closure.placement1.translation)),
        (closure.joint2, np.array(closure.placement2.translation)),
    )


def at(position: np.ndarray) -> np.ndarray:
    """Transform (4, 4) that moves to a position and does not turn."""
    transform = np.eye(4)
    transform[:3, 3] = position
    return transform


def _along(begin: np.ndarray, end: np.ndarray, length: float) -> np.ndarray:
    """Pose of a Meshcat cylinder, whose axis is y, stretched to reach between two points."""
    transform = at(0.5 * (begin + end))
    reach = float(np.linalg.norm(end - begin))
    stretch = np.diag([1.0, max(reach / length, 1e-6), 1.0])  # never flat: that has no inverse
    axis = (end - begin) / reach if reach > 0.0 else np.array([0.0, 1.0, 0.0])
    turn = np.eye(3)
    if axis[1] >= -1.0 + 1e-9:
        turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 1.0, 0.0]), axis).matrix()
    transform[:3, :3] = turn @ stretch
    return transform
