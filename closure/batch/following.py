"""Following a branch between two targets: the rules of ``closure.continuation.follow``."""

from __future__ import annotations

import math

import numpy as np

from closedchain.closure.batch.codes import NONE
from closedchain.closure.batch.compiled import kernel
from closedchain.closure.batch.kinematics import compose, log3, place_tree, turn_about
from closedchain.closure.batch.newton import Equations, Scratch, correct
from closedchain.closure.batch.tables import Tables, Tip

_LONGEST = 1.0  # of one sub-step: a characteristic length, or a radian


@kernel
def target_at(
    t: Tables, tip: Tip, e: Equations, q: np.ndarray, target: np.ndarray, s: Scratch
) -> None:
    """Target (p + 12,) that a posture meets: its pinned joints, and its tip."""
    p = e.pins.shape[0]
    for k in range(p):
        target[k] = q[e.pins[k]]
    place_tree(t, q, s.pose)
    compose(s.pose, tip.joint, tip.place, 0, s.work, 0)
    for k in range(12):
        target[p + k] = s.work[0, k]


@kernel
def follow(
    t: Tables,
    tip: Tip,
    e: Equations,
    q: np.ndarray,
    start: np.ndarray,
    goal: np.ndarray,
    place: int,
    smallest: float,
    s: Scratch,
) -> tuple[int, int, int]:
    """Follow the branch of q (factors at ``place``) from target ``start`` to ``goal``, in place.

    Pins and the tip's origin move on straight lines, its rotation about a fixed axis. Steps are
    halved where Newton's method refuses, down to the share ``smallest``.

    Returns the refusal, the place of the last factors, and the number of steps taken: factors at
    the start's place are overwritten by the second one.
    """
    p = e.pins.shape[0]
    travel = 0.0
    for k in range(p):
        travel = max(travel, abs(goal[k] - start[k]) / e.pin_units[k])
    if e.outputs.shape[0] > 0:
        way, turn = s.turn[0], s.turn[1]
        for a in range(3):
            for b in range(3):
                turn[3 * a + b] = (
                    start[p + a] * goal[p + b]
                    + start[p + 3 + a] * goal[p + 3 + b]
                    + start[p + 6 + a] * goal[p + 6 + b]
                )
        angle = log3(turn, 0, way)
        shift = 0.0
        for a in range(3):
            shift += (goal[p + 9 + a] - start[p + 9 + a]) ** 2
        travel = max(travel, math.sqrt(shift) + angle)
    longest = min(1.0, _LONGEST / travel) if travel > 0.0 else 1.0
    longest = max(longest, 1e-3)
    branch = s.numbers[place, 0]
    reached, step, why, taken = 0.0, longest, NONE, 0
    while reached < 1.0 and step >= smallest * longest:
        to = min(1.0, reached + step)
        last = to == 1.0
        for k in range(p + 12):
            s.target[k] = goal[k] if last else start[k] + to * (goal[k] - start[k])
        if e.outputs.shape[0] > 0 and not last:
            turn_about(start, p, s.turn[0], to, s.turn[1])
            for k in range(9):
                s.target[p + k] = s.turn[1, k]
        for k in range(q.shape[0]):
            s.trial[k] = q[k]
        for k in range(p):
            s.trial[e.pins[k]] = s.target[k]
        why, _ = correct(t, tip, e, s.trial, s.target, branch, place, s)
        if why == NONE:
            for k in range(q.shape[0]):
                q[k] = s.trial[k]
            reached, step, place = to, min(longest, 2.0 * step), 1 - place
            taken += 1
        else:
            step *= 0.5
    return (NONE if reached >= 1.0 else why), place, taken
