"""Looking for closed postures from anywhere: damped least squares, as ``closure.trust_region``."""

from __future__ import annotations

import math

import numpy as np

from closedchain.closure.batch.algebra import cholesky, cholesky_solve
from closedchain.closure.batch.codes import BEYOND, CLOSED, NONE, OPEN, UNDECIDED
from closedchain.closure.batch.compiled import entry, kernel
from closedchain.closure.batch.kinematics import move, place_tree
from closedchain.closure.batch.newton import Equations, Scratch, correct, evaluate, largest, scratch
from closedchain.closure.batch.rows import beyond, mirrored
from closedchain.closure.batch.tables import Tables, Tip

_EVALUATIONS = 120
_SETTLED = 1e-2  # a squared gap that cannot be lowered by more than this share stays open
_NEAR = 1e-3  # squared gap from which Newton's method is tried
_LONGEST = 0.7  # of a step, dimensionless


@entry
def search(
    t: Tables,
    tip: Tip,
    e: Equations,
    starts: np.ndarray,
    shared: bool,
    targets: np.ndarray,
    postures: np.ndarray,
    verdicts: np.ndarray,
) -> None:
    """First proper closed posture for every target (n, p + 12), or the best end; verdicts (n,).

    ``starts`` (s, nq) for all targets where ``shared``, else (n s, nq).
    """
    s = scratch(t, e)
    n, nq = postures.shape
    count = starts.shape[0] if shared else starts.shape[0] // max(n, 1)
    k = e.unknowns
    normal, damped = np.empty((k, k)), np.empty((k, k))
    slope, step = np.empty(k), np.empty(k)
    q, trial = np.empty(nq), np.empty(nq)
    for i in range(n):
        least, verdict = math.inf, OPEN
        for a in range(count):
            begin = starts[a] if shared else starts[i * count + a]
            for x in range(nq):
                q[x] = begin[x]
            for x in range(e.pins.shape[0]):
                q[e.pins[x]] = targets[i, x]
            found, gap = _descend(t, tip, e, q, targets[i], normal, damped, slope, step, trial, s)
            if found == CLOSED:
                place_tree(t, q, s.pose)
                if mirrored(t, s.pose, s.work) or beyond(t, q):
                    found = BEYOND
            # proper beats improper, that beats what may yet close, that beats open
            if _order(found) < _order(verdict) or (found == verdict and gap < least):
                verdict, least = found, gap
                for x in range(nq):
                    postures[i, x] = q[x]
            if verdict == CLOSED:
                break
        verdicts[i] = verdict


@kernel
def _order(verdict: int) -> int:
    if verdict == CLOSED:
        return 0
    if verdict == BEYOND:
        return 1
    return 2 if verdict == UNDECIDED else 3


@kernel
def _descend(
    t: Tables,
    tip: Tip,
    e: Equations,
    q: np.ndarray,
    target: np.ndarray,
    normal: np.ndarray,
    damped: np.ndarray,
    slope: np.ndarray,
    step: np.ndarray,
    trial: np.ndarray,
    s: Scratch,
) -> tuple[int, float]:
    """Levenberg-Marquardt on q in place [Nielsen 1999]; verdict and largest row.

    Open where the linear model promises to lower the squared gap by less than a small share.
    """
    k = e.unknowns
    evaluate(t, tip, e, q, target, True, s)
    cost = _cost(s)
    _normal(s, normal, slope)
    tried = math.inf
    most = 0.0
    for a in range(k):
        most = max(most, normal[a, a])
    mu, factor = 1e-3 * most, 2.0
    for _ in range(_EVALUATIONS):
        if cost < _NEAR and cost < 1e-2 * tried:
            tried = cost
            for x in range(q.shape[0]):
                trial[x] = q[x]
            why, gap = correct(t, tip, e, trial, target, 0.0, -1, s)
            if why == NONE:
                for x in range(q.shape[0]):
                    q[x] = trial[x]
                return CLOSED, gap
            evaluate(t, tip, e, q, target, False, s)
        gap = largest(t, e, s.values)
        if gap < 1e-12:
            return CLOSED, gap
        for a in range(k):
            for b in range(a + 1):
                damped[a, b] = normal[a, b]
            damped[a, a] += mu
            step[a] = -slope[a]
        if not cholesky(damped, k):
            mu = max(10.0 * mu, 1e-12 * most)
            continue
        cholesky_solve(damped, k, step)
        size, predicted = 0.0, 0.0
        for a in range(k):
            size += step[a] * step[a]
            predicted += step[a] * (mu * step[a] - slope[a])
        size = math.sqrt(size)
        if predicted < _SETTLED * cost and mu <= 1e-2 * most:
            return OPEN, gap
        if size > _LONGEST:
            # too long for the linear model: damp more, without a look
            mu *= 4.0
            continue
        for x in range(q.shape[0]):
            trial[x] = q[x]
        move(t, trial, step, e.column)
        evaluate(t, tip, e, trial, target, True, s)
        new = _cost(s)
        share = (cost - new) / predicted
        if share > 0.0:
            for x in range(q.shape[0]):
                q[x] = trial[x]
            cost = new
            _normal(s, normal, slope)
            mu *= max(1.0 / 3.0, 1.0 - (2.0 * share - 1.0) ** 3)
            factor = 2.0
        else:
            mu *= factor
            factor *= 2.0
            evaluate(t, tip, e, q, target, False, s)
        if not mu < 1e12 * most:
            break
    evaluate(t, tip, e, q, target, False, s)
    gap = largest(t, e, s.values)
    return (CLOSED if gap < 1e-12 else UNDECIDED), gap


@kernel
def _cost(s: Scratch) -> float:
    total = 0.0
    for a in range(s.matrix.shape[0]):
        total += s.values[a] * s.values[a]
    return total


@kernel
def _normal(s: Scratch, normal: np.ndarray, slope: np.ndarray) -> None:
    """A^T A (lower half) and A^T values, skipping zeros."""
    m, n = s.matrix.shape
    for a in range(n):
        slope[a] = 0.0
        for b in range(a + 1):
            normal[a, b] = 0.0
    for r in range(m):
        value = s.values[r]
        for a in range(n):
            x = s.matrix[r, a]
            if x != 0.0:
                slope[a] += x * value
                for b in range(a + 1):
                    normal[a, b] += x * s.matrix[r, b]
