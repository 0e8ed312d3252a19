"""The equations that a path puts on a mechanism, and their derivatives along the path.

A path of inputs leaves the passive joints to be found: K_p qdot_p = -K_a qdot_a. A path of tip
poses leaves all joints: [K; J] qdot = [0; V]. Both are dimensionless here.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from closedchain.analysis.motion.track.routes import Prescribed
from closedchain.analysis.structure.mobility import generic_rank
from closedchain.closure.equations import Equations
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.solve.newton import Rows
from closedchain.closure.solve.system import System
from closedchain.closure.task import WORLD_ALIGNED, Goal, goal
from closedchain.urdf.description import OUTPUTS


@dataclass(frozen=True, eq=False)
class Linear:
    """Equations at a posture: values + matrix x = 0, and rates x' with matrix x' = rhs.

    ``known`` (nv,) are the joint rates that the path gives itself.
    """

    values: np.ndarray
    matrix: np.ndarray
    known: np.ndarray
    rhs: np.ndarray


@dataclass(frozen=True, eq=False)
class Demand(ABC):
    """What a kind of path demands of a mechanism."""

    mechanism: Mechanism
    free: np.ndarray

    @property
    @abstractmethod
    def rank(self) -> int:
        """Rank of the matrix at a regular posture."""

    @abstractmethod
    def equations(self, p: Prescribed) -> Rows:
        """Equations of a posture that is where ``p`` asks for."""

    @abstractmethod
    def place(self, q: np.ndarray, p: Prescribed) -> np.ndarray:
        """``q`` (nq,) with what the path gives itself put in."""

    @abstractmethod
    def linearise(self, q: np.ndarray, p: Prescribed) -> Linear:
        """Values, matrix and demanded rates at ``q`` (nq,)."""

    @abstractmethod
    def second(self, q: np.ndarray, p: Prescribed, qdot: np.ndarray) -> tuple[np.ndarray, ...]:
        """``known`` and ``rhs`` of the accelerations, right after ``linearise`` at ``q``."""

    def joints(self, known: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Joint rates (nv,) of a dimensionless solution (free,)."""
        rates = known.copy()
        rates[self.free] = x * self.mechanism.column_scale[self.free]
        return rates


class InputDemand(Demand):
    """A path of inputs: the passive joints are found."""

    @property
    def rank(self) -> int:
        """As the classification of direct singularities has it."""
        return min(generic_rank(self.mechanism), self.free.size)

    def equations(self, p: Prescribed) -> System:
        """Closures in the passive joints."""
        return System(self.mechanism, self.free)

    def place(self, q: np.ndarray, p: Prescribed) -> np.ndarray:
        """``q`` with its inputs replaced."""
        q = q.copy()
        q[self.mechanism.input_q] = p.value
        return q

    def linearise(self, q: np.ndarray, p: Prescribed) -> Linear:
        """K_p and -K_a qdot_a."""
        m = self.mechanism
        values, jacobian = m.workspace.evaluate(q)
        matrix = jacobian[:, self.free] * m.column_scale[self.free] / m.row_scale[:, None]
        rhs = -(jacobian[:, m.input_v] @ p.rate) / m.row_scale
        return Linear(values / m.row_scale, matrix, self._known(p.rate), rhs)

    def second(self, q: np.ndarray, p: Prescribed, qdot: np.ndarray) -> tuple[np.ndarray, ...]:
        """-K_a qddot_a - Kdot qdot."""
        m = self.mechanism
        jacobian = m.workspace.evaluate(q)[1]
        rhs = -(jacobian[:, m.input_v] @ p.second) - m.workspace.drift(q, qdot)
        return self._known(p.second), rhs / m.row_scale

    def _known(self, rates: np.ndarray) -> np.ndarray:
        known = np.zeros(self.mechanism.model.nv)
        known[self.mechanism.input_v] = rates
        return known


