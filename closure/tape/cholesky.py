"""Sparse L D L^T of a symmetric positive definite matrix of expressions, unrolled.

Rows are taken in the order that fills in least by their pattern alone [Tinney and Walker 1967]:
no pivot of such a matrix is small against what it came from.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from closedchain.closure.tape.expression import Expr, Graph, total

Sparse = dict[int, Expr]

CHAINS = 3


@dataclass(frozen=True, eq=False)
class Cholesky:
    """Factors of a matrix (n, n).

    Attributes
    ----------
    order : tuple of int
        Rows in the order of elimination.
    lower : tuple of dict
        For each step the multipliers of the rows below, by row.
    inverses : tuple of expressions
        1 / D, by step.
    """

    graph: Graph
    order: tuple[int, ...]
    lower: tuple[Sparse, ...]
    inverses: tuple[Expr, ...]

    def numbers(self) -> list[Expr]:
        """All numbers of the factors, one after the other."""
        return [*self.inverses, *(x for row in self.lower for x in row.values())]

    def renewed(self, graph: Graph, numbers: Sequence[Expr]) -> Cholesky:
        """Return the same factors with their numbers from elsewhere, as ``numbers`` orders them."""
        rest = iter(numbers)
        inverses = tuple(next(rest) for _ in self.inverses)
        lower = tuple({row: next(rest) for row in step} for step in self.lower)
        return Cholesky(graph, self.order, lower, inverses)

    def solve(self, right: Sequence[Expr]) -> list[Expr]:
        """x with A x = right."""
        x = list(right)
        above: list[list[tuple[Expr, int]]] = [[] for _ in x]
        for row, multipliers in zip(self.order, self.lower, strict=True):
            x[row] = less(x[row], [factor * x[other] for factor, other in above[row]])
            for below, factor in multipliers.items():
                above[below].append((factor, row))
        for row, inverse in zip(self.order, self.inverses, strict=True):
            x[row] = x[row] * inverse
        place = {row: k for k, row in enumerate(self.order)}
        for row, multipliers in zip(reversed(self.order), reversed(self.lower), strict=True):
            later = sorted(multipliers, key=place.__getitem__, reverse=True)
            x[row] = less(x[row], [multipliers[other] * x[other] for other in later])
        return x


def less(value: Expr, terms: Sequence[Expr]) -> Expr:
    """``value`` less all terms, in several sums side by side; the terms known last come last.

    A processor need not wait for one addition to begin the next.
    """
    early, late = terms[: -2 or None], terms[-2:]
    if len(terms) > 6:
        parts = [early[k::CHAINS] for k in range(CHAINS)]
        sums = [value.graph.lift(total(part)) for part in parts[1:]]
        for term in parts[0]:
            value = value - term
        value = value - (sums[0] + sums[1])
    else:
        late = terms
    for term in late:
        value = value - term
    return value


def cholesky(graph: Graph, matrix: dict[int, Sparse]) -> Cholesky:
    """Factorise a symmetric matrix given by its rows, all entries of both triangles."""
    left = {i: dict(row) for i, row in matrix.items()}
    order, lower, inverses = [], [], []
    while left:
        row = min(left, key=lambda i: (len(left[i]), i))
        rest = left.pop(row)
        inverse = rest.pop(row).recip()
        multipliers = {i: entry * inverse for i, entry in rest.items()}
        for i, factor in multipliers.items():
            left[i].pop(row)
            for j, entry in rest.items():
                if j < i:
                    continue
                old = left[i].get(j)
                new = -(factor * entry) if old is None else old - factor * entry
                left[i][j] = left[j][i] = new
        order.append(row)
        lower.append(multipliers)
        inverses.append(inverse)
    return Cholesky(graph, tuple(order), tuple(lower), tuple(inverses))


def gram(graph: Graph, rows: Sequence[Sparse]) -> dict[int, Sparse]:
    """Products A A^T of sparse rows, both triangles, without those that vanish."""
    found: dict[int, Sparse] = {i: {} for i in range(len(rows))}
    for i, one in enumerate(rows):
        for j in range(i, len(rows)):
            other = rows[j]
            entry = graph.lift(total(one[c] * other[c] for c in one if c in other))
            if entry.value != 0.0 or i == j:
                found[i][j] = found[j][i] = entry
    return found
