"""Lanczos' method on a tape: the tridiagonal matrix of the inverse of a symmetric matrix.

One step after the other, without reorthogonalisation: copies of eigenvalues that are found may
turn up again, and the largest stays right [Paige 1980]. The eigenvalues sought may be those of a
pencil A - x W^-1: then vectors v go with z = W v, and W's factors are needed too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from closedchain.closure.tape.cholesky import Cholesky
from closedchain.closure.tape.dense import inner
from closedchain.closure.tape.expression import Expr, Graph
from closedchain.closure.tape.layout import sums
from closedchain.closure.tape.machine import Looped, looped

EXHAUSTED = 1e-26
"""Share of the square of a step that is rounding: the vectors so far span all there is."""


@dataclass(frozen=True, eq=False)
class Lanczos:
    """The method for matrices with factors of one pattern.

    Attributes
    ----------
    matrix : Cholesky
        Factors of A (r, r).
    weight : Cholesky or None
        Factors of W; None for the identity.
    steps : int
        How many steps are remembered.
    """

    matrix: Cholesky
    weight: Cholesky | None
    steps: int

    @property
    def size(self) -> int:
        """Rows r."""
        return len(self.matrix.order)

    @property
    def vectors(self) -> int:
        """Vectors in the state: z, z before, and v where it is another one."""
        return 2 if self.weight is None else 3

    @property
    def states(self) -> int:
        """Numbers of the state: vectors, square of z, then diagonal and squares beside it."""
        return self.vectors * self.size + 1 + 2 * self.steps

    def numbers(self) -> list[Expr]:
        """What goes in as parameters."""
        return self.matrix.numbers() + ([] if self.weight is None else self.weight.numbers())

    def begin(self, state: np.ndarray, z: np.ndarray, v: np.ndarray) -> None:
        """Make a state (states, n) one to begin with: from z (r,), and v (r, n) where it differs.

        z v must be positive; it need not be 1.
        """
        r = self.size
        state[:] = 0.0
        state[:r] = z[:, None]
        if self.weight is None:
            state[2 * r] = z @ z
        else:
            state[2 * r : 3 * r] = v
            state[3 * r] = sums(z[:, None] * v)

    def found(self, state: Sequence[object]) -> tuple[Sequence[object], Sequence[object]]:
        """Diagonal, and squares beside it with the last one pending, of a state or its rows."""
        begin = self.vectors * self.size + 1
        return state[begin : begin + self.steps], state[begin + self.steps :]

    def loop(self) -> Looped:
        """Machine code of a step, repeated."""
        g, r = Graph(), self.size
        state = g.inputs(0, self.states)
        parameters = len(self.numbers())
        given = g.inputs(self.states, parameters)
        count = len(self.matrix.numbers())
        matrix = self.matrix.renewed(g, given[:count])
        weight = None if self.weight is None else self.weight.renewed(g, given[count:])
        raw, before = state[:r], state[r : 2 * r]
        square = state[self.vectors * r]
        inverse = (square > 0.0).select((square > 0.0).select(square, 1.0).sqrt().recip(), 0.0)
        size = square * inverse
        z = [x * inverse for x in raw]
        v = z if weight is None else [x * inverse for x in state[2 * r : 3 * r]]
        u = matrix.solve(v)
        share = inner(g, u, v)
        new = [(a - share * b) - size * c for a, b, c in zip(u, z, before, strict=True)]
        dual = new if weight is None else weight.solve(new)
        left = inner(g, new, dual)
        left = (left > EXHAUSTED * (share * share)).select(left, 0.0)
        diagonal, beside = self.found(state)
        after = [*new, *z, *([] if weight is None else dual), left]
        after += [*diagonal[1:], share, *beside[1:], left]  # type: ignore[list-item]
        inputs = self.states + parameters
        return looped(g.tape([*after, share < share + 1.0], inputs), self.states, single=False)
