"""A mechanism under constant loads: its accelerations, energy, and how it is put back on its loops.

M a + h = S^T tau + K^T lambda with K a = -Kdot v. With Z a basis of ker K and a_p a solution of
K a = -Kdot v: Z^T M Z y = Z^T (S^T tau - h - M a_p), a = a_p + Z y. Pinocchio gives M and h,
machine code the rest. Where its pivots are small, or where no posture was found at which the two
could be compared, LAPACK does it by the generic rank of K, so that redundant rows do no harm.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from closedchain.analysis.first_order import moving_joints
from closedchain.analysis.forces.closed_motions import FACTS, ClosedMotions, closed_motions
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
from closedchain.closure.generic import dimensionless_jacobian, sampled_rank
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.ranks import doubtful
from closedchain.closure.solve.control import CLOSED
from closedchain.closure.solve.problem import problem_of
from closedchain.closure.tape.machine import Compiled
from closedchain.closure.tape.verified import POSTURES, agree
from closedchain.urdf.errors import ClosureError

SLIDING = 1e-3
"""Rate [rad/s or m/s] at which dry friction has three quarters of its size: F tanh(v / SLIDING)."""

SINGULAR = 1e-8  # share of the largest singular value of K below which a rank is lost
ZERO = 1e-12  # share of it that is rounding
MASSLESS = 1e-12  # share of the largest inertia of a motion that is none
PIVOT = 1e-3  # dimensionless: below it the elimination loses digits, and LAPACK is asked
CONSISTENT = 1e-6  # by which velocities may miss what the loops allow, dimensionless
MOST_KEPT = 8  # plants of one mechanism and thread
SPREAD = 1e8  # of the inertias of motions, beyond which it is asked as well


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
class Fit:
    """A posture, and a velocity there, seen from the loops.

    Attributes
    ----------
    gap : float
        Largest closure row [m, rad].
    step : (nv,) array
        The least one that closes the loops to first order [m, rad].
    v : (nv,) array
        The nearest velocity that the loops allow [m/s, rad/s].
    basis : (nv, n) array
        A basis N of the closed motions, dimensionless.
    side : float
        det [K; N^T] with independent rows of K, but for a factor above zero.
    """

    gap: float
    step: np.ndarray
    v: np.ndarray
    basis: np.ndarray
    side: float


@dataclass(frozen=True, eq=False)
class Plant:
    """A mechanism under constant loads, ready to be asked at many states. For one thread."""

    mechanism: Mechanism
    on: Loads

    @cached_property
    def rank(self) -> int:
        """Generic rank of K."""
        return sampled_rank(self.mechanism).rank.value if self.mechanism.rows else 0

    @cached_property
    def model(self) -> pin.Model:
        """The tree with payloads, gravity and armatures."""
        found = self.on.model.copy()
        found.gravity = pin.Motion(self.on.gravity, np.zeros(3))
        found.armature = self.train.armature
        return found

    @cached_property
    def train(self) -> Drivetrain:
        """Rotors, damping and friction."""
        return drivetrain(self.mechanism)

    def state(self, q: ArrayLike, v: ArrayLike | None) -> tuple[np.ndarray, np.ndarray]:
        """Check a closed posture (nq,) and velocities (nv,) that the loops allow; None at rest.

        Raises
        ------
        ClosureError
            Malformed numbers, an open posture, velocities that the loops contradict.
        """
        m = self.mechanism
        q = m.configuration(q)
        gap = float(np.abs(m.workspace.residual(q)).max(initial=0.0))
        if gap >= CLOSED:
            raise ClosureError(f"the loops are open there by {gap:.3g}: use cc.close(m, q).q")
        rates = np.zeros(m.model.nv) if v is None else m.tangent(v)
        fit = self.fit(q, rates).v
        off = float(np.abs((rates - fit) / m.column_scale).max(initial=0.0))
        if off > CONSISTENT * max(1.0, float(np.abs(rates / m.column_scale).max(initial=0.0))):
            raise ClosureError(f"the velocities contradict the loops: they are off by {off:.3g}")
        return q, fit

    # -- accelerations ---------------------------------------------------------------------------

    def acceleration(self, q: np.ndarray, v: np.ndarray, tau: np.ndarray) -> np.ndarray:
        """Accelerations (nv,) under input efforts (n_inputs,).

        Raises
        ------
        ClosureError
            A motion without inertia, or a posture at which the closures lose rank.
        """
        effort = self.driving(tau) - self.bias(q, v)
        if not self._trusted:
            return self._by_lapack(q, v, self.mass(q), effort)
        pin.crba(self.model, self._data, q)
        ask = self._asked
        least, spread, smallest = ask(q, v, self._entries(), effort)[:FACTS]
        if abs(least) > PIVOT and smallest > 0.0 and spread < SPREAD:
            return np.array(ask.answers)
        return self._by_lapack(q, v, self.mass(q), effort)

    def _by_lapack(
        self, q: np.ndarray, v: np.ndarray, mass: np.ndarray, effort: np.ndarray
    ) -> np.ndarray:
        m, c = self.mechanism, self.mechanism.column_scale
        here = self.closed(q)
        if here.least < SINGULAR:
            raise ClosureError(
                "the closures lose rank there (a constraint singularity): the accelerations are "
                "not determined"
            )
        start = -here.inverse @ (m.workspace.drift(q, v) / m.row_scale)
        mass = mass * c * c[:, None]
        inertia = here.basis.T @ mass @ here.basis
        self._refuse_massless(inertia, here.basis)
        own = np.linalg.solve(inertia, here.basis.T @ (c * effort - mass @ start))
        return np.asarray(c * (start + here.basis @ own))

    def mass(self, q: np.ndarray) -> np.ndarray:
        """Mass matrix (nv, nv) of the tree, rotors included."""
        upper = np.triu(pin.crba(self.model, self._data, q))
        return np.asarray(upper + np.triu(upper, 1).T)

    def bias(self, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Efforts (nv,) that the tree needs without acceleration: velocities, loads, friction."""
        found = np.array(pin.nonLinearEffects(self.model, self._data, q, v))
        if self.on.wrenches:
            found += self._against_wrenches(q)
        return found + self.resistance(v) if self._resists else found

    def power(self, q: np.ndarray, v: np.ndarray) -> float:
        """Power [W] of the wrenches at named frames, less what damping and friction take."""
        found = -float(self.resistance(v) @ v) if self._resists else 0.0
        return found - float(self._against_wrenches(q) @ v) if self.on.wrenches else found

    def _against_wrenches(self, q: np.ndarray) -> np.ndarray:
        only = Loads(np.zeros(3), self.on.wrenches, self.on.model)
        forces = added(list(body_forces(self.mechanism, q, only).values()), self.model)
        return needed_efforts(self.mechanism, only, q, forces)

    def resistance(self, v: np.ndarray) -> np.ndarray:
        """Efforts (nv,) of damping and of friction, which sets in smoothly."""
        return np.asarray(self.train.damping * v + self.train.friction * np.tanh(v / SLIDING))

    @cached_property
    def _resists(self) -> bool:
        return bool(self.train.damping.any() or self.train.friction.any())

    def driving(self, tau: np.ndarray) -> np.ndarray:
        """Efforts (nv,) at the tree's joints of input efforts (n_inputs,)."""
        found = np.zeros(self.mechanism.model.nv)
        found[self.mechanism.input_v] = tau
        return found

    def energy(self, q: np.ndarray, v: np.ndarray) -> float:
        """Kinetic energy, rotors included, and potential energy of gravity [J]."""
        kinetic = pin.computeKineticEnergy(self.model, self._data, q, v)
        return float(kinetic + pin.computePotentialEnergy(self.model, self._data, q))

    def _refuse_massless(self, inertia: np.ndarray, basis: np.ndarray) -> None:
        if not inertia.size:
            return
        sizes, axes = np.linalg.eigh(inertia)
        if sizes[0] <= MASSLESS * max(sizes[-1], 0.0):
            motion = basis @ axes[:, 0] * self.mechanism.column_scale
            names = ", ".join(moving_joints(self.mechanism, motion, share=1e-3))
            raise ClosureError(
                f"a motion of the joints {names} has no inertia: the links that it moves need "
                "masses (<inertial>, a material with a density, with_inertias, --density), or the "
                "joints an armature"
            )

    # -- the loops -------------------------------------------------------------------------------

    def closed(self, q: np.ndarray) -> Closed:
        """The closed motions at a posture (nq,), by the generic rank and LAPACK."""
        m, r = self.mechanism, self.rank
        if not m.rows:
            return Closed(np.eye(m.model.nv), np.zeros((m.model.nv, 0)), 1.0, np.zeros(0))
        values, jacobian = m.workspace.evaluate(q)
        k = jacobian * m.column_scale / m.row_scale[:, None]
        u, s, vt = np.linalg.svd(k)
        inverse = (vt[:r].T / np.maximum(s[:r], 1e-300)) @ u[:, :r].T
        return Closed(vt[r:].T, inverse, float(s[r - 1] / s[0]), values / m.row_scale)

    def fit(self, q: np.ndarray, v: np.ndarray) -> Fit:
        """How far a state is from the loops, and the least changes that close them."""
        if not self._trusted:
            return self._fit_by_lapack(q, v)
        ask, nv = self._fitting, self.mechanism.model.nv
        least, gap, side = ask(q, v)[:FACTS].tolist()
        if not abs(least) > PIVOT:
            return self._fit_by_lapack(q, v)
        found = np.array(ask.answers)
        return Fit(gap, found[:nv], found[nv : 2 * nv], found[2 * nv :].reshape(nv, -1), side)

    def _fit_by_lapack(self, q: np.ndarray, v: np.ndarray) -> Fit:
        m, c, here = self.mechanism, self.mechanism.column_scale, self.closed(q)
        side = 1.0
        if m.rows:
            _, jacobian = m.workspace.evaluate(q)
            kept = list(problem_of(m).kept)
            k = (jacobian * c / m.row_scale[:, None])[kept]
            side = float(np.linalg.det(np.vstack([k, here.basis.T])))
        return Fit(
            gap=float(np.abs(here.values * m.row_scale).max(initial=0.0)),
            step=-c * (here.inverse @ here.values),
            v=c * (here.basis @ (here.basis.T @ (v / c))),
            basis=here.basis,
            side=side,
        )

    # -- machine code ----------------------------------------------------------------------------

    @cached_property
    def _code(self) -> ClosedMotions:
        return closed_motions(self.mechanism)

    @cached_property
    def _trusted(self) -> bool:
        """Whether machine code was compared with LAPACK; once for each mechanism."""
        known, name = self.mechanism.known, "forces.closed_motions.agree"
        if name not in known:
            known[name] = _agree(self._code)
        return bool(known[name])

    @cached_property
    def _data(self) -> pin.Data:
        return self.model.createData()

    @cached_property
    def _asked(self) -> Ask:
        return Ask(self._code.accelerations)

    @cached_property
    def _fitting(self) -> Ask:
        return Ask(self._code.fit)

    @cached_property
    def _entries(self) -> Callable[[], np.ndarray]:
        """The entries of the last mass matrix that machine code asks for."""
        # Pinocchio's matrix lies column by column and stays where it is
        flat = self._data.M.T.reshape(-1)
        places = np.array([a * self.model.nv + b for b, a in self._code.pairs], dtype=int)
        return lambda: flat.take(places)


