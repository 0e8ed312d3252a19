"""Following many branches: rows of postures, and the cells of a block from their neighbours."""

from __future__ import annotations

import numpy as np

from closedchain.closure.batch.codes import (
    FOLD,
    JOINT_LIMIT,
    MIRRORED,
    MIRRORED_END,
    NONE,
    OK,
    OPEN_START,
    SIGN,
    SINGULAR,
    STUCK,
    UNSEEN,
)
from closedchain.closure.batch.compiled import entry
from closedchain.closure.batch.following import follow, target_at
from closedchain.closure.batch.kinematics import place_tree
from closedchain.closure.batch.newton import Equations, begin, correct, scratch
from closedchain.closure.batch.rows import beyond, mirrored
from closedchain.closure.batch.tables import Tables, Tip

SMALLEST_ALONE = 1e-6  # share of the way, as closure.continuation.SMALLEST_STEP
SMALLEST_CELL = 1e-4  # share of a cell, as the maps have it
NEARS = 0.05  # of a neighbour's closeness to singularity: a path that ends below it met a fold


@entry
def solve(
    t: Tables, tip: Tip, e: Equations, postures: np.ndarray, targets: np.ndarray, status: np.ndarray
) -> None:
    """Follow every posture (n, nq), in place, to its target (n, p + 12); refusals (n,)."""
    s = scratch(t, e)
    start = np.empty(targets.shape[1])
    for i in range(postures.shape[0]):
        q = postures[i]
        target_at(t, tip, e, q, start, s)
        why, _ = correct(t, tip, e, q, start, 0.0, -1, s)
        if why != NONE:
            status[i] = why if why == SINGULAR else OPEN_START
            continue
        target_at(t, tip, e, q, start, s)
        why, _, _ = follow(t, tip, e, q, start, targets[i], 0, SMALLEST_ALONE, s)
        if why == NONE and t.senses.shape[0] > 0:
            place_tree(t, q, s.pose)
            if mirrored(t, s.pose, s.work):
                why = MIRRORED_END
        status[i] = why


@entry
def spread(
    t: Tables,
    tip: Tip,
    e: Equations,
    shape: np.ndarray,
    targets: np.ndarray,
    status: np.ndarray,
    postures: np.ndarray,
    seeds: np.ndarray,
    label: int,
    ends: np.ndarray,
    done: np.ndarray,
) -> None:
    """Reach the unseen cells of a block, see ``Batch.spread``; arrays are flat over its cells."""
    s = scratch(t, e)
    axes = shape.shape[0]
    stride = np.empty(axes, np.int64)
    size = 1
    for a in range(axes - 1, -1, -1):
        stride[a] = size
        size *= shape[a]
    queue = np.empty(size + seeds.shape[0], np.int64)
    head, tail = 0, 0
    for k in range(seeds.shape[0]):
        status[seeds[k]] = label
        queue[tail] = seeds[k]
        tail += 1
    q = np.empty(postures.shape[1])
    while head < tail:
        cell = queue[head]
        head += 1
        ready, dead, near = False, False, 0.0
        for side in range(2 * axes):
            a, up = side // 2, side % 2 == 1
            at = (cell // stride[a]) % shape[a]
            if dead or at == (shape[a] - 1 if up else 0):
                continue
            beside = cell + (stride[a] if up else -stride[a])
            if status[beside] != UNSEEN:
                continue
            if not ready:
                # factors of the cell, in place 0 until a path of several steps overwrites them
                dead = not begin(t, tip, e, postures[cell], targets[cell], 0, s)
                if dead:
                    continue
                near = s.numbers[0, 1]
            for k in range(q.shape[0]):
                q[k] = postures[cell, k]
            why, place, taken = follow(
                t, tip, e, q, targets[cell], targets[beside], 0, SMALLEST_CELL, s
            )
            nearing = s.numbers[place, 1] < NEARS * near
            ready = taken < 2
            if why != NONE:
                folded = nearing or why in (SIGN, SINGULAR)
                if ends[beside] != FOLD:
                    ends[beside] = FOLD if folded else STUCK
                continue
            if t.senses.shape[0] > 0:
                place_tree(t, q, s.pose)
                if mirrored(t, s.pose, s.work):
                    if ends[beside] != FOLD:
                        ends[beside] = MIRRORED
                    continue
            if beyond(t, q):
                if label == OK:
                    status[beside] = JOINT_LIMIT
                    done[0] += 1
                continue
            for k in range(q.shape[0]):
                postures[beside, k] = q[k]
            status[beside] = label
            queue[tail] = beside
            tail += 1
            done[0] += 1
    for k in range(status.shape[0]):
        if status[k] != UNSEEN:
            ends[k] = 0
