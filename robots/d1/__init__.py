"""D1: a redundant parallel manipulator of two stages, 3-RPS below 3-RPS + 3-UPS.

J. Gallardo-Alvarado, "DeLiA: A New Family of Redundant Robot Manipulators", 2010. Closed forms
only: geometry, all position solutions by elimination, screws and rates, the tasks of section 6.
Frames, numbering and equation numbers are those of the source.
"""

from closedchain.robots.elimination import CircleSolutions, eliminant, three_points_on_circles

from .geometry import NORMAL, RADIAL, TANGENT, VARIANTS, Geometry, Pose, geometry
from .position import (
    MODE_PAIRS,
    Assembly,
    ForwardSolutions,
    InverseSolutions,
    Mode,
    ModePair,
    SelfMotion,
    StageSolutions,
    forward,
    inverse,
    leg_lengths,
    stage1,
    stage1_polynomial,
    stage2,
)
from .rates import Motion, limb_rates, limb_screws, motion
from .screws import LENGTH_B, LENGTH_C, j1, j2, j3, planes1, planes2, scaled_screws
from .selfmotion import vertical_tool_quaternions
from .tasks import (
    Assemblies,
    InputMotion,
    drill_waypoints,
    follow_inputs,
    hexagon_waypoints,
    periodic,
    rest_to_rest,
    step_waypoints,
    vertical_tool,
)

__all__ = [
    "LENGTH_B",
    "LENGTH_C",
    "MODE_PAIRS",
    "NORMAL",
    "RADIAL",
    "TANGENT",
    "VARIANTS",
    "Assemblies",
    "Assembly",
    "CircleSolutions",
    "ForwardSolutions",
    "Geometry",
    "InputMotion",
    "InverseSolutions",
    "Mode",
    "ModePair",
    "Motion",
    "Pose",
    "SelfMotion",
    "StageSolutions",
    "drill_waypoints",
    "eliminant",
    "follow_inputs",
    "forward",
    "geometry",
    "hexagon_waypoints",
    "inverse",
    "j1",
    "j2",
    "j3",
    "leg_lengths",
    "limb_rates",
    "limb_screws",
    "motion",
    "periodic",
    "planes1",
    "planes2",
    "rest_to_rest",
    "scaled_screws",
    "stage1",
    "stage1_polynomial",
    "stage2",
    "step_waypoints",
    "three_points_on_circles",
    "vertical_tool",
    "vertical_tool_quaternions",
]
