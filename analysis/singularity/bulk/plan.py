"""What is eliminated for the measures of a mechanism: independent rows, pivots, closed motions.

K's independent rows are eliminated in the passive columns, the inputs' carried along, so that the
free columns are the inputs' and what they leave undriven or idle. A motion for a unit rate of each
free column is a basis M of the closed motions. Where passive columns do not suffice (inputs to
spare, or inputs that do not drive), pivots may be anywhere.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from closedchain.analysis.singularity.classify import row_combination
from closedchain.closure.generic import GenericRanks, dimensionless_jacobian, generic_ranks
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.solve.problem import Problem, problem_of
from closedchain.closure.tape.bodies import Entries
from closedchain.closure.tape.dense import determinant, gram_root
from closedchain.closure.tape.eliminated import EliminatedClosures
from closedchain.closure.tape.elimination import Sparse, along, parity
from closedchain.closure.tape.expression import Expr, Graph, total
from closedchain.closure.tape.rows import Kinematics
from closedchain.urdf.description import OUTPUTS


@dataclass(frozen=True, eq=False)
class Plan:
    """Choice of rows and columns for a mechanism and outputs.

    Attributes
    ----------
    kept : tuple of int
        Independent closure rows, as many as the generic rank.
    columns, carried : tuple of int
        Tangent coordinates that may have a pivot, and those that may not.
    samples : (n, nq) array
        Regular closed postures at which pivots are judged.
    upright : frozenset of str
        Closures whose rows that hold a point may stand along the world's axes.
    """

    mechanism: Mechanism
    outputs: tuple[str, ...]
    generic: GenericRanks
    kept: tuple[int, ...]
    columns: tuple[int, ...]
    carried: tuple[int, ...]
    samples: np.ndarray
    upright: frozenset[str]

    @property
    def motions(self) -> int:
        """Dimension of the closed motions."""
        return self.generic.motions

    @property
    def redundant(self) -> bool:
        """Whether there are closure rows beside the kept ones."""
        return len(self.kept) < self.mechanism.rows

    @property
    def has_direct(self) -> bool:
        """Whether K_p is square, of independent rows."""
        return self.motions == len(self.mechanism.inputs)

    @property
    def has_inverse(self) -> bool:
        """Whether [K; J] is square."""
        return self.motions == len(self.outputs)

    @property
    def oriented_by_home(self) -> bool:
        """Whether the sign of det [K; J] is told by the rows' orientation at home."""
        return self.redundant and self.has_inverse and not self.has_direct


def planned(mechanism: Mechanism, outputs: tuple[str, ...]) -> Plan | None:
    """Plan for a mechanism; None where its samples do not show the generic rank."""
    generic = generic_ranks(mechanism, outputs)
    nv = mechanism.model.nv
    rank = nv - generic.motions
    inputs = tuple(int(v) for v in mechanism.input_v)
    pinned = problem_of(mechanism, pinned=inputs)
    if len(pinned.kept) == rank:
        return _plan(pinned, outputs, generic)
    whole = problem_of(mechanism)
    if len(whole.kept) != rank:
        return None
    return _plan(whole, outputs, generic)


def _plan(problem: Problem, outputs: tuple[str, ...], generic: GenericRanks) -> Plan:
    """Plan with the rows, axes, coordinates and samples of a problem."""
    m, kept, regular = problem.mechanism, problem.kept, problem.regular
    columns, carried = problem.free, problem.pinned
    return Plan(m, outputs, generic, kept, columns, carried, regular, problem.upright)


