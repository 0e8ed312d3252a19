"""Velocities and accelerations of all joints and of the tip from those of the inputs.

With K the constraint Jacobian, a and p its input and passive columns:
K_p qdot_p = -K_a qdot_a and K_p qddot_p = -K_a qddot_a - Kdot qdot.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from closedchain.analysis.first_order import first_order
from closedchain.analysis.singularity.deciding import Deciding
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.ranks import Rank
from closedchain.urdf.errors import ClosureError

_CONSISTENT = 1e-9  # dimensionless rate by which given input rates may miss the loops' demands


@dataclass(frozen=True, eq=False)
class Acceleration:
    """First and second order motion of a mechanism at a posture.

    Attributes
    ----------
    tip_twist : (6,) array
        (linear, angular) velocity of the tip, world-aligned at the tip [m/s, rad/s].
    tip_acceleration : (6,) array
        Classical acceleration of the tip's origin and angular acceleration, world axes
        [m/s^2, rad/s^2].
    qdot, qddot : (nv,) arrays
        Velocities and accelerations of all joints, in Pinocchio's tangent. Idle freedoms, such as
        the spin of a rod between two spherical joints, get the smallest rates that fit.
    rank : Rank
        Of the dimensionless K_p, with its gap.

    Examples
    --------
    >>> m = cc.load("linear_delta")
    >>> a = cc.acceleration(m, m.home, v_inputs=[0.1, 0.1, 0.1], a_inputs=[0.0, 0.0, 2.0])
    >>> print(a.tip_twist.round(3) + 0.0)  # all sliders rise at 0.1 m/s, and so does the platform
    [0.  0.  0.1 0.  0.  0. ]
    >>> a.qddot.shape == (m.model.nv,)
    True
    """

    tip_twist: np.ndarray
    tip_acceleration: np.ndarray
    qdot: np.ndarray
    qddot: np.ndarray
    rank: Rank


def acceleration(
    mechanism: Mechanism,
    q: ArrayLike,
    v_inputs: ArrayLike | Mapping[str, float],
    a_inputs: ArrayLike | Mapping[str, float],
) -> Acceleration:
    """Motion of all joints and of the tip for given input velocities and accelerations.

    Parameters
    ----------
    q : (nq,) array
        Closed posture.
    v_inputs, a_inputs : (n_inputs,) arrays, or mappings of input name to value
        [m/s or rad/s] and [m/s^2 or rad/s^2].

    Raises
    ------
    ClosureError
        Malformed or open posture, no task, a direct singularity (the inputs do not determine the
        motion), or, with more inputs than freedoms, rates that the loops contradict.

    Examples
    --------
    >>> m = cc.load("linear_delta")
    >>> a = cc.acceleration(m, m.home, {"q1": 0.1, "q2": 0.0, "q3": 0.0}, [0.0, 0.0, 0.0])
    >>> print(a.tip_acceleration.round(4) + 0.0)  # [m/s^2, rad/s^2], though no slider accelerates
    [0.0111 0.     0.0558 0.     0.     0.    ]
    """
    at = first_order(mechanism, q, "x y z rx ry rz")  # the whole tip must be determined
    va = mechanism.input_vector(v_inputs, "input velocities")
    aa = mechanism.input_vector(a_inputs, "input accelerations")
    decided = Deciding(at)
    rank = decided.locked.rank
    free = decided.passive_factors.kernel(mechanism.passive_v.size - rank.value)
    if np.abs(at.J[:, mechanism.passive_v] @ free).max(initial=0.0) > _CONSISTENT:
        raise ClosureError(
            f"the inputs do not determine the tip's motion: K_p has {rank}, "
            f"{mechanism.passive_v.size} needed (a direct singularity, or too few inputs)"
        )
    qdot = _joints(decided, (va, np.zeros(mechanism.rows)), "velocities")
    drift = mechanism.workspace.drift(at.q, qdot)
    qddot = _joints(decided, (aa, drift), "accelerations")
    model, data = mechanism.model, mechanism.workspace.data
    pin.forwardKinematics(model, data, at.q, qdot, qddot)
    tip = model.frames[mechanism.frame_id(mechanism.required_task().tip)]
    where = (model, data, tip.parentJoint, tip.placement, pin.LOCAL_WORLD_ALIGNED)
    return Acceleration(
        tip_twist=np.array(pin.getFrameVelocity(*where).vector),
        tip_acceleration=np.array(pin.getFrameClassicalAcceleration(*where).vector),
        qdot=qdot,
        qddot=qddot,
        rank=rank,
    )


def _joints(decided: Deciding, wanted_of: tuple[np.ndarray, np.ndarray], what: str) -> np.ndarray:
    """All joint rates (nv,) with K rates = -drift and the inputs' as given, of (inputs, drift)."""
    at, m, (inputs, drift) = decided.at, decided.at.mechanism, wanted_of
    a, p = m.input_v, m.passive_v
    scaled = inputs / at.column_unit[a]
    wanted = -at.K[:, a] @ scaled - drift / at.row_unit
    passive = decided.passive_factors.solve(wanted, decided.locked.rank.value)
    miss = np.abs(at.K_passive @ passive - wanted).max(initial=0.0)
    if miss > _CONSISTENT * (1.0 + np.abs(wanted).max(initial=0.0)):
        raise ClosureError(
            f"the input {what} contradict each other: the loops are violated at a rate of "
            f"{miss:.3g}; with more inputs than freedoms only some combinations are possible"
        )
    rates = np.empty(m.model.nv)
    rates[a], rates[p] = inputs, passive * at.column_unit[p]
    return rates
