"""Runs of D1's tasks that several tests look at: made once."""

from __future__ import annotations

from functools import cache

import closedchain as cc
from closedchain.analysis.motion.follow import (
    Comparison,
    TaskPath,
    compare,
    task_path,
)
from closedchain.robots.d1 import (
    drill_waypoints,
    hexagon_waypoints,
    rest_to_rest,
    step_waypoints,
)

AXIS_TASK = "x y z rx rz"
CORNERS = {"drill": drill_waypoints, "hexagon": hexagon_waypoints, "step": step_waypoints}


@cache
def d1_robot() -> cc.Mechanism:
    return cc.load("d1")


@cache
def d1_task(name: str, samples: int = 20) -> TaskPath:
    times, tips = rest_to_rest(CORNERS[name](), samples=samples)
    return task_path(d1_robot(), times, tips, name=name)


@cache
def d1_comparison(name: str) -> Comparison:
    return compare(d1_robot(), d1_task(name, 10), outputs=AXIS_TASK)
