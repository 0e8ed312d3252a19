"""What is asked of a mechanism: mobility, velocity, singularities, redundancy, maps."""

if __name__ != "closedchain.analysis":
    raise ImportError(
        "import closedchain.analysis, not analysis: two copies of a class never match"
    )

from closedchain.analysis.acceleration import Acceleration, acceleration
from closedchain.analysis.curves import SingularitySet, singularity_set
from closedchain.analysis.maps import singularity_map
from closedchain.analysis.mobility import Mobility, mobility
from closedchain.analysis.redundancy import Redundancy, redundancy
from closedchain.analysis.singularities import Classification, classify
from closedchain.analysis.velocity import Velocity, velocity

__all__ = [
    "Acceleration",
    "Classification",
    "Mobility",
    "Redundancy",
    "SingularitySet",
    "Velocity",
    "acceleration",
    "classify",
    "mobility",
    "redundancy",
    "singularity_map",
    "singularity_set",
    "velocity",
]
