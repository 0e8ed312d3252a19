"""Equations of a mechanism at single postures: values and Jacobian, from machine code.

What solvers drive to zero: closures, then goals for frames, dimensionless, in unknowns that are
coordinates of Pinocchio's v. Rows are divided and columns multiplied by the mechanism's units
(``length`` or 1), so that ranks, steps and determinants mean the same for lengths and angles.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from weakref import WeakKeyDictionary

import numpy as np
import pinocchio as pin

from closedchain.closure.mechanism import Mechanism
from closedchain.closure.solve.problem import POSE, pose_of
from closedchain.closure.tape.machine import Compiled, compiled
from closedchain.closure.tape.rows import kinematics
from closedchain.closure.unknowns import Unknowns
from closedchain.urdf.description import OUTPUTS

Components = tuple[tuple[str, tuple[str, ...]], ...]


@dataclass(frozen=True, eq=False)
class System(Unknowns):
    """Closures and goals of a mechanism in some of its coordinates."""

    @cached_property
    def row_scale(self) -> np.ndarray:
        """Unit of each row, (rows,)."""
        return self._code.units

    @cached_property
    def _code(self) -> Code:
        return code_of(self.mechanism, tuple((g.frame, g.outputs) for g in self.goals))

    @cached_property
    def _targets(self) -> np.ndarray:
        poses = [pin.SE3ToXYZQUAT(g.target) for g in self.goals]
        return np.concatenate(poses) if poses else np.zeros(0)

    @cached_property
    def _places(self) -> tuple[np.ndarray, np.ndarray]:
        """Which entries of the code are wanted, and where in the transposed Jacobian they go."""
        column = np.full(self.mechanism.model.nv, -1)
        column[self.free] = np.arange(len(self.free))
        rows, columns = self._code.places
        wanted = np.flatnonzero(column[columns] >= 0)
        return wanted, column[columns[wanted]] * self._code.units.size + rows[wanted]

    def evaluate(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Residual (rows,) [m, rad] and dimensionless Jacobian (rows, free) at ``q`` (nq,)."""
        numbers = self._code.run(q, self._targets)
        rows = self._code.units.size  # subclasses may add rows of their own
        wanted, places = self._places
        matrix = np.zeros(len(self.free) * rows)
        matrix[places] = numbers[rows:][wanted]
        # stored column by column: the order in memory that LAPACK wants
        return numbers[:rows], matrix.reshape(len(self.free), rows).T

    def residual(self, q: np.ndarray) -> np.ndarray:
        """Residual (rows,) [m, rad] alone at ``q``."""
        return self._code.run(q, self._targets)[: self._code.units.size]


@dataclass(frozen=True, eq=False)
class Code:
    """Machine code of the rows of a mechanism and of goals, and of all entries of their Jacobian.

    Attributes
    ----------
    code : Compiled
        From q and the goals' poses to rows [m, rad], then entries, dimensionless.
    places : two (entries,) arrays
        Row and column of v of each entry.
    units : (rows,) array
        Unit of each row: ``length`` or 1.
    """

    code: Compiled
    places: tuple[np.ndarray, np.ndarray]
    units: np.ndarray

    def run(self, q: np.ndarray, targets: np.ndarray) -> np.ndarray:
        """Rows, then entries, at one posture."""
        x = np.concatenate([q, targets])[:, None]
        return self.code.run(x)[:, 0]


_CODES: WeakKeyDictionary[Mechanism, dict[Components, Code]] = WeakKeyDictionary()


def code_of(mechanism: Mechanism, goals: Components) -> Code:
    """Machine code for goals given as (frame, components), made once for each mechanism."""
    known = _CODES.setdefault(mechanism, {})
    if goals not in known:
        known[goals] = _code(mechanism, goals)
    return known[goals]


def _code(mechanism: Mechanism, goals: Components) -> Code:
    k = kinematics(mechanism, upright=False)
    nq = mechanism.model.nq
    rows = k.closures
    for i, (frame, outputs) in enumerate(goals):
        target = pose_of(k.graph.inputs(nq + POSE * i, POSE), mechanism.length)
        rows = rows + k.goal(frame, [OUTPUTS.index(n) for n in outputs], target)
    entries = [k.own(row) for row in rows.entries]
    places = [(r, v) for r, row in enumerate(entries) for v in row]
    values = [unit * value for unit, value in zip(rows.units, rows.values, strict=True)]
    tape = k.graph.tape([*values, *(entries[r][v] for r, v in places)], nq + POSE * len(goals))
    where = np.array(places, dtype=int).reshape(-1, 2)
    return Code(compiled(tape, lanes=1), (where[:, 0], where[:, 1]), np.array(rows.units))
