"""Determinants and vanishing singular values of many postures, reduced to numbers one by one.

The matrix is [K; J] with the inputs' columns last. With r independent closure rows K' and as many
passive columns, one elimination serves all: it leaves the twist map S in the lower right corner,
det [K'; J] = det K'_p det S, and factors of K'_p and of [K'; J].
Singular values come from A A^T as long as squares leave them digits; small ones from Lanczos on
the factors, or on a triangular factor of a matrix that is not square.
Redundant closure rows are first combined into K' = Q K by an orthonormal basis Q of the column
space of K: the singular values that are not zero stay.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from closedchain.closure.batch.algebra import eliminate, gather, singular_values
from closedchain.closure.batch.compiled import entry, kernel
from closedchain.closure.batch.goals import task_rows
from closedchain.closure.batch.kinematics import identity_first, place_tree
from closedchain.closure.batch.reduction import combine, frobenius, least_twist
from closedchain.closure.batch.rows import clear, closure_rows, largest_row
from closedchain.closure.batch.tables import Tables, Tip
from closedchain.closure.batch.tridiagonal import gram
from closedchain.closure.batch.values import exact_values, smallest_value

DET_DIRECT, DET_INVERSE, RESIDUAL, DIRECT, INVERSE, CONSTRAINT, CONDITION = range(7)
NAMES = (
    "det_direct",
    "det_inverse",
    "residual",
    "sigma_direct",
    "sigma_inverse",
    "sigma_constraint",
    "condition",
)

_STEPS = 30  # of Lanczos, before the direct method takes over
_GROWTH = 1e3  # of entries, beyond which an elimination is not trusted
_RANK = 1e-9  # as closure.ranks.RANK_TOLERANCE


class Problem(NamedTuple):
    """What is measured.

    Attributes
    ----------
    rank, passive, outputs : r, number of passive columns, outputs (d,) as 0 to 5
    sign_rows, sign_passive, sign_all : parities of the orders of pivot rows, passive columns, all
    column, steps, slots : elimination of the passive columns, see ``system.System``
    last_steps, last_slots : elimination of the twist map that is left
    all_steps, all_slots : elimination of the whole [K'; J] with free pivoting
    home : (r, rows) basis that orients redundant rows where K'_p is not square
    """

    rank: int
    passive: int
    outputs: np.ndarray
    sign_rows: float
    sign_passive: float
    sign_all: float
    column: np.ndarray
    steps: np.ndarray
    slots: np.ndarray
    last_steps: np.ndarray
    last_slots: np.ndarray
    all_steps: np.ndarray
    all_slots: np.ndarray
    home: np.ndarray


@entry
def measure(
    t: Tables, tip: Tip, p: Problem, postures: np.ndarray, full: bool, out: np.ndarray
) -> None:
    """Measures of postures (n, nq) into out (n, 7), in the order of ``NAMES``.

    Without ``full``, determinants and residual only. What is not defined is left as it was.
    """
    rows, nv, d = t.row_unit.shape[0], t.column_unit.shape[0], p.outputs.shape[0]
    r, n = p.rank, p.passive
    pose = np.empty((t.joints.shape[0], 12))
    work = np.empty((6, 12))
    values = np.empty(max(rows, 1))
    raw = np.empty((rows + d, nv))
    matrix = np.empty((r + d, nv))
    spare = np.empty((r + d, nv))
    order = np.empty(r + d, np.int64)
    vectors = np.empty((max(nv, rows + d), max(nv, rows + d)))
    basis = np.empty((max(nv, rows + d) + 3, max(nv, rows + d)))
    shares = np.empty((max(nv, rows + d), max(nv, rows + d)))
    square, square_all = r == n, r + d == nv and d > 0
    lu = np.empty((r, r))
    lu_all = np.empty((r + d, r + d))
    square_of = np.empty((r + d, r + d))
    across = np.empty((nv, r + d))
    twist = np.empty((min(d, nv - n), max(d, nv - n)))
    small = np.empty(max(nv, rows + d))
    alpha = np.empty(_STEPS)
    beta = np.empty(_STEPS)
    identity_first(pose)
    for i in range(postures.shape[0]):
        place_tree(t, postures[i], pose)
        clear(raw)
        closure_rows(t, postures[i], pose, values, raw, p.column, True, work)
        task_rows(t, tip, p.outputs, pose, raw, rows, p.column, work)
        out[i, RESIDUAL] = largest_row(t, values)
        turned = 1.0
        excess = False
        if r < rows:
            excess, turned = combine(p.home, r, raw, rows, vectors, basis, shares, matrix)
        else:
            for a in range(rows):
                for b in range(nv):
                    matrix[a, b] = raw[a, b]
        for a in range(d):
            for b in range(nv):
                matrix[r + a, b] = raw[rows + a, b]
        for a in range(r + d):
            order[a] = a
            for b in range(nv):
                spare[a, b] = matrix[a, b]
        norm = frobenius(spare, r + d, nv)
        trusted = False
        if square:
            det, least, _ = eliminate(matrix, order, p.steps, p.slots)
            det *= p.sign_rows
            direct = det * p.sign_passive
            out[i, DET_DIRECT] = direct if r == rows else abs(direct)
            if r < rows:
                turned = -1.0 if direct < 0.0 else 1.0
            if full:
                gather(matrix, order, p.steps, p.slots, lu)
            # the corner [r:, n:] now holds the twist map
            growth = 0.0
            for a in range(r, r + d):
                for b in range(n, nv):
                    growth = max(growth, abs(matrix[a, b]))
            trusted = least > 0.0 and growth < _GROWTH
        if full and trusted:
            # kept before the last steps overwrite it
            for a in range(d):
                for b in range(nv - n):
                    if d <= nv - n:
                        twist[a, b] = matrix[r + a, n + b]
                    else:
                        twist[b, a] = matrix[r + a, n + b]
        if square_all:
            if trusted:
                rest, _, _ = eliminate(matrix, order, p.last_steps, p.last_slots)
                whole = det * rest * p.sign_all
                if full:
                    _gather_both(matrix, order, p, r, d, lu_all)
            else:
                for a in range(r + d):
                    order[a] = a
                    for b in range(nv):
                        matrix[a, b] = spare[a, b]
                whole, _, _ = eliminate(matrix, order, p.all_steps, p.all_slots)
                whole *= p.sign_all
                if full:
                    gather(matrix, order, p.all_steps, p.all_slots, lu_all)
            out[i, DET_INVERSE] = turned * whole
        if not full:
            continue
        if excess:
            exact_values(raw, rows, d, nv, n, r, vectors, small, out, i, DIRECT)
        else:
            # products of the rows over passive columns, then over the inputs' too
            for a in range(r + d):
                for b in range(nv):
                    across[b, a] = spare[a, b]
            gram(spare, across, 0, r, 0, n, square_of, True)
            out[i, DIRECT] = smallest_value(
                spare,
                r,
                n,
                square_of,
                lu,
                square,
                False,
                norm,
                vectors,
                basis,
                shares,
                alpha,
                beta,
                small,
            )
            if nv > n:
                gram(spare, across, 0, r, n, nv, square_of, False)
            out[i, CONSTRAINT] = smallest_value(
                spare,
                r,
                nv,
                square_of,
                lu,
                False,
                False,
                norm,
                vectors,
                basis,
                shares,
                alpha,
                beta,
                small,
            )
            if d > 0:
                out[i, INVERSE] = 0.0
                if r + d <= nv:
                    gram(spare, across, r, r + d, 0, nv, square_of, True)
                    out[i, INVERSE] = smallest_value(
                        spare, r + d, nv, square_of, lu_all, square_all, True, norm, vectors, basis,
                        shares, alpha, beta, small,
                    )  # fmt: skip
        if d > 0:
            there = nv > n
            if there and not (trusted and out[i, DIRECT] > _RANK * norm):
                there = least_twist(raw, rows, d, n, nv, vectors, basis, shares, small, twist)
            out[i, CONDITION] = math.inf
            if there:
                count, length = min(d, nv - n), max(d, nv - n)
                singular_values(twist, count, length, small)
                if small[count - 1] > 0.0:
                    out[i, CONDITION] = small[0] / small[count - 1]


@kernel
def _gather_both(
    matrix: np.ndarray, order: np.ndarray, p: Problem, r: int, d: int, factors: np.ndarray
) -> None:
    """Factors of [K'; J] after both eliminations."""
    for k in range(r + d):
        if k < r:
            row = order[p.slots[p.steps[k, 0]]]
        else:
            row = order[p.last_slots[p.last_steps[k - r, 0]]]
        for j in range(r + d):
            factors[k, j] = matrix[row, j]
