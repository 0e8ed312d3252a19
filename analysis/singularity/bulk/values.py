"""Singular values of the small matrices of a posture, and of K, found in one loop in lanes.

For mechanisms whose inputs drive all that moves, none of them to spare: A, T and the twist map S
have full rank generically, so the values sought are the smallest and the largest of theirs.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from closedchain.analysis.singularity.bulk.plan import FirstOrderTape, Plan
from closedchain.closure.tape.dense import bidiagonal, over_triangle, triangle
from closedchain.closure.tape.expression import Expr, Graph, total
from closedchain.closure.tape.extremes import Bidiagonal, Tridiagonal, step
from closedchain.closure.tape.machine import Compiled, Looped, compiled, looped
from closedchain.closure.tape.rates import physical_rates

SEARCHES = ("direct", "inverse", "twist_least", "twist_most")


def regular(plan: Plan) -> bool:
    """Whether the values sought are the smallest and the largest of each matrix."""
    generic, drives, d = plan.generic, len(plan.mechanism.inputs), len(plan.outputs)
    driven = generic.undriven == 0 and generic.spare == 0 and drives > 0
    return driven and generic.outputs.value == min(d, drives) == min(d, plan.motions) > 0


@dataclass(frozen=True, eq=False)
class SmallMatrices:
    """The matrices on the closed motions, as expressions."""

    tape: FirstOrderTape

    @cached_property
    def upper(self) -> list[list[Expr]]:
        """R of P M = Q R: N = M R^-1 is orthonormal in the norm of joint rates."""
        rates = physical_rates(self.tape.kinematics, self.tape.basis)
        return triangle(self.tape.graph, rates)

    @cached_property
    def size(self) -> Expr:
        """Squared size of M in that norm: digits are lost in proportion to its root."""
        return self.tape.graph.lift(total(x * x for row in self.upper for x in row))

    @cached_property
    def inputs(self) -> list[list[Expr]]:
        """A."""
        return over_triangle(self.tape.graph, self.tape.inputs, self.upper)

    @cached_property
    def outputs(self) -> list[list[Expr]]:
        """T."""
        return over_triangle(self.tape.graph, self.tape.outputs, self.upper)

    @cached_property
    def twist_map(self) -> list[list[Expr]]:
        """S, for inputs that are free columns: outputs for their unit rates."""
        place = {column: i for i, column in enumerate(self.tape.factors.free)}
        columns = [place[int(v)] for v in self.tape.plan.mechanism.input_v]
        return [[row[i] for i in columns] for row in self.tape.outputs]

    @cached_property
    def reduced(self) -> list[tuple[list[Expr], list[Expr]]]:
        """Bidiagonal forms of A, or R where A is its inverse, of T and of S."""
        g = self.tape.graph
        direct = self.inputs if self.tape.plan.generic.idle else self.upper
        return [bidiagonal(g, m) for m in (direct, self.outputs, self.twist_map)]


def ritz_matrix(graph: Graph, begin: int, steps: int) -> Tridiagonal:
    """Lanczos' tridiagonal matrix, from the inputs ``begin`` on."""
    return Tridiagonal(graph, graph.inputs(begin, steps), graph.inputs(begin + steps, steps - 1))


def ritz_code(steps: int) -> Compiled:
    """Squared size of a Ritz vector from its value and the tridiagonal matrix."""
    g = Graph()
    return compiled(g.tape([ritz_matrix(g, 1, steps).spread(g.input(0))], 2 * steps), single=False)


@dataclass(frozen=True, eq=False)
class Search:
    """The loop over all values of a posture.

    Attributes
    ----------
    sizes : tuple of int
        Entries on the diagonals of the bidiagonal forms of A or R, T and S; none where those are
        not sought.
    inverted : bool
        Whether the first form is that of R.
    steps : int
        Size of Lanczos' tridiagonal matrix; 0 without one.
    """

    sizes: tuple[int, ...]
    inverted: bool
    steps: int

    @property
    def searches(self) -> int:
        """How many values are sought."""
        return len(SEARCHES) * bool(self.sizes) + (self.steps > 0)

    @property
    def states(self) -> int:
        """For each value the value and whether it is still sought."""
        return 2 * self.searches

    @cached_property
    def loop(self) -> Looped:
        """Machine code: repeats until all are found."""
        g, n = Graph(), self.searches
        x, on = g.inputs(0, n), g.inputs(n, n)
        begin = self.states
        forms = []
        for size in self.sizes:
            forms.append(Bidiagonal(g, g.inputs(begin, size), g.inputs(begin + size, size - 1)))
            begin += 2 * size - 1
        searched: list[tuple[Bidiagonal | Tridiagonal, bool]] = []
        if forms:
            direct, inverse, twist = forms
            searched = [(direct, not self.inverted), (inverse, True), (twist, True), (twist, False)]
        if self.steps:
            searched.append((ritz_matrix(g, begin, self.steps), False))
            begin += 2 * self.steps - 1
        values, flags, running = [], [], g.constant(1.0) < 0.0
        for k, (form, upward) in enumerate(searched):
            sought = on[k] > 0.0
            new, further = step(x[k], form.slopes(x[k]), form.size, upward)
            values.append(sought.select(new, x[k]))
            further = sought & further
            flags.append(further.select(1.0, 0.0))
            running = running | further
        return looped(g.tape([*values, *flags, running], begin), self.states, single=False)
