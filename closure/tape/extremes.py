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
        """Derivatives at x, by the stationary qd transform, cleared of its divisions."""
        g = self.graph
        one, zero = g.constant(1.0), g.constant(0.0)
        p, u = (one, zero, zero), (-x, -one, zero)
        for i, q in enumerate(self.diagonal):
            p = (q * p[0] + u[0], q * p[1] + u[1], q * p[2] + u[2])
            if i + 1 < self.size:
                e = self.beside[i]
                u = (
                    e * u[0] - x * p[0],
                    (e * u[1] - p[0]) - x * p[1],
                    (e * u[2] - 2.0 * p[1]) - x * p[2],
                )
        return logarithmic(*p)


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
        """Derivatives at x, by the recurrence of the leading minors."""
        g = self.graph
        one, zero = g.constant(1.0), g.constant(0.0)
        before, p = (zero, zero, zero), (one, zero, zero)
        for i, entry in enumerate(self.diagonal):
            a = entry - x
            new = (a * p[0], a * p[1] - p[0], a * p[2] - 2.0 * p[1])
            if i:
                e = self.beside[i - 1]
                new = (new[0] - e * before[0], new[1] - e * before[1], new[2] - e * before[2])
            before, p = p, new
        return logarithmic(*p)

    def spread(self, x: Expr) -> Expr:
        """|y|^2 of the eigenvector at an eigenvalue x, its last entry being 1.

        For eigenvectors that grow from their last entry to their first. Entries before one that
        nothing couples to the last are left out.
        """
        g = self.graph
        before, q = g.constant(0.0), g.constant(1.0)
        above, below = g.constant(1.0), g.constant(1.0)
        coupled = g.constant(0.0) < 1.0
        for i in reversed(range(self.size - 1)):
            e = self.beside[i]
            last = self.beside[i + 1] if i + 2 < self.size else g.constant(0.0)
            before, q = q, (self.diagonal[i + 1] - x) * q - last * before
            coupled = coupled & (e > 0.0)
            above = coupled.select(above * e + q * q, above)
            below = coupled.select(below * e, below)
        return above * below.recip()


def logarithmic(value: Expr, slope: Expr, bend: Expr) -> Slopes:
    """Logarithmic derivatives from a value and its first and second derivative."""
    inverse = value.recip()
    first = slope * inverse
    return Slopes(first, first * first - bend * inverse)


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
