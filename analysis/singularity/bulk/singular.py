"""Singular values of many postures from what the tape of their measures gives."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from closedchain.analysis.singularity.bulk.constraint import ACCURATE, MORE, SQUARED, Constraint
from closedchain.analysis.singularity.bulk.machine import MeasuresCode, Numbers
from closedchain.analysis.singularity.bulk.values import SEARCHES, Search
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


def singular_values(code: MeasuresCode, numbers: Numbers) -> Singular:
    """Sigmas and condition of n postures."""
    n = numbers.rows.shape[1]
    krylov = None if code.constraint is None else Krylov.after(code.constraint, numbers)
    values = searched(code, numbers, krylov)
    found = small_values(code, values) if code.regular else from_matrices(code, numbers)
    if krylov is None:
        return Singular(found | {"sigma_constraint": np.ones(n)}, np.ones(n, dtype=bool))
    value = values[-1]
    settled = krylov.settled(value, code.search)
    again = np.flatnonzero(~settled & np.isfinite(value))
    if again.size:
        further = krylov.further(again)
        value[again] = ritz_values(code, further)
        settled[again] = further.settled(value[again], code.search)
    with np.errstate(divide="ignore", invalid="ignore"):
        found["sigma_constraint"] = 1.0 / np.sqrt(value)
        settled &= value * krylov.trace < 1.0 / SQUARED
    return Singular(found, settled)


@dataclass(frozen=True, eq=False)
class Krylov:
    """Lanczos' method for sigma_constraint of n postures, some steps on.

    Attributes
    ----------
    trace : (n,) array
        Of A.
    factors : (.., n) array
    state : (.., n) array
    """

    constraint: Constraint
    trace: np.ndarray
    factors: np.ndarray
    state: np.ndarray

    @classmethod
    def after(cls, constraint: Constraint, numbers: Numbers) -> Krylov:
        """After the steps that the samples needed."""
        given = numbers["constraint"]
        count = len(constraint.lanczos.numbers())
        z = np.repeat(constraint.begin[:, None], given.shape[1], axis=1)
        state = constraint.lanczos.start(np.vstack([z, given[1 + count :]]))
        constraint.loop.run(state, given[1 : 1 + count], constraint.first)
        return cls(constraint, given[0], given[1 : 1 + count], state)

    def further(self, which: np.ndarray) -> Krylov:
        """Some of the postures, some steps further."""
        state = np.ascontiguousarray(self.state[:, which])
        factors = np.ascontiguousarray(self.factors[:, which])
        self.constraint.loop.run(state, factors, MORE)
        return Krylov(self.constraint, self.trace[which], factors, state)

    @property
    def tridiagonal(self) -> np.ndarray:
        """Diagonal and squares beside it, (2 steps - 1, n)."""
        return self.state[-2 * self.constraint.lanczos.steps : -1]

    def settled(self, value: np.ndarray, search: Search) -> np.ndarray:
        """Whether a Ritz value is near enough to an eigenvalue, (n,) of bool."""
        spread = search.spread.run(np.vstack([value, self.tridiagonal]))[0]
        with np.errstate(invalid="ignore", divide="ignore"):
            near = np.sqrt(self.state[-1] / spread) < ACCURATE * value
        return np.asarray(near & np.isfinite(value))


def searched(code: MeasuresCode, numbers: Numbers, krylov: Krylov | None) -> np.ndarray:
    """Values (searches, n) of all searches."""
    search, n = code.search, numbers.rows.shape[1]
    count = search.searches
    state = np.zeros((search.states, n))
    if not count:
        return state
    state[count:] = 1.0
    parameters = []
    if code.regular:
        parameters.append(numbers["forms"])
        ends = np.cumsum([2 * size - 1 for size in search.sizes])
        if search.inverted:
            state[0] = parameters[0][: ends[0]].sum(axis=0) * ABOVE
        state[3] = parameters[0][ends[1] :].sum(axis=0) * ABOVE
    if krylov is not None:
        parameters.append(krylov.tridiagonal)
        state[count - 1] = krylov.tridiagonal[: search.steps].sum(axis=0) * ABOVE
    search.loop.run(state, np.vstack(parameters), TICKS)
    return state[:count]


def ritz_values(code: MeasuresCode, krylov: Krylov) -> np.ndarray:
    """Ritz values (n,) alone."""
    search, n = code.search, krylov.state.shape[1]
    count = search.searches
    state = np.zeros((search.states, n))
    state[-1] = 1.0
    state[count - 1] = krylov.tridiagonal[: search.steps].sum(axis=0) * ABOVE
    others = np.zeros((search.loop.parameters - len(krylov.tridiagonal), n))
    search.loop.run(state, np.vstack([others, krylov.tridiagonal]), TICKS)
    return np.asarray(state[count - 1])


def small_values(code: MeasuresCode, values: np.ndarray) -> Found:
    """Measures on the closed motions from squares of singular values."""
    direct, inverse, least, most = values[: len(SEARCHES)]
    with np.errstate(divide="ignore", invalid="ignore"):
        return {
            "sigma_direct": np.sqrt(1.0 / direct if code.search.inverted else direct),
            "sigma_inverse": np.sqrt(inverse),
            "condition": np.sqrt(most / least),
        }


def from_matrices(code: MeasuresCode, numbers: Numbers) -> Found:
    """Measures on the closed motions from A and T, by LAPACK."""
    plan, n = code.plan, numbers.rows.shape[1]

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
