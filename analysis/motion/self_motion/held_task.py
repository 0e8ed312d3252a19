"""Closures with the task held: the equations of a self-motion, and the limits of its joints."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pinocchio as pin

from closedchain.closure.mechanism import Mechanism
from closedchain.closure.solve.outcome import Ending
from closedchain.closure.solve.solution_set import Bound
from closedchain.closure.solve.system import System
from closedchain.closure.turns import turning, without_turns

BRANCHING = 1e-4  # singular values below this are not divided by: a branch point stays in place


@dataclass(frozen=True, eq=False)
class HeldTask:
    """Postures that hold a task, as ``tracing`` wants them; points are configurations (nq,).

    Revolute joints are compared up to whole turns, so that a curve closes where the posture comes
    back.
    """

    equations: System

    @property
    def mechanism(self) -> Mechanism:
        """The mechanism."""
        return self.equations.mechanism

    @property
    def size(self) -> int:
        """Number of unknowns: the columns of v that are not locked."""
        return int(self.equations.free.size)

    @cached_property
    def turning(self) -> np.ndarray:
        """Which tangent coordinates are angles of joints with one freedom, (nv,) of bool."""
        return turning(self.mechanism)

    def frame(self, z: np.ndarray) -> None:
        """Nothing needs to be held for these equations to be smooth."""

    def evaluate(self, z: np.ndarray, frame: None = None) -> tuple[np.ndarray, np.ndarray]:
        """Residual (rows,) and Jacobian (rows, size), dimensionless."""
        values, jacobian = self.equations.evaluate(z)
        return values / self.equations.row_scale, jacobian

    def move(self, z: np.ndarray, step: np.ndarray) -> np.ndarray:
        """Posture after a dimensionless step (size,)."""
        return self.equations.move(z, step)

    def change(self, one: np.ndarray, two: np.ndarray) -> np.ndarray:
        """Motion (nv,) [m, rad] from one posture to another, whole turns left out."""
        return without_turns(pin.difference(self.mechanism.model, one, two), self.turning)

    def difference(self, one: np.ndarray, two: np.ndarray) -> np.ndarray:
        """Dimensionless step (size,) from one posture to another, whole turns left out."""
        free = self.equations.free
        return np.asarray((self.change(one, two) / self.mechanism.column_scale)[free])

    def polished(self, z: np.ndarray) -> np.ndarray:
        """Posture with the last rounding taken out by a Gauss-Newton step across the curve."""
        values, jacobian = self.evaluate(z)
        return self.move(z, -np.linalg.lstsq(jacobian, values, rcond=BRANCHING)[0])

    def residuals(self, z: np.ndarray) -> tuple[float, float]:
        """Largest closure row and largest task row [m or rad]."""
        values = np.abs(self.equations.residual(z))
        loops = self.mechanism.rows
        return float(values[:loops].max(initial=0.0)), float(values[loops:].max(initial=0.0))

    @cached_property
    def limits(self) -> list[Bound]:
        """Limits of the unlocked joints, labelled with the name of the input or else the joint."""
        m = self.mechanism
        lower, upper = m.limits
        driven = dict(zip(m.input_q.tolist(), m.inputs, strict=True))
        return [
            Bound(
                index=joint.idx_q,
                column=int(np.searchsorted(self.equations.free, joint.idx_v)),
                unit=float(m.column_scale[joint.idx_v]),
                lower=float(lower[joint.idx_q]),
                upper=float(upper[joint.idx_q]),
                label=driven.get(joint.idx_q, m.model.names[joint.id]),
                ending=Ending.LIMIT,
            )
            for joint in list(m.model.joints)[1:]
            if joint.nq == 1
            and joint.idx_v in self.equations.free
            and np.isfinite([lower[joint.idx_q], upper[joint.idx_q]]).any()
        ]
