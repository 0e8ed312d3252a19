"""SciPy's general solvers on the closure rows and Jacobians of this package."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np
import pinocchio as pin
from scipy.optimize import least_squares, minimize

import closedchain as cc
from closedchain.closure.task import Goal, goal, goal_rows


class _Rows(ABC):
    """Rows as a function of a tangent step from the last posture, in some of the coordinates."""

    def __init__(self, m: cc.Mechanism, q: np.ndarray) -> None:
        self.m, self.q = m, np.array(q)
        self.base, self.free = self.q, m.passive_v
        self.goal: Goal | None = None

    def posture(self, x: np.ndarray) -> np.ndarray:
        return np.asarray(pin.integrate(self.m.model, self.base, self._tangent(x)))

    def rows(self, x: np.ndarray) -> np.ndarray:
        return self._evaluate(self.posture(x))[0]

    def jacobian(self, x: np.ndarray) -> np.ndarray:
        """Exact: the tangent at the moving posture is not that at the last one."""
        turned = pin.dIntegrate(self.m.model, self.base, self._tangent(x), pin.ARG1)
        return (self._evaluate(self.posture(x))[1] @ turned)[:, self.free]

    def _evaluate(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        values, jacobian = self.m.workspace.evaluate(q)
        if self.goal is None:
            return values, jacobian
        more, rows = goal_rows(self.m, self.goal)
        return np.concatenate([values, more]), np.vstack([jacobian, rows])

    def _tangent(self, x: np.ndarray) -> np.ndarray:
        v = np.zeros(self.m.model.nv)
        v[self.free] = x
        return v

    def step(self, target: np.ndarray) -> None:
        self.base, self.free, self.goal = self.q.copy(), self.m.passive_v, None
        self.base[self.m.input_q] = target
        self.q = self.posture(self.solved(np.zeros(self.free.size)))

    def reach(self, target: pin.SE3) -> None:
        m = self.m
        self.base, self.free = self.q.copy(), np.arange(m.model.nv)
        self.goal = goal(m, m.required_task().tip, target, m.outputs())
        self.q = self.posture(self.solved(np.zeros(self.free.size)))

    @abstractmethod
    def solved(self, x: np.ndarray) -> np.ndarray: ...

    def residual(self) -> float:
        return float(np.abs(cc.residual(self.m, self.q)).max())

    def tip(self) -> np.ndarray:
        return self.m.point(self.q, self.m.required_task().tip)


class LeastSquares(_Rows):
    """Levenberg-Marquardt of MINPACK, or a trust region where there are fewer rows than unknowns.

    MINPACK refuses those.
    """

    def solved(self, x: np.ndarray) -> np.ndarray:
        method = "lm" if self.rows(x).size >= x.size else "trf"
        found = least_squares(
            self.rows, x, self.jacobian, method=method, xtol=1e-15, ftol=1e-15, gtol=1e-15
        )
        return np.asarray(found.x)


class Slsqp(_Rows):
    """Sequential quadratic programming: the shortest step under the rows as equalities."""

    def solved(self, x: np.ndarray) -> np.ndarray:
        found = minimize(
            lambda x: 0.5 * float(x @ x),
            x,
            jac=lambda x: x,
            method="SLSQP",
            constraints={"type": "eq", "fun": self.rows, "jac": self.jacobian},
            options={"ftol": 1e-15, "maxiter": 50},
        )
        self.message = str(found.message)
        return np.asarray(found.x)
