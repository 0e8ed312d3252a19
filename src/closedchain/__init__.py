"""Kinematics and singularities of closed-chain (parallel) manipulators, on Pinocchio."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from closedchain.closure import (
    Closure,
    Mechanism,
    Solution,
    Solutions,
    close,
    constraint_drift,
    constraint_jacobian,
    load_urdf,
    residual,
)
from closedchain.closure.files import load_file
from closedchain.closure.showing import register as _register
from closedchain.robots import load, robots
from closedchain.urdf.errors import ClosedChainError, ClosureError, DescriptionError

if TYPE_CHECKING:
    from closedchain._notebook import show
    from closedchain.analysis.acceleration import Acceleration, acceleration
    from closedchain.analysis.forces.capabilities import (
        Capabilities,
        capabilities,
        compliance,
        stiffness,
        twist_maps,
    )
    from closedchain.analysis.forces.effort_history import EffortHistory, efforts_along
    from closedchain.analysis.forces.forward_dynamics import ForwardDynamics, forward_dynamics
    from closedchain.analysis.forces.input_dynamics import (
        InputDynamics,
        input_dynamics,
        mass_matrix,
    )
    from closedchain.analysis.forces.input_efforts import input_efforts
    from closedchain.analysis.forces.inverse_dynamics import InverseDynamics, inverse_dynamics
    from closedchain.analysis.forces.motor_map import Transmission
    from closedchain.analysis.forces.resets import Resets, resets
    from closedchain.analysis.forces.simulate import Simulation, simulate
    from closedchain.analysis.forces.statics import Statics, statics
    from closedchain.analysis.forces.tip_measures import (
        effort_per_force,
        effort_per_moment,
        isotropy,
        largest_compliance,
        least_force,
        least_speed,
        least_stiffness,
        output_transmission,
    )
    from closedchain.analysis.forces.transmission import transmission
    from closedchain.analysis.forces.transmission_table import transmission_table
    from closedchain.analysis.motion.follow import (
        Comparison,
        ComparisonRow,
        Follow,
        compare,
        follow,
    )
    from closedchain.analysis.motion.follow.task_path import TaskPath, read_task_path, task_path
    from closedchain.analysis.motion.joint_positions import JointPositions, joint_positions
    from closedchain.analysis.motion.self_motion.motion import SelfMotion, self_motion
    from closedchain.analysis.motion.track.stops import Stop
    from closedchain.analysis.motion.track.tracking import Track, track
    from closedchain.analysis.redundancy import Redundancy, Split, redundancy
    from closedchain.analysis.screws.accelerators import Accelerators, accelerators
    from closedchain.analysis.screws.hessian import Hessian, hessian
    from closedchain.analysis.screws.legs import LegVelocity, leg_velocity
    from closedchain.analysis.screws.network import Network, network
    from closedchain.analysis.singularity.classify import Classification, classify
    from closedchain.analysis.singularity.maps.mapping import singularity_map
    from closedchain.analysis.singularity.sets.finding import singularity_set
    from closedchain.analysis.singularity.sets.singular_set import SingularitySet
    from closedchain.analysis.structure.dependence import Dependence, dependence
    from closedchain.analysis.structure.loops import LoopGraph, loops
    from closedchain.analysis.structure.mobility import Mobility, mobility
    from closedchain.analysis.structure.open_chains import Structure
    from closedchain.analysis.structure.poc import Poc, poc
    from closedchain.analysis.structure.relaxation import Relaxation, relaxation
    from closedchain.analysis.structure.topology import structure
    from closedchain.analysis.symbolic import SymbolicSingularities, symbolic_singularities
    from closedchain.analysis.velocity import Velocity, velocity
    from closedchain.closure.code.exporting import export_code
    from closedchain.closure.exporting import export
    from closedchain.closure.modes.all_postures import postures
    from closedchain.closure.modes.connections.connected import Connections
    from closedchain.closure.modes.connections.meetings import Meeting
    from closedchain.closure.modes.connections.passages import Passage
    from closedchain.closure.modes.positions import direct, inverse
    from closedchain.closure.modes.result import Postures
    from closedchain.closure.solids import with_inertias

__version__ = "0.1.0"

# What is asked of a mechanism is imported when it is first asked, so that loading stays quick.
_LATER = {
    "_notebook": "show",
    "closure.exporting": "export",
    "closure.code.exporting": "export_code",
    "closure.modes.positions": "direct inverse",
    "closure.solids": "with_inertias",
    "closure.modes.all_postures": "postures",
    "closure.modes.connections.connected": "Connections",
    "closure.modes.connections.meetings": "Meeting",
    "closure.modes.connections.passages": "Passage",
    "closure.modes.result": "Postures",
    "analysis.motion.track.stops": "Stop",
    "analysis.acceleration": "Acceleration acceleration",
    "analysis.forces.input_dynamics": "InputDynamics input_dynamics mass_matrix",
    "analysis.forces.input_efforts": "input_efforts",
    "analysis.forces.inverse_dynamics": "InverseDynamics inverse_dynamics",
    "analysis.forces.motor_map": "Transmission",
    "analysis.forces.transmission": "transmission",
    "analysis.forces.transmission_table": "transmission_table",
    "analysis.forces.resets": "Resets resets",
    "analysis.forces.capabilities": "Capabilities capabilities compliance stiffness twist_maps",
    "analysis.forces.tip_measures": "effort_per_force effort_per_moment isotropy "
    "largest_compliance least_force least_speed least_stiffness output_transmission",
    "analysis.forces.effort_history": "EffortHistory efforts_along",
    "analysis.forces.forward_dynamics": "ForwardDynamics forward_dynamics",
    "analysis.forces.simulate": "Simulation simulate",
    "analysis.forces.statics": "Statics statics",
    "analysis.screws.accelerators": "Accelerators accelerators",
    "analysis.structure.dependence": "Dependence dependence",
    "analysis.motion.follow": "Comparison ComparisonRow Follow compare follow",
    "analysis.motion.follow.task_path": "TaskPath read_task_path task_path",
    "analysis.motion.joint_positions": "JointPositions joint_positions",
    "analysis.screws.hessian": "Hessian hessian",
    "analysis.screws.legs": "LegVelocity leg_velocity",
    "analysis.structure.loops": "LoopGraph loops",
    "analysis.singularity.maps.mapping": "singularity_map",
    "analysis.structure.mobility": "Mobility mobility",
    "analysis.screws.network": "Network network",
    "analysis.structure.open_chains": "Structure",
    "analysis.structure.poc": "Poc poc",
    "analysis.redundancy": "Redundancy Split redundancy",
    "analysis.motion.self_motion.motion": "SelfMotion self_motion",
    "analysis.singularity.sets.finding": "singularity_set",
    "analysis.singularity.sets.singular_set": "SingularitySet",
    "analysis.singularity.classify": "Classification classify",
    "analysis.structure.relaxation": "Relaxation relaxation",
    "analysis.structure.topology": "structure",
    "analysis.symbolic": "SymbolicSingularities symbolic_singularities",
    "analysis.motion.track.tracking": "Track track",
    "analysis.velocity": "Velocity velocity",
}
_MODULES = {name: module for module, names in _LATER.items() for name in names.split()}


def _show(mechanism: Mechanism, q: Any = None, **options: Any) -> Any:
    """What ``Mechanism.show`` does: drawing is imported when it is first asked for."""
    from closedchain.robots.embedding import show

    return show(mechanism, q, **options)


_register(_show)


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    found = getattr(import_module(f"closedchain.{_MODULES[name]}"), name)
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return sorted({*globals(), *_MODULES})


__all__ = [
    "Acceleration",
    "Accelerators",
    "Capabilities",
    "Classification",
    "ClosedChainError",
    "Closure",
    "ClosureError",
    "Comparison",
    "ComparisonRow",
    "Connections",
    "Dependence",
    "DescriptionError",
    "EffortHistory",
    "Follow",
    "ForwardDynamics",
    "Hessian",
    "InputDynamics",
    "InverseDynamics",
    "JointPositions",
    "LegVelocity",
    "LoopGraph",
    "Mechanism",
    "Meeting",
    "Mobility",
    "Network",
    "Passage",
    "Poc",
    "Postures",
    "Redundancy",
    "Relaxation",
    "Resets",
    "SelfMotion",
    "Simulation",
    "SingularitySet",
    "Solution",
    "Solutions",
    "Split",
    "Statics",
    "Stop",
    "Structure",
    "SymbolicSingularities",
    "TaskPath",
    "Track",
    "Transmission",
    "Velocity",
    "acceleration",
    "accelerators",
    "capabilities",
    "classify",
    "close",
    "compare",
    "compliance",
    "constraint_drift",
    "constraint_jacobian",
    "dependence",
    "direct",
    "effort_per_force",
    "effort_per_moment",
    "efforts_along",
    "export",
    "export_code",
    "follow",
    "forward_dynamics",
    "hessian",
    "input_dynamics",
    "input_efforts",
    "inverse",
    "inverse_dynamics",
    "isotropy",
    "joint_positions",
    "largest_compliance",
    "least_force",
    "least_speed",
    "least_stiffness",
    "leg_velocity",
    "load",
    "load_file",
    "load_urdf",
    "loops",
    "mass_matrix",
    "mobility",
    "network",
    "output_transmission",
    "poc",
    "postures",
    "read_task_path",
    "redundancy",
    "relaxation",
    "resets",
    "residual",
    "robots",
    "self_motion",
    "show",
    "simulate",
    "singularity_map",
    "singularity_set",
    "statics",
    "stiffness",
    "structure",
    "symbolic_singularities",
    "task_path",
    "track",
    "transmission",
    "transmission_table",
    "twist_maps",
    "velocity",
    "with_inertias",
]
