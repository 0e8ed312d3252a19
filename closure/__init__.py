"""Mechanisms with loops: model, closure rows and their derivatives; solvers stand beside."""

if __name__ != "closedchain.closure":
    raise ImportError("import closedchain.closure, not closure: two copies of a class never match")

from closedchain.closure.closures import Closure, Coupling
from closedchain.closure.constraints import constraint_drift, constraint_jacobian, residual
from closedchain.closure.loading import load_urdf, mechanism_from_description
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.nearest import close
from closedchain.closure.ranks import Rank, numerical_rank
from closedchain.closure.solution import Solution, Solutions
from closedchain.closure.task_frame import TaskFrame

__all__ = [
    "Closure",
    "Coupling",
    "Mechanism",
    "Rank",
    "Solution",
    "Solutions",
    "TaskFrame",
    "close",
    "constraint_drift",
    "constraint_jacobian",
    "load_urdf",
    "mechanism_from_description",
    "numerical_rank",
    "residual",
]
