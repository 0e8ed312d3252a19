"""The equation of motion in the coordinates of the inputs: M a + c + g + f = tau."""

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
    added,
    body_forces,
    loads,
    moving_efforts,
    needed_efforts,
    no_forces,
)
from closedchain.closure.mechanism import Mechanism


@dataclass(frozen=True, eq=False)
class InputDynamics:
    """Terms of the equation of motion in input coordinates at a state.

    Attributes
    ----------
    mass : (n_inputs, n_inputs) array
        M, symmetric [kg, kg m, kg m^2]; rotors and armatures included.
    coriolis : (n_inputs,) array
        Efforts c [N, N m] that the velocities ask for, Coriolis and centrifugal.
    gravity : (n_inputs,) array
        Efforts g [N, N m] that hold the weights.
    friction : (n_inputs,) array
        Efforts f [N, N m] against damping and dry friction of all joints.
    reflected_inertia : (n_inputs, n_inputs) array
        The share of M that rotors and armatures have. Of a motor on its own joint it is the
        rotor's inertia times the reduction squared; armatures of other joints add to it.

    Examples
    --------
    >>> m = cc.with_inertias(cc.load("linear_delta"))
    >>> terms = cc.input_dynamics(m, m.home, [0.5, 0.0, 0.0])
    >>> terms.mass.shape, terms.coriolis.shape, terms.gravity.shape
    ((3, 3), (3,), (3,))
    """

    mass: np.ndarray
    coriolis: np.ndarray
    gravity: np.ndarray
    friction: np.ndarray
    reflected_inertia: np.ndarray


def input_dynamics(
    mechanism: Mechanism,
    q: ArrayLike,
    v_inputs: ArrayLike | Mapping[str, float] | None = None,
    *,
    gravity: Gravity = True,
    payload: Mapping[str, float] | None = None,
) -> InputDynamics:
    """Mass matrix, Coriolis, gravity and friction terms in the coordinates of the inputs.

    With G the motion of all joints by unit input rates, idle motions as inertia has them, and
    a_0 the accelerations at unaccelerated inputs: M = G^T M_tree G, c = G^T (M_tree a_0 + h).

    Parameters
    ----------
    q : (nq,) array
        Closed posture.
    v_inputs : (n_inputs,) array, or mapping of input name to value, optional
        [m/s or rad/s]; at rest by default.
    gravity, payload
        As for ``statics``.

    Raises
    ------
    ClosureError
        Malformed numbers, an open posture, a direct singularity, too few inputs, or more inputs
        than freedoms: they are no coordinates then.

    Examples
    --------
    >>> m = cc.with_inertias(cc.load("linear_delta"))
    >>> terms, a = cc.input_dynamics(m, m.home, [0.5, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])
    >>> efforts = terms.mass @ a + terms.coriolis + terms.gravity + terms.friction
    >>> bool(np.allclose(efforts, cc.inverse_dynamics(m, m.home, [0.5, 0.0, 0.0], a).inputs))
    True
    """
    at = first_order(mechanism, q, task=mechanism.task is not None)
    n = len(mechanism.inputs)
    rates = mechanism.input_vector(np.zeros(n) if v_inputs is None else v_inputs, "velocities")
    on = loads(mechanism, None, gravity, payload)
    motion, train = driven_motion(at, on.model), drivetrain(mechanism)
    by_inputs = motion.dynamic
    v = motion.rates(rates)
    start = motion.rates(np.zeros(n), mechanism.workspace.drift(at.q, v))
    still = np.zeros(mechanism.model.nv)
    turning = moving_efforts(mechanism, on, (at.q, v, still), no_forces(mechanism.model))
    weights = added(list(body_forces(mechanism, at.q, on).values()), mechanism.model)
    return InputDynamics(
        mass=by_inputs.T @ motion.mass @ by_inputs,
        coriolis=by_inputs.T @ (motion.mass @ start + turning),
        gravity=by_inputs.T @ needed_efforts(mechanism, on, at.q, weights),
        friction=by_inputs.T @ train.resistance(v),
        reflected_inertia=by_inputs.T @ (train.armature[:, None] * by_inputs),
    )


def mass_matrix(
    mechanism: Mechanism, q: ArrayLike, *, payload: Mapping[str, float] | None = None
) -> np.ndarray:
    """Mass matrix (n_inputs, n_inputs) in the coordinates of the inputs [kg, kg m, kg m^2].

    Symmetric; kinetic energy is half of it between the input rates. Rotors and armatures count.
    Parameters and errors as for ``input_dynamics``.

    Examples
    --------
    >>> m = cc.with_inertias(cc.load("linear_delta"))
    >>> M = cc.mass_matrix(m, m.home)  # [kg], in front of the sliders
    >>> bool(np.allclose(M, M.T)), bool(np.linalg.eigvalsh(M).min() > 0.0)
    (True, True)
    """
    return input_dynamics(mechanism, q, gravity=False, payload=payload).mass
