"""Reconfigurable 2(3-RUS): two 3-RUS stages on one platform, one of them reconfigurable.

R. E. Sanchez-Alonso, "An application of screw theory for the identification of singularities in a
novel reconfigurable parallel robot", Nexo 29(2), 2016. Closed forms only: geometry, the 64 working
modes of the inverse problem, the screws of the velocity equation (5), and postures with chosen
singular legs. Frames, numbering and equation numbers are those of the source.
"""

from .geometry import UP, Geometry, Pose, geometry, rotation_ypr
from .position import MODES, OUTWARD, Legs, gaps, inverse, mode_of, posture, wrapped
from .screws import (
    LegScrews,
    det_jx,
    input_rates,
    j_beta,
    j_inputs,
    j_q,
    j_x,
    klein,
    leg_screws,
    platform_rates,
    screw,
    stage_sigma,
    state_at_origin,
)
from .singular import (
    idle_beta_tip,
    pencil_margin,
    pose_with_tip,
    roots,
    stretched_heights,
    stretched_tip,
)

__all__ = [
    "MODES",
    "OUTWARD",
    "UP",
    "Geometry",
    "LegScrews",
    "Legs",
    "Pose",
    "det_jx",
    "gaps",
    "geometry",
    "idle_beta_tip",
    "input_rates",
    "inverse",
    "j_beta",
    "j_inputs",
    "j_q",
    "j_x",
    "klein",
    "leg_screws",
    "mode_of",
    "pencil_margin",
    "platform_rates",
    "pose_with_tip",
    "posture",
    "roots",
    "rotation_ypr",
    "screw",
    "stage_sigma",
    "state_at_origin",
    "stretched_heights",
    "stretched_tip",
    "wrapped",
]
