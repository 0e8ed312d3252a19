"""Closure rows and their Jacobian, dimensionless, as ``closure.rows`` and ``kinds`` define them."""

from __future__ import annotations

import math

import numpy as np

from closedchain.closure.batch.compiled import kernel
from closedchain.closure.batch.kinematics import compose, log3, log3_jacobian
from closedchain.closure.batch.tables import FIXED, FLOATING, REVOLUTE, Tables


@kernel
def closure_rows(
    t: Tables,
    q: np.ndarray,
    pose: np.ndarray,
    values: np.ndarray,
    matrix: np.ndarray,
    column: np.ndarray,
    jacobian: bool,
    work: np.ndarray,
) -> None:
    """Residual values (rows,) and, with ``jacobian``, the entries of K in matrix (>= rows, *).

    Column column[v] holds unknown v; below 0 it is left out. Entries that cannot differ from zero
    are not written. ``work`` is (6, 12) of scratch: frames 1 and 2, their gap, and rows for log6.
    """
    for c in range(t.closures.shape[0]):
        first, second = t.closures[c, 1], t.closures[c, 2]
        row, count = t.closures[c, 3], t.closures[c, 4]
        compose(pose, first, t.frames, 2 * c, work, 0)
        compose(pose, second, t.frames, 2 * c + 1, work, 1)
        dx, dy, dz = work[1, 9] - work[0, 9], work[1, 10] - work[0, 10], work[1, 11] - work[0, 11]
        for a in range(3):
            work[2, 9 + a] = work[0, a] * dx + work[0, 3 + a] * dy + work[0, 6 + a] * dz
        if t.closures[c, 5] == 1:
            values[row] = work[2, 9]
            values[row + 1] = work[2, 10]
            values[row + 2] = work[2, 11]
        else:
            for a in range(3):
                for b in range(3):
                    work[2, 3 * a + b] = (
                        work[0, a] * work[1, b]
                        + work[0, 3 + a] * work[1, 3 + b]
                        + work[0, 6 + a] * work[1, 6 + b]
                    )
            if t.closures[c, 0] == FIXED:
                _log6(work, values, row)
            else:
                for r in range(row, row + count):
                    a, b = t.entries[r, 1], t.entries[r, 2]
                    values[r] = work[2, 9 + a] if t.entries[r, 0] == 0 else work[2, 3 * a + b]
        if jacobian:
            point = t.closures[c, 5] == 1
            for n in range(t.path_ends[c], t.path_ends[c + 1]):
                joint, sign = t.path[n, 0], float(t.path[n, 1])
                kind, iv = t.joints[joint, 0], t.joints[joint, 3]
                ax = work[1, 9] - pose[joint, 9]
                ay = work[1, 10] - pose[joint, 10]
                az = work[1, 11] - pose[joint, 11]
                for k in range(0 if kind == FLOATING else 2, 3):
                    slide = turn = -1
                    if kind == FLOATING:
                        slide, turn = column[iv + k], column[iv + 3 + k]
                    elif kind == REVOLUTE:
                        turn = column[iv]
                    else:
                        slide = column[iv]
                    # axis of the joint, and its velocity at the origin of frame 2, in frame 1
                    x, y, z = (
                        sign * pose[joint, k],
                        sign * pose[joint, 3 + k],
                        sign * pose[joint, 6 + k],
                    )
                    wx = work[0, 0] * x + work[0, 3] * y + work[0, 6] * z
                    wy = work[0, 1] * x + work[0, 4] * y + work[0, 7] * z
                    wz = work[0, 2] * x + work[0, 5] * y + work[0, 8] * z
                    ux, uy, uz = y * az - z * ay, z * ax - x * az, x * ay - y * ax
                    vx = work[0, 0] * ux + work[0, 3] * uy + work[0, 6] * uz
                    vy = work[0, 1] * ux + work[0, 4] * uy + work[0, 7] * uz
                    vz = work[0, 2] * ux + work[0, 5] * uy + work[0, 8] * uz
                    if point:
                        if slide >= 0:
                            matrix[row, slide] = wx
                            matrix[row + 1, slide] = wy
                            matrix[row + 2, slide] = wz
                        if turn >= 0:
                            matrix[row, turn] = vx
                            matrix[row + 1, turn] = vy
                            matrix[row + 2, turn] = vz
                        continue
                    fixed = t.closures[c, 0] == FIXED
                    if slide >= 0:
                        if fixed:
                            _put_log6(matrix, row, slide, wx, wy, wz, 0.0, 0.0, 0.0, work)
                        else:
                            _put(
                                t.entries,
                                row,
                                count,
                                matrix,
                                slide,
                                wx,
                                wy,
                                wz,
                                0.0,
                                0.0,
                                0.0,
                                work,
                            )
                    if turn >= 0:
                        if fixed:
                            _put_log6(matrix, row, turn, vx, vy, vz, wx, wy, wz, work)
                        else:
                            _put(t.entries, row, count, matrix, turn, vx, vy, vz, wx, wy, wz, work)
    for k in range(t.couplings.shape[0]):
        row = t.couplings[k, 0]
        follower, leader = q[t.couplings[k, 1]], q[t.couplings[k, 2]]
        values[row] = (follower - t.ratios[k, 0] * leader - t.ratios[k, 1]) / t.ratios[k, 2]
        if jacobian:
            f, ell = column[t.couplings[k, 3]], column[t.couplings[k, 4]]
            if f >= 0:
                matrix[row, f] = t.ratios[k, 3]
            if ell >= 0:
                matrix[row, ell] = t.ratios[k, 4]


