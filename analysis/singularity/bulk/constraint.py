"""sigma_constraint in lanes: the smallest singular value of K that is generically not zero.

Its square is the smallest eigenvalue of A = K_kept K_kept^T, or, with redundant rows X K_kept, that
of the pencil A - x W^-1 with W = 1 + X^T X. Lanczos' method on the inverse finds it; the residual
of the Ritz vector bounds the error.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from closedchain.analysis.singularity.bulk.plan import FirstOrderTape
from closedchain.analysis.singularity.bulk.values import Search, ritz_code
from closedchain.closure.tape.cholesky import Cholesky, cholesky, gram
from closedchain.closure.tape.expression import Expr, total
from closedchain.closure.tape.lanczos import Lanczos
from closedchain.closure.tape.machine import Compiled, Looped
from closedchain.closure.tape.numbers import evaluate

ACCURATE = 2e-9
"""Largest residual of a Ritz vector against its value: twice the relative error of sigma."""

SQUARED = 1e-6
"""Smallest share of the trace of A that its smallest eigenvalue may be: it keeps ten digits."""

MORE = 6  # steps for postures that need more than the samples


@dataclass(frozen=True, eq=False)
class Constraint:
    """How sigma_constraint is found for a plan."""

    tape: FirstOrderTape

    @cached_property
    def products(self) -> dict[int, dict[int, Expr]]:
        """A."""
        return gram(self.tape.graph, self.tape.entries)

    @cached_property
    def factors(self) -> Cholesky:
        """Factors of A."""
        return cholesky(self.tape.graph, self.products)

    @cached_property
    def weight(self) -> dict[int, dict[int, Expr]] | None:
        """W; None where no row is redundant."""
        if not self.tape.plan.redundant:
            return None
        r, g = len(self.tape.plan.kept), self.tape.graph
        columns: list[dict[int, Expr]] = [{} for _ in range(r)]
        for i, share in enumerate(self.tape.shares):
            for c, x in share.items():
                columns[c][i] = x
        found = gram(g, columns)
        for i in range(r):
            found[i][i] = found[i][i] + 1.0
        return found

    @cached_property
    def weights(self) -> Cholesky | None:
        """Factors of W."""
        return None if self.weight is None else cholesky(self.tape.graph, self.weight)

    @cached_property
    def outputs(self) -> list[Expr]:
        """What each posture's search needs: trace of A, factors, and v to start with."""
        g, r = self.tape.graph, len(self.tape.plan.kept)
        trace = g.lift(total(self.products[i][i] for i in range(r)))
        found = [trace, *self.lanczos.numbers()]
        if self.weights is not None:
            found += self.weights.solve([g.constant(float(x)) for x in self.begin])
        return found

    @cached_property
    def lanczos(self) -> Lanczos:
        """The method, remembering its steps and those for postures that need more."""
        return Lanczos(self.factors, self.weights, self.steps + MORE)

    @cached_property
    def parameters(self) -> int:
        """Numbers of the factors."""
        return len(self.lanczos.numbers())

    @cached_property
    def loop(self) -> Looped:
        """Machine code of its steps."""
        return self.lanczos.loop()

    @cached_property
    def sampled(self) -> tuple[np.ndarray, np.ndarray]:
        """Inverses of A and of W (n, r, r) at the plan's samples, whose eigenvectors are sought."""
        r, samples = len(self.tape.plan.kept), self.tape.plan.samples
        zero = self.tape.graph.constant(0.0)
        weight = self.weight or {i: {i: self.tape.graph.constant(1.0)} for i in range(r)}
        wanted = [
            m[i].get(j, zero) for m in (self.products, weight) for i in range(r) for j in range(r)
        ]
        tape = self.tape.graph.tape(wanted, samples.shape[1])
        values = np.array(
            [np.broadcast_to(x, len(samples)) for x in evaluate(tape, list(samples.T))]
        )
        matrices = np.moveaxis(values.reshape(2, r, r, len(samples)), 3, 1)
        return np.linalg.inv(matrices[0]), np.linalg.inv(matrices[1])

    @cached_property
    def begin(self) -> np.ndarray:
        """z (r,) to start with: what vanishes at the first sample, and some of everything."""
        inverse, weight = self.sampled
        values, vectors = np.linalg.eig(weight[0] @ inverse[0])
        best = np.real(vectors[:, int(np.argmax(np.real(values)))])
        best = np.linalg.solve(weight[0], best)
        generic = np.sin(1.0 + np.arange(len(best)))
        found = best / np.linalg.norm(best) + 0.3 * generic / np.linalg.norm(generic)
        return np.asarray(found / np.linalg.norm(found))

    @cached_property
    def steps(self) -> int:
        """Steps that suffice at all samples, and one more."""
        needed = [steps_needed(a, w, self.begin) for a, w in zip(*self.sampled, strict=True)]
        return min(max(needed) + 1, len(self.begin))

    @cached_property
    def spread(self) -> Compiled:
        """Squared size (1, n) of a Ritz vector from its value and the tridiagonal matrix."""
        return ritz_code(self.steps)

    @cached_property
    def spread_further(self) -> Compiled:
        """The same after some more steps."""
        return ritz_code(self.steps + MORE)

    @cached_property
    def further(self) -> Search:
        """Search for the Ritz value after some more steps."""
        return Search((), False, self.steps + MORE)


def steps_needed(inverse: np.ndarray, weight: np.ndarray, z: np.ndarray) -> int:
    """Steps of Lanczos' method for the largest eigenvalue of W^-1 A^-1, from z."""
    root = np.linalg.cholesky(weight)
    matrix, v = root.T @ inverse @ root, root.T @ z
    basis = [v / np.linalg.norm(v)]
    for k in range(len(z)):
        span = np.array(basis).T
        values, vectors = np.linalg.eigh(span.T @ matrix @ span)
        best = span @ vectors[:, -1]
        if np.linalg.norm(matrix @ best - values[-1] * best) < ACCURATE * values[-1]:
            return k + 1
        new = matrix @ basis[-1]
        for _ in range(2):
            new = new - span @ (span.T @ new)
        size = float(np.linalg.norm(new))
        if size < 1e-13 * values[-1]:
            return k + 1
        basis.append(new / size)
    return len(z)
