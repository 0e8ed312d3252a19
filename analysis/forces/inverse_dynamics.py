"""Inverse dynamics: the input efforts of a motion, and what the loops and joints carry in it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from closedchain.analysis.first_order import first_order
from closedchain.analysis.forces.driven_motion import driven_motion
from closedchain.analysis.forces.drivetrain import drivetrain
from closedchain.analysis.forces.loads import (
    Gravity,
    Wrenches,
    added,
    body_forces,
    loads,
    moving_efforts,
)
from closedchain.analysis.forces.statics import Statics, held
from closedchain.closure.mechanism import Mechanism


@dataclass(frozen=True, eq=False)
class InverseDynamics:
    """What makes a mechanism move as prescribed.

    Attributes
    ----------
    inputs : (n_inputs,) array
        Efforts at the driven joints [N or N m].
    motors : (n_inputs,) array
        The same at the motors, behind the gears: ``inputs`` by the reductions.
    powers : (n_inputs,) array
        Mechanical power of the inputs [W].
    v, a : (nv,) arrays
        Velocities and accelerations of all joints. Idle freedoms have the least velocities that
        fit, and accelerate as inertia has it.
    forces : Statics
        Loop forces, joint wrenches, and what rigid bodies leave open. The component along a
        driven joint's axis is its effort less what friction and the rotor take.

    Examples
    --------
    >>> m = cc.with_inertias(cc.load("linear_delta"))
    >>> found = cc.inverse_dynamics(m, m.home, [0.1, 0.1, 0.1], [0.0, 0.0, 0.0])
    >>> bool(np.allclose(found.powers, 0.1 * found.inputs))  # effort times speed
    True
    >>> found.forces.joints["leg1_B"].shape  # force and moment that a hinge carries
    (6,)
    """

    inputs: np.ndarray
    motors: np.ndarray
    powers: np.ndarray
    v: np.ndarray
    a: np.ndarray
    forces: Statics


def inverse_dynamics(
    mechanism: Mechanism,
    q: ArrayLike,
    v_inputs: ArrayLike | Mapping[str, float],
    a_inputs: ArrayLike | Mapping[str, float],
    wrench: Wrenches | None = None,
    *,
    gravity: Gravity = True,
    payload: Mapping[str, float] | None = None,
) -> InverseDynamics:
    """Input efforts for given input velocities and accelerations at a posture.

    Pinocchio's recursive Newton-Euler algorithm gives what the tree needs, S^T tau + K^T lambda =
    M a + h; armature, damping and dry friction of the description count, see ``m.notes``.

    Parameters
    ----------
    q : (nq,) array
        Closed posture.
    v_inputs, a_inputs : (n_inputs,) arrays, or mappings of input name to value
        [m/s or rad/s] and [m/s^2 or rad/s^2].
    wrench, gravity, payload
        As for ``statics``.

    Raises
    ------
    ClosureError
        Malformed numbers, an open posture, a direct singularity or too few inputs (the inputs do
        not determine the motion), rates that the loops contradict.

    Examples
    --------
    >>> m = cc.with_inertias(cc.load("linear_delta"))
    >>> rest = cc.inverse_dynamics(m, m.home, [0, 0, 0], [0, 0, 0])
    >>> bool(np.allclose(rest.inputs, cc.statics(m, m.home).inputs))
    True
    """
    at = first_order(mechanism, q, task=mechanism.task is not None)
    on = loads(mechanism, wrench, gravity, payload)
    rates = mechanism.input_vector(v_inputs, "input velocities")
    wanted = mechanism.input_vector(a_inputs, "input accelerations")
    motion, train = driven_motion(at, on.model), drivetrain(mechanism)
    v = motion.rates(rates)
    a = motion.rates(wanted, mechanism.workspace.drift(at.q, v))
    if motion.idle.shape[1]:
        forces = added(list(body_forces(mechanism, at.q, on).values()), mechanism.model)
        still = np.zeros(mechanism.model.nv)
        bias = moving_efforts(mechanism, on, (at.q, v, still), forces) + train.resistance(v)
        a = motion.settled(a, bias)
    found = held(at, on, (at.q, v, a), motion.rank, train.armature * a + train.resistance(v))
    return InverseDynamics(
        inputs=found.inputs,
        motors=found.inputs / train.reductions,
        powers=found.inputs * rates,
        v=v,
        a=a,
        forces=found,
    )
