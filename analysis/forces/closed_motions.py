"""Machine code for what a simulation asks at every step: accelerations, and a fit to the loops.

Closures are eliminated in independent rows, K N = 0 with N (nv, n) the closed motions that the
elimination gives and K p = -Kdot v. The tree's mass matrix M and the efforts e on its joints come
from outside: N^T M N y = N^T (e - M p), and the accelerations are p + N y.

Velocities are Pinocchio's: floating bodies along their own axes. ``Kinematics`` has them along the
axes outside, where the elimination is sparser; both differ by rotations, which change no length.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

from closedchain.closure.mechanism import Mechanism
from closedchain.closure.solve.problem import Problem, problem_of
from closedchain.closure.tape.cholesky import cholesky
from closedchain.closure.tape.derivative import forward
from closedchain.closure.tape.eliminated import EliminatedClosures
from closedchain.closure.tape.elimination import Elimination, along
from closedchain.closure.tape.expression import Expr, Graph, total
from closedchain.closure.tape.machine import Compiled, compiled
from closedchain.closure.tape.rows import Kinematics

Motion = dict[int, Expr]
"""Coordinates of a motion that are not zero, dimensionless."""

FACTS = 3
"""Numbers that stand before the answers: whether these can be trusted."""


@dataclass(frozen=True, eq=False)
class ClosedMotions:
    """Programs of a mechanism.

    ``accelerations`` takes q, v, the entries ``pairs`` of M and e, and gives the smallest pivot,
    the largest 1/D of N^T M N = L D L^T times its largest diagonal entry, the smallest 1/D, and
    the accelerations (nv,). ``fit`` takes q and v and gives the smallest pivot, the largest closure
    row [m, rad], the determinant of [K; N^T] but for a factor above zero, the least step (nv,) that
    closes the kept rows to first order, the nearest velocity (nv,) that the loops allow, and N
    (nv, n), dimensionless, row by row. All else is in SI units.
    """

    mechanism: Mechanism

    @cached_property
    def problem(self) -> Problem:
        """All joints free."""
        return problem_of(self.mechanism)

    @cached_property
    def freedoms(self) -> int:
        """n"""
        return self.mechanism.model.nv - len(self.problem.kept)

    @cached_property
    def pairs(self) -> tuple[tuple[int, int], ...]:
        """Entries (row, column) of the upper triangle of M that need not vanish."""
        model = self.mechanism.model
        joint = [i for i in range(1, model.njoints) for _ in range(model.nvs[i])]
        above = {0: {0}}
        for i in range(1, model.njoints):
            above[i] = above[model.parents[i]] | {i}
        return tuple(
            (a, b)
            for a in range(model.nv)
            for b in range(a, model.nv)
            if joint[a] in above[joint[b]] or joint[b] in above[joint[a]]
        )

    @cached_property
    def accelerations(self) -> Compiled:
        """From (q, v, M, e) to the accelerations."""
        model, scale = self.mechanism.model, self.mechanism.column_scale
        g = Graph()
        at = _Posture(self.problem, g)
        entries = g.inputs(model.nq + model.nv, len(self.pairs))
        first = model.nq + model.nv + len(self.pairs)
        effort = [scale[v] * e for v, e in enumerate(g.inputs(first, model.nv))]
        mass: list[Motion] = [{} for _ in range(model.nv)]
        for (a, b), entry in zip(self.pairs, entries, strict=True):
            mass[a][b] = mass[b][a] = (scale[a] * scale[b]) * entry
        start = at.own(at.factors.solve([-x for x in at.drift]))
        motions = [at.own(motion) for motion in at.closures.basis]
        pulled = [_times(mass, motion) for motion in motions]
        inertia: dict[int, Motion] = {i: {} for i in range(len(motions))}
        for i, one in enumerate(motions):
            for j in range(i, len(motions)):
                inertia[i][j] = inertia[j][i] = g.lift(along(one, pulled[j]))
        right = [
            g.lift(along(motion, dict(enumerate(effort))) - along(start, pull))
            for motion, pull in zip(motions, pulled, strict=True)
        ]
        largest, spread, least = g.constant(0.0), g.constant(1.0), g.constant(1.0)
        shares: list[Expr] = []
        if motions:
            factors = cholesky(g, inertia)
            shares = factors.solve(right)
            spread = least = factors.inverses[0]
            for inverse in factors.inverses[1:]:
                spread, least = spread.max(inverse), least.min(inverse)
            for i in inertia:
                largest = largest.max(inertia[i][i])
            spread = spread * largest
        zero = g.constant(0.0)
        found = []
        for v in range(model.nv):
            terms = [y * m[v] for y, m in zip(shares, motions, strict=True) if v in m]
            found.append(scale[v] * g.lift(start.get(v, zero) + total(terms)))
        return compiled(g.tape([at.factors.least, spread, least, *found], first + model.nv))

    @cached_property
    def fit(self) -> Compiled:
        """From (q, v) to a step, a velocity and N."""
        model, scale = self.mechanism.model, self.mechanism.column_scale
        g = Graph()
        at = _Posture(self.problem, g)
        rows, kept, zero = at.kinematics.closures, self.problem.kept, g.constant(0.0)
        step = at.own(at.factors.shortest([-rows.values[r] for r in kept]))
        off = at.factors.shortest(at.row_rates)
        fits = at.own({v: x - off.get(v, zero) for v, x in at.velocity.items()})
        motions = [at.own(motion) for motion in at.closures.basis]
        determinant = at.factors.determinant(range(model.nv))
        answers = [scale[v] * g.lift(part.get(v, zero)) for part in (step, fits)
                   for v in range(model.nv)]  # fmt: skip
        basis = [g.lift(motion.get(v, zero)) for v in range(model.nv) for motion in motions]
        numbers = [at.factors.least, at.closures.residual, determinant, *answers, *basis]
        return compiled(g.tape([g.lift(x) for x in numbers], model.nq + model.nv))


@dataclass(frozen=True, eq=False)
class _Posture:
    """Expressions at a posture and a velocity, the first inputs of a graph."""

    problem: Problem
    graph: Graph

    @cached_property
    def closures(self) -> EliminatedClosures:
        return self.problem.eliminated(self.graph)

    @property
    def kinematics(self) -> Kinematics:
        return self.closures.kinematics

    @property
    def factors(self) -> Elimination:
        return self.closures.factors

    @cached_property
    def given(self) -> list[Expr]:
        """v (nv,) in SI units."""
        model = self.problem.mechanism.model
        return self.graph.inputs(model.nq, model.nv)

    @cached_property
    def velocity(self) -> Motion:
        """v, dimensionless, floating bodies along the axes outside."""
        scale = self.problem.mechanism.column_scale
        return self.kinematics.outside({v: x * (1.0 / scale[v]) for v, x in enumerate(self.given)})

    @cached_property
    def row_rates(self) -> list[Expr]:
        """K v of the kept rows."""
        return [self.graph.lift(along(row, self.velocity)) for row in self.closures.entries]

    @cached_property
    def drift(self) -> list[Expr]:
        """Kdot v of the kept rows: how K v changes while v stays as it is."""
        seeds: dict[int, Expr] = {}
        model = self.problem.mechanism.model
        scale = self.problem.mechanism.column_scale
        half = self.graph.constant(0.5)
        for i in range(1, model.njoints):
            iq, iv = model.idx_qs[i], model.idx_vs[i]
            if model.nvs[i] == 1:
                seeds[iq] = self.given[iv]
                continue
            for k in range(3):
                seeds[iq + k] = scale[iv] * self.velocity[iv + k]
            x, y, z, w = self.kinematics.q[iq + 3 : iq + 7]
            a, b, c = self.given[iv + 3 : iv + 6]
            rates = (
                w * a + y * c - z * b,
                w * b + z * a - x * c,
                w * c + x * b - y * a,
                -(x * a + y * b + z * c),
            )
            seeds |= {iq + 3 + k: half * rate for k, rate in enumerate(rates)}
        return forward(self.graph, self.row_rates, seeds)

    def own(self, motion: Motion) -> Motion:
        """A motion with floating bodies along their own axes."""
        return self.kinematics.own(motion)


def closed_motions(mechanism: Mechanism) -> ClosedMotions:
    """Programs of a mechanism, made once."""
    found: ClosedMotions = mechanism.known.setdefault(
        "forces.closed_motions", ClosedMotions(mechanism)
    )
    return found


def _times(matrix: Sequence[Motion], motion: Motion) -> Motion:
    found = {}
    for row, entries in enumerate(matrix):
        terms = [entry * motion[v] for v, entry in entries.items() if v in motion]
        if terms:
            entry = terms[0]
            for term in terms[1:]:
                entry = entry + term
            found[row] = entry
    return found
