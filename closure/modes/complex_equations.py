"""The equations of a problem on complex numbers: kept rows and their Jacobian in the unknowns."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from closedchain.closure.modes.complex_tape import ComplexTape, complex_tape
from closedchain.closure.solve.problem import Problem
from closedchain.closure.tape.expression import Graph
from closedchain.closure.tape.rows import Kinematics
from closedchain.closure.tape.vectors import turned_quaternion

MISSED = 1e-8
"""Largest row, dimensionless, of a posture; beyond, a solution of the kept rows is none."""


@dataclass(frozen=True, eq=False)
class ComplexEquations:
    """Kept rows of a problem and their Jacobian in its unknowns, for many complex postures."""

    problem: Problem

    @cached_property
    def size(self) -> int:
        """Number of unknowns."""
        return len(self.problem.free)

    @cached_property
    def _everything(self) -> tuple[ComplexTape, np.ndarray, np.ndarray, int]:
        """All rows, then the senses of closed joints, then the Jacobian of all rows by entries."""
        problem, nq = self.problem, self.problem.mechanism.model.nq
        g = Graph()
        k = Kinematics(problem.mechanism, g, g.inputs(0, nq), upright=False)
        rows = problem.rows(k, g.inputs(nq, problem.prescribed))
        place = {v: i for i, v in enumerate(problem.free)}
        senses = k.senses
        entries = [
            (i, place[v], entry)
            for i, row in enumerate(rows.entries)
            for v, entry in row.items()
            if v in place
        ]
        out = [*rows.values, *senses, *(entry for _, _, entry in entries)]
        tape = complex_tape(g.tape(out, nq + problem.prescribed))
        at = np.array([(i, j) for i, j, _ in entries], dtype=int).reshape(-1, 2)
        return tape, at[:, 0], at[:, 1], len(senses)

    def all_rows(self, q: np.ndarray, targets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """All rows (n, rows) and their Jacobians (n, rows, size), as ``at``."""
        tape, row, column, senses = self._everything
        count = self.problem.units.size
        found = tape.run(np.hstack([q, targets]).T.astype(complex))
        jacobian = np.zeros((len(q), count, self.size), dtype=complex)
        jacobian[:, row, column] = found[count + senses :].T
        return np.ascontiguousarray(found[:count].T), jacobian

    def proper(self, q: np.ndarray, targets: np.ndarray) -> np.ndarray:
        """Which postures (n, nq) meet all rows, no closed joint mirrored, (n,) of bool."""
        if not len(q):
            return np.zeros(0, dtype=bool)
        tape, _, _, senses = self._everything
        count = self.problem.units.size
        targets = np.broadcast_to(targets, (len(q), self.problem.prescribed))
        found = tape.run(np.hstack([q, targets]).T.astype(complex))
        closed = np.abs(found[:count]).max(axis=0, initial=0.0) < MISSED
        return np.asarray(closed & (found[count : count + senses].real > 0.0).all(axis=0))

    @cached_property
    def pattern(self) -> np.ndarray:
        """Which entries (rows, unknowns) of the Jacobian are not always zero."""
        problem, nq = self.problem, self.problem.mechanism.model.nq
        g = Graph()
        k = Kinematics(problem.mechanism, g, g.inputs(0, nq), upright=False)
        rows = problem.rows(k, g.inputs(nq, problem.prescribed))
        return np.array([[v in rows.entries[r] for v in problem.free] for r in problem.kept])

    def at(self, q: np.ndarray, targets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Kept rows (n, r) and Jacobians (n, r, size) at postures (n, nq), targets (n, m)."""
        values, jacobian = self.all_rows(q, targets)
        kept = list(self.problem.kept)
        return values[:, kept], jacobian[:, kept]

    def moved(self, q: np.ndarray, step: np.ndarray) -> np.ndarray:
        """Postures (n, nq) after dimensionless steps (n, size), complex as they may be."""
        m, found = self.problem.mechanism, q.copy()
        place = {v: i for i, v in enumerate(self.problem.free)}
        model = m.model
        for j in range(1, model.njoints):
            iq, iv = model.idx_qs[j], model.idx_vs[j]
            if model.nvs[j] == 1:
                if iv in place:
                    found[:, iq] += m.column_scale[iv] * step[:, place[iv]]
                continue
            change = [
                step[:, place[iv + i]] if iv + i in place else np.zeros(len(q)) for i in range(6)
            ]
            for i in range(3):
                found[:, iq + i] += m.length * change[i]
            found[:, iq + 3 : iq + 7] = _turned(q[:, iq + 3 : iq + 7], change[3:])
        return found


def equations_of(problem: Problem) -> ComplexEquations:
    """Equations of a problem, made once."""
    key = "modes.equations", problem.pinned, problem.goals
    found: ComplexEquations = problem.mechanism.known.setdefault(key, ComplexEquations(problem))
    return found


def normalised(quaternions: np.ndarray) -> np.ndarray:
    """Quaternions (n, 4) divided by the root of their sum of squares, without conjugates."""
    with np.errstate(all="ignore"):  # what is not finite is looked for later
        size = np.sqrt((quaternions * quaternions).sum(axis=1, keepdims=True))
        return np.asarray(quaternions / size)


def _turned(quaternion: np.ndarray, by: list[np.ndarray]) -> np.ndarray:
    """Quaternions (n, 4) turned by small rotation vectors, along the axes outside."""
    return normalised(np.stack(turned_quaternion(list(quaternion.T), by), axis=1))