@dataclass(frozen=True, eq=False)
class FirstOrderTape(EliminatedClosures):
    """The first-order kinematics of a plan as expressions in q."""

    plan: Plan

    @cached_property
    def task(self) -> list[Entries]:
        """Rows of J."""
        if not self.plan.outputs:
            return []
        tip = self.plan.mechanism.required_task().tip
        return self.kinematics.task(tip, [OUTPUTS.index(name) for name in self.plan.outputs])

    @cached_property
    def outputs(self) -> list[list[Expr]]:
        """Rows of J M."""
        return [[self._along(row, motion) for motion in self.basis] for row in self.task]

    @cached_property
    def inputs(self) -> list[list[Expr]]:
        """Rows of M that are the inputs' rates."""
        zero = self.graph.constant(0.0)
        return [
            [motion.get(int(v), zero) for motion in self.basis] for v in self.plan.mechanism.input_v
        ]

    def _along(self, row: Entries, motion: Sparse) -> Expr:
        return self.graph.lift(along(row, motion))

    @cached_property
    def left_out(self) -> list[Entries]:
        """Rows of K that are not kept."""
        kept = set(self.kept)
        return [row for r, row in enumerate(self.kinematics.closures.entries) if r not in kept]

    @cached_property
    def shares(self) -> list[dict[int, Expr]]:
        """X of the redundant rows: K_redundant = X K_kept, at closed postures."""
        found = []
        for row in self.left_out:
            solved = self.factors.solve_transposed(row)
            found.append({i: x for i, x in enumerate(solved) if x.value != 0.0})
        return found

    @cached_property
    def stretch(self) -> Expr:
        """How much larger determinants are with rows combined orthonormally instead of kept."""
        return gram_root(self.graph, self.shares)

    @cached_property
    def determinants(self) -> dict[str, Expr]:
        """Signed determinants, as ``classify.determinants`` has them; none that is not square."""
        plan, inputs = self.plan, self.plan.mechanism.input_v
        pivots = self.factors.determinant(range(plan.mechanism.model.nv))
        if plan.redundant:
            pivots = pivots * self.stretch
        found = {}
        if plan.has_direct:
            order = parity([*(int(v) for v in plan.mechanism.passive_v), *(int(v) for v in inputs)])
            found["det_direct"] = pivots * determinant(self.graph, self.inputs) * order
        if plan.has_inverse:
            found["det_inverse"] = pivots * determinant(self.graph, self.outputs)
        if plan.redundant:
            self._orient(found)
        return {name: self.graph.lift(det) for name, det in found.items()}

    def _orient(self, found: dict[str, Expr]) -> None:
        """Give determinants of redundant rows signs that do not depend on the choice of rows."""
        if "det_direct" in found:
            orientation = found["det_direct"]
            found["det_direct"] = abs(orientation)
        elif "det_inverse" in found:
            orientation = self._orientation()
        if "det_inverse" in found:
            det = found["det_inverse"]
            found["det_inverse"] = (orientation < 0.0).select(-det, det)

    def _orientation(self) -> Expr:
        """Determinant whose sign tells the kept rows' orientation from that of home's."""
        plan = self.plan
        at_home = dimensionless_jacobian(plan.mechanism, plan.mechanism.home)
        home = row_combination(plan.mechanism, at_home[None])[0]
        others = [r for r in range(plan.mechanism.rows) if r not in set(plan.kept)]
        matrix = [
            [
                self.graph.lift(
                    float(one[r])
                    + total(
                        float(one[o]) * x[i]
                        for o, x in zip(others, self.shares, strict=True)
                        if i in x
                    )
                )
                for i, r in enumerate(plan.kept)
            ]
            for one in home
        ]
        return determinant(self.graph, matrix)

    @property
    def guards(self) -> dict[str, Expr]:
        """What tells whether the numbers can be trusted.

        The smallest pivot; the largest entry of what was solved for, huge where a pivot is small;
        and how far the closed motions are from meeting the rows left out, which they do wherever
        these depend on the kept ones.
        """
        zero, one = self.graph.constant(0.0), self.graph.constant(1.0)
        solved = [*rows_of(self.outputs), *rows_of(self.inputs)]
        solved += [x for share in self.shares for x in share.values()]
        missed = [self._along(row, motion) for row in self.left_out for motion in self.basis]
        return {
            "least": self.factors.least,
            "large": largest(solved, one),
            "left_out": largest(missed, zero),
        }


def first_order_tape(plan: Plan) -> FirstOrderTape:
    """Expressions of a plan; along Pinocchio's axes of rows where their signs matter."""
    m, graph = plan.mechanism, Graph()
    upright = False if plan.oriented_by_home else plan.upright
    k = Kinematics(m, graph, graph.inputs(0, m.model.nq), upright)
    return FirstOrderTape(k, plan.kept, plan.columns, plan.carried, plan.samples, plan)


def largest(values: Sequence[Expr], least: Expr) -> Expr:
    """Largest size of some values, at least ``least``."""
    for value in values:
        least = least.max(abs(value))
    return least


def rows_of(matrix: Sequence[Sequence[Expr]]) -> list[Expr]:
    """Entries of a matrix, row by row."""
    return [entry for row in matrix for entry in row]
