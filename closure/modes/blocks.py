"""Equations that can be solved one part after another, as those of open chains.

Kept rows and unknowns are paired off; what depends on each other in a ring is one block, and each
block needs but the unknowns of those before.
"""

from __future__ import annotations

import numpy as np

from closedchain.closure.modes.complex_equations import ComplexEquations
from closedchain.closure.modes.paths import Block


def blocks_of(equations: ComplexEquations) -> list[Block]:
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
