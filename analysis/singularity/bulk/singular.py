"""Singular values of many postures from what the tape of their measures gives."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from closedchain.analysis.singularity.bulk.constraint import ACCURATE, MORE, SQUARED, Constraint
from closedchain.analysis.singularity.bulk.machine import MeasuresCode, Numbers
from closedchain.analysis.singularity.bulk.values import SEARCHES
from closedchain.analysis.singularity.rank_loss import (
    ClosedMotions,
    condition,
    sigma_direct,
    sigma_inverse,
)
from closedchain.closure.tape.layout import sums
from closedchain.closure.tape.machine import Compiled

TICKS = 200  # of a search: some 5 for single eigenvalues, some 30 for coincident ones
ABOVE = 1.0 + 1e-10  # a trace times this is above the largest eigenvalue

Found = dict[str, np.ndarray]


@dataclass(frozen=True, eq=False)
class Singular:
    """Singular values (n,) by name, and whether each posture's are found."""

    found: Found
    settled: np.ndarray


@dataclass(frozen=True, eq=False)
class Workspace:
    """Memory for ``count`` postures at once; one call uses it at a time.

    Attributes
    ----------
    x, rows : (.., count) arrays
        Inputs and outputs of the tape of all measures.
    krylov : (.., count) array
        State of Lanczos' method.
    given, sought : (.., count) arrays
        Parameters and state of the search for eigenvalues.
    """

    code: MeasuresCode
    count: int
    x: np.ndarray
    rows: np.ndarray
    krylov: np.ndarray
    given: np.ndarray
    sought: np.ndarray

    @classmethod
    def of(cls, code: MeasuresCode, count: int) -> Workspace:
        """Memory for a mechanism's code."""
        search, constraint = code.search, code.constraint
        sizes = [
            code.inputs,
            code.everything.code.outputs,
            0 if constraint is None else constraint.lanczos.states,
            search.loop.parameters if search.searches else 0,
            search.states,
        ]
        return cls(code, count, *(np.zeros((size, count)) for size in sizes))

    def evaluated(self, postures: np.ndarray) -> Evaluated:
        """All numbers of postures (n, nq), n at most ``count``, as views into this memory."""
        n = len(postures)
        parts = (self.x, self.rows, self.krylov, self.given, self.sought)
        x, rows, krylov, given, sought = (part[:, :n] for part in parts)
        x[:] = postures.T
        self.code.everything.code.run_into(x, rows)
        return Evaluated(
            self.code, Numbers(self.code.everything.begins, rows), krylov, given, sought
        )


