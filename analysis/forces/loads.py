"""What acts on the bodies of a mechanism: gravity, payloads, wrenches at named frames.

Pinocchio's recursive Newton-Euler algorithm turns loads and motion into efforts of the tree's
joints and the wrenches that these carry. It runs on a copy of the model without gravity: gravity
is one load among others here, so that each can be told apart.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from closedchain.closure.given import finite_vector
from closedchain.closure.mechanism import Mechanism
from closedchain.urdf.errors import ClosureError

GRAVITY = (0.0, 0.0, -9.81)
"""Acceleration of free fall [m/s^2] where none is given, along the world's axes."""

LARGEST_LOAD = 1e12
"""Largest size of a load or an effort [N, N m, kg]."""

Wrenches = ArrayLike | Mapping[str, ArrayLike]
Gravity = bool | ArrayLike
_WEIGHTLESS = "forces.weightless"


@dataclass(frozen=True, eq=False)
class Loads:
    """Loads on a mechanism, checked.

    Attributes
    ----------
    gravity : (3,) array
        Acceleration of free fall [m/s^2] along the world's axes; zeros for none.
    wrenches : mapping of frame name to (6,) array
        (force, moment) [N, N m] on the mechanism at the frame's origin, along the world's axes.
    model : pin.Model
        The mechanism's tree with its payloads, without gravity.
    """

    gravity: np.ndarray
    wrenches: Mapping[str, np.ndarray]
    model: pin.Model


def loads(
    mechanism: Mechanism,
    wrench: Wrenches | None = None,
    gravity: Gravity = True,
    payload: Mapping[str, float] | None = None,
) -> Loads:
    """Check loads.

    Parameters
    ----------
    wrench : (6,) array, or mapping of frame name to (6,) array, optional
        (force, moment) [N, N m] on the mechanism, along the world's axes, at the origin of the tip
        or of named frames.
    gravity : bool or (3,) array
        9.81 m/s^2 against the world's z, none, or an acceleration of free fall [m/s^2].
    payload : mapping of frame name to mass, optional
        Point masses [kg] at the origins of named frames.

    Raises
    ------
    ClosureError
        Malformed numbers, unknown frames, a wrench for the tip without a task, a mass below zero.
    """
    if isinstance(gravity, bool | np.bool_):
        fall = np.array(GRAVITY) if gravity else np.zeros(3)
    else:
        fall = finite_vector(gravity, 3, "gravity", "x y z in m/s^2")
    named: Mapping[str, ArrayLike]
    if wrench is None:
        named = {}
    elif isinstance(wrench, Mapping):
        named = wrench
    else:
        named = {mechanism.required_task().tip: wrench}
    checked = {}
    for frame, numbers in named.items():
        mechanism.frame_id(frame)
        checked[frame] = finite_vector(
            numbers, 6, f"wrench at {frame}", "force, moment", LARGEST_LOAD
        )
    if payload is not None and not isinstance(payload, Mapping):
        raise ClosureError(f"payload must be masses by frame, {{'tool': 2.0}}, got {payload!r}")
    return Loads(fall, checked, _loaded(mechanism, payload or {}))


def _loaded(mechanism: Mechanism, payload: Mapping[str, float]) -> pin.Model:
    """Copy of the model without gravity, with point masses added."""
    model: pin.Model | None = None if payload else mechanism.known.get(_WEIGHTLESS)
    if model is not None:
        return model
    model = mechanism.model.copy()
    model.gravity = pin.Motion.Zero()
    for frame, mass in payload.items():
        f = mechanism.model.frames[mechanism.frame_id(frame)]
        (value,) = finite_vector(mass, 1, f"payload at {frame}", "kg", LARGEST_LOAD)
        if value < 0.0:
            raise ClosureError(f"payload at {frame}: a mass of {value:g} kg is below zero")
        if f.parentJoint:
            point = pin.Inertia(float(value), f.placement.translation, np.zeros((3, 3)))
            model.inertias[f.parentJoint] += point
    if not payload:
        mechanism.known[_WEIGHTLESS] = model
    return model


def body_forces(mechanism: Mechanism, q: np.ndarray, on: Loads) -> dict[str, list[pin.Force]]:
    """Forces on the bodies, by load: one for each joint's body, at the joint's frame, in its axes.

    Gravity comes under "gravity", wrenches under the names of their frames.
    """
    model, data = on.model, mechanism.workspace.data
    pin.forwardKinematics(model, data, q)
    found: dict[str, list[pin.Force]] = {}
    if on.gravity.any():
        fall = pin.Motion(on.gravity, np.zeros(3))
        still = [pin.Force.Zero()]
        weights = [model.inertias[i] * data.oMi[i].actInv(fall) for i in range(1, model.njoints)]
        found["gravity"] = still + weights
    for name, numbers in on.wrenches.items():
        f = model.frames[mechanism.frame_id(name)]
        place = data.oMi[f.parentJoint] * f.placement
        at = pin.SE3(np.eye(3), place.translation)
        forces = no_forces(model)
        if f.parentJoint:
            forces[f.parentJoint] = data.oMi[f.parentJoint].actInv(at.act(pin.Force(numbers)))
        found[f"wrench at {name}"] = forces
    return found


def no_forces(model: pin.Model) -> list[pin.Force]:
    """A zero force for each joint's body."""
    return [pin.Force.Zero() for _ in range(model.njoints)]


def added(parts: list[list[pin.Force]], model: pin.Model) -> list[pin.Force]:
    """Sum of several lists of forces, joint by joint."""
    total = no_forces(model)
    for part in parts:
        total = [one + other for one, other in zip(total, part, strict=True)]
    return total


def needed_efforts(
    mechanism: Mechanism, on: Loads, q: np.ndarray, forces: list[pin.Force]
) -> np.ndarray:
    """Efforts (nv,) at the tree's joints that hold forces on the bodies at rest, loops left out."""
    still = np.zeros(mechanism.model.nv)
    return moving_efforts(mechanism, on, (q, still, still), forces)


def moving_efforts(
    mechanism: Mechanism,
    on: Loads,
    motion: tuple[np.ndarray, np.ndarray, np.ndarray],
    forces: list[pin.Force],
) -> np.ndarray:
    """Efforts (nv,) at the tree's joints for a motion (q, v, a) under forces, loops left out."""
    vector = pin.StdVec_Force()
    for force in forces:
        vector.append(force)
    return np.array(pin.rnea(on.model, mechanism.workspace.data, *motion, vector))


def carried(mechanism: Mechanism) -> dict[str, np.ndarray]:
    """Wrenches (6,) of the tree's joints on their children after ``moving_efforts``, by joint.

    (force, moment) at the joint's frame on the child, in its axes. Floating joints are left out:
    they are coordinates of a body and carry nothing.
    """
    model, data = mechanism.model, mechanism.workspace.data
    return {
        model.names[i]: np.array(data.f[i].vector)
        for i in range(1, model.njoints)
        if model.nvs[i] == 1
    }
