"""Joints that motors move through closed loops: positions, rates, efforts and inertias both ways.

An ankle on two rods, a knee on a four-bar, a gripper: a controller asks for joints, the motors sit
elsewhere. With x the joints' positions and y(x) those of the motors, J = dy/dx: rates y' = J x',
efforts tau_x = J^T tau_y, inertia of the rotors J^T I J.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product

import numpy as np
from numpy.typing import ArrayLike

from closedchain.analysis.forces.drivetrain import drivetrain
from closedchain.analysis.forces.motor_limits import TOGGLE, effort_limits, speed_limits, toggle
from closedchain.analysis.forces.pinned_motion import PinnedMotion
from closedchain.closure.generic import dimensionless_jacobian
from closedchain.closure.given import number_table, real_array
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.solution import Solutions
from closedchain.urdf.description import Input
from closedchain.urdf.errors import ClosureError, known_names


@dataclass(frozen=True, eq=False)
class Transmission:
    """Joints and the motors that move them, at any position; the rest of the inputs stays at home.

    Positions are those of the driven joints, in front of the gears [m or rad]; many at once are
    (n, k). Postures are on the branch of home.

    Attributes
    ----------
    joint_names, motor_names : tuples of str
        k joints and m motors; motors by the names of their inputs.

    Examples
    --------
    >>> m = cc.load("d1")
    >>> t = cc.transmission(m, ["leg1_R", "leg2_R", "leg3_R"])  # hinges of three legs
    >>> t.motor_names
    ('q1', 'q2', 'q3')
    >>> bool(np.allclose(t.joints_at(t.motors(t.home)), t.home))
    True
    """

    mechanism: Mechanism
    joint_names: tuple[str, ...]
    motor_names: tuple[str, ...]

    @cached_property
    def _motor_v(self) -> tuple[int, ...]:
        names = self.mechanism.inputs
        return tuple(int(self.mechanism.input_v[names.index(n)]) for n in self.motor_names)

    @cached_property
    def _joint_v(self) -> tuple[int, ...]:
        return tuple(joint_column(self.mechanism, name) for name in self.joint_names)

    @cached_property
    def _held_v(self) -> tuple[int, ...]:
        """Inputs that are neither motors nor joints here: they stay at home."""
        taken = {*self._motor_v, *self._joint_v}
        return tuple(int(v) for v in self.mechanism.input_v if int(v) not in taken)

    @cached_property
    def _forth(self) -> PinnedMotion:
        return PinnedMotion(self.mechanism, (*self._joint_v, *self._held_v), self._motor_v)

    @cached_property
    def _back(self) -> PinnedMotion:
        if len(self.motor_names) != len(self.joint_names):
            raise ClosureError(
                f"{len(self.motor_names)} motors ({', '.join(self.motor_names)}) move "
                f"{len(self.joint_names)} joints ({', '.join(self.joint_names)}): motor positions "
                "that fit each other cannot be given freely"
            )
        return PinnedMotion(self.mechanism, (*self._motor_v, *self._held_v), self._joint_v)

    # -- positions -------------------------------------------------------------------------------

    def solutions(self, joint_positions: ArrayLike) -> Solutions:
        """Postures for joint positions (n, k), those that are out of reach told apart."""
        return self._solved(self._forth, number_table(joint_positions, self.joint_names))

    def motors(self, joint_positions: ArrayLike) -> np.ndarray:
        """Motor positions (m,) or (n, m) for joint positions (k,) or (n, k).

        Raises
        ------
        ClosureError
            Malformed numbers, or positions that the straight way from home does not reach.
        """
        return self._answered(self._forth, joint_positions, self.joint_names, self._motor_v)

    def joints_at(self, motor_positions: ArrayLike) -> np.ndarray:
        """Joint positions (k,) or (n, k) for motor positions (m,) or (n, m). Errors alike."""
        return self._answered(self._back, motor_positions, self.motor_names, self._joint_v)

    def _answered(
        self, way: PinnedMotion, values: ArrayLike, names: Sequence[str], wanted: tuple[int, ...]
    ) -> np.ndarray:
        table = number_table(values, names)
        found = self._reached(way, table, names)[:, self._q_of(wanted)]
        return np.asarray(found[0] if np.ndim(values) < 2 else found)

    def _reached(self, way: PinnedMotion, table: np.ndarray, names: Sequence[str]) -> np.ndarray:
        found = self._solved(way, table)
        bad = np.flatnonzero(~found.converged)
        if bad.size:
            first = int(bad[0])
            at = ", ".join(f"{n}={x:.6g}" for n, x in zip(names, table[first], strict=True))
            more = f", and {bad.size - 1} more positions" if bad.size > 1 else ""
            raise ClosureError(f"{at} is not reached: {found[first].message}{more}")
        return np.asarray(found.q)

    def _solved(self, way: PinnedMotion, table: np.ndarray) -> Solutions:
        held = self.mechanism.closed_home()[self._q_of(self._held_v)]
        return way.solve(np.hstack([table, np.tile(held, (len(table), 1))]))

    def _q_of(self, columns: tuple[int, ...]) -> np.ndarray:
        model = self.mechanism.model
        at = {model.idx_vs[j]: model.idx_qs[j] for j in range(1, model.njoints)}
        return np.array([at[v] for v in columns], dtype=int)

    @cached_property
    def home(self) -> np.ndarray:
        """Joint positions (k,) at home."""
        return np.asarray(self.mechanism.closed_home()[self._q_of(self._joint_v)])

    @property
    def joint_units(self) -> tuple[str, ...]:
        """Unit of each joint, "m" or "rad"."""
        return self._units_of(self._joint_v)

    @property
    def motor_units(self) -> tuple[str, ...]:
        """Unit of each motor, "m" or "rad"."""
        return self._units_of(self._motor_v)

    def _units_of(self, columns: tuple[int, ...]) -> tuple[str, ...]:
        return tuple("m" if self.mechanism.translational[v] else "rad" for v in columns)

    def joint_ranges(self, span: float) -> dict[str, tuple[float, float]]:
        """Limits of each joint; ``span`` around home where they are infinite or leave whole turns.

        The span is in radians, or in characteristic lengths for slides.
        """
        lower, upper = (limit[self._q_of(self._joint_v)] for limit in self.mechanism.limits)
        reach = span * self.mechanism.column_scale[list(self._joint_v)]
        turns = (upper - lower > 2.0 * np.pi) & ~self.mechanism.translational[list(self._joint_v)]
        low = np.where(np.isfinite(lower) & ~turns, lower, self.home - reach)
        high = np.where(np.isfinite(upper) & ~turns, upper, self.home + reach)
        return dict(
            zip(self.joint_names, zip(low.tolist(), high.tolist(), strict=True), strict=True)
        )

    def motor_positions(self, q: np.ndarray) -> np.ndarray:
        """Motor positions (n, m) of postures (n, nq)."""
        return np.asarray(q[:, self._q_of(self._motor_v)])

    def within(self, motors: np.ndarray) -> np.ndarray:
        """Whether motor positions (n, m) are within the motors' limits, (n,) of bool."""
        lower, upper = (limit[self._q_of(self._motor_v)] for limit in self.mechanism.limits)
        return np.asarray(((motors >= lower) & (motors <= upper)).all(axis=1))

    # -- rates -----------------------------------------------------------------------------------

    def jacobian(self, joint_positions: ArrayLike) -> np.ndarray:
        """J = d motors / d joints, (m, k) or (n, m, k).

        Raises
        ------
        ClosureError
            As ``motors``; or a position where the joints do not determine the motors' rates.
        """
        table = number_table(joint_positions, self.joint_names)
        rates, good = self.rates(self._reached(self._forth, table, self.joint_names))
        if not good.all():
            first = table[int(np.flatnonzero(~good)[0])]
            at = ", ".join(f"{n}={x:.6g}" for n, x in zip(self.joint_names, first, strict=True))
            raise ClosureError(f"at {at} the motors can move with the joints at rest: a toggle")
        return np.asarray(rates[0] if np.ndim(joint_positions) < 2 else rates)

    def rates(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """J (n, m, k) at closed postures (n, nq), and where it exists, (n,) of bool."""
        rates, good = self._forth.rates(q)
        return rates[:, :, : len(self.joint_names)], good

    def hessian(self, joint_positions: ArrayLike) -> np.ndarray:
        """Second derivatives of the motor positions by those of the joints, (m, k, k), at one."""
        j = self.jacobian(_one(joint_positions, self.joint_names))
        (q,) = self._reached(
            self._forth, number_table(joint_positions, self.joint_names), self.joint_names
        )
        bend = _Bend(self, q)
        k = len(self.joint_names)
        found = np.zeros((*j.shape, k))
        for a in range(k):
            found[:, a, a] = bend.along(np.eye(k)[a])
        for a, b in product(range(k), range(k)):
            if a < b:
                both = bend.along(np.eye(k)[a] + np.eye(k)[b])
                mixed = (both - found[:, a, a] - found[:, b, b]) / 2.0
                found[:, a, b] = found[:, b, a] = mixed
        return found

    def jacobian_rate(self, joint_positions: ArrayLike, joint_rates: ArrayLike) -> np.ndarray:
        """Time derivative of J, (m, k), at joint rates (k,): y'' = J x'' + J' x'."""
        x = _one(joint_rates, self.joint_names)
        return np.asarray(self.hessian(joint_positions) @ x)

    # -- efforts and inertias --------------------------------------------------------------------

    def joint_efforts(self, joint_positions: ArrayLike, motor_efforts: ArrayLike) -> np.ndarray:
        """Efforts (k,) at the joints [N, N m] that motor efforts (m,) make; J^T tau."""
        tau = _one(motor_efforts, self.motor_names)
        return np.asarray(self.jacobian(_one(joint_positions, self.joint_names)).T @ tau)

    def motor_efforts(self, joint_positions: ArrayLike, joint_efforts: ArrayLike) -> np.ndarray:
        """Motor efforts (m,) that make joint efforts (k,); the least ones of more motors.

        Raises
        ------
        ClosureError
            As ``jacobian``; or, at a toggle, efforts that no motor efforts make.
        """
        tau = _one(joint_efforts, self.joint_names)
        j = self.jacobian(_one(joint_positions, self.joint_names))
        found, *_ = np.linalg.lstsq(j.T, tau, rcond=1e-9)
        if np.abs(j.T @ found - tau).max() > 1e-9 * max(1.0, np.abs(tau).max()):
            raise ClosureError("no motor efforts make these joint efforts there: a toggle")
        return np.asarray(found)

    def effort_corners(self, joint_positions: ArrayLike, limits: ArrayLike) -> np.ndarray:
        """Joint efforts at the corners of the motors' limits, (2^m, k) or (n, 2^m, k).

        What the joints can do is their convex hull: a parallelogram for two motors.

        Parameters
        ----------
        limits : (m,) or (2, m) array
            Largest motor efforts [N, N m]; or the least and the largest.
        """
        return np.einsum("...mk,cm->...ck", self.jacobian(joint_positions), self.corners(limits))

    def effort_limits(self, joint_positions: ArrayLike, limits: ArrayLike) -> np.ndarray:
        """Least and largest effort of each joint with the others at zero, (2, k) or (n, 2, k).

        Limits as for ``effort_corners``; zero must lie between them.

        Raises
        ------
        ClosureError
            As ``jacobian``; more or fewer motors than joints; or a toggle.
        """
        if len(self.motor_names) != len(self.joint_names):
            raise ClosureError("effort limits of single joints need as many motors as joints")
        j = self.jacobian(joint_positions)
        if (toggle(j / self.units) < TOGGLE).any():
            raise ClosureError("the joints can move there with the motors at rest: a toggle")
        return effort_limits(j, self.low_high(limits))

    def speed_limits(self, joint_positions: ArrayLike, limits: ArrayLike) -> np.ndarray:
        """Largest speed of each joint with the others at rest, (k,) or (n, k).

        ``limits`` (m,) are the motors' [m/s, rad/s].
        """
        return speed_limits(self.jacobian(joint_positions), self.top_speeds(limits))

    def reflected_inertia(
        self, joint_positions: ArrayLike, inertias: ArrayLike | None = None
    ) -> np.ndarray:
        """Inertia of the motors as the joints feel it, J^T I J, (k, k) or (n, k, k) [kg m^2, kg].

        ``inertias`` (m,) are those of the rotors in front of the gears (times the reduction
        squared); by default what the description says.
        """
        own = self.rotor_inertias if inertias is None else _one(inertias, self.motor_names)
        if (own < 0.0).any():
            raise ClosureError(f"inertias must not be negative, got {own}")
        j = self.jacobian(joint_positions)
        return np.einsum("...mi,m,...mj->...ij", j, own, j)

    def toggle(self, joint_positions: ArrayLike) -> np.ndarray:
        """How far from a toggle, () or (n,): 0 where motors or joints can move without the others.

        The least singular value of J or of its inverse, slides in units of the characteristic
        length. Below 1 everywhere; small where motors and joints move at very different rates.
        """
        return toggle(self.jacobian(joint_positions) / self.units)

    @property
    def rotor_inertias(self) -> np.ndarray:
        """Inertia of each motor in front of its gear (m,) [kg m^2 or kg], as described."""
        return drivetrain(self.mechanism).armature[list(self._motor_v)]

    @cached_property
    def units(self) -> np.ndarray:
        """Unit of each entry of J, (m, k)."""
        scale = self.mechanism.column_scale
        return np.asarray(scale[list(self._motor_v), None] / scale[None, list(self._joint_v)])

    def top_speeds(self, limits: ArrayLike) -> np.ndarray:
        """Largest speeds (m,) of the motors, checked."""
        found = _one(limits, self.motor_names)
        if (found < 0.0).any():
            raise ClosureError(f"largest speeds must not be negative, got {found}")
        return found

    def low_high(self, limits: ArrayLike) -> np.ndarray:
        """Limits (2, m) of the motors, the least first, from (m,) or (2, m); checked."""
        found = real_array(limits, "limits")
        m = len(self.motor_names)
        if found.shape == (m,):
            found = np.array([-found, found])
        if found.shape != (2, m) or not np.isfinite(found).all() or (found[0] > found[1]).any():
            raise ClosureError(f"limits must be ({m},) or (2, {m}) numbers, the least first")
        return found

    def corners(self, limits: ArrayLike) -> np.ndarray:
        """Motor efforts (2^m, m) with each at one of its limits, (m,) or (2, m)."""
        return np.array(list(product(*self.low_high(limits).T)))

    @cached_property
    def driven_by_joints(self) -> Mechanism:
        """The same mechanism with the joints, and the inputs held at home, as its inputs.

        ``cc.export_code`` of it writes the way from joints to motors as a program; that of the
        mechanism itself has the way back.
        """
        m = self.mechanism
        names = [m.model.names[i] for i in range(1, m.model.njoints)
                 if m.model.idx_vs[i] in self._held_v]  # fmt: skip
        inputs = tuple(Input(name, name) for name in (*self.joint_names, *names))
        description = replace(m.description, inputs=inputs)
        return replace(m, description=description, inputs=tuple(i.name for i in inputs))


@dataclass(frozen=True, eq=False)
class _Bend:
    """Accelerations of the motors while joints move evenly through a posture."""

    of: Transmission
    q: np.ndarray

    def along(self, joint_rates: np.ndarray) -> np.ndarray:
        """Second derivative (m,) of the motor positions along the joints' straight way."""
        t, m = self.of, self.of.mechanism
        joints, held = list(t._joint_v), list(t._held_v)
        motion = PinnedMotion(m, (*joints, *held), tuple(range(m.model.nv)))
        rates, _ = motion.rates_at(self.q)
        scale = m.column_scale
        v = scale * (rates[:, : len(joints)] @ (joint_rates / scale[joints]))
        drift = m.workspace.drift(self.q, v) / m.row_scale
        k = dimensionless_jacobian(m, self.q)[:, list(motion.problem.free)]
        a = np.zeros(m.model.nv)
        a[list(motion.problem.free)] = np.linalg.lstsq(k, -drift, rcond=1e-9)[0]
        return np.asarray((a * scale)[list(t._motor_v)])


def joint_column(mechanism: Mechanism, name: str) -> int:
    """Tangent coordinate of a joint of the tree with one freedom. Raises ``ClosureError``."""
    model = mechanism.model
    single = [model.names[i] for i in range(1, model.njoints) if model.nvs[i] == 1]
    if name not in single:
        raise ClosureError(known_names(name, "joint of the tree with one freedom", single))
    return int(model.idx_vs[model.getJointId(name)])


def _one(values: ArrayLike, names: Sequence[str]) -> np.ndarray:
    found = number_table(values, names)
    if len(found) != 1:
        raise ClosureError(f"expected {len(names)} numbers for {' '.join(names)}")
    return np.asarray(found[0])
