"""Folds on ways: where two postures with the same targets meet, located to rounding, many at once.

A branch that is followed up to a fold ends short of it. The fold itself is found by Newton's method
in the posture and the share of the way together: the rows, and the least singular value of their
Jacobian, its singular vectors held for a step. Near it the way is a parabola in the vector that
vanishes, one posture on either side: that tells where the other one is.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from closedchain.closure.solve.problem import Problem
from closedchain.closure.solve.ways import partway
from closedchain.closure.tape.expression import Graph
from closedchain.closure.tape.machine import Compiled, compiled
from closedchain.closure.tape.rows import Kinematics

STEP = 1e-5  # dimensionless, or a share of the way: how far away slopes are taken
ITERATIONS = 30
LONGEST = 0.2  # of a step of Newton's method
CLOSED = 1e-12  # dimensionless rows
FARTHEST = 2.0  # shares beyond the ends of a way at which nothing is sought
VANISHED = 1e-10  # share of the largest singular value
BOTH = 1e-5  # share below which a second singular value vanishes with the least one
CROSSING = 1e-7  # least slope of rows along the way, and least curvature, that make a fold


@dataclass(frozen=True, eq=False)
class Folds:
    """Singular postures on ways, and the parabolas around them.

    Attributes
    ----------
    found : (n,) array of bool
        Whether there is one; the rest means nothing where there is none.
    q : (n, nq) array
    share : (n,) array
        Of the way.
    along : (n, free) array
        Unit vector that the Jacobian takes to zero, dimensionless.
    left : (n, rows) array
        Unit vector that takes the Jacobian's rows to zero.
    bend : (n,) array
        Postures beside it at ``x`` along that vector have the share ``share + bend x^2``; 0 where
        the branch does not fold, but goes on or meets others.
    lost : (n,) array of int
        How many ranks the Jacobian loses; more than one where several folds coincide.
    """

    found: np.ndarray
    q: np.ndarray
    share: np.ndarray
    along: np.ndarray
    left: np.ndarray
    bend: np.ndarray
    lost: np.ndarray

    def aside(self, share: np.ndarray) -> np.ndarray:
        """How far (n,) along the vector the two postures of other shares (n,) are.

        NaN on the far side of a fold, and where there is none.
        """
        bend = np.where(self.bend == 0.0, np.nan, self.bend)
        square = (share - self.share) / bend
        return np.asarray(np.sqrt(np.where(square < 0.0, np.nan, square)))


@dataclass(frozen=True, eq=False)
class _Code:
    """Machine code for rows, Jacobian and steps of a problem."""

    problem: Problem

    @cached_property
    def _rows(self) -> Compiled:
        problem, nq = self.problem, self.problem.mechanism.model.nq
        g = Graph()
        target = g.inputs(nq, problem.prescribed)
        q = problem.pinned_at(g.inputs(0, nq), target)
        # K is then the derivative of open rows, too
        k = Kinematics(problem.mechanism, g, q, upright=False)
        rows, zero = problem.rows(k, target), g.constant(0.0)
        dense = [row.get(v, zero) for row in rows.entries for v in problem.free]
        tape = g.tape([*rows.values, *dense], nq + problem.prescribed)
        return compiled(tape, single=False)

    @cached_property
    def _moved(self) -> Compiled:
        problem, nq = self.problem, self.problem.mechanism.model.nq
        g = Graph()
        q, step = list(g.inputs(0, nq)), g.inputs(nq, len(problem.free))
        k = Kinematics(problem.mechanism, g, q)
        moved = k.moved(q, dict(zip(problem.free, step, strict=True)))
        return compiled(g.tape(moved, nq + len(problem.free)), single=False)

    def at(self, q: np.ndarray, targets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Rows (n, m) and Jacobian (n, m, free), dimensionless, pinned joints at their targets."""
        rows = self.problem.units.size
        numbers = self._rows.run(np.concatenate([q.T, targets.T])).T
        return numbers[:, :rows], numbers[:, rows:].reshape(len(q), rows, len(self.problem.free))

    def moved(self, q: np.ndarray, step: np.ndarray) -> np.ndarray:
        """Postures (n, nq) after dimensionless steps (n, free)."""
        return np.ascontiguousarray(self._moved.run(np.concatenate([q.T, step.T])).T)


def moved(problem: Problem, q: np.ndarray, step: np.ndarray) -> np.ndarray:
    """Postures (n, nq) after dimensionless steps (n, free)."""
    return _code(problem).moved(q, step)


def side_of(
    problem: Problem, folds: Folds, which: np.ndarray, q: np.ndarray, targets: np.ndarray
) -> np.ndarray:
    """On which side of folds (n,) closed postures (n, nq) beside them are, (n,) of 1 or -1.

    By the sign of the singular value that vanishes at the fold, which is that of the determinant
    but for a factor that the two sides share; also where rows are redundant.

    Parameters
    ----------
    which : (n,) int array
        The fold that each is beside.
    targets : (n, prescribed) array
        Of the postures.
    """
    _, jacobian = _code(problem).at(q, targets)
    left, along = folds.left[which], folds.along[which]
    return np.sign(np.einsum("nm,nmf,nf->n", left, jacobian, along))


