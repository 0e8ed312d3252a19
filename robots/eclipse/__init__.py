"""Eclipse and Eclipse-II: three PPRS legs on a circular guide.

H. Simas, A. Dias, D. Martins, "Kinematic model for Eclipse and Eclipse-II parallel robot". Closed
forms only: all solutions of both position problems, the velocity equation with its singular sets,
the paper's screws and determinants, its trajectory and its integration method.
"""

from . import davies, trajectory
from .geometry import ECLIPSE, ECLIPSE2, PHASES, Geometry, plate_points
from .position import (
    Assembly,
    DirectSolutions,
    InverseSolutions,
    Mode,
    carriages,
    direct,
    inverse,
    joints_S,
    plate_pose,
    working_modes,
)
from .screws import (
    determinant_arc,
    determinant_column,
    determinant_virtual,
    leg_pose,
    leg_screws,
    link_frames,
    network,
    virtual_screws,
    wrist_angles,
)
from .singularities import (
    actuator_jacobian,
    direct_determinant,
    first_direct_tilt,
    four_planes,
    platform_jacobian,
    reciprocal_lines,
    tilted,
)

__all__ = [
    "ECLIPSE",
    "ECLIPSE2",
    "PHASES",
    "Assembly",
    "DirectSolutions",
    "Geometry",
    "InverseSolutions",
    "Mode",
    "actuator_jacobian",
    "carriages",
    "davies",
    "determinant_arc",
    "determinant_column",
    "determinant_virtual",
    "direct",
    "direct_determinant",
    "first_direct_tilt",
    "four_planes",
    "inverse",
    "joints_S",
    "leg_pose",
    "leg_screws",
    "link_frames",
    "network",
    "plate_points",
    "plate_pose",
    "platform_jacobian",
    "reciprocal_lines",
    "tilted",
    "trajectory",
    "virtual_screws",
    "working_modes",
    "wrist_angles",
]
