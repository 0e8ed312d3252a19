"""Singular values of many postures from what the tape of their measures gives."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from closedchain.analysis.singularity.bulk.constraint import ACCURATE, SQUARED
from closedchain.analysis.singularity.bulk.machine import MeasuresCode, Numbers
from closedchain.analysis.singularity.bulk.values import SEARCHES
from closedchain.analysis.singularity.rank_loss import (
    ClosedMotions,
    condition,
    sigma_direct,
    sigma_inverse,
)

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
        size = constraint.spread.run(np.vstack([value, self.given[-self._ritz :]]))[0]
        with np.errstate(divide="ignore", invalid="ignore"):
            settled = np.sqrt(self.krylov[-1] / size) < ACCURATE * value
            settled &= value * trace < 1.0 / SQUARED
            found["sigma_constraint"] = 1.0 / np.sqrt(value)
        return Singular(found, settled)

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
                state[0] = self.given[: ends[0]].sum(axis=0) * ABOVE
            state[3] = self.given[ends[1] : ends[2]].sum(axis=0) * ABOVE
        if ritz:
            self.given[forms:] = self.krylov[-ritz - 1 : -1]
            state[count - 1] = self.given[forms : forms + search.steps].sum(axis=0) * ABOVE
        search.loop.run(state, self.given, TICKS)


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