def folds_near(
    problem: Problem, q: np.ndarray, begin: np.ndarray, end: np.ndarray, share: np.ndarray
) -> Folds:
    """Singular postures beside nearly closed ones (n, nq), at shares (n,) of ways between targets.

    Parameters
    ----------
    begin, end : (n, prescribed) arrays
        The ways.
    """
    n, size = len(q), len(problem.free)
    out = Folds(
        found=np.zeros(n, dtype=bool),
        q=q.copy(),
        share=share.copy(),
        along=np.zeros((n, size)),
        left=np.zeros((n, problem.units.size)),
        bend=np.zeros(n),
        lost=np.zeros(n, dtype=int),
    )
    if not n or not size or problem.units.size < size:
        return out
    left = np.arange(n)
    for _ in range(ITERATIONS):
        going = np.isfinite(q).all(axis=1) & (np.abs(share) < FARTHEST)
        left, q, share = left[going], q[going], share[going]
        if not left.size:
            break
        here = _Around(problem, q, share, begin[left], end[left])
        done = here.solved
        at = left[done]
        out.found[at], out.share[at], out.lost[at] = True, share[done], here.lost[done]
        out.left[at] = here.left[done]
        out.q[at], out.along[at], out.bend[at] = (
            here.pinned[done],
            here.right[done],
            here.bend[done],
        )
        q, share = here.newton()
        left, q, share = left[~done], q[~done], share[~done]
    return out


class _Around:
    """Rows at postures (n, nq) and shares (n,), with slopes by differences."""

    def __init__(
        self,
        problem: Problem,
        q: np.ndarray,
        share: np.ndarray,
        begin: np.ndarray,
        end: np.ndarray,
    ) -> None:
        self._problem, self._q, self._share = problem, q, share
        self._begin, self._end = begin, end

    def _rows(self, q: np.ndarray, by: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
        targets = partway(self._problem, self._begin, self._end, self._share + by)
        return _code(self._problem).at(q, targets)

    @cached_property
    def _here(self) -> tuple[np.ndarray, np.ndarray]:
        return self._rows(self._q)

    @property
    def pinned(self) -> np.ndarray:
        """The postures (n, nq) with pinned joints where they belong."""
        q, problem = self._q.copy(), self._problem
        targets = partway(problem, self._begin, self._end, self._share)
        q[:, problem.pinned_q] = targets[:, : len(problem.pinned)]
        return q

    @cached_property
    def _singular(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        u, s, vt = np.linalg.svd(self._here[1], full_matrices=False)
        return u[:, :, -1], s, vt[:, -1]

    @property
    def left(self) -> np.ndarray:
        """Left singular vectors (n, rows) of the least singular values."""
        return self._singular[0]

    @property
    def right(self) -> np.ndarray:
        """Right singular vectors (n, free) of the least singular values."""
        return self._singular[2]

    @property
    def solved(self) -> np.ndarray:
        """Which ones are closed and singular, (n,) of bool."""
        _, s, _ = self._singular
        closed = np.abs(self._here[0]).max(axis=1) < CLOSED
        return np.asarray(closed & (s[:, -1] < VANISHED * s[:, 0]))

    @property
    def lost(self) -> np.ndarray:
        """How many ranks (n,) are lost."""
        _, s, _ = self._singular
        return np.asarray((s < BOTH * s[:, :1]).sum(axis=1))

    @cached_property
    def _slopes(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Of rows by the share (n, m), of the least singular value by the share (n,) and q."""
        left, _, right = self._singular
        (after, later), (before, earlier) = (self._rows(self._q, side * STEP) for side in (1, -1))
        code = _code(self._problem)
        ahead, behind = (
            self._rows(code.moved(self._q, side * STEP * right))[1] for side in (1.0, -1.0)
        )
        by_share = np.einsum("nm,nmf,nf->n", left, later - earlier, right)
        # at a fold, slopes of u.J v by q are those of u.J along v: rows' second derivatives
        by_q = np.einsum("nm,nmf->nf", left, ahead - behind)
        return (after - before) / (2.0 * STEP), by_share / (2.0 * STEP), by_q / (2.0 * STEP)

    @property
    def bend(self) -> np.ndarray:
        """Of the parabolas (n,), 0 where slopes are not those of a fold."""
        left, s, right = self._singular
        rows, _, by_q = self._slopes
        slope = np.einsum("nm,nm->n", left, rows)
        curvature = np.einsum("nf,nf->n", by_q, right)
        folds = np.minimum(np.abs(slope), np.abs(curvature)) > CROSSING * s[:, 0]
        return np.asarray(np.where(folds, -0.5 * curvature / np.where(folds, slope, 1.0), 0.0))

    def newton(self) -> tuple[np.ndarray, np.ndarray]:
        """Postures (n, nq) and shares (n,) after a step."""
        values, jacobian = self._here
        _, s, _ = self._singular
        rows, by_share, by_q = self._slopes
        top = np.concatenate([jacobian, rows[:, :, None]], axis=2)
        bottom = np.concatenate([by_q, by_share[:, None]], axis=1)[:, None]
        matrix = np.concatenate([top, bottom], axis=1)
        wanted = np.concatenate([values, s[:, -1:]], axis=1)
        step = -(np.linalg.pinv(matrix, rcond=1e-12) @ wanted[:, :, None])[:, :, 0]
        size = np.linalg.norm(step, axis=1, keepdims=True)
        step *= np.minimum(1.0, LONGEST / np.maximum(size, LONGEST))
        return _code(self._problem).moved(self._q, step[:, :-1]), self._share + step[:, -1]


def _code(problem: Problem) -> _Code:
    found: _Code = problem.mechanism.known.setdefault(("folds", problem), _Code(problem))
    return found