@dataclass(frozen=True, eq=False)
class Evaluated:
    """A workspace's memory for n postures, with the tape's numbers in it."""

    code: MeasuresCode
    numbers: Numbers
    krylov: np.ndarray
    given: np.ndarray
    sought: np.ndarray

    def singular(self) -> Singular:
        """Sigmas and condition."""
        self._iterate()
        self._search()
        values = self.sought[: self.code.search.searches]
        numbers, n = self.numbers, self.numbers.rows.shape[1]
        found = small_values(self.code, values) if self.code.regular else from_matrices(self)
        constraint = self.code.constraint
        if constraint is None:
            return Singular(found | {"sigma_constraint": np.ones(n)}, np.ones(n, dtype=bool))
        value, trace = values[-1], numbers.one("constraint")
        ritz = self.given[-self._ritz :]
        settled = settles(constraint.spread, value, ritz, self.krylov[-1])
        again = np.flatnonzero(~settled & np.isfinite(value))
        if again.size:
            value[again], settled[again] = self._further(constraint, again)
        with np.errstate(divide="ignore", invalid="ignore"):
            settled &= value * trace < 1.0 / SQUARED
            found["sigma_constraint"] = 1.0 / np.sqrt(value)
        return Singular(found, settled)

    def _further(self, constraint: Constraint, which: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Values of some postures after some more of Lanczos' steps, and whether they settled."""
        state = np.ascontiguousarray(self.krylov[:, which])
        factors = self.numbers["constraint"][1 : 1 + constraint.parameters, which]
        constraint.loop.run(state, np.ascontiguousarray(factors), MORE)
        count = constraint.lanczos.steps
        ritz = np.ascontiguousarray(state[-2 * count : -1])
        sought = np.ones((2, which.size))
        sought[0] = sums(ritz[:count]) * ABOVE
        constraint.further.loop.run(sought, ritz, TICKS)
        return sought[0], settles(constraint.spread_further, sought[0], ritz, state[-1])

    def _newest(self, steps: int) -> np.ndarray:
        """Newest entries of the diagonal of Lanczos' matrix."""
        end = len(self.krylov) - (steps + MORE)
        return self.krylov[end - steps : end]

    @property
    def _ritz(self) -> int:
        """Entries of Lanczos' tridiagonal matrix."""
        return max(0, 2 * self.code.search.steps - 1)

    def _iterate(self) -> None:
        """Lanczos' steps."""
        constraint = self.code.constraint
        if constraint is None:
            return
        given = self.numbers["constraint"]
        count = constraint.parameters
        constraint.lanczos.begin(self.krylov, constraint.begin, given[1 + count :])
        constraint.loop.run(self.krylov, given[1 : 1 + count], constraint.steps)

    def _search(self) -> None:
        """Search for all eigenvalues from where they are sure to be beyond."""
        search, count = self.code.search, self.code.search.searches
        if not count:
            return
        state, forms, ritz = self.sought, 0, self._ritz
        state[:count] = 0.0
        state[count:] = 1.0
        if self.code.regular:
            forms = len(self.numbers["forms"])
            self.given[:forms] = self.numbers["forms"]
            ends = np.cumsum([2 * size - 1 for size in search.sizes])
            if search.inverted:
                state[0] = sums(self.given[: ends[0]]) * ABOVE
            state[3] = sums(self.given[ends[1] : ends[2]]) * ABOVE
        if ritz:
            steps = search.steps
            self.given[forms : forms + steps] = self._newest(steps)
            self.given[forms + steps :] = self.krylov[-steps:-1]
            state[count - 1] = sums(self.given[forms : forms + search.steps]) * ABOVE
        search.loop.run(state, self.given, TICKS)


def settles(spread: Compiled, value: np.ndarray, ritz: np.ndarray, last: np.ndarray) -> np.ndarray:
    """Whether Ritz values (n,) are near enough to eigenvalues, by the residual of their vectors.

    ``ritz`` holds Lanczos' tridiagonal matrices, ``last`` the square of the step after them.
    """
    size = spread.run(np.vstack([value, ritz]))[0]
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.sqrt(last / size) < ACCURATE * value)


def small_values(code: MeasuresCode, values: np.ndarray) -> Found:
    """Measures on the closed motions from squares of singular values."""
    direct, inverse, least, most = values[: len(SEARCHES)]
    with np.errstate(divide="ignore", invalid="ignore"):
        return {
            "sigma_direct": np.sqrt(1.0 / direct if code.search.inverted else direct),
            "sigma_inverse": np.sqrt(inverse),
            "condition": np.sqrt(most / least),
        }


def from_matrices(at: Evaluated) -> Found:
    """Measures on the closed motions from A and T, by LAPACK."""
    plan, numbers = at.code.plan, at.numbers
    n = numbers.rows.shape[1]

    def matrix(name: str, rows: int) -> np.ndarray:
        entries = numbers[name].T.reshape(n, rows, plan.motions)
        good = np.isfinite(entries).all(axis=(1, 2), keepdims=True)
        return np.where(good, entries, 0.0)  # what is not finite is not trusted either

    v = ClosedMotions(
        np.empty((n, 0, plan.motions)),
        matrix("inputs", len(plan.mechanism.inputs)),
        matrix("outputs", len(plan.outputs)),
    )
    return {
        "sigma_direct": sigma_direct(v, plan.generic),
        "sigma_inverse": sigma_inverse(v, plan.generic),
        "condition": condition(v, plan.generic),
    }
