"""The linear Delta 3-PRPaR: three vertical sliders move a platform that only translates.

K. Z. Zenebe, "Formulation of a Generalized Jacobian and Inverse Acceleration Analysis of a Linear
Delta Manipulator Based on Reciprocal Screws Method", IJERT 2(2), 2013. Closed forms only: position
problems, screws and generalised Jacobian, Hessian, singularities and the numerical example. Symbols
and equation numbers are those of the source.
"""

from .acceleration import (
    bracket,
    hessian,
    inverse_acceleration,
    layers,
    limb_hessians,
    slider_accelerations,
)
from .geometry import AXIS, PHI, RADIAL, TANGENT, Geometry
from .position import (
    MODES,
    DirectSolutions,
    direct,
    inverse,
    leg_angles,
    margins,
    rods,
    sliders,
)
from .screws import (
    Jacobian,
    Limbs,
    generalized_jacobian,
    limb_rates,
    limbs,
    parallelogram,
    pins,
    slider_rates,
)
from .singularities import (
    collapse_factors,
    direct_factor,
    free_direction,
    horizontal_rod,
    inverse_factors,
    opposed_rods,
)
from .trajectory import PRINTED, V1, V2, History, Trajectory, history

__all__ = [
    "AXIS",
    "MODES",
    "PHI",
    "PRINTED",
    "RADIAL",
    "TANGENT",
    "V1",
    "V2",
    "DirectSolutions",
    "Geometry",
    "History",
    "Jacobian",
    "Limbs",
    "Trajectory",
    "bracket",
    "collapse_factors",
    "direct",
    "direct_factor",
    "free_direction",
    "generalized_jacobian",
    "hessian",
    "history",
    "horizontal_rod",
    "inverse",
    "inverse_acceleration",
    "inverse_factors",
    "layers",
    "leg_angles",
    "limb_hessians",
    "limb_rates",
    "limbs",
    "margins",
    "opposed_rods",
    "parallelogram",
    "pins",
    "rods",
    "slider_accelerations",
    "slider_rates",
    "sliders",
]
