"""Kinematics and singularities of closed-chain (parallel) manipulators, on Pinocchio."""

from closedchain.analysis import (
    Acceleration,
    Classification,
    Mobility,
    Redundancy,
    SingularitySet,
    Velocity,
    acceleration,
    classify,
    mobility,
    redundancy,
    singularity_map,
    singularity_set,
    velocity,
)
from closedchain.closure import (
    Closure,
    Mechanism,
    Solution,
    close,
    constraint_drift,
    constraint_jacobian,
    direct,
    inverse,
    load_urdf,
    residual,
)
from closedchain.robots import load, robots
from closedchain.urdf.errors import ClosedChainError, ClosureError, DescriptionError

__version__ = "0.1.0"

__all__ = [
    "Acceleration",
    "Classification",
    "ClosedChainError",
    "Closure",
    "ClosureError",
    "DescriptionError",
    "Mechanism",
    "Mobility",
    "Redundancy",
    "SingularitySet",
    "Solution",
    "Velocity",
    "acceleration",
    "classify",
    "close",
    "constraint_drift",
    "constraint_jacobian",
    "direct",
    "inverse",
    "load",
    "load_urdf",
    "mobility",
    "redundancy",
    "residual",
    "robots",
    "singularity_map",
    "singularity_set",
    "velocity",
]
