"""Steps of a Runge-Kutta method on closed postures, by Dormand and Prince, of order 5 with 4.

The posture is q moved by u, a tangent vector at the step's start, so that quaternions keep their
length: with J the derivative of ``pin.integrate`` by u, J u' = v. After each step the posture is
closed again and the velocity made to fit, by the least changes.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from closedchain.analysis.forces.forward_dynamics import Closed, Plant
from closedchain.closure.solve.control import CLOSED

Efforts = Callable[[float, np.ndarray, np.ndarray], np.ndarray]

# J. R. Dormand, P. J. Prince: A family of embedded Runge-Kutta formulae, 1980
_NODES = (0.0, 1 / 5, 3 / 10, 4 / 5, 8 / 9, 1.0, 1.0)
_TABLE = (
    (),
    (1 / 5,),
    (3 / 40, 9 / 40),
    (44 / 45, -56 / 15, 32 / 9),
    (19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729),
    (9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656),
    (35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84),
)
_ERROR = (71 / 57600, 0.0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40)
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
        slopes: list[np.ndarray] = []
        y = np.concatenate([np.zeros(nv), start.v, [start.work]])
        now = y
        for node, row in zip(_NODES, _TABLE, strict=True):
            now = y + h * sum((w * s for w, s in zip(row, slopes, strict=True)), np.zeros(y.size))
            slopes.append(self._slope(start, start.t + node * h, now))
        off = h * sum((w * s for w, s in zip(_ERROR, slopes, strict=True)), np.zeros(y.size))
        q = pin.integrate(self.plant.mechanism.model, start.q, now[:nv])
        unit = self.plant.mechanism.column_scale
        error = max(
            float(np.abs(off[part] / unit).max(initial=0.0))
            for part in (slice(0, nv), slice(nv, 2 * nv))
        )
        q, v, _ = self.fitted(q, now[nv : 2 * nv])
        return State(start.t + h, q, v, float(now[-1])), error

    def fitted(self, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray, Closed]:
        """Posture closed and velocity made to fit, by the least changes."""
        m = self.plant.mechanism
        here = self.plant.closed(q)
        for _ in range(_ROUNDS):
            if np.abs(here.values * m.row_scale).max(initial=0.0) < _ENOUGH:
                break
            step = -here.inverse @ here.values
            q = pin.integrate(m.model, q, m.column_scale * step)
            here = self.plant.closed(q)
        c = m.column_scale
        return q, c * (here.basis @ (here.basis.T @ (v / c))), here

    def _slope(self, start: State, t: float, y: np.ndarray) -> np.ndarray:
        plant, model = self.plant, self.plant.mechanism.model
        u, v = y[: model.nv], y[model.nv : 2 * model.nv]
        q = pin.integrate(model, start.q, u)
        rate = v
        if model.nq > model.nv:
            by_u = pin.dIntegrate(model, start.q, u, pin.ArgumentPosition.ARG1)
            rate = np.linalg.solve(by_u, v)
        tau = self.efforts(t, q, v)
        a = plant.acceleration(q, v, tau)
        power = tau @ v[plant.mechanism.input_v] - plant.resistance(v) @ v
        if plant.on.wrenches:
            power += plant.power_of_wrenches(q, v)
        return np.concatenate([rate, a, [power]])
