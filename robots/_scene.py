"""A scene as Meshcat commands: the mechanism, what is drawn with it, camera and background."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from closedchain.closure import Mechanism
from closedchain.robots._body import Bodies, at, draw_bodies
from closedchain.robots._ground import draw_ground
from closedchain.robots._overlays import Overlay, draw_overlay, extent_of
from closedchain.robots._recorder import TO_Z, Recorder, Up, opened

# from the scene to the camera, in Meshcat's axes of the camera: y is up and -z is world y
_VIEW = np.array([0.55, 0.22, 0.80])
_FROM_ABOVE = np.array([0.20, 0.90, 0.45])  # for a mechanism that lies in a plane
# half width and half height of what may be filled of the picture at distance 1: Meshcat's view is
# 75 degrees high; a page of 6:5 and wider shows all, with a margin
_REACH = 0.85 * np.tan(np.radians(37.5)) * np.array([1.2, 1.0])
_LIT = (0.1, 30.0)  # [m] radii of scenes that Meshcat's lights and clipping planes suit


@dataclass(frozen=True, eq=False)
class Scene:
    """A recorded drawing."""

    bodies: Bodies
    view: Any
    root: str  # Meshcat's path of the node whose coordinates are the world's
    up: Up
    cell: float  # [m] side of the squares of the ground


def draw(
    recorder: Recorder,
    mechanism: Mechanism,
    postures: np.ndarray,
    up: Up,
    overlays: Sequence[Overlay] = (),
) -> Scene:
    """Record the drawing of the first of the postures (n, nq), framed so that all are in view."""
    view = opened(recorder)
    robot = view["robot"]
    bodies = draw_bodies(robot, mechanism, postures)
    for i, overlay in enumerate(overlays):
        draw_overlay(robot["overlays"][str(i)], overlay, bodies.size)
    points = np.vstack([bodies.extent, *(extent_of(overlay) for overlay in overlays)])
    _look_at(view, points @ TO_Z[up].T, TO_Z[up])
    cell = draw_ground(robot["ground"], points, TO_Z[up])
    return Scene(bodies, robot, robot.path.lower(), up, cell)


def _look_at(view: Any, points: np.ndarray, rotation: np.ndarray) -> None:
    """Turn the robot upright (points (n, 3) are so already) and set the camera to show them all."""
    low, high = points.min(axis=0), points.max(axis=0)
    radius = 0.5 * float(np.linalg.norm(high - low)) or 1.0
    scale = 1.0 if _LIT[0] < radius < _LIT[1] else 1.0 / radius
    view_from = _FROM_ABOVE if high[2] - low[2] < 0.2 * radius else _VIEW
    view_from = view_from / np.linalg.norm(view_from)
    back = np.array([view_from[0], -view_from[2], view_from[1]])  # in the axes of the points
    right = np.cross([0.0, 0.0, 1.0], back) / np.linalg.norm(np.cross([0.0, 0.0, 1.0], back))
    axes = np.array([right, np.cross(back, right), back])
    seen = points @ axes.T
    middle = 0.5 * (seen.min(axis=0) + seen.max(axis=0))
    across = np.abs(seen - middle)
    # nearest the camera may come with every point within the picture
    distance = float((across[:, :2] / _REACH + (seen - middle)[:, 2:]).max())
    distance = max(distance, 0.5 * radius)
    turned = at(-scale * middle @ axes)
    turned[:3, :3] = scale * rotation
    view["robot"].set_transform(turned)
    position = (distance * scale * view_from).tolist()
    view["/Cameras/default/rotated/<object>"].set_property("position", position)
    for path in ("/Grid", "/Axes"):
        view[path].set_property("visible", False)
    view["/Background"].set_property("top_color", [0.97, 0.98, 1.0])
    view["/Background"].set_property("bottom_color", [0.90, 0.92, 0.95])
