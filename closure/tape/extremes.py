"""Largest and smallest eigenvalues of tridiagonal matrices on a tape, one step after the other.

Laguerre's method, which comes from one side and does not pass the eigenvalue: fast for single ones
and sure for close ones [Parlett, The Symmetric Eigenvalue Problem, 1980]. ``Bidiagonal`` stands for
B^T B with squares of B's entries, whose smallest eigenvalue keeps its relative digits
[Demmel and Kahan 1990]; ``Tridiagonal`` for any symmetric matrix.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from closedchain.closure.tape.expression import Expr, Graph, total

SETTLED = 1e-11
"""Relative step after which the next would be rounding: the method is cubic."""


@dataclass(frozen=True, eq=False)
class Slopes:
    """Logarithmic derivative of det (A - x) and minus its derivative: sums over eigenvalues e of
    1 / (x - e) and 1 / (x - e)^2."""

    first: Expr
    second: Expr


@dataclass(frozen=True, eq=False)
class Bidiagonal:
    """B^T B of a bidiagonal B: squares of its diagonal and of the entries beside it."""

    graph: Graph
    diagonal: Sequence[Expr]
    beside: Sequence[Expr]

    @property
    def size(self) -> int:
        """Number of eigenvalues."""
        return len(self.diagonal)

    @property
    def trace(self) -> Expr:
        """Sum of the eigenvalues."""
        return self.graph.lift(total([*self.diagonal, *self.beside]))

    def slopes(self, x: Expr) -> Slopes:
        """Derivatives at x, by the stationary qd transform."""
        g = self.graph
        t, t1, t2 = -x, g.constant(-1.0), g.constant(0.0)
        first, second = g.constant(0.0), g.constant(0.0)
        for i, q in enumerate(self.diagonal):
            inverse = (q + t).recip()
            u1, u2 = t1 * inverse, t2 * inverse
            first = first + u1
            second = second + (u1 * u1 - u2)
            if i + 1 < self.size:
                e = self.beside[i] * inverse
                qe = q * e
                t, t1, t2 = t * e - x, qe * u1 - 1.0, qe * (u2 - 2.0 * (u1 * u1))
        return Slopes(first, second)


@dataclass(frozen=True, eq=False)
class Tridiagonal:
    """A symmetric tridiagonal matrix: its diagonal, and squares of the entries beside it."""

    graph: Graph
    diagonal: Sequence[Expr]
    beside: Sequence[Expr]

    @property
    def size(self) -> int:
        """Number of eigenvalues."""
        return len(self.diagonal)

    def slopes(self, x: Expr) -> Slopes:
        """Derivatives at x."""
        g = self.graph
        first, second = g.constant(0.0), g.constant(0.0)
        d1, d2 = g.constant(-1.0), g.constant(0.0)
        d = self.diagonal[0] - x
        for i in range(self.size):
            inverse = d.recip()
            u1, u2 = d1 * inverse, d2 * inverse
            first = first + u1
            second = second + (u1 * u1 - u2)
            if i + 1 < self.size:
                e = self.beside[i] * inverse
                share = e * inverse
                d = (self.diagonal[i + 1] - x) - e
                d1, d2 = share * d1 - 1.0, e * (u2 - 2.0 * (u1 * u1))
        return Slopes(first, second)

    def spread(self, x: Expr) -> Expr:
        """|y|^2 of the eigenvector at an eigenvalue x, its last entry being 1.

        For eigenvectors that grow from their last entry to their first.
        """
        g = self.graph
        pivots = [self.diagonal[-1] - x]
        for i in reversed(range(self.size - 1)):
            pivots.append((self.diagonal[i] - x) - self.beside[i] * pivots[-1].recip())
        size = g.constant(1.0)
        for pivot, square in zip(reversed(pivots[:-1]), self.beside, strict=True):
            coupled = square > 0.0
            ratio = pivot * pivot * coupled.select(square, 1.0).recip()
            size = 1.0 + coupled.select(ratio * size, 0.0)
        return size


def step(x: Expr, slopes: Slopes, count: int, upward: bool) -> tuple[Expr, Expr]:
    """Next value from one side of all ``count`` eigenvalues, and whether to go on from there.

    Upward from below the smallest, else downward from above the largest. Where rounding ends it,
    or x is an eigenvalue, x stays.
    """
    slope = -slopes.first if upward else slopes.first
    rest = (float(count) * slopes.second - slopes.first * slopes.first).max(0.0)
    change = float(count) * (slope + (float(count - 1) * rest).sqrt()).recip()
    good = (slope > 0.0) & (change > 0.0)
    new = x + change if upward else x - change
    good = good & (new > 0.0) if not upward else good
    further = good & (change > SETTLED * new)
    return good.select(new, x), further
