"""The drawing of a mechanism as Meshcat commands: visuals or sticks, camera, background."""

from __future__ import annotations

import re
import warnings
from typing import Any, Literal

import numpy as np
import pinocchio as pin

from closedchain.closure import Closure, Mechanism

_TO_Z = {  # rotation that takes the world axis "up" to Meshcat's z
    "x": np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]),
    "y": np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]),
    "z": np.eye(3),
}
_VIEW = np.array([0.55, 0.22, 0.80])  # from the robot to the camera; y is up here
_FROM_ABOVE = np.array([0.20, 0.90, 0.45])  # for a mechanism that lies in a plane
_DISTANCE = 1.6  # in radii of the robot: all of it within the field of view
_IDENTIFIER = re.compile(r"[0-9a-f]{8}(-[0-9a-f]{4}){3}-[0-9a-f]{12}")
_STICK, _JOINT, _CLOSURE = 0x5A5E66, 0xE6730D, 0x0D8C80


class Recorder:
    """What Meshcat takes for its window: keeps the commands instead of sending them.

    Meshcat's random identifiers are replaced by numbers, so that equal drawings are equal bytes.
    """

    web_url = ""

    def __init__(self) -> None:
        self.commands: list[bytes] = []
        self._numbers: dict[str, str] = {}

    def send(self, command: Any) -> None:
        """Keep a command as Meshcat packs it."""
        import umsgpack  # type: ignore[import-untyped]

        self.commands.append(umsgpack.packb(self._numbered(command.lower())))

    def _numbered(self, value: Any) -> Any:
        if isinstance(value, dict):
            return {key: self._numbered(item) for key, item in value.items()}
        if isinstance(value, list) and value and isinstance(value[0], dict):
            return [self._numbered(item) for item in value]
        if isinstance(value, str) and _IDENTIFIER.fullmatch(value):
            return self._numbers.setdefault(value, f"id-{len(self._numbers)}")
        return value


def draw(
    recorder: Recorder, mechanism: Mechanism, q: np.ndarray, up: Literal["x", "y", "z"]
) -> str:
    """Record the drawing of a posture; return a remark for the reader, or an empty string."""
    with warnings.catch_warnings():  # meshcat asks pyzmq for a module that pyzmq deprecates
        warnings.simplefilter("ignore", DeprecationWarning)
        import meshcat

    view = meshcat.Visualizer(window=recorder)
    visuals, note = _visuals(mechanism)
    points = [_sticks(view, mechanism, q, visuals)]
    if visuals is not None:
        points.append(_show_visuals(view, mechanism, visuals, q))
    _look_at(view, np.vstack(points) @ _TO_Z[up].T, _TO_Z[up])
    return note


def _visuals(mechanism: Mechanism) -> tuple[pin.GeometryModel | None, str]:
    """Shapes of the URDF, or None and the reason why they are not drawn."""
    if not any(link.visuals for link in mechanism.description.links):
        return None, "no visuals: drawn as sticks between the joints"
    try:
        # Pinocchio's parser knows no capsules
        text = re.sub(r"<(/?)capsule\b", r"<\1cylinder", mechanism.description.text)
        model = pin.buildGeomFromUrdfString(mechanism.model, text, pin.GeometryType.VISUAL)
    except (ValueError, RuntimeError) as error:
        return None, f"drawn as sticks: the visuals cannot be read ({str(error).strip()[:200]})"
    return model, ""


def _show_visuals(
    view: Any, mechanism: Mechanism, visuals: pin.GeometryModel, q: np.ndarray
) -> np.ndarray:
    """Draw the shapes; return corners of their boxes in the world, (n, 3)."""
    from pinocchio.visualize import MeshcatVisualizer

    display = MeshcatVisualizer(mechanism.model, None, visuals)
    display.initViewer(viewer=view["robot"], open=False, loadModel=False)
    display.loadViewerModel("bodies")
    display.display(q)
    corners = []
    for shape, pose in zip(visuals.geometryObjects, display.visual_data.oMg, strict=True):
        shape.geometry.computeLocalAABB()
        box = shape.geometry.aabb_local
        ends = np.array([box.min_, box.max_]) * shape.meshScale
        for x, y, z in np.ndindex(2, 2, 2):
            corners.append(pose.act(np.array([ends[x, 0], ends[y, 1], ends[z, 2]])))
    return np.array(corners).reshape(-1, 3)


