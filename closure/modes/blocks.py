"""Equations that can be solved one part after another, as those of open chains.

Kept rows and unknowns are paired off; what depends on each other in a ring is one block, and each
block needs but the unknowns of those before.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from closedchain.closure.modes.complex_equations import ComplexEquations
from closedchain.closure.modes.path_control import BOUND
from closedchain.closure.modes.paths import Followed
from closedchain.closure.modes.places import random_place, random_postures
from closedchain.closure.modes.systems import (
    Linear,
    Numbers,
    System,
    quaternions_of_targets,
    sizes,
    solved,
)
from closedchain.closure.solve.square_systems import solutions
from closedchain.closure.tape.expression import Graph
from closedchain.closure.tape.rows import Kinematics

SAMPLES = 6
"""Postures, real and as many complex ones, at which the order of elimination is chosen."""

TRIED, TRIALS, SETTLED = 24, 40, 1e-8
"""Random postures that Newton's method tries to close for that, its steps, and a small one."""


@dataclass(frozen=True, eq=False)
class Block(Followed):
    """Rows and unknowns of the equations that are solved together, the others held.

    ``rows`` are positions among the kept rows, ``columns`` among the unknowns, as many; ``own`` are
    the numbers of q that these unknowns change, and ``also`` the rows beside the kept ones, which
    are to be met, too.
    """

    equations: ComplexEquations
    rows: np.ndarray
    columns: np.ndarray
    own: np.ndarray
    also: np.ndarray

    def at(self, q: np.ndarray, targets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Rows (n, k) and Jacobian (n, k, k)."""
        values, jacobian = self.equations.at(q, targets)
        return values[:, self.rows], jacobian[:, self.rows][:, :, self.columns]

    def moved(self, q: np.ndarray, step: np.ndarray) -> np.ndarray:
        """Postures after steps (n, k) of the block's unknowns."""
        whole = np.zeros((len(q), self.equations.size), dtype=complex)
        whole[:, self.columns] = step
        return self.equations.moved(q, whole)

    @cached_property
    def system(self) -> System:
        """The block's equations for paths."""
        problem = self.equations.problem
        g, nq = Graph(), problem.mechanism.model.nq
        k = Kinematics(problem.mechanism, g, g.inputs(0, nq), upright=False)
        every = problem.rows(k, g.inputs(nq, problem.prescribed))
        chosen = [problem.kept[r] for r in self.rows]
        unknown = [problem.free[c] for c in self.columns]
        entries = [{v: e for v, e in every.entries[r].items() if v in unknown} for r in chosen]
        linear = Linear([every.values[r] for r in chosen], entries, unknown)
        step, guard = solved(g, linear, self._samples())
        moved = k.moved(k.q, step)
        out = [*(moved[i] for i in self.own), *(step[v] for v in unknown), *guard]
        tape = g.tape(out, nq + problem.prescribed)
        slow = self.newton_by_lapack
        return System(self.numbers, problem.prescribed, tape, self.relative, slow)

    def _samples(self) -> np.ndarray:
        """Closed postures and what they meet (nq + prescribed, n), real and complex ones.

        Off closure, entries are large that are nothing on it.
        """
        problem, rng = self.equations.problem, np.random.default_rng(3)
        q = random_postures(problem.mechanism, rng, TRIED)
        targets = np.array([random_place(problem, rng).targets for _ in range(TRIED)])
        q[:, problem.pinned_q] = targets[:, : len(problem.pinned)]
        size = np.full(TRIED, np.inf)
        for _ in range(TRIALS):
            _, step = self.newton_by_lapack(q, targets)
            size = sizes(self.relative, q, step)
            step *= (BOUND / np.maximum(size, BOUND))[:, None]
            q = self.moved(q, step)
        closed = np.flatnonzero(size < SETTLED)[:SAMPLES]
        real = problem.regular[:SAMPLES]
        every = np.concatenate([q[closed], real])
        return np.hstack([every, np.concatenate([targets[closed], problem.targets_at(real)])]).T

    def newton_by_lapack(self, q: np.ndarray, targets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Newton's step by LAPACK: postures (n, nq) after it, steps (n, k)."""
        values, jacobian = self.at(q, targets)
        step = -solutions(jacobian, values[:, :, None])[:, :, 0]
        return self.moved(q, step), step

    @cached_property
    def relative(self) -> dict[int, tuple[int, float]]:
        """Columns whose unknowns are lengths: their numbers of q, and the characteristic length."""
        problem = self.equations.problem
        m, model = problem.mechanism, problem.mechanism.model
        number = {}
        for j in range(1, model.njoints):
            for k in range(3 if model.nvs[j] == 6 else 1):
                if m.translational[model.idx_vs[j] + k]:
                    number[model.idx_vs[j] + k] = int(model.idx_qs[j]) + k
        v = [problem.free[c] for c in self.columns]
        return {i: (number[one], m.length) for i, one in enumerate(v) if one in number}

    @cached_property
    def numbers(self) -> Numbers:
        """What the numbers of its postures are."""
        problem = self.equations.problem
        m, model = problem.mechanism, problem.mechanism.model
        kind = np.zeros(model.nq, dtype=int)
        turns = []
        for j in range(1, model.njoints):
            first = int(model.idx_qs[j])
            if model.nqs[j] == 1:
                kind[first] = 0 if m.translational[model.idx_vs[j]] else 1
            else:
                turns.append(first + 3)
                kind[first + 3 : first + 7] = 2
        lengths, angles, others = (
            tuple(int(i) for i in self.own if kind[i] == wanted) for wanted in range(3)
        )
        return Numbers(
            count=model.nq,
            own=self.own,
            unit=m.length,
            lengths=lengths,
            angles=angles,
            others=others,
            turns=tuple(turns),
            pinned=tuple(int(i) for i in problem.pinned_q),
            poses=quaternions_of_targets(len(problem.pinned), len(problem.goals)),
        )


def blocks_of(equations: ComplexEquations) -> list[Block]:
    """Blocks of equations, found once."""
    problem = equations.problem
    key = "modes.blocks", problem.pinned, problem.goals
    known = problem.mechanism.known
    if key not in known:
        known[key] = _blocks(equations)
    found: list[Block] = known[key]
    return found


def _blocks(equations: ComplexEquations) -> list[Block]:
    """Blocks in the order in which they can be solved; one where nothing comes apart.

    The kept rows are as many as the unknowns. Where there are other rows as well, all is one block:
    solutions of the kept ones alone are many more, and no postures.
    """
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import connected_components, maximum_bipartite_matching

    pattern = equations.pattern
    size = equations.size
    if not size:
        return []
    every = np.arange(size)
    others = np.setdiff1d(np.arange(equations.problem.units.size), equations.problem.kept)
    if others.size:
        return [Block(equations, every, every, _own(equations, every), others)]
    row_of = maximum_bipartite_matching(csr_array(pattern), perm_type="row")
    row_of = np.where(row_of < 0, np.arange(size), row_of)  # structurally singular: one block
    needs = pattern[row_of]  # (unknown, unknown): the row paired with one holds the other
    for joint in _floating(equations):
        needs[np.ix_(joint, joint)] = True
    count, label = connected_components(csr_array(needs), connection="strong")
    order = _in_order(needs, label, count)
    blocks = []
    for one in order:
        columns = np.flatnonzero(label == one)
        rows = np.sort(row_of[columns])
        blocks.append(Block(equations, rows, columns, _own(equations, columns), others))
    return blocks


def _in_order(needs: np.ndarray, label: np.ndarray, count: int) -> list[int]:
    """Blocks such that each needs only those before."""
    before: list[set[int]] = [set() for _ in range(count)]
    for i, j in np.argwhere(needs):
        if label[i] != label[j]:
            before[label[i]].add(int(label[j]))
    found: list[int] = []
    while len(found) < count:
        found += [b for b in range(count) if b not in found and before[b] <= set(found)][:1]
    return found


def _floating(equations: ComplexEquations) -> list[np.ndarray]:
    """Positions among the unknowns of each floating joint's."""
    model, place = equations.problem.mechanism.model, equations.problem.free
    found = []
    for j in range(1, model.njoints):
        if model.nvs[j] == 6:
            own = range(model.idx_vs[j], model.idx_vs[j] + 6)
            found.append(np.array([place.index(v) for v in own if v in place], dtype=int))
    return found


def _own(equations: ComplexEquations, columns: np.ndarray) -> np.ndarray:
    """Numbers of q that unknowns change."""
    model = equations.problem.mechanism.model
    v = {equations.problem.free[c] for c in columns}
    found: list[int] = []
    for j in range(1, model.njoints):
        if v & set(range(model.idx_vs[j], model.idx_vs[j] + model.nvs[j])):
            found += range(model.idx_qs[j], model.idx_qs[j] + model.nqs[j])
    return np.array(found, dtype=int)
