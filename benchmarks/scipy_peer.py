"""SciPy's general solvers on the closure rows and Jacobians of this package."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from scipy.optimize import least_squares, minimize

import closedchain as cc


class _Rows:
    """Closure rows as a function of a tangent step (passive,) from the last posture."""

    def __init__(self, m: cc.Mechanism, q: np.ndarray) -> None:
        self.m, self.q = m, np.array(q)

    def posture(self, x: np.ndarray) -> np.ndarray:
        return np.asarray(pin.integrate(self.m.model, self.base, self._tangent(x)))

    def rows(self, x: np.ndarray) -> np.ndarray:
        return self.m.workspace.residual(self.posture(x))

    def jacobian(self, x: np.ndarray) -> np.ndarray:
        """Exact: the tangent at the moving posture is not that at the last one."""
        turned = pin.dIntegrate(self.m.model, self.base, self._tangent(x), pin.ARG1)
        return (self.m.workspace.evaluate(self.posture(x))[1] @ turned)[:, self.m.passive_v]

    def _tangent(self, x: np.ndarray) -> np.ndarray:
        v = np.zeros(self.m.model.nv)
        v[self.m.passive_v] = x
        return v

    def begin(self, target: np.ndarray) -> np.ndarray:
        """Put the inputs at ``target``; return the start of the step."""
        self.base = self.q.copy()
        self.base[self.m.input_q] = target
        return np.zeros(self.m.passive_v.size)

    def residual(self) -> float:
        return float(np.abs(cc.residual(self.m, self.q)).max())

    def tip(self) -> np.ndarray:
        return self.m.point(self.q, self.m.required_task().tip)


class LeastSquares(_Rows):
    """Levenberg-Marquardt of MINPACK."""

    def step(self, target: np.ndarray) -> None:
        x = self.begin(target)
        found = least_squares(
            self.rows, x, self.jacobian, method="lm", xtol=1e-15, ftol=1e-15, gtol=1e-15
        )
        self.q = self.posture(found.x)


class Slsqp(_Rows):
    """Sequential quadratic programming: the shortest step under the rows as equalities."""

    def step(self, target: np.ndarray) -> None:
        found = minimize(
            lambda x: 0.5 * float(x @ x),
            self.begin(target),
            jac=lambda x: x,
            method="SLSQP",
            constraints={"type": "eq", "fun": self.rows, "jac": self.jacobian},
            options={"ftol": 1e-15, "maxiter": 50},
        )
        self.q = self.posture(found.x)
        self.message = str(found.message)
