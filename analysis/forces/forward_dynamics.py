"""Forward dynamics: the accelerations that efforts and loads make, on the closed postures.

M a + h = S^T tau + K^T lambda with K a = -Kdot v. With Z a basis of ker K and a_p a solution of
K a = -Kdot v: Z^T M Z y = Z^T (S^T tau - h - M a_p), a = a_p + Z y. Redundant rows do no harm: the
rank of K is the generic one.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from closedchain.analysis.first_order import first_order, moving_joints
from closedchain.analysis.forces.driven_motion import tree_mass
from closedchain.analysis.forces.drivetrain import Drivetrain, drivetrain
from closedchain.analysis.forces.loads import (
    Gravity,
    Loads,
    Wrenches,
    added,
    body_forces,
    loads,
    needed_efforts,
)
from closedchain.closure.generic import sampled_rank
from closedchain.closure.mechanism import Mechanism
from closedchain.urdf.errors import ClosureError

SLIDING = 1e-3
"""Rate [rad/s or m/s] at which dry friction has three quarters of its size: F tanh(v / SLIDING)."""

SINGULAR = 1e-8  # share of the largest singular value of K below which a rank is lost
MASSLESS = 1e-12  # share of the largest inertia of a motion that is none
CONSISTENT = 1e-6  # rate of the closure rows that given velocities may have, dimensionless


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


@dataclass(frozen=True, eq=False)
class Closed:
    """The closed motions at a posture, dimensionless.

    Attributes
    ----------
    basis : (nv, n) array
        Orthonormal.
    inverse : (nv, rows) array
        Pseudo-inverse of K, by its generic rank.
    least : float
        Smallest singular value of K that counts, as a share of the largest.
    values : (rows,) array
        Closure rows.
    """

    basis: np.ndarray
    inverse: np.ndarray
    least: float
    values: np.ndarray


@dataclass(frozen=True, eq=False)
class Plant:
    """A mechanism under constant loads, ready to be asked for accelerations at many states."""

    mechanism: Mechanism
    on: Loads

    @cached_property
    def rank(self) -> int:
        """Generic rank of K."""
        return sampled_rank(self.mechanism).rank.value if self.mechanism.rows else 0

    @cached_property
    def model(self) -> pin.Model:
        """The tree with payloads and gravity."""
        found = self.on.model.copy()
        found.gravity = pin.Motion(self.on.gravity, np.zeros(3))
        return found

    @cached_property
    def train(self) -> Drivetrain:
        """Rotors, damping and friction."""
        return drivetrain(self.mechanism)

    def closed(self, q: np.ndarray) -> Closed:
        """The closed motions at a posture (nq,), by the generic rank."""
        m, r = self.mechanism, self.rank
        if not m.rows:
            return Closed(np.eye(m.model.nv), np.zeros((m.model.nv, 0)), 1.0, np.zeros(0))
        values, jacobian = m.workspace.evaluate(q)
        k = jacobian * m.column_scale / m.row_scale[:, None]
        u, s, vt = np.linalg.svd(k)
        inverse = (vt[:r].T / np.maximum(s[:r], 1e-300)) @ u[:, :r].T
        return Closed(vt[r:].T, inverse, float(s[r - 1] / s[0]), values / m.row_scale)

    def acceleration(self, q: np.ndarray, v: np.ndarray, tau: np.ndarray) -> np.ndarray:
        """Accelerations (nv,) under input efforts (n_inputs,).

        Raises
        ------
        ClosureError
            A motion without inertia, or a posture at which the closures lose rank.
        """
        m, c = self.mechanism, self.mechanism.column_scale
        here = self.closed(q)
        if here.least < SINGULAR:
            raise ClosureError(
                "the closures lose rank there (a constraint singularity): the accelerations are "
                "not determined"
            )
        start = -here.inverse @ (m.workspace.drift(q, v) / m.row_scale)
        mass = self.mass(q) * c * c[:, None]
        force = c * (self.driving(tau) - self.bias(q, v))
        inertia = here.basis.T @ mass @ here.basis
        self._refuse_massless(inertia, here.basis)
        own = np.linalg.solve(inertia, here.basis.T @ (force - mass @ start))
        return np.asarray(c * (start + here.basis @ own))

    def mass(self, q: np.ndarray) -> np.ndarray:
        """Mass matrix (nv, nv) of the tree, rotors included."""
        return tree_mass(self.model, self.mechanism.workspace.data, q, self.train.armature)

    def bias(self, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Efforts (nv,) that the tree needs without acceleration: velocities, loads, friction."""
        data = self.mechanism.workspace.data
        found = np.array(pin.nonLinearEffects(self.model, data, q, v))
        if self.on.wrenches:
            found += self._against_wrenches(q)
        return found + self.resistance(v)

    def power_of_wrenches(self, q: np.ndarray, v: np.ndarray) -> float:
        """Power [W] of the wrenches at named frames."""
        return -float(self._against_wrenches(q) @ v)

    def _against_wrenches(self, q: np.ndarray) -> np.ndarray:
        only = Loads(np.zeros(3), self.on.wrenches, self.on.model)
        forces = added(list(body_forces(self.mechanism, q, only).values()), self.model)
        return needed_efforts(self.mechanism, only, q, forces)

    def resistance(self, v: np.ndarray) -> np.ndarray:
        """Efforts (nv,) of damping and of friction, which sets in smoothly."""
        return np.asarray(self.train.damping * v + self.train.friction * np.tanh(v / SLIDING))

    def driving(self, tau: np.ndarray) -> np.ndarray:
        """Efforts (nv,) at the tree's joints of input efforts (n_inputs,)."""
        found = np.zeros(self.mechanism.model.nv)
        found[self.mechanism.input_v] = tau
        return found

    def energy(self, q: np.ndarray, v: np.ndarray) -> float:
        """Kinetic energy, rotors included, and potential energy of gravity [J]."""
        data = self.mechanism.workspace.data
        kinetic = pin.computeKineticEnergy(self.model, data, q, v)
        rotors = 0.5 * float(self.train.armature @ (v * v))
        return float(kinetic + pin.computePotentialEnergy(self.model, data, q)) + rotors

    def _refuse_massless(self, inertia: np.ndarray, basis: np.ndarray) -> None:
        if not inertia.size:
            return
        sizes, axes = np.linalg.eigh(inertia)
        if sizes[0] <= MASSLESS * max(sizes[-1], 0.0):
            motion = basis @ axes[:, 0] * self.mechanism.column_scale
            names = ", ".join(moving_joints(self.mechanism, motion, share=1e-3))
            raise ClosureError(
                f"a motion of the joints {names} has no inertia: the links that it moves need "
                "masses (<inertial>, or a density: with_inertias), or the joints an armature"
            )


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
    at = first_order(mechanism, q, task=False)
    v = mechanism.tangent(v)
    rate = np.abs(at.K @ (v / at.column_unit)).max(initial=0.0)
    if rate > CONSISTENT * max(1.0, np.abs(v / at.column_unit).max(initial=0.0)):
        raise ClosureError(
            f"the velocities contradict the loops: a closure row opens at {rate:.3g} a second"
        )
    tau = np.zeros(len(mechanism.inputs))
    if efforts is not None:
        tau = mechanism.input_vector(efforts, "efforts")
    a = Plant(mechanism, loads(mechanism, wrench, gravity, payload)).acceleration(at.q, v, tau)
    return ForwardDynamics(a, a[mechanism.input_v])