@kernel
def _put(
    entries: np.ndarray,
    row: int,
    count: int,
    matrix: np.ndarray,
    col: int,
    vx: float,
    vy: float,
    vz: float,
    wx: float,
    wy: float,
    wz: float,
    work: np.ndarray,
) -> None:
    """Slides and dots for a twist (v, w) of frame 2 against frame 1, at the origin of frame 2."""
    for r in range(row, row + count):
        a, b = entries[r, 1], entries[r, 2]
        if entries[r, 0] == 0:
            matrix[r, col] = vx if a == 0 else (vy if a == 1 else vz)
        else:
            # e_a . (w x c), c column b of the gap's rotation
            x, y, z = work[2, b], work[2, 3 + b], work[2, 6 + b]
            if a == 0:
                matrix[r, col] = wy * z - wz * y
            elif a == 1:
                matrix[r, col] = wz * x - wx * z
            else:
                matrix[r, col] = wx * y - wy * x


@kernel
def _put_log6(
    matrix: np.ndarray,
    row: int,
    col: int,
    vx: float,
    vy: float,
    vz: float,
    wx: float,
    wy: float,
    wz: float,
    work: np.ndarray,
) -> None:
    """Rows of a fixed closure for the same twist: its Jacobian times the twist in frame 2."""
    x = work[2, 0] * vx + work[2, 3] * vy + work[2, 6] * vz
    y = work[2, 1] * vx + work[2, 4] * vy + work[2, 7] * vz
    z = work[2, 2] * vx + work[2, 5] * vy + work[2, 8] * vz
    a = work[2, 0] * wx + work[2, 3] * wy + work[2, 6] * wz
    b = work[2, 1] * wx + work[2, 4] * wy + work[2, 7] * wz
    d = work[2, 2] * wx + work[2, 5] * wy + work[2, 8] * wz
    for r in range(3):
        k = 3 * r
        shift = work[3, k] * x + work[3, k + 1] * y + work[3, k + 2] * z
        bend = work[4, k] * a + work[4, k + 1] * b + work[4, k + 2] * d
        matrix[row + r, col] = shift + bend
        matrix[row + 3 + r, col] = work[3, k] * a + work[3, k + 1] * b + work[3, k + 2] * d


