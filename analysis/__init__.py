"""What is asked of a mechanism: mobility, velocity, singularities, redundancy, maps."""

if __name__ != "closedchain.analysis":
    raise ImportError(
        "import closedchain.analysis, not analysis: two copies of a class never match"
    )

from closedchain.analysis._stops import Stop
from closedchain.analysis.acceleration import Acceleration, acceleration
from closedchain.analysis.accelerators import Accelerators, accelerators
from closedchain.analysis.curves import SingularitySet, singularity_set
from closedchain.analysis.dependence import Dependence, dependence
from closedchain.analysis.hessian import Hessian, hessian
from closedchain.analysis.legs import LegVelocity, leg_velocity
from closedchain.analysis.loops import LoopGraph, loops
from closedchain.analysis.maps import singularity_map
from closedchain.analysis.mobility import Mobility, mobility
from closedchain.analysis.network import Network, network
from closedchain.analysis.open_chains import Structure
from closedchain.analysis.poc import Poc, poc
from closedchain.analysis.redundancy import Redundancy, redundancy
from closedchain.analysis.singularities import Classification, classify
from closedchain.analysis.structure import structure
from closedchain.analysis.track import Track, track
from closedchain.analysis.velocity import Velocity, velocity

__all__ = [
    "Acceleration",
    "Accelerators",
    "Classification",
    "Dependence",
    "Hessian",
    "LegVelocity",
    "LoopGraph",
    "Mobility",
    "Network",
    "Poc",
    "Redundancy",
    "SingularitySet",
    "Stop",
    "Structure",
    "Track",
    "Velocity",
    "acceleration",
    "accelerators",
    "classify",
    "dependence",
    "hessian",
    "leg_velocity",
    "loops",
    "mobility",
    "network",
    "poc",
    "redundancy",
    "singularity_map",
    "singularity_set",
    "structure",
    "track",
    "velocity",
]
