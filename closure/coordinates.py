"""Coordinates of a spanning tree: those that inputs drive, lengths and angles, and limits."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from closedchain.closure.joint_kinds import TREE_KINDS
from closedchain.urdf.description import Description
from closedchain.urdf.errors import ClosureError


def joints_of_inputs(
    model: pin.Model, description: Description, inputs: Sequence[str]
) -> tuple[int, ...]:
    """Pinocchio joint id of each input."""
    by_name = {spec.name: spec.joint for spec in description.inputs}
    return tuple(model.getJointId(by_name[name]) for name in inputs)


def units_of_inputs(description: Description, inputs: Sequence[str]) -> tuple[str, ...]:
    """Unit of each input, "m" or "rad"."""
    kinds = {joint.name: joint.type for joint in description.joints}
    driven = {spec.name: kinds[spec.joint] for spec in description.inputs}
    return tuple("m" if driven[name] == "prismatic" else "rad" for name in inputs)


def translations_of(model: pin.Model, description: Description) -> np.ndarray:
    """Which tangent coordinates are translations [m], (nv,) of bool; the others are angles."""
    slides = np.zeros(model.nv, dtype=bool)
    types = {joint.name: joint.type for joint in description.joints}
    for name, joint in list(zip(model.names, model.joints, strict=True))[1:]:
        lengths = [screw.is_length for screw in TREE_KINDS[types[name]].screws]
        slides[joint.idx_v : joint.idx_v + joint.nv] = lengths
    return slides


def limits_of(model: pin.Model) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper limits of configurations, (nq,) each; infinite for floating joints."""
    lower, upper = np.full(model.nq, -np.inf), np.full(model.nq, np.inf)
    for joint in list(model.joints)[1:]:
        if joint.nq == 1:
            lower[joint.idx_q] = model.lowerPositionLimit[joint.idx_q]
            upper[joint.idx_q] = model.upperPositionLimit[joint.idx_q]
    return lower, upper


def required_inputs(inputs: tuple[str, ...], name: str) -> tuple[str, ...]:
    """Inputs of a mechanism called ``name``. Raises ``ClosureError`` where it has none."""
    if not inputs:
        raise ClosureError(
            f"mechanism {name!r} has no inputs: add "
            '<transmission name="..."><joint name="..."/></transmission> for each to its URDF'
        )
    return inputs


def bodies_of(model: pin.Model) -> dict[str, int]:
    """Pinocchio frame of every link and named point."""
    return {f.name: i for i, f in enumerate(model.frames) if f.type == pin.FrameType.BODY}
