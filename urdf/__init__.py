"""Closed-chain URDF and xacro: reading it, checking it, writing its constraints."""

if __name__ != "closedchain.urdf":
    raise ImportError("import closedchain.urdf, not urdf: this folder is a part of closedchain")

from closedchain.urdf.constraint_element import constraint_xml, read_constraint
from closedchain.urdf.description import (
    CLOSURE_TYPES,
    JOINT_TYPES,
    OUTPUTS,
    RELATION_TYPES,
    ClosureType,
    Coupling,
    Description,
    Inertial,
    Input,
    Joint,
    JointRelation,
    JointType,
    Link,
    LoopClosure,
    Origin,
    ParameterValue,
    RelationType,
    Remark,
    Task,
    Vector3,
)
from closedchain.urdf.errors import (
    ClosedChainError,
    ClosureError,
    DescriptionError,
    known_names,
)
from closedchain.urdf.expansion import Expansion, expand
from closedchain.urdf.reader import load_description, read

__all__ = [
    "CLOSURE_TYPES",
    "JOINT_TYPES",
    "OUTPUTS",
    "RELATION_TYPES",
    "ClosedChainError",
    "ClosureError",
    "ClosureType",
    "Coupling",
    "Description",
    "DescriptionError",
    "Expansion",
    "Inertial",
    "Input",
    "Joint",
    "JointRelation",
    "JointType",
    "Link",
    "LoopClosure",
    "Origin",
    "ParameterValue",
    "RelationType",
    "Remark",
    "Task",
    "Vector3",
    "constraint_xml",
    "expand",
    "known_names",
    "load_description",
    "read",
    "read_constraint",
]
