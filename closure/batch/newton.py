"""Newton's method that must not change branch: the rules of ``closure.equations.correct``."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from closedchain.closure.batch.algebra import dot, eliminate, gather, orthogonalise, singular_values
from closedchain.closure.batch.algebra import solve as solve_square
from closedchain.closure.batch.codes import FAR, NONE, SIGN, SINGULAR, SLOW, STEP
from closedchain.closure.batch.compiled import entry, kernel
from closedchain.closure.batch.goals import goal_rows
from closedchain.closure.batch.kinematics import (
    identity_first,
    move,
    place_tree,
)
from closedchain.closure.batch.rows import clear, closure_rows, largest_row
from closedchain.closure.batch.tables import Tables, Tip

_TOLERANCE = 1e-12
_FIRST_STEP, _CONTRACTION, _QUADRATIC, _NEAR = 0.5, 0.3, 1e-6, 0.9
_PIVOT_LIMIT, _RANK = 1e-14, 1e-9
_ITERATIONS = 12


class Equations(NamedTuple):
    """Closure and goal rows in the unknowns of a chart.

    Attributes
    ----------
    pins : (p,) index in q, and pin_units (p,) unit, of each pinned joint
    outputs : (g,) goal rows as 0 to 5
    goal_units : (g,)
    square : whether there are as many rows as unknowns
    column, steps, slots, sign : see ``system.System``
    """

    pins: np.ndarray
    pin_units: np.ndarray
    outputs: np.ndarray
    goal_units: np.ndarray
    square: bool
    column: np.ndarray
    steps: np.ndarray
    slots: np.ndarray
    sign: float
    unknowns: int


class Scratch(NamedTuple):
    """Memory of one call. Factors have two places: of the last solution, and of a trial.

    For square systems ``first`` holds LU in the order of ``rows``; for others A = Q^T T Z is held
    as Q in ``first``, T (lower) in ``middle``, Z in ``last``. ``numbers`` (2, 4): sign of the
    determinant, closeness to singularity (least over largest pivot), rank.
    """

    pose: np.ndarray
    work: np.ndarray
    values: np.ndarray
    matrix: np.ndarray
    order: np.ndarray
    rows: np.ndarray
    first: np.ndarray
    middle: np.ndarray
    last: np.ndarray
    numbers: np.ndarray
    vectors: np.ndarray
    shares: np.ndarray
    step: np.ndarray
    trial: np.ndarray
    target: np.ndarray
    turn: np.ndarray


@entry
def scratch(t: Tables, e: Equations) -> Scratch:
    """Fresh memory for one call."""
    m, n = t.row_unit.shape[0] + e.outputs.shape[0], e.unknowns
    k = max(m, n, 1)
    flat = 0 if e.square else k
    s = Scratch(
        np.empty((t.joints.shape[0], 12)),
        np.empty((6, 12)),
        np.zeros(k),
        np.empty((m, n)),
        np.empty(k, np.int64),
        np.empty((2, k), np.int64),
        np.empty((2, k, k)) if not e.square else np.empty((2, n, n)),
        np.empty((2, flat, flat)),
        np.empty((2, flat, flat)),
        np.zeros((2, 4)),
        np.empty((flat, flat)),
        np.empty((flat, flat)),
        np.empty(k),
        np.empty(t.limits.shape[1]),
        np.empty(e.pins.shape[0] + 12),
        np.empty((2, 12)),
    )
    identity_first(s.pose)
    return s


@kernel
def evaluate(
    t: Tables, tip: Tip, e: Equations, q: np.ndarray, target: np.ndarray, jacobian: bool, s: Scratch
) -> None:
    """Dimensionless values and, with ``jacobian``, the matrix of the equations at q."""
    rows = t.row_unit.shape[0]
    place_tree(t, q, s.pose)
    if jacobian:
        clear(s.matrix)
    closure_rows(t, q, s.pose, s.values, s.matrix, e.column, jacobian, s.work)
    if e.outputs.shape[0] > 0:
        p = e.pins.shape[0]
        goal_rows(
            t,
            tip,
            e.outputs,
            s.pose,
            target,
            p,
            s.values,
            s.matrix,
            rows,
            e.column,
            jacobian,
            s.work,
        )


@kernel
def largest(t: Tables, e: Equations, values: np.ndarray) -> float:
    """Largest absolute row [m, rad], goals included."""
    rows = t.row_unit.shape[0]
    most = largest_row(t, values)
    for k in range(e.outputs.shape[0]):
        size = abs(values[rows + k]) * e.goal_units[k]
        if not size <= most:
            most = size
    return most


@kernel
def factorise(e: Equations, s: Scratch, at: int) -> bool:
    """Factors of the matrix, which is destroyed, into place ``at``; False where it is singular."""
    m, n = s.matrix.shape
    if e.square:
        for a in range(m):
            s.order[a] = a
        product, least, most = eliminate(s.matrix, s.order, e.steps, e.slots)
        s.numbers[at, 0] = 1.0 if product * e.sign > 0.0 else -1.0
        s.numbers[at, 1] = least / most if n > 0 else 1.0
        s.numbers[at, 2] = n
        gather(s.matrix, s.order, e.steps, e.slots, s.first[at])
        for k in range(n):
            s.rows[at, k] = s.order[e.slots[e.steps[k, 0]]]
        if not least >= _PIVOT_LIMIT * most:
            s.numbers[at, 0] = 0.0
            return False
        return True
    for a in range(m):
        for b in range(n):
            s.vectors[b, a] = s.matrix[a, b]
    q, low, z = s.first[at], s.middle[at], s.last[at]
    rank, _, first, least = orthogonalise(s.vectors, n, m, min(m, n), q, s.shares, _RANK, True)
    for a in range(rank):
        for b in range(n):
            s.vectors[a, b] = s.shares[a, b]
    orthogonalise(s.vectors, rank, n, rank, z, s.shares, 0.0, False)
    for a in range(rank):
        for b in range(rank):
            low[a, b] = s.shares[b, a]
    s.numbers[at, 0] = 1.0
    s.numbers[at, 1] = least / first if first > 0.0 else 0.0
    s.numbers[at, 2] = rank
    return True


@kernel
def newton_step(e: Equations, s: Scratch, at: int) -> float:
    """Dimensionless step from the values and the factors at ``at``, into s.step; its length."""
    m, n = s.matrix.shape
    if e.square:
        for k in range(n):
            s.step[k] = -s.values[s.rows[at, k]]
        solve_square(s.first[at], s.step)
        return math.sqrt(dot(s.step, s.step, n))
    rank = int(s.numbers[at, 2])
    q, low, z = s.first[at], s.middle[at], s.last[at]
    y = s.shares[0]
    for a in range(rank):
        y[a] = -dot(q[a], s.values, m)
        for k in range(a):
            y[a] -= low[a, k] * y[k]
        y[a] /= low[a, a]
    for b in range(n):
        s.step[b] = 0.0
    for a in range(rank):
        for b in range(n):
            s.step[b] += y[a] * z[a, b]
    return math.sqrt(dot(y, y, rank))


@kernel
def _too_far(s: Scratch, at: int, to: int) -> bool:
    """Whether the rank changed from factors ``at`` to ``to``, or may have dropped in between.

    Where T^-1 Q A' Z^T differs from 1 by less than 1, so does every matrix on the straight line
    from A to A': all of them keep the rank. A' = Q'^T T' Z'.
    """
    rank = int(s.numbers[at, 2])
    if int(s.numbers[to, 2]) != rank:
        return True
    m, n = s.matrix.shape
    q, low, z = s.first[at], s.middle[at], s.last[at]
    q2, low2, z2 = s.first[to], s.middle[to], s.last[to]
    total = 0.0
    for a in range(rank):
        # row a of Q Q'^T T', then of that times Z' Z^T
        half = s.shares[a]
        for b in range(rank):
            half[b] = 0.0
        for k in range(rank):
            share = dot(q[a], q2[k], m)
            for b in range(k + 1):
                half[b] += share * low2[k, b]
        full = s.vectors[a]
        for b in range(rank):
            full[b] = 0.0
        for x in range(n):
            s.step[x] = 0.0
        for k in range(rank):
            for x in range(n):
                s.step[x] += half[k] * z2[k, x]
        for b in range(rank):
            full[b] = dot(s.step, z[b], n)
    for a in range(rank):
        for k in range(a):
            for b in range(rank):
                s.vectors[a, b] -= low[a, k] * s.vectors[k, b]
        for b in range(rank):
            s.vectors[a, b] /= low[a, a]
    for a in range(rank):
        s.vectors[a, a] -= 1.0
        total += dot(s.vectors[a], s.vectors[a], rank)
    if total < _NEAR * _NEAR:
        return False
    singular_values(s.vectors, rank, rank, s.step)
    return not s.step[0] < _NEAR


@kernel
def correct(
    t: Tables,
    tip: Tip,
    e: Equations,
    q: np.ndarray,
    target: np.ndarray,
    branch: float,
    chord: int,
    s: Scratch,
) -> tuple[int, float]:
    """Newton's method on q in place; refusal code, and the largest row.

    ``chord`` is the place of factors from nearby, or -1; the last factors go to the other place
    (place 0 without a chord). ``branch`` is the sign that the determinant must have, 0 for any.
    """
    last_step, count = _FIRST_STEP, 0
    closed = math.inf
    to = 1 - chord if chord >= 0 else 0
    if chord >= 0:
        count = 1
        evaluate(t, tip, e, q, target, False, s)
        size = newton_step(e, s, chord)
        if not size <= last_step:
            return STEP, closed
        last_step = max(_CONTRACTION * size, 1e-14)
        move(t, q, s.step, e.column)
    while count < _ITERATIONS:
        count += 1
        evaluate(t, tip, e, q, target, True, s)
        closed = largest(t, e, s.values)
        if e.unknowns == 0 or s.matrix.shape[0] == 0:
            s.numbers[to, 0] = s.numbers[to, 1] = 1.0
            return NONE if closed < _TOLERANCE else STEP, closed
        regular = factorise(e, s, to)
        if e.square:
            if not regular:
                return SINGULAR, closed
            if s.numbers[to, 0] == -branch:
                return SIGN, closed
        elif chord >= 0 and _too_far(s, chord, to):
            return FAR, closed
        size = newton_step(e, s, to)
        if size < _QUADRATIC and closed < 0.1 * _TOLERANCE:
            return NONE, closed
        if not size <= last_step:
            return NONE if size < 1e-9 and closed < _TOLERANCE else STEP, closed
        last_step = max(_CONTRACTION * size, 1e-14)
        move(t, q, s.step, e.column)
        if size < _QUADRATIC:
            evaluate(t, tip, e, q, target, False, s)
            closed = largest(t, e, s.values)
            if closed < 0.1 * _TOLERANCE:
                return NONE, closed
    return SLOW, closed


@kernel
def begin(
    t: Tables, tip: Tip, e: Equations, q: np.ndarray, target: np.ndarray, place: int, s: Scratch
) -> bool:
    """Factors at a closed posture; False where it is open or singular."""
    evaluate(t, tip, e, q, target, True, s)
    if largest(t, e, s.values) > 1e-9:
        return False
    if e.unknowns == 0 or s.matrix.shape[0] == 0:
        s.numbers[place, 0] = s.numbers[place, 1] = 1.0
        return True
    return factorise(e, s, place)
