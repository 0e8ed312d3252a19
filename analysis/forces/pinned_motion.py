"""Postures and rates of a mechanism some of whose joints are prescribed, for many postures at once.

The closures, eliminated in the joints that are left free, give the rates of all joints for unit
rates of the prescribed ones, as machine code. Where a pivot is small the elimination loses digits,
and LAPACK decides.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from closedchain.closure.generic import dimensionless_jacobian
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.position import solve_many
from closedchain.closure.ranks import least_solution, numerical_rank
from closedchain.closure.solution import Solutions
from closedchain.closure.solve.problem import Problem, problem_of
from closedchain.closure.tape.expression import Graph
from closedchain.closure.tape.machine import Compiled, compiled
from closedchain.closure.tape.verified import POSTURES, agree

PIVOT = 1e-6  # dimensionless: digits are lost in proportion to the smallest pivot


@dataclass(frozen=True, eq=False)
class PinnedMotion:
    """How some joints move others.

    Attributes
    ----------
    pinned : tuple of int
        Tangent coordinates of the joints that are prescribed; of one freedom each.
    wanted : tuple of int
        Tangent coordinates of those asked for.
    """

    mechanism: Mechanism
    pinned: tuple[int, ...]
    wanted: tuple[int, ...]

    @cached_property
    def problem(self) -> Problem:
        """The position problem."""
        return problem_of(self.mechanism, self.pinned)

    def solve(self, values: np.ndarray, guess: np.ndarray | None = None) -> Solutions:
        """Postures for values (n, pinned), on the branch of the guess, home by default."""
        return solve_many(self.problem, values, guess)

    def rates(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Rates (n, wanted, pinned) at closed postures (n, nq), SI units, and where they exist.

        The second array, (n,) of bool, is false where the pinned joints do not determine the
        others; the rates there are zeros.
        """
        numbers = self._code.run(np.ascontiguousarray(q.T))
        found = numbers[1:].reshape(len(self.wanted), len(self.pinned), -1).transpose(2, 0, 1)
        found, good = np.array(found), np.ones(len(q), dtype=bool)
        for i in np.flatnonzero(~(np.abs(numbers[0]) > PIVOT)):
            found[i], good[i] = self.rates_at(q[i])
        return found * self._units, good

    def rates_at(self, q: np.ndarray) -> tuple[np.ndarray, bool]:
        """The same at one posture by LAPACK, dimensionless."""
        k = dimensionless_jacobian(self.mechanism, q)
        free, pinned = list(self.problem.free), list(self.pinned)
        rank = numerical_rank(k[:, free]).value
        if rank < len(self.problem.kept):
            return np.zeros((len(self.wanted), len(pinned))), False
        whole = np.zeros((self.mechanism.model.nv, len(pinned)))
        whole[pinned] = np.eye(len(pinned))
        whole[free] = least_solution(k[:, free], -k[:, pinned], rank)[0]
        return whole[list(self.wanted)], True

    @cached_property
    def _units(self) -> np.ndarray:
        scale = self.mechanism.column_scale
        return np.asarray(scale[list(self.wanted), None] / scale[None, list(self.pinned)])

    @cached_property
    def _code(self) -> Compiled:
        """Smallest pivot, then the rates row by row; compared with LAPACK at two postures."""
        g, model = Graph(), self.mechanism.model
        closures = self.problem.eliminated(g)
        zero, one = g.constant(0.0), g.constant(1.0)
        factors = closures.factors
        columns = []
        for pin in self.pinned:
            right = [-row[pin] if pin in row else zero for row in closures.entries]
            columns.append({**factors.shortest(right), pin: one})
        numbers = [g.lift(column.get(v, zero)) for v in self.wanted for column in columns]
        code = compiled(g.tape([g.lift(factors.least), *numbers], model.nq))
        tried = closures.samples[-POSTURES:]
        expected = np.array([self.rates_at(q)[0].ravel() for q in tried]).T
        agree(f"rates of {self.mechanism.name!r}", code.run(tried.T.copy())[1:], expected)
        return code
