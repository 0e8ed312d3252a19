"""RPa(3R)2R+RPa: a translational parallel mechanism with two parallelograms.

H. Shen, C. Wu, D. Chablat, G. Wu, T.-L. Yang, "Topological design of an asymmetric 3-translational
parallel mechanism with zero coupling degree and motion decoupling", DETC2018-85709, 2018. Closed
forms only; symbols and equation numbers are those of the source, corrected where it errs.
"""

from .geometry import HOME, Geometry, geometry, points, residuals, tip
from .jacobians import (
    Factors,
    det_parallel,
    det_serial,
    factors,
    output_jacobian,
    parallel_jacobian,
    serial_jacobian,
    twist_map,
)
from .joints import joint_values
from .position import (
    ASSEMBLY_MODES,
    WORKING_MODES,
    DirectSolutions,
    InverseSolutions,
    arm_angles,
    direct,
    inverse,
)
from .singularities import (
    inverse_surfaces,
    kappa_surface,
    output_surface,
    parallel_rods,
    self_motion,
)

__all__ = [
    "ASSEMBLY_MODES",
    "HOME",
    "WORKING_MODES",
    "DirectSolutions",
    "Factors",
    "Geometry",
    "InverseSolutions",
    "arm_angles",
    "det_parallel",
    "det_serial",
    "direct",
    "factors",
    "geometry",
    "inverse",
    "inverse_surfaces",
    "joint_values",
    "kappa_surface",
    "output_jacobian",
    "output_surface",
    "parallel_jacobian",
    "parallel_rods",
    "points",
    "residuals",
    "self_motion",
    "serial_jacobian",
    "tip",
    "twist_map",
]
