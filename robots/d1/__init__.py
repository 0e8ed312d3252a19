"""D1: a redundant parallel manipulator of two stages, 3-RPS below 3-RPS + 3-UPS.

J. Gallardo-Alvarado, "DeLiA: A New Family of Redundant Robot Manipulators", 2010. Closed forms
only: geometry, all position solutions by elimination, and the screw matrices. Frames, numbering
and equation numbers are those of the source.
"""

from .elimination import CircleSolutions, eliminant, three_points_on_circles
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
from .screws import LENGTH_B, LENGTH_C, j1, j2, j3, planes1, planes2, scaled_screws
from .selfmotion import vertical_tool_quaternions

__all__ = [
    "LENGTH_B",
    "LENGTH_C",
    "MODE_PAIRS",
    "NORMAL",
    "RADIAL",
    "TANGENT",
    "VARIANTS",
    "Assembly",
    "CircleSolutions",
    "ForwardSolutions",
    "Geometry",
    "InverseSolutions",
    "Mode",
    "ModePair",
    "Pose",
    "SelfMotion",
    "StageSolutions",
    "eliminant",
    "forward",
    "geometry",
    "inverse",
    "j1",
    "j2",
    "j3",
    "leg_lengths",
    "planes1",
    "planes2",
    "scaled_screws",
    "stage1",
    "stage1_polynomial",
    "stage2",
    "three_points_on_circles",
    "vertical_tool_quaternions",
]