def plant_under(
    mechanism: Mechanism,
    wrench: Wrenches | None = None,
    gravity: Gravity = True,
    payload: Mapping[str, float] | None = None,
) -> Plant:
    """A plant, loads as for ``statics``; under weights alone it is made once a thread."""
    on = loads(mechanism, wrench, gravity, payload)
    if on.wrenches or payload:
        return Plant(mechanism, on)
    kept = mechanism.known.setdefault("forces.plants", threading.local())
    plants: dict[bytes, Plant] = kept.__dict__.setdefault("plants", {})
    if len(plants) > MOST_KEPT:  # gravity that changes from call to call
        plants.clear()
    return plants.setdefault(on.gravity.tobytes(), Plant(mechanism, on))


class Ask:
    """A program with its arrays, for one posture after the other."""

    def __init__(self, code: Compiled) -> None:
        """Make the arrays."""
        self._given, self._out = np.zeros((code.inputs, 1)), np.zeros((code.outputs, 1))
        self.given, self.out = self._given[:, 0], self._out[:, 0]
        self.answers = self.out[FACTS:]
        self._run: Any = code.bound(self._given, self._out)

    def __call__(self, *parts: np.ndarray) -> np.ndarray:
        """Outputs (outputs,) for inputs in parts; they hold until the next call."""
        np.concatenate(parts, out=self.given)
        self._run()
        return self.out


