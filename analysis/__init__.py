"""What is asked of a mechanism: mobility, velocity, singularities, redundancy, maps."""

if __name__ != "closedchain.analysis":
    raise ImportError(
        "import closedchain.analysis, not analysis: two copies of a class never match"
    )

from closedchain.analysis.acceleration import Acceleration, acceleration
from closedchain.analysis.curves import SingularitySet, singularity_set
from closedchain.analysis.dependence import Dependence, dependence
from closedchain.analysis.loops import LoopGraph, loops
from closedchain.analysis.maps import singularity_map
from closedchain.analysis.mobility import Mobility, mobility
from closedchain.analysis.open_chains import Structure
from closedchain.analysis.poc import Poc, poc
from closedchain.analysis.redundancy import Redundancy, redundancy
from closedchain.analysis.singularities import Classification, classify
from closedchain.analysis.structure import structure
from closedchain.analysis.velocity import Velocity, velocity

__all__ = [
    "Acceleration",
    "Classification",
    "Dependence",
    "LoopGraph",
    "Mobility",
    "Poc",
    "Redundancy",
    "SingularitySet",
    "Structure",
    "Velocity",
    "acceleration",
    "classify",
    "dependence",
    "loops",
    "mobility",
    "poc",
    "redundancy",
    "singularity_map",
    "singularity_set",
    "structure",
    "velocity",
]
