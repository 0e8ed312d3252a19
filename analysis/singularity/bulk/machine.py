"""Machine code for all measures of a plan, and how its numbers are laid out.

One tape takes a posture to its determinants and to small matrices, reduced to numbers; loops take
those to singular values. Where singular values are not simply the smallest and the largest of full
matrices, the matrices come out, for ``rank_loss`` and LAPACK.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from closedchain.analysis.singularity.bulk.constraint import Constraint
from closedchain.analysis.singularity.bulk.plan import (
    FirstOrderTape,
    Plan,
    first_order_tape,
    rows_of,
)
from closedchain.analysis.singularity.bulk.values import Search, SmallMatrices, regular
from closedchain.closure.tape.expression import Expr, Graph
from closedchain.closure.tape.machine import Compiled, compiled


@dataclass(frozen=True, eq=False)
class Numbers:
    """Outputs of a tape by name: rows of its result."""

    begins: dict[str, slice]
    rows: np.ndarray

    def __getitem__(self, name: str) -> np.ndarray:
        return self.rows[self.begins[name]]

    def one(self, name: str) -> np.ndarray:
        """A single row (n,)."""
        return np.asarray(self.rows[self.begins[name].start])


@dataclass(frozen=True, eq=False)
class NamedTape:
    """A compiled tape whose outputs have names."""

    code: Compiled
    begins: dict[str, slice]

    @classmethod
    def of(cls, graph: Graph, outputs: dict[str, list[Expr]], inputs: int) -> NamedTape:
        """Compile."""
        begins, at = {}, 0
        for name, expressions in outputs.items():
            begins[name] = slice(at, at + len(expressions))
            at += len(expressions)
        flat = [e for expressions in outputs.values() for e in expressions]
        return cls(compiled(graph.tape(flat, inputs), single=False), begins)

    def run(self, x: np.ndarray) -> Numbers:
        """Evaluate at (inputs, n)."""
        return Numbers(self.begins, self.code.run(x))


@dataclass(frozen=True, eq=False)
class MeasuresCode:
    """Machine code of a plan, compiled when first used."""

    plan: Plan

    @property
    def inputs(self) -> int:
        """Numbers of a posture."""
        return int(self.plan.mechanism.model.nq)

    @cached_property
    def determinants(self) -> NamedTape:
        """Residual, determinants and what guards them."""
        tape = first_order_tape(self.plan)
        return NamedTape.of(tape.graph, first_outputs(tape), self.inputs)

    @cached_property
    def tape(self) -> FirstOrderTape:
        """Expressions of the second tape."""
        return first_order_tape(self.plan)

    @cached_property
    def constraint(self) -> Constraint | None:
        """How sigma_constraint is found; None without closures that hold anything."""
        return Constraint(self.tape) if self.plan.kept else None

    @cached_property
    def search(self) -> Search:
        """The loop over all singular values: of small matrices that do not come out, and of K."""
        steps = 0 if self.constraint is None else self.constraint.steps
        if not self.regular:
            return Search((), False, steps)
        sizes = tuple(len(diagonal) for diagonal, _ in self.small.reduced)
        return Search(sizes, not self.plan.generic.idle, steps)

    @cached_property
    def regular(self) -> bool:
        """Whether the small matrices are reduced to numbers."""
        return regular(self.plan)

    @cached_property
    def small(self) -> SmallMatrices:
        """The matrices on the closed motions."""
        return SmallMatrices(self.tape)

    @cached_property
    def everything(self) -> NamedTape:
        """The second tape: besides, small matrices and what sigma_constraint needs."""
        tape, small = self.tape, self.small
        outputs = first_outputs(tape) | {"size": [small.size]}
        if self.regular:
            outputs["forms"] = [x for form in small.reduced for part in form for x in part]
        else:
            outputs |= {"inputs": rows_of(small.inputs), "outputs": rows_of(small.outputs)}
        if self.constraint is not None:
            outputs["constraint"] = self.constraint.outputs
        return NamedTape.of(tape.graph, outputs, self.inputs)


def first_outputs(tape: FirstOrderTape) -> dict[str, list[Expr]]:
    """Residual, determinants and what guards them."""
    found = {"residual": tape.residual} | tape.guards | tape.determinants
    return {name: [expression] for name, expression in found.items()}