@dataclass(frozen=True, eq=False)
class TipDemand(Demand):
    """A path of tip poses in the components ``outputs``: all joints are found."""

    outputs: tuple[str, ...]

    @property
    def rank(self) -> int:
        """As the classification of inverse singularities has it."""
        return min(generic_rank(self.mechanism) + len(self.outputs), self.free.size)

    def equations(self, p: Prescribed) -> Equations:
        """Closures and the goal in all joints."""
        return Equations(self.mechanism, self.free, (self._goal(p),))

    def place(self, q: np.ndarray, p: Prescribed) -> np.ndarray:
        """``q`` itself."""
        return q

    def linearise(self, q: np.ndarray, p: Prescribed) -> Linear:
        """[K; J] and [0; V], J being the derivative of the goal's rows."""
        equations = self.equations(p)
        values, matrix = equations.evaluate(q)
        scale = equations.row_scale
        rhs = np.zeros(values.size)
        operator = _operator(equations.goals[0], self._rotation(q))
        rhs[self.mechanism.rows :] = operator @ p.rate
        return Linear(values / scale, matrix, np.zeros(self.mechanism.model.nv), rhs / scale)

    def second(self, q: np.ndarray, p: Prescribed, qdot: np.ndarray) -> tuple[np.ndarray, ...]:
        """[-Kdot qdot; A (Vdot - Jdot qdot) - Adot (J qdot - V)]: goals move by A (J qdot - V)."""
        m, g, rotation = self.mechanism, self._goal(p), self._rotation(q)
        drift = m.workspace.drift(q, qdot)  # leaves the frames' velocities, accelerations at rest
        where = (m.model, m.workspace.data, g.joint, g.placement, WORLD_ALIGNED)
        twist = np.array(pin.getFrameVelocity(*where).vector)
        bias = np.array(pin.getFrameClassicalAcceleration(*where).vector)
        rows = _operator(g, rotation) @ (p.second - bias)
        rows -= _operator_rate(g, rotation, twist[3:], p.rate[3:]) @ (twist[3:] - p.rate[3:])
        scale = self.equations(p).row_scale
        return np.zeros(m.model.nv), np.concatenate([-drift, rows]) / scale

    def _goal(self, p: Prescribed) -> Goal:
        return goal(self.mechanism, self.mechanism.required_task().tip, p.value, self.outputs)

    def _rotation(self, q: np.ndarray) -> np.ndarray:
        return np.array(self.mechanism.pose(q).rotation)


def _angular(g: Goal) -> list[int]:
    return [OUTPUTS.index(name) - 3 for name in g.outputs if name[0] == "r"]


def _operator(g: Goal, rotation: np.ndarray) -> np.ndarray:
    """A (rows, 6): rate of the goal's rows from a twist of the tip less that of the target."""
    linear = [OUTPUTS.index(name) for name in g.outputs if name in "xyz"]
    angular = _angular(g)
    operator = np.zeros((len(g.outputs), 6))
    operator[range(len(linear)), linear] = 1.0
    wanted = g.target.rotation
    if len(angular) == 2:
        (third,) = {0, 1, 2} - set(angular)
        operator[len(linear) :, 3:] = np.cross(rotation[:, third], wanted[:, angular].T)
    elif angular:
        operator[len(linear) :, 3:] = (pin.Jlog3(wanted.T @ rotation) @ rotation.T)[angular]
    return operator


def _operator_rate(
    g: Goal, rotation: np.ndarray, omega: np.ndarray, target: np.ndarray
) -> np.ndarray:
    """Derivative (rows, 3) of the angular columns of A while tip and target turn."""
    angular = _angular(g)
    out = np.zeros((len(g.outputs), 3))
    start = len(g.outputs) - len(angular)
    wanted = g.target.rotation
    if len(angular) == 2:
        (third,) = {0, 1, 2} - set(angular)
        axis = rotation[:, third]
        sides = wanted[:, angular].T
        out[start:] = np.cross(np.cross(omega, axis), sides) + np.cross(
            axis, np.cross(target, sides)
        )
    elif angular:
        relative = wanted.T @ rotation
        to_log = pin.Jlog3(relative)
        vector = pin.log3(relative)
        turning = rotation.T @ (omega - target)
        rows = _log_rate(vector, to_log @ turning) @ rotation.T
        rows -= to_log @ rotation.T @ pin.skew(omega)
        out[start:] = rows[angular]
    return out


def _log_rate(r: np.ndarray, rate: np.ndarray) -> np.ndarray:
    """Derivative (3, 3) of Jlog3 = 1 + [r]/2 + c(|r|) [r]^2 where r moves with ``rate``."""
    angle = float(np.linalg.norm(r))
    if angle < 1e-2:
        c, slope = 1.0 / 12.0 + angle**2 / 720.0, 1.0 / 360.0 + angle**2 / 7560.0
    else:
        half = 0.5 * angle
        c = (1.0 - half / np.tan(half)) / angle**2
        slope = (
            0.5 * half / np.sin(half) ** 2 - 0.5 / np.tan(half)
        ) / angle**3 - 2.0 * c / angle**2
    x, xdot = pin.skew(r), pin.skew(rate)
    return np.asarray(0.5 * xdot + c * (xdot @ x + x @ xdot) + slope * (r @ rate) * (x @ x))
