"""``efforts_along``: efforts, powers and joint wrenches over a timed path of postures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from closedchain.analysis.forces.inverse_dynamics import InverseDynamics, inverse_dynamics
from closedchain.analysis.forces.loads import Gravity, Wrenches
from closedchain.closure.given import real_array
from closedchain.closure.mechanism import Mechanism
from closedchain.urdf.errors import ClosureError
from closedchain.urdf.extras import require

if TYPE_CHECKING:
    import xarray as xr

COMPONENTS = ("fx", "fy", "fz", "mx", "my", "mz")
FEWEST = 4  # samples that a spline needs


@dataclass(frozen=True, eq=False)
class EffortHistory:
    """What a motion takes, over time.

    Attributes
    ----------
    times : (n,) array
        [s]
    q, v, a : (n, nq), (n, nv), (n, nv) arrays
    inputs, motors, powers : (n, n_inputs) arrays
        Efforts at the driven joints and behind the gears [N, N m], power [W].
    joints : mapping of str to (n, 6) array
        Wrench that each joint carries, as ``Statics.joints`` has it.
    undetermined : mapping of str to tuple of str
        What rigid bodies leave open, as ``Statics.undetermined``, at any of the times.

    Examples
    --------
    >>> m = cc.with_inertias(cc.load("linear_delta"))
    >>> times = np.linspace(0.0, 1.0, 11)
    >>> path = m.input_values(m.home) + np.outer(0.02 * times**2, [1, 1, 1])
    >>> way = cc.track(m, path, times=times)
    >>> history = cc.efforts_along(m, times, way.q, way.qdot, way.qddot)
    >>> history.inputs.shape, history.joints["leg1_B"].shape
    ((11, 3), (11, 6))
    """

    mechanism: Mechanism = field(repr=False)
    times: np.ndarray
    q: np.ndarray
    v: np.ndarray
    a: np.ndarray
    inputs: np.ndarray
    motors: np.ndarray
    powers: np.ndarray
    joints: Mapping[str, np.ndarray]
    undetermined: Mapping[str, tuple[str, ...]]

    def to_dataset(self) -> xr.Dataset:
        """As an xarray Dataset over ``time``."""
        require("a dataset is made with xarray", "maps")
        import xarray as xr

        m = self.mechanism
        efforts = ["N" if unit == "m" else "N m" for unit in m.input_units]
        wrenches = np.stack(list(self.joints.values()), axis=1)
        data = {
            "effort": (("time", "input"), self.inputs),
            "motor_effort": (("time", "input"), self.motors),
            "power": (("time", "input"), self.powers, {"units": "W"}),
            "speed": (("time", "input"), self.v[:, m.input_v]),
            "wrench": (("time", "joint", "component"), wrenches, {"units": "N, N m"}),
        }
        names = {
            "time": ("time", self.times, {"units": "s"}),
            "input": list(m.inputs),
            "effort_units": ("input", efforts),
            "joint": list(self.joints),
            "component": list(COMPONENTS),
        }
        return xr.Dataset(data, names, {"mechanism": m.name})


def efforts_along(
    mechanism: Mechanism,
    times: ArrayLike,
    q: ArrayLike,
    v: ArrayLike | None = None,
    a: ArrayLike | None = None,
    *,
    wrench: Wrenches | None = None,
    gravity: Gravity = True,
    payload: Mapping[str, float] | None = None,
) -> EffortHistory:
    """Efforts that move a mechanism along a path, such as one of ``track`` or ``follow``.

    Parameters
    ----------
    times : (n,) array
        Rising times [s].
    q : (n, nq) array
        Closed postures at the times.
    v, a : (n, nv) arrays, optional
        Velocities and accelerations of all joints there, as ``Track.qdot`` and ``Track.qddot``; of
        which those of the inputs count. Without them they are those of a cubic spline through the
        inputs' values.
    wrench, gravity, payload
        As for ``statics``.

    Raises
    ------
    ClosureError
        Malformed numbers, open postures, singular ones, or too few samples for a spline.

    Examples
    --------
    >>> m = cc.with_inertias(cc.load("linear_delta"))
    >>> times = np.linspace(0.0, 1.0, 11)
    >>> rest = cc.efforts_along(m, times, np.tile(m.home, (11, 1)))
    >>> bool(np.allclose(rest.inputs, cc.statics(m, m.home).inputs))
    True
    >>> bool(np.allclose(rest.powers, 0.0))  # nothing moves, no power is needed
    True
    """
    t = real_array(times, "times")
    postures = np.atleast_2d(mechanism.configurations(q))
    if t.shape != (len(postures),) or not np.isfinite(t).all() or (np.diff(t) <= 0.0).any():
        raise ClosureError(f"times must be {len(postures)} rising numbers, one for each posture")
    rates, bends = _derivatives(mechanism, t, postures, (v, a))
    found = []
    for k, one in enumerate(postures):
        try:
            found.append(
                inverse_dynamics(
                    mechanism, one, rates[k], bends[k], wrench, gravity=gravity, payload=payload
                )
            )
        except ClosureError as error:
            raise ClosureError(f"at {t[k]:.6g} s: {error}") from None
    return _history(mechanism, t, postures, found)


def _derivatives(
    mechanism: Mechanism,
    t: np.ndarray,
    postures: np.ndarray,
    given: tuple[ArrayLike | None, ArrayLike | None],
) -> tuple[np.ndarray, np.ndarray]:
    """Rates and accelerations (n, n_inputs) of the inputs, as given or of a spline."""
    from scipy.interpolate import CubicSpline

    v, a = given
    if (v is None) != (a is None):
        raise ClosureError("give velocities and accelerations, or neither")
    if v is not None and a is not None:
        both = [real_array(x, "velocities and accelerations") for x in (v, a)]
        for x in both:
            if x.shape != (len(t), mechanism.model.nv) or not np.isfinite(x).all():
                raise ClosureError(
                    f"velocities and accelerations must be ({len(t)}, {mechanism.model.nv}) "
                    f"finite numbers, got {x.shape}"
                )
        return both[0][:, mechanism.input_v], both[1][:, mechanism.input_v]
    if len(t) < FEWEST:
        raise ClosureError(f"a spline needs {FEWEST} samples or more, got {len(t)}: give v and a")
    spline = CubicSpline(t, postures[:, mechanism.input_q])
    return spline(t, 1), spline(t, 2)


def _history(
    mechanism: Mechanism, t: np.ndarray, postures: np.ndarray, found: list[InverseDynamics]
) -> EffortHistory:
    undetermined: dict[str, set[str]] = {}
    for one in found:
        for name, parts in one.forces.undetermined.items():
            undetermined.setdefault(name, set()).update(parts)
    return EffortHistory(
        mechanism=mechanism,
        times=t,
        q=postures,
        v=np.array([one.v for one in found]),
        a=np.array([one.a for one in found]),
        inputs=np.array([one.inputs for one in found]),
        motors=np.array([one.motors for one in found]),
        powers=np.array([one.powers for one in found]),
        joints={
            n: np.array([one.forces.joints[n] for one in found]) for n in found[0].forces.joints
        },
        undetermined={
            n: tuple(c for c in (*COMPONENTS, "effort") if c in parts)
            for n, parts in undetermined.items()
        },
    )
