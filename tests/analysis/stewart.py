"""Gough-Stewart platforms: six legs of a universal, a driven prismatic and a ball joint."""

from __future__ import annotations

import math

import numpy as np
import pinocchio as pin
from linkages import Cut, J, load

import closedchain as cc

POSE = pin.SE3(pin.rpy.rpyToMatrix(0.1, -0.2, 0.15), np.array([0.03, -0.02, 0.5]))


def hexagon(radius: float, half: float) -> list[np.ndarray]:
    """Three pairs of points on a circle, ``half`` to either side of 0, 120 and 240 degrees."""
    angles = [k * 2.0 * math.pi / 3.0 + s * half for k in range(3) for s in (-1.0, 1.0)]
    return [radius * np.array([math.cos(t), math.sin(t), 0.0]) for t in angles]


def stewart(
    base: list[np.ndarray] | None = None, platform: list[np.ndarray] | None = None
) -> cc.Mechanism:
    """Platform on six legs between points of base and platform, at ``POSE``."""
    base = hexagon(0.3, 0.2) if base is None else base
    platform = hexagon(0.2, 0.9) if platform is None else platform
    joints = [J("pose", "base", "platform", type="floating")]
    cuts, inputs = [], {}
    home: dict[str, object] = {"pose": " ".join(f"{x!r}" for x in pin.SE3ToXYZQUAT(POSE).tolist())}
    for i, (a, b) in enumerate(zip(base, platform, strict=True), 1):
        leg = POSE.act(b) - a
        size = float(np.linalg.norm(leg))
        x, y, z = leg / size
        joints += [
            J(f"u{i}", "base", f"cross{i}", _text(a), axis="1 0 0"),
            J(f"w{i}", f"cross{i}", f"lower{i}", axis="0 1 0"),
            J(f"p{i}", f"lower{i}", f"upper{i}", type="prismatic"),
        ]
        cuts.append(Cut(f"s{i}", f"upper{i}", "platform", "0 0 0", _text(b), type="spherical"))
        home |= {f"u{i}": math.atan2(-y, z), f"w{i}": math.asin(x), f"p{i}": size}
        inputs[f"q{i}"] = f"p{i}"
    return load("stewart", joints, cuts, inputs=inputs, home=home, tip="platform")


def _text(point: np.ndarray) -> str:
    return " ".join(f"{x!r}" for x in point.tolist())
