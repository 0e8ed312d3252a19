"""Rows of the tip: its task Jacobian, and goals for its pose, as ``closure.task`` defines them."""

from __future__ import annotations

import numpy as np

from closedchain.closure.batch.compiled import kernel
from closedchain.closure.batch.kinematics import compose, log3, log3_jacobian
from closedchain.closure.batch.tables import FLOATING, REVOLUTE, Tables, Tip


@kernel
def task_rows(
    t: Tables,
    tip: Tip,
    outputs: np.ndarray,
    pose: np.ndarray,
    matrix: np.ndarray,
    row: int,
    column: np.ndarray,
    work: np.ndarray,
) -> None:
    """Task Jacobian from ``row`` of the matrix on; outputs (d,) are 0 to 5 for x y z rx ry rz.

    ``work`` is (6, 12) of scratch.
    """
    compose(pose, tip.joint, tip.place, 0, work, 0)
    angular = 0
    for k in range(outputs.shape[0]):
        angular += 1 if outputs[k] > 2 else 0
    for k in range(outputs.shape[0]):
        a = outputs[k]
        for x in range(3):
            if a < 3 or angular == 3:
                work[1 + k // 2, 3 * (k % 2) + x] = 1.0 if x == a % 3 else 0.0
            else:
                work[1 + k // 2, 3 * (k % 2) + x] = work[0, 3 * x + a - 3]
    _covector_rows(t, tip, outputs, pose, matrix, row, column, work)


@kernel
def goal_rows(
    t: Tables,
    tip: Tip,
    outputs: np.ndarray,
    pose: np.ndarray,
    target: np.ndarray,
    at: int,
    values: np.ndarray,
    matrix: np.ndarray,
    row: int,
    column: np.ndarray,
    jacobian: bool,
    work: np.ndarray,
) -> None:
    """Gap of the tip from a wanted pose, target[at:at+12], and its Jacobian, from ``row`` on."""
    compose(pose, tip.joint, tip.place, 0, work, 0)
    angular, third = 0, 3
    for k in range(outputs.shape[0]):
        if outputs[k] > 2:
            angular += 1
            third -= outputs[k] - 3
    rotation, turning = work[4], work[5]
    if angular == 1 or angular == 3:
        for a in range(3):
            for b in range(3):
                rotation[3 * a + b] = (
                    target[at + a] * work[0, b]
                    + target[at + 3 + a] * work[0, 3 + b]
                    + target[at + 6 + a] * work[0, 6 + b]
                )
        angle = log3(rotation, 0, turning)
        log3_jacobian(turning, angle, rotation)
    for k in range(outputs.shape[0]):
        a = outputs[k]
        p, o = 1 + k // 2, 3 * (k % 2)
        if a < 3:
            values[row + k] = work[0, 9 + a] - target[at + 9 + a]
            for x in range(3):
                work[p, o + x] = 1.0 if x == a else 0.0
        elif angular == 2:
            b = a - 3
            cx, cy, cz = work[0, third], work[0, 3 + third], work[0, 6 + third]
            wx, wy, wz = target[at + b], target[at + 3 + b], target[at + 6 + b]
            values[row + k] = cx * wx + cy * wy + cz * wz
            work[p, o] = cy * wz - cz * wy
            work[p, o + 1] = cz * wx - cx * wz
            work[p, o + 2] = cx * wy - cy * wx
        else:
            b = a - 3
            values[row + k] = turning[b]
            for x in range(3):
                work[p, o + x] = (
                    rotation[3 * b] * work[0, 3 * x]
                    + rotation[3 * b + 1] * work[0, 3 * x + 1]
                    + rotation[3 * b + 2] * work[0, 3 * x + 2]
                )
    if jacobian:
        _covector_rows(t, tip, outputs, pose, matrix, row, column, work)


@kernel
def _covector_rows(
    t: Tables,
    tip: Tip,
    outputs: np.ndarray,
    pose: np.ndarray,
    matrix: np.ndarray,
    row: int,
    column: np.ndarray,
    work: np.ndarray,
) -> None:
    """Rows e . v (outputs below 3) and e . w of the tip's twist, e two a row in work[1:4]."""
    for n in range(tip.ancestors.shape[0]):
        joint = tip.ancestors[n]
        kind, iv = t.joints[joint, 0], t.joints[joint, 3]
        ax = work[0, 9] - pose[joint, 9]
        ay = work[0, 10] - pose[joint, 10]
        az = work[0, 11] - pose[joint, 11]
        for k in range(0 if kind == FLOATING else 2, 3):
            zx, zy, zz = pose[joint, k], pose[joint, 3 + k], pose[joint, 6 + k]
            slide = turn = -1
            if kind == FLOATING:
                slide, turn = column[iv + k], column[iv + 3 + k]
            elif kind == REVOLUTE:
                turn = column[iv]
            else:
                slide = column[iv]
            vx, vy, vz = zy * az - zz * ay, zz * ax - zx * az, zx * ay - zy * ax
            for r in range(outputs.shape[0]):
                p, o = 1 + r // 2, 3 * (r % 2)
                x, y, z = work[p, o], work[p, o + 1], work[p, o + 2]
                linear = outputs[r] < 3
                if slide >= 0:
                    matrix[row + r, slide] = x * zx + y * zy + z * zz if linear else 0.0
                if turn >= 0:
                    if linear:
                        matrix[row + r, turn] = x * vx + y * vy + z * vz
                    else:
                        matrix[row + r, turn] = x * zx + y * zy + z * zz
