"""Steps of a Runge-Kutta method on closed postures, by Dormand and Prince, of order 5 with 4.

The posture is q moved by u, a tangent vector at the step's start, so that quaternions keep their
length: with J the derivative of ``pin.integrate`` by u, J u' = v. After each step the posture is
closed again and the velocity made to fit, by the least changes.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pinocchio as pin
from scipy.linalg.lapack import dgesv

from closedchain.analysis.forces.plant import Plant
from closedchain.closure.solve.control import CLOSED

Efforts = Callable[[float, np.ndarray, np.ndarray], np.ndarray]

# J. R. Dormand, P. J. Prince: A family of embedded Runge-Kutta formulae, 1980
_NODES = (0.0, 1 / 5, 3 / 10, 4 / 5, 8 / 9, 1.0, 1.0)
_TABLE = tuple(
    np.array(row)
    for row in (
        (),
        (1 / 5,),
        (3 / 40, 9 / 40),
        (44 / 45, -56 / 15, 32 / 9),
        (19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729),
        (9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656),
        (35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84),
    )
)
_ERROR = np.array([71 / 57600, 0.0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40])
_ENOUGH = 0.05 * CLOSED
_ROUNDS = 6


@dataclass(frozen=True, eq=False)
class State:
    """Time [s], posture (nq,), velocity (nv,), and the work [J] done by efforts and friction."""

    t: float
    q: np.ndarray
    v: np.ndarray
    work: float


@dataclass(frozen=True, eq=False)
class Stepper:
    """Steps of a plant under efforts f(t, q, v)."""

    plant: Plant
    efforts: Efforts

    def step(self, start: State, h: float) -> tuple[State, float]:
        """State after h [s], and the estimated error of the step, dimensionless."""
        nv = self.plant.mechanism.model.nv
        slopes = np.zeros((len(_NODES), 2 * nv + 1))
        y = np.concatenate([np.zeros(nv), start.v, [start.work]])
        now = y
        for i, (node, row) in enumerate(zip(_NODES, _TABLE, strict=True)):
            now = y + (h * row) @ slopes[:i]
            slopes[i] = self._slope(start, start.t + node * h, now)
        off = np.abs((h * _ERROR) @ slopes)[: 2 * nv] / self._units
        q = pin.integrate(self.plant.mechanism.model, start.q, now[:nv])
        q, v = self.fitted(q, now[nv : 2 * nv])
        return State(start.t + h, q, v, float(now[-1])), float(off.max(initial=0.0))

    @cached_property
    def _units(self) -> np.ndarray:
        return np.tile(self.plant.mechanism.column_scale, 2)

    def fitted(self, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Posture closed and velocity made to fit, by the least changes."""
        model = self.plant.mechanism.model
        here = self.plant.fit(q, v)
        for _ in range(_ROUNDS):
            if here.gap < _ENOUGH:
                break
            q = pin.integrate(model, q, here.step)
            here = self.plant.fit(q, v)
        return q, here.v

    def _slope(self, start: State, t: float, y: np.ndarray) -> np.ndarray:
        plant, model = self.plant, self.plant.mechanism.model
        u, v = y[: model.nv], y[model.nv : 2 * model.nv]
        q = pin.integrate(model, start.q, u)
        tau = self.efforts(t, q, v)
        a = plant.acceleration(q, v, tau)
        power = tau @ v[plant.mechanism.input_v] + plant.power(q, v)
        return np.concatenate([self._rate(u, v), a, [power]])

    def _rate(self, u: np.ndarray, v: np.ndarray) -> np.ndarray:
        """u' (nv,): of floating bodies by the derivative of the exponential map."""
        if not self._floating:
            return v
        rate = v.copy()
        for i in self._floating:
            six = slice(i, i + 6)
            # Jlog6 of exp6 would do, but loses six digits at motions of some milliradians
            rate[six] = dgesv(pin.Jexp6(u[six]), v[six])[2]
        return rate

    @cached_property
    def _floating(self) -> tuple[int, ...]:
        model = self.plant.mechanism.model
        return tuple(model.idx_vs[i] for i in range(1, model.njoints) if model.nvs[i] == 6)
