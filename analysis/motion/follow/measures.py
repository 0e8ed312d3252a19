"""Distances of a posture from singularities as it is driven, and their exact slopes.

The measures are those of ``singularity.rank_loss``. With S either the choice of inputs or J,
each is a singular value sigma = |S x| of a closed motion x with K x = 0 and |P x| = 1, where K, J
and the joint rates P depend on the posture. Along a path of postures, with u = S x / sigma,

    sigma' = u^T S' x - sigma (P x)^T P' x - mu^T K' x,   K^T mu = S^T u - sigma P^T P x,

by Lagrange's rule: mu exists, since the right side vanishes on all closed motions, and what is left
free of it, in redundant rows, meets no K' x. Locked inputs are left out of the columns. The terms
with K' and J' are exact, from machine code; P' along the null motion is a central difference of the
exact P, which no basis enters.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from closedchain.analysis.first_order import FirstOrder, first_order
from closedchain.analysis.motion.follow.problem import Problem
from closedchain.analysis.singularity.classify import SINGULAR
from closedchain.analysis.singularity.rank_loss import ClosedMotions, closed_motions, entry
from closedchain.analysis.singularity.sets.postures_at import first_order_code
from closedchain.analysis.structure.mobility import generic_rank
from closedchain.closure.generic import generic_ranks
from closedchain.closure.ranks import rank_of_singular_values

KEPT = 3
"""Smallest singular values of each kind that are kept, so that two of them may cross."""

_STEP = 1e-5  # dimensionless way of the central differences


@dataclass(frozen=True, eq=False)
class Sigmas:
    """Singular values of a posture that vanish at singularities.

    Attributes
    ----------
    direct, inverse, constraint : float
        As ``cc.classify`` gives them.
    driven : float
        The inverse one of the closed motions with the locked inputs at rest. 0 also where outputs
        are asked for that the mechanism does not have, and where closures and locks lose rank.
    """

    direct: float
    inverse: float
    constraint: float
    driven: float

    @property
    def smallest(self) -> float:
        """Distance to the nearest singularity of the mechanism as it is driven."""
        return min(self.direct, self.driven)


@dataclass(frozen=True, eq=False)
class Space:
    """Closed motions with some columns of v at rest.

    Attributes
    ----------
    columns : (c,) array of int
        Columns of v that move.
    left, values, right : arrays
        Singular value decomposition of K in these columns, the vanishing part left out.
    constraint : float
        Its singular value number r, the generic rank of K.
    v : ClosedMotions
        N (nv, m), zero in the columns at rest.
    """

    columns: np.ndarray
    left: np.ndarray
    values: np.ndarray
    right: np.ndarray
    constraint: float
    v: ClosedMotions


@dataclass(frozen=True, eq=False)
class Part:
    """The smallest singular values of A or T on a space of closed motions.

    Attributes
    ----------
    outputs : bool
        Of T if true, else of A.
    every : (s,) array
        All singular values, falling.
    sigma : float
        The one that vanishes at singularities.
    values : (w,) array
        It and those before it, KEPT at the most.
    left : (w, d) array
        Left singular vectors u.
    motions : (nv, w) array
        Closed motions x.
    """

    outputs: bool
    every: np.ndarray
    sigma: float
    values: np.ndarray
    left: np.ndarray
    motions: np.ndarray


@dataclass(frozen=True, eq=False)
class Measures:
    """The measures at a posture, and what their slopes need.

    Attributes
    ----------
    every, driven : Space
        Closed motions, and those with the locked inputs at rest.
    rates : (k, nv) array
        P.
    direct, inverse : Part
        Of A on all closed motions, of T on the driven ones.
    """

    at: FirstOrder
    rates: np.ndarray
    every: Space
    driven: Space
    direct: Part
    inverse: Part
    sigmas: Sigmas

    @property
    def values(self) -> np.ndarray:
        """The kept singular values (w,), direct ones first."""
        return np.concatenate([self.direct.values, self.inverse.values])


def measured(problem: Problem, q: np.ndarray) -> Measures:
    """Measure a closed posture. Raises ``ClosureError`` for an open one."""
    m, d = problem.mechanism, len(problem.outputs)
    at = first_order(m, q, problem.outputs)
    rates = first_order_code(m, problem.outputs).rates(q[None])[0][0]
    generic = generic_ranks(m, problem.outputs)
    every = _space(at, rates, np.arange(m.model.nv))
    driven = _space(at, rates, problem.free) if problem.locked else every
    direct = _part(every, generic.together.value + every.v.size - generic.motions, outputs=False)
    inverse = _part(driven, d + driven.v.size - (problem.free.size - generic_rank(m)), outputs=True)
    produced = inverse.every
    if problem.locked:
        produced = np.linalg.svd(every.v.outputs, compute_uv=False)
    sigmas = Sigmas(
        direct=direct.sigma,
        inverse=float(entry(produced, generic.outputs.value)),
        constraint=every.constraint,
        driven=inverse.sigma,
    )
    return Measures(at, rates, every, driven, direct, inverse, sigmas)


def null_motions(problem: Problem, here: Measures) -> np.ndarray:
    """Orthonormal dimensionless motions (free, k) of closures and task, locked inputs at rest."""
    v = here.driven.v
    _, _, wt = np.linalg.svd(v.outputs)
    null = v.motions[problem.free] @ wt[v.size - problem.freedoms :].T
    return np.asarray(np.linalg.qr(null)[0])


def slopes(problem: Problem, here: Measures, basis: np.ndarray) -> np.ndarray:
    """Derivatives (w, k) of ``here.values`` along dimensionless motions ``basis`` (free, k)."""
    turned = _rate_changes(problem, here, basis)
    every = [
        _changes(problem, here, *ends, basis, turned)
        for ends in ((here.every, here.direct), (here.driven, here.inverse))
    ]
    return np.concatenate(every)


def _space(at: FirstOrder, rates: np.ndarray, columns: np.ndarray) -> Space:
    """Closed motions in the given columns."""
    m = at.mechanism
    r = generic_rank(m)
    matrix = at.K[:, columns]
    if len(matrix):
        u, s, vt = np.linalg.svd(matrix)
    else:
        u, s, vt = np.zeros((0, 0)), np.zeros(0), np.eye(columns.size)
    rank = min(rank_of_singular_values(s, SINGULAR).value, r)
    basis = np.zeros((m.model.nv, columns.size - rank))
    basis[columns] = vt[rank:].T
    v = closed_motions(m, basis, rates, at.J)
    return Space(columns, u[:, :rank], s[:rank], vt[:rank], float(entry(s, r)), v)


def _part(space: Space, number: int, *, outputs: bool) -> Part:
    """The last singular values up to ``number`` of A or T."""
    matrix = space.v.outputs if outputs else space.v.inputs
    u, s, wt = np.linalg.svd(matrix, full_matrices=False)
    last = min(number, s.size)
    kept = slice(max(last - KEPT, 0), last)
    motions = space.v.motions @ wt[kept].T
    return Part(outputs, s, float(entry(s, number)), s[kept], u[:, kept].T, motions)


def _changes(
    problem: Problem,
    here: Measures,
    space: Space,
    part: Part,
    basis: np.ndarray,
    turned: np.ndarray,
) -> np.ndarray:
    """Derivatives (w, k) of singular values along the basis, with those of P (k, rates, nv)."""
    x, sigma, d = part.motions, part.values, len(here.at.J)
    produced = part.left @ here.at.J if part.outputs else _at_inputs(here.at, part.left)
    unit = here.rates @ x
    pull = (produced.T - here.rates.T @ unit * sigma)[space.columns]
    mu = space.left @ (space.right @ pull / space.values[:, None])
    weights = np.hstack([-mu.T, part.left if part.outputs else np.zeros((len(part.left), d))])
    code = first_order_code(problem.mechanism, problem.outputs)
    of_matrices = [
        code.slopes(here.at.q, *both)[problem.free] @ basis
        for both in zip(weights, np.ascontiguousarray(x.T), strict=True)
    ]
    of_norms = sigma[:, None] * np.einsum("rw,krv,vw->wk", unit, turned, x)
    return np.array(of_matrices).reshape(of_norms.shape) - of_norms


def _at_inputs(at: FirstOrder, left: np.ndarray) -> np.ndarray:
    """Rows (w, nv) with ``left`` (w, n_inputs) in the columns of the inputs."""
    found = np.zeros((len(left), at.mechanism.model.nv))
    found[:, at.mechanism.input_v] = left
    return found


def _rate_changes(problem: Problem, here: Measures, basis: np.ndarray) -> np.ndarray:
    """Derivatives (k, rates, nv) of P along dimensionless motions ``basis`` (free, k)."""
    ways = [h * motion for motion in basis.T for h in (_STEP, -_STEP)]
    if not ways:
        return np.zeros((0, *here.rates.shape))
    ends = np.array([problem.moved(here.at.q, way) for way in ways])
    rates = first_order_code(problem.mechanism, problem.outputs).rates(ends)[0]
    return np.asarray((rates[::2] - rates[1::2]) / (2.0 * _STEP))
