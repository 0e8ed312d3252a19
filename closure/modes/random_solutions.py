"""Solutions at a complex place from random complex postures, by Newton's method."""

from __future__ import annotations

import numpy as np

from closedchain.closure.modes.blocks import Block
from closedchain.closure.modes.path_control import BOUND, CLOSED, FAR, HIGH, NEWTON
from closedchain.closure.modes.places import Place, random_postures
from closedchain.closure.modes.systems import sizes
from closedchain.closure.solve.square_systems import solutions

STARTS = 400  # at once
ROUNDS = 12
HITS = 6  # for each solution that is known, before it ends


def random_solutions(
    block: Block, place: Place, rng: np.random.Generator, count: int
) -> np.ndarray:
    """Solutions (n, nq) from random complex starts, shapes as often as they were hit.

    Starts go on until each of ``count`` solutions had several hits, in the mean.
    """
    found = []
    hits = 0
    for _ in range(ROUNDS):
        q = _met(
            block,
            place,
            newton(block, place, random_postures(block.equations.problem.mechanism, rng, STARTS)),
        )
        found.append(q)
        hits += len(q)
        if hits >= HITS * count:
            break
    return np.concatenate(found)


def newton(block: Block, place: Place, q: np.ndarray) -> np.ndarray:
    """Solutions (m, nq) that Newton's method, with bounded steps, reaches from postures (n, nq).

    With more rows than unknowns those of Gauss and Newton, on all.
    """
    if not block.also.size:
        return block.paths.closed(place, q)
    q, targets = block.numbers.between(place, place, q, np.zeros(len(q)))
    done = np.zeros(len(q), dtype=bool)
    alive = np.ones(len(q), dtype=bool)
    for _ in range(int(NEWTON)):
        i = np.flatnonzero(alive & ~done)
        if not i.size:
            break
        step = _toward(block, q[i], targets[i])
        size = sizes(block.relative, q[i], step)
        fine = np.isfinite(size)
        alive[i[~fine]] = False
        i, step, size = i[fine], step[fine], size[fine]
        step *= (BOUND / np.maximum(size, BOUND))[:, None]
        q[i] = block.moved(q[i], step)
        done[i] = size < CLOSED
        alive[i] &= ~block.numbers.far(q[i], FAR, HIGH)
    return np.asarray(q[done])


def _toward(block: Block, q: np.ndarray, targets: np.ndarray) -> np.ndarray:
    """Steps (n, k) of Gauss and Newton."""
    values, jacobian = block.equations.all_rows(q, targets)
    every = np.concatenate([np.array(block.equations.problem.kept)[block.rows], block.also])
    a = jacobian[:, every][:, :, block.columns]
    adjoint = a.conj().swapaxes(1, 2)
    right = adjoint @ values[:, every, None]
    return -solutions(adjoint @ a + 1e-14 * np.eye(a.shape[2]), right)[:, :, 0]


def _met(block: Block, place: Place, q: np.ndarray) -> np.ndarray:
    """Those of postures (n, nq) that meet the other rows, too, with no closed joint mirrored."""
    if not len(q) or not block.also.size:
        return q
    targets = np.broadcast_to(place.targets, (len(q), place.targets.size))
    return np.asarray(q[block.equations.proper(q, targets)])