@kernel
def _log6(work: np.ndarray, values: np.ndarray, row: int) -> None:
    """log6 of the gap work[2] into six values; its Jacobian into work[3] (A) and work[4] (B).

    The Jacobian is [[A, B], [0, A]] for a twist in frame 2, A that of log3 (as ``pin.Jlog6``).
    """
    w = work[5]
    angle = log3(work[2], 0, w)
    log3_jacobian(w, angle, work[3])
    x, y, z = w[0], w[1], w[2]
    px, py, pz = work[2, 9], work[2, 10], work[2, 11]
    t2 = angle * angle
    along = x * px + y * py + z * pz
    if angle < 0.1:
        # beta(t) = 1/t^2 - cot(t/2)/(2t), and its derivative over t, as series: they cancel there
        beta = 1.0 / 12.0 + t2 * (1.0 / 720.0 + t2 * (1.0 / 30240.0 + t2 / 1209600.0))
        beta += t2 * t2 * t2 * t2 / 47900160.0
        rate = 1.0 / 360.0 + t2 * (1.0 / 7560.0 + t2 * (1.0 / 201600.0 + t2 / 5987520.0))
    else:
        sine = math.sin(0.5 * angle)
        beta = 1.0 / t2 - 0.5 / (angle * math.tan(0.5 * angle))
        rate = -2.0 / (t2 * t2) + (1.0 + math.sin(angle) / angle) / (4.0 * t2 * sine * sine)
    alpha = 1.0 - beta * t2
    values[row] = alpha * px - 0.5 * (y * pz - z * py) + beta * along * x
    values[row + 1] = alpha * py - 0.5 * (z * px - x * pz) + beta * along * y
    values[row + 2] = alpha * pz - 0.5 * (x * py - y * px) + beta * along * z
    values[row + 3], values[row + 4], values[row + 5] = x, y, z
    f, g = rate * along, t2 * rate + 2.0 * beta
    sx, sy, sz = f * x - g * px, f * y - g * py, f * z - g * pz
    d = along * beta
    c00, c01, c02 = sx * x + beta * x * px + d, sx * y + beta * x * py, sx * z + beta * x * pz
    c10, c11, c12 = sy * x + beta * y * px, sy * y + beta * y * py + d, sy * z + beta * y * pz
    c20, c21, c22 = sz * x + beta * z * px, sz * y + beta * z * py, sz * z + beta * z * pz + d
    c01, c02 = c01 - 0.5 * pz, c02 + 0.5 * py
    c10, c12 = c10 + 0.5 * pz, c12 - 0.5 * px
    c20, c21 = c20 - 0.5 * py, c21 + 0.5 * px
    j, out = work[3], work[4]
    for k in range(3):
        u, v, s = j[k], j[3 + k], j[6 + k]
        out[k] = c00 * u + c01 * v + c02 * s
        out[3 + k] = c10 * u + c11 * v + c12 * s
        out[6 + k] = c20 * u + c21 * v + c22 * s


@kernel
def mirrored(t: Tables, pose: np.ndarray, work: np.ndarray) -> bool:
    """Whether some closure has axes opposed that a closed joint has parallel; poses up to date."""
    for n in range(t.senses.shape[0]):
        c, a = t.senses[n, 0], t.senses[n, 1]
        compose(pose, t.closures[c, 1], t.frames, 2 * c, work, 0)
        compose(pose, t.closures[c, 2], t.frames, 2 * c + 1, work, 1)
        cosine = (
            work[0, a] * work[1, a]
            + work[0, 3 + a] * work[1, 3 + a]
            + work[0, 6 + a] * work[1, 6 + a]
        )
        if cosine < 0.0:
            return True
    return False


@kernel
def beyond(t: Tables, q: np.ndarray) -> bool:
    """Whether some joint is outside its limits by more than 1e-9."""
    for i in range(q.shape[0]):
        if q[i] < t.limits[0, i] - 1e-9 or q[i] > t.limits[1, i] + 1e-9:
            return True
    return False


@kernel
def largest_row(t: Tables, values: np.ndarray) -> float:
    """Largest absolute closure row [m, rad] of dimensionless values (rows,)."""
    most = 0.0
    for r in range(t.row_unit.shape[0]):
        size = abs(values[r]) * t.row_unit[r]
        if not size <= most:  # a NaN must not pass for closed
            most = size
    return most


@kernel
def clear(matrix: np.ndarray) -> None:
    """Set all entries to zero."""
    for i in range(matrix.shape[0]):
        for j in range(matrix.shape[1]):
            matrix[i, j] = 0.0
