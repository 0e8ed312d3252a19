"""What ``cc.postures`` is asked: inputs, a pose or joints that are held, as a problem."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from closedchain.closure.chart import joint_index, joint_names
from closedchain.closure.given import finite_number
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.position import driven, posed
from closedchain.closure.solve.problem import Problem, problem_of
from closedchain.urdf.errors import ClosureError, known_names


@dataclass(frozen=True, eq=False)
class Question:
    """What is held: a problem, its targets (prescribed,), and how to say it."""

    problem: Problem
    targets: np.ndarray
    held: str


def question_of(
    mechanism: Mechanism,
    inputs: ArrayLike | Mapping[str, float] | None,
    pose: pin.SE3 | None,
    fixed: Mapping[str, float] | None,
    outputs: str | tuple[str, ...] | None,
) -> Question:
    """Problem and targets of what is held."""
    held = [
        name for name, x in (("inputs", inputs), ("pose", pose), ("fixed", fixed)) if x is not None
    ]
    if len(held) > 1:
        raise ClosureError(f"hold one of inputs, pose and fixed, got {' and '.join(held)}")
    if inputs is not None:
        if not mechanism.inputs:
            raise ClosureError(
                f"{mechanism.name!r} has no inputs (<transmission> elements); hold joints with "
                "fixed={joint: value, ...} (--fixed JOINT=VALUE)"
            )
        values = mechanism.input_vector(inputs, "input values")
        said = ", ".join(f"{n} = {x:.6g}" for n, x in zip(mechanism.inputs, values, strict=True))
        return Question(driven(mechanism), np.array(values, dtype=float), said)
    if pose is not None:
        if not isinstance(pose, pin.SE3) or not np.isfinite(pose.homogeneous).all():
            raise ClosureError(f"pose must be a pin.SE3 of finite numbers, got {pose!r}")
        problem = posed(mechanism, outputs)
        names = " ".join(mechanism.outputs(outputs))
        return Question(problem, pin.SE3ToXYZQUAT(pose), f"the tip's {names} held")
    return _joints_held(mechanism, {str(name): value for name, value in (fixed or {}).items()})


def _joints_held(mechanism: Mechanism, values: Mapping[str, float]) -> Question:
    """Problem and targets of joints that are held, or of nothing."""
    joints = {name: _joint(mechanism, name) for name in values}
    ordered = sorted(joints, key=lambda name: joints[name])
    for one, other in pairwise(ordered):
        if joints[one] == joints[other]:
            raise ClosureError(f"{one} and {other} are the same joint")
    numbers = [
        finite_number(
            values[name],
            f"the value of {name!r}",
            "m" if mechanism.translational[joints[name]] else "rad",
        )
        for name in ordered
    ]
    problem = problem_of(mechanism, [joints[name] for name in ordered])
    told = zip(ordered, numbers, strict=True)
    said = ", ".join(f"{name} = {x:.6g}" for name, x in told) or "nothing held"
    return Question(problem, np.array(numbers), said)


def _joint(mechanism: Mechanism, name: str) -> int:
    """Tangent coordinate of a joint that can be held."""
    try:
        return joint_index(mechanism, name)[1]
    except KeyError:
        known = tuple(joint_names(mechanism))
        raise ClosureError(known_names(name, "joint with one freedom", known)) from None
