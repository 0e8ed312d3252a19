"""Forward dynamics: the accelerations that efforts and loads make, on the closed postures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from closedchain.analysis.forces.loads import LARGEST_LOAD, Gravity, Wrenches
from closedchain.analysis.forces.plant import plant_under
from closedchain.closure.mechanism import Mechanism


@dataclass(frozen=True, eq=False)
class ForwardDynamics:
    """What efforts make of a state.

    Attributes
    ----------
    a : (nv,) array
        Accelerations of all joints [m/s^2, rad/s^2].
    inputs : (n_inputs,) array
        Those of the inputs.

    Examples
    --------
    >>> m = cc.with_inertias(cc.load("linear_delta"))
    >>> fall = cc.forward_dynamics(m, m.home, np.zeros(m.model.nv))
    >>> print(fall.inputs.round(3))  # let go, all of it falls freely [m/s^2]
    [-9.81 -9.81 -9.81]
    """

    a: np.ndarray
    inputs: np.ndarray


def forward_dynamics(
    mechanism: Mechanism,
    q: ArrayLike,
    v: ArrayLike,
    efforts: ArrayLike | Mapping[str, float] | None = None,
    *,
    wrench: Wrenches | None = None,
    gravity: Gravity = True,
    payload: Mapping[str, float] | None = None,
) -> ForwardDynamics:
    """Accelerations that input efforts and loads make.

    Dry friction is F tanh(v / 0.001), so that it is nothing at rest.

    Parameters
    ----------
    q : (nq,) array
        Closed posture.
    v : (nv,) array
        Velocities that the loops allow [m/s, rad/s].
    efforts : (n_inputs,) array, or mapping of input name to value, optional
        At the driven joints [N or N m]; none by default. A motor's effort times its reduction.
    wrench, gravity, payload
        As for ``statics``.

    Raises
    ------
    ClosureError
        Malformed numbers, an open posture, velocities that the loops contradict, motions without
        inertia, a constraint singularity.

    Examples
    --------
    >>> m = cc.with_inertias(cc.load("linear_delta"))
    >>> held = cc.input_efforts(m, m.home)  # what the weights ask for
    >>> a = cc.forward_dynamics(m, m.home, np.zeros(m.model.nv), held).a
    >>> bool(np.abs(a).max() < 1e-9)
    True
    """
    plant = plant_under(mechanism, wrench, gravity, payload)
    q, v = plant.state(q, v)
    tau = np.zeros(len(mechanism.inputs))
    if efforts is not None:
        tau = mechanism.input_vector(efforts, "efforts", LARGEST_LOAD)
    a = plant.acceleration(q, v, tau)
    return ForwardDynamics(a, a[mechanism.input_v])
