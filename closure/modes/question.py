"""What ``cc.postures`` is asked: inputs, a pose or joints that are held, as a problem."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from closedchain.closure.chart import joint_index, joint_names
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
        if not isinstance(pose, pin.SE3):
            raise ClosureError(f"pose must be a pin.SE3, got {pose!r}")
        problem = posed(mechanism, outputs)
        names = " ".join(mechanism.outputs(outputs))
        return Question(problem, pin.SE3ToXYZQUAT(pose), f"the tip's {names} held")
    values_of = dict(fixed or {})
    joints = {str(name): _joint(mechanism, str(name)) for name in values_of}
    for name, value in values_of.items():
        if not np.isfinite(float(value)):
            raise ClosureError(f"the value of {name!r} must be a finite number, got {value!r}")
    ordered = sorted(joints, key=lambda name: joints[name][1])
    problem = problem_of(mechanism, [joints[name][1] for name in ordered])
    said = ", ".join(f"{n} = {values_of[n]:.6g}" for n in ordered) or "nothing held"
    return Question(problem, np.array([float(values_of[n]) for n in ordered]), said)


def _joint(mechanism: Mechanism, name: str) -> tuple[int, int]:
    """Index in q and v of a joint that can be held."""
    try:
        return joint_index(mechanism, name)
    except KeyError:
        known = tuple(joint_names(mechanism))
        raise ClosureError(known_names(name, "joint with one freedom", known)) from None