def _agree(code: ClosedMotions) -> bool:
    """Compare with LAPACK at two postures, all bodies with unit inertia; whether that could be.

    Raises
    ------
    TapeError
        They differ.
    """
    m = code.mechanism
    model = m.model.copy()
    for i in range(1, model.njoints):
        model.inertias[i] = pin.Inertia(1.0, np.full(3, 0.1 * m.length), m.length**2 * np.eye(3))
    plant = Plant(m, Loads(np.zeros(3), {}, model))
    rng, compared = np.random.default_rng(0), False
    for q in problem_of(m).regular[-POSTURES:]:
        if doubtful(dimensionless_jacobian(m, q), ZERO, SINGULAR):
            continue  # rows may depend on each other but for the posture's error
        v, effort = rng.standard_normal((2, model.nv)) * [m.column_scale, 1.0 / m.column_scale]
        mass, by_lapack = plant.mass(q), plant._fit_by_lapack(q, v)
        entries = np.array([mass[pair] for pair in code.pairs])
        seen = np.array(Ask(code.fit)(q, v))
        v = by_lapack.v
        found = np.array(Ask(code.accelerations)(q, v, entries, effort))
        if not (min(abs(found[0]), abs(seen[0])) > PIVOT and found[1] < SPREAD):
            continue
        scale = m.column_scale
        expected = plant._by_lapack(q, v, mass, effort) / scale
        size = max(1.0, np.abs(expected).max(initial=0.0))
        agree(f"accelerations of {m.name!r}", found[FACTS:] / scale / size, expected / size)
        velocities = seen[FACTS + model.nv : FACTS + 2 * model.nv]
        agree(f"closed motions of {m.name!r}", velocities / scale, by_lapack.v / scale)
        compared = True
    return compared
