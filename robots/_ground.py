"""A grid under the robot, with squares of a round size: where the ground is, and the scale."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

_CELLS = 12  # across the robot, at most
_COLOUR = 0x9AA3AD


def draw_ground(node: Any, points: np.ndarray, upright: np.ndarray) -> float:
    """Draw it under points (n, 3) [m]; ``upright`` (3, 3) turns their axis that is up to z.

    Returns the side of its squares [m], 1, 2 or 5 times a power of 10.
    """
    import meshcat.geometry as shapes

    turned = points @ upright.T
    low, high = turned.min(axis=0), turned.max(axis=0)
    size = float(np.linalg.norm(high - low)) or 1.0
    cell = _round_length(max(float((high - low)[:2].max()), 0.5 * size) / _CELLS)
    begin, end = np.floor(low[:2] / cell - 1.0), np.ceil(high[:2] / cell + 1.0)
    lines = [((x, begin[1]), (x, end[1])) for x in np.arange(begin[0], end[0] + 0.5)]
    lines += [((begin[0], y), (end[0], y)) for y in np.arange(begin[1], end[1] + 0.5)]
    flat = np.array(lines).reshape(-1, 2) * cell
    level = np.full(len(flat), low[2] - 0.01 * size)
    corners = np.column_stack([flat, level]) @ upright
    geometry = shapes.PointsGeometry(corners.astype(np.float32).T)
    node.set_object(shapes.LineSegments(geometry, shapes.LineBasicMaterial(color=_COLOUR)))
    return cell


def _round_length(length: float) -> float:
    power = 10.0 ** math.floor(math.log10(length))
    return next(k * power for k in (1.0, 2.0, 5.0, 10.0) if k * power >= length)
