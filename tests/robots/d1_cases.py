"""D1's reference states for its closed forms. No tests here."""

from __future__ import annotations

from typing import Any

import numpy as np

from closedchain.robots.d1.geometry import (
    Geometry,
    Pose,
    geometry,
    rotation_from_quaternion,
)
from closedchain.robots.d1.position import (
    Assembly,
    leg_lengths,
)

G = geometry()
SEED = 20100301


def pose(quaternion: Any, position: Any) -> Pose:
    return Pose(rotation_from_quaternion(np.array(quaternion)), np.array(position))


def state(entry: dict[str, Any]) -> tuple[Pose, Pose]:
    return pose(entry["quatB"], entry["pB"]), pose(entry["quatC"], entry["pC"])


def residuals(assembly: Assembly, g: Geometry = G) -> np.ndarray:
    """Left minus right sides of eqs (2), (3), (4), (7) as printed (m^2)."""
    s, s4 = assembly.coupler.points(g.s_B), assembly.platform.points(g.c_C)
    r, r4 = g.R, assembly.coupler.points(g.r_B)
    q = assembly.q
    rows = []
    for points, feet, ends, lengths, sides in (
        (s, r, r, q[:3], g.sides_S),
        (s4, r4, g.U, q[3:], g.sides_S4),
    ):
        for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
            rows.append((points[i] - feet[i]) @ (feet[j] - feet[k]))
            rows.append((points[i] - ends[i]) @ (points[i] - ends[i]) - lengths[i] ** 2)
            rows.append((points[i] - points[j]) @ (points[i] - points[j]) - sides[i] ** 2)
    return np.array(rows)


HOME_Q = leg_lengths(G.home_coupler, G.home_platform, G)