def _sticks(
    view: Any, mechanism: Mechanism, q: np.ndarray, visuals: pin.GeometryModel | None
) -> np.ndarray:
    """Draw straight sticks in the bodies without visuals and in the base: joint to joint.

    Without any visuals the joints are drawn too. Returns all joints and points, (n, 3) [m].
    """
    import meshcat.geometry as shapes

    spots = {name: mechanism.point(q, name) for name in mechanism.frame_ids}
    body = {n: mechanism.model.frames[i].parentJoint for n, i in mechanism.frame_ids.items()}
    dressed = set() if visuals is None else {o.parentJoint for o in visuals.geometryObjects} - {0}
    joints = [j for j in mechanism.description.joints if j.type != "floating"]
    sticks = [(j.parent, spots[j.child]) for j in joints]
    closed = []
    for closure in mechanism.closures:
        if isinstance(closure, Closure):
            ends = _closure_points(mechanism, closure)
            closed += list(ends)
            sticks += zip((closure.parent, closure.child), ends, strict=True)
    every = np.array([*spots.values(), *closed])
    radius = 0.5 * float(np.linalg.norm(np.ptp(every, axis=0))) or mechanism.length
    width = radius * (0.011 if visuals is None else 0.005)
    material = shapes.MeshLambertMaterial(color=_STICK)
    for i, (link, end) in enumerate(sticks):
        length = float(np.linalg.norm(end - spots[link]))
        if length > 1e-6 * radius and body[link] not in dressed:
            node = view["robot"]["sticks"][str(i)]
            node.set_object(shapes.Cylinder(length, width), material)
            node.set_transform(_along(spots[link], end))
    if visuals is None:
        balls = [(spots[j.child], _JOINT) for j in joints if j.type != "fixed"]
        balls += [(spot, _CLOSURE) for spot in closed]
        for i, (spot, colour) in enumerate(balls):
            node = view["robot"]["joints"][str(i)]
            node.set_object(shapes.Sphere(2.2 * width), shapes.MeshLambertMaterial(color=colour))
            node.set_transform(_at(spot))
    return every


def _closure_points(mechanism: Mechanism, closure: Closure) -> tuple[np.ndarray, np.ndarray]:
    """Both ends of a closure in the world, at the posture evaluated last."""
    poses = mechanism.workspace.data.oMi
    one = poses[closure.joint1].act(closure.placement1.translation)
    two = poses[closure.joint2].act(closure.placement2.translation)
    return np.array(one), np.array(two)


def _at(position: np.ndarray) -> np.ndarray:
    transform = np.eye(4)
    transform[:3, 3] = position
    return transform


def _along(begin: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Pose of a Meshcat cylinder, whose axis is y, between two points."""
    axis = (end - begin) / np.linalg.norm(end - begin)
    transform = _at(0.5 * (begin + end))
    if axis[1] < -1.0 + 1e-9:
        return transform
    turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 1.0, 0.0]), axis)
    transform[:3, :3] = turn.matrix()
    return transform


def _look_at(view: Any, points: np.ndarray, rotation: np.ndarray) -> None:
    """Turn the robot, put the middle of all points (n, 3) in the middle, and show all of them."""
    low, high = points.min(axis=0), points.max(axis=0)
    radius = 0.5 * float(np.linalg.norm(high - low)) or 1.0
    turned = _at(-0.5 * (low + high))
    turned[:3, :3] = rotation
    view["robot"].set_transform(turned)
    flat = high[2] - low[2] < 0.2 * radius
    view_from = _FROM_ABOVE if flat else _VIEW
    position = _DISTANCE * radius * view_from / np.linalg.norm(view_from)
    view["/Cameras/default/rotated/<object>"].set_property("position", position.tolist())
    for path in ("/Grid", "/Axes"):
        view[path].set_property("visible", False)
    view["/Background"].set_property("top_color", [0.97, 0.98, 1.0])
    view["/Background"].set_property("bottom_color", [0.90, 0.92, 0.95])
