"""What motors and joints add to the dynamics of the bodies: rotors, gears, damping and friction."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from closedchain.closure.mechanism import Mechanism

_KEY = "forces.drivetrain"


@dataclass(frozen=True, eq=False)
class Drivetrain:
    """Numbers of the description, in the order of ``v``; zero for floating joints.

    Attributes
    ----------
    armature : (nv,) array
        Inertia [kg or kg m^2] that moves with a joint and with nothing else: the joint's
        ``armature``, and the rotor's inertia times the square of the reduction.
    damping : (nv,) array
        [N s/m or N m s/rad]
    friction : (nv,) array
        Dry friction [N or N m] of a joint that moves.
    reductions : (n_inputs,) array
        How far each motor turns by unit motion of its joint [1 or rad/m].
    """

    armature: np.ndarray
    damping: np.ndarray
    friction: np.ndarray
    reductions: np.ndarray

    def resistance(self, v: np.ndarray) -> np.ndarray:
        """Efforts (nv,) [N, N m] that damping and friction ask for at velocities (nv,)."""
        return np.asarray(self.damping * v + self.friction * np.sign(v))


def drivetrain(mechanism: Mechanism) -> Drivetrain:
    """Drivetrain of a mechanism, read once from its description."""
    found: Drivetrain | None = mechanism.known.get(_KEY)
    if found is None:
        found = mechanism.known.setdefault(_KEY, _read(mechanism))
    return found


def _read(mechanism: Mechanism) -> Drivetrain:
    model = mechanism.model
    armature, damping, friction = np.zeros((3, model.nv))
    for joint in mechanism.description.joints:
        if joint.type not in ("fixed", "floating"):
            v = model.idx_vs[model.getJointId(joint.name)]
            armature[v], damping[v], friction[v] = joint.armature, joint.damping, joint.friction
    by_name = {spec.name: spec for spec in mechanism.description.inputs}
    motors = [by_name[name] for name in mechanism.inputs]
    for v, motor in zip(mechanism.input_v, motors, strict=True):
        armature[v] += motor.reduction**2 * motor.rotor_inertia
    reductions = np.array([motor.reduction for motor in motors])
    return Drivetrain(armature, damping, friction, reductions)
