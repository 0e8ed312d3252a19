"""Poses of all joints of the spanning tree, and steps of the configuration.

A pose is a row of twelve numbers: the rotation row by row, then the origin. Lengths are divided by
the characteristic length. Every hinge and slide has its axis along z of its own frame.
"""

from __future__ import annotations

import math

import numpy as np

from closedchain.closure.batch.compiled import kernel
from closedchain.closure.batch.tables import FLOATING, REVOLUTE, Tables


@kernel
def compose(a: np.ndarray, i: int, b: np.ndarray, j: int, out: np.ndarray, k: int) -> None:
    """Product of the poses a[i] and b[j], into out[k]."""
    b0, b1, b2 = b[j, 0], b[j, 1], b[j, 2]
    b3, b4, b5 = b[j, 3], b[j, 4], b[j, 5]
    b6, b7, b8 = b[j, 6], b[j, 7], b[j, 8]
    x, y, z = b[j, 9], b[j, 10], b[j, 11]
    for r in range(3):
        a0, a1, a2 = a[i, 3 * r], a[i, 3 * r + 1], a[i, 3 * r + 2]
        out[k, 3 * r] = a0 * b0 + a1 * b3 + a2 * b6
        out[k, 3 * r + 1] = a0 * b1 + a1 * b4 + a2 * b7
        out[k, 3 * r + 2] = a0 * b2 + a1 * b5 + a2 * b8
        out[k, 9 + r] = a0 * x + a1 * y + a2 * z + a[i, 9 + r]


@kernel
def place_tree(t: Tables, q: np.ndarray, pose: np.ndarray) -> None:
    """Poses (joints + 1, 12) of all joints at q (nq,); row 0 is the base."""
    inverse_length = 1.0 / t.length
    for i in range(1, t.joints.shape[0]):
        kind, parent, iq = t.joints[i, 0], t.joints[i, 1], t.joints[i, 2]
        compose(pose, parent, t.place, i, pose, i)
        if kind == REVOLUTE:
            c, s = math.cos(q[iq]), math.sin(q[iq])
            for r in range(0, 9, 3):
                x, y = pose[i, r], pose[i, r + 1]
                pose[i, r] = c * x + s * y
                pose[i, r + 1] = c * y - s * x
        elif kind == FLOATING:
            _float(pose, i, q, iq, inverse_length)
        else:
            d = q[iq] * inverse_length
            for r in range(3):
                pose[i, 9 + r] += d * pose[i, 3 * r + 2]


@kernel
def _float(pose: np.ndarray, i: int, q: np.ndarray, iq: int, inverse_length: float) -> None:
    x, y, z, w = q[iq + 3], q[iq + 4], q[iq + 5], q[iq + 6]
    r00, r01, r02 = 1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)
    r10, r11, r12 = 2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)
    r20, r21, r22 = 2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)
    px, py, pz = q[iq] * inverse_length, q[iq + 1] * inverse_length, q[iq + 2] * inverse_length
    for r in range(3):
        a0, a1, a2 = pose[i, 3 * r], pose[i, 3 * r + 1], pose[i, 3 * r + 2]
        pose[i, 3 * r] = a0 * r00 + a1 * r10 + a2 * r20
        pose[i, 3 * r + 1] = a0 * r01 + a1 * r11 + a2 * r21
        pose[i, 3 * r + 2] = a0 * r02 + a1 * r12 + a2 * r22
        pose[i, 9 + r] += a0 * px + a1 * py + a2 * pz


@kernel
def move(t: Tables, q: np.ndarray, step: np.ndarray, column: np.ndarray) -> None:
    """Add a dimensionless step to q (nq,), in place; unknown v is entry column[v] of the step.

    Columns below 0 stay. Floating joints move by the exponential of their twist, as in
    ``pin.integrate``.
    """
    for i in range(1, t.joints.shape[0]):
        kind, iq, iv = t.joints[i, 0], t.joints[i, 2], t.joints[i, 3]
        if kind != FLOATING:
            if column[iv] >= 0:
                unit = 1.0 if kind == REVOLUTE else t.length
                q[iq] += unit * step[column[iv]]
            continue
        if column[iv] < 0:
            continue
        vx, vy, vz = step[column[iv]], step[column[iv + 1]], step[column[iv + 2]]
        wx, wy, wz = step[column[iv + 3]], step[column[iv + 4]], step[column[iv + 5]]
        angle2 = wx * wx + wy * wy + wz * wz
        angle = math.sqrt(angle2)
        if angle < 1e-4:
            # series of sin(h)/(2h) with h half the angle, (1 - cos a)/a^2, (a - sin a)/a^3
            half = 0.5 - angle2 / 48.0
            real = 1.0 - angle2 / 8.0 + angle2 * angle2 / 384.0
            a, b = 0.5 - angle2 / 24.0, 1.0 / 6.0 - angle2 / 120.0
        else:
            half, real = math.sin(0.5 * angle) / angle, math.cos(0.5 * angle)
            sine = math.sin(0.5 * angle)
            a = 2.0 * sine * sine / angle2
            b = (angle - math.sin(angle)) / (angle2 * angle)
        cx, cy, cz = wy * vz - wz * vy, wz * vx - wx * vz, wx * vy - wy * vx
        dx = t.length * (vx + a * cx + b * (wy * cz - wz * cy))
        dy = t.length * (vy + a * cy + b * (wz * cx - wx * cz))
        dz = t.length * (vz + a * cz + b * (wx * cy - wy * cx))
        x, y, z, w = q[iq + 3], q[iq + 4], q[iq + 5], q[iq + 6]
        # d turned by the quaternion: d + 2 w u x d + 2 u x (u x d)
        tx, ty, tz = 2.0 * (y * dz - z * dy), 2.0 * (z * dx - x * dz), 2.0 * (x * dy - y * dx)
        q[iq] += dx + w * tx + y * tz - z * ty
        q[iq + 1] += dy + w * ty + z * tx - x * tz
        q[iq + 2] += dz + w * tz + x * ty - y * tx
        ex, ey, ez, ew = half * wx, half * wy, half * wz, real
        nx = w * ex + x * ew + y * ez - z * ey
        ny = w * ey - x * ez + y * ew + z * ex
        nz = w * ez + x * ey - y * ex + z * ew
        nw = w * ew - x * ex - y * ey - z * ez
        scale = 1.0 / math.sqrt(nx * nx + ny * ny + nz * nz + nw * nw)
        q[iq + 3], q[iq + 4], q[iq + 5], q[iq + 6] = nx * scale, ny * scale, nz * scale, nw * scale


@kernel
def log3(r: np.ndarray, at: int, out: np.ndarray) -> float:
    """Rotation vector of the rotation r[at:at+9] (row by row), into out[0:3]; return its angle.

    Through the quaternion, which is well conditioned at all angles up to pi.
    """
    a, b, c = r[at], r[at + 1], r[at + 2]
    d, e, f = r[at + 3], r[at + 4], r[at + 5]
    g, h, k = r[at + 6], r[at + 7], r[at + 8]
    trace = a + e + k
    if trace > 0.0:
        w, x, y, z = 1.0 + trace, h - f, c - g, d - b
    elif a >= e and a >= k:
        w, x, y, z = h - f, 1.0 + a - e - k, b + d, c + g
    elif e >= k:
        w, x, y, z = c - g, b + d, 1.0 + e - a - k, f + h
    else:
        w, x, y, z = d - b, c + g, f + h, 1.0 + k - a - e
    if w < 0.0:
        w, x, y, z = -w, -x, -y, -z
    sine = math.sqrt(x * x + y * y + z * z)
    angle = 2.0 * math.atan2(sine, w)
    factor = angle / sine if sine > 1e-12 * w else 2.0 / w
    out[0], out[1], out[2] = factor * x, factor * y, factor * z
    return angle


@kernel
def log3_jacobian(w: np.ndarray, angle: float, out: np.ndarray) -> None:
    """Inverse right Jacobian (9,) of the rotation vector w[0:3], row by row."""
    x, y, z = w[0], w[1], w[2]
    if angle < 1e-3:
        alpha = 1.0 / 12.0 + angle * angle / 720.0
    else:
        alpha = 1.0 / (angle * angle) - 0.5 / (angle * math.tan(0.5 * angle))
    diagonal = 1.0 - alpha * (x * x + y * y + z * z)
    out[0], out[1], out[2] = (
        diagonal + alpha * x * x,
        alpha * x * y - 0.5 * z,
        alpha * x * z + 0.5 * y,
    )
    out[3], out[4], out[5] = (
        alpha * x * y + 0.5 * z,
        diagonal + alpha * y * y,
        alpha * y * z - 0.5 * x,
    )
    out[6], out[7], out[8] = (
        alpha * x * z - 0.5 * y,
        alpha * y * z + 0.5 * x,
        diagonal + alpha * z * z,
    )


@kernel
def turn_about(r: np.ndarray, at: int, w: np.ndarray, share: float, out: np.ndarray) -> None:
    """Rotation r[at:at+9] times the exponential of share * w[0:3], into out[0:9]."""
    x, y, z = share * w[0], share * w[1], share * w[2]
    angle2 = x * x + y * y + z * z
    angle = math.sqrt(angle2)
    if angle < 1e-4:
        a, b = 1.0 - angle2 / 6.0, 0.5 - angle2 / 24.0
    else:
        sine = math.sin(0.5 * angle)
        a, b = math.sin(angle) / angle, 2.0 * sine * sine / angle2
    c = 1.0 - b * angle2
    e00, e01, e02 = c + b * x * x, b * x * y - a * z, b * x * z + a * y
    e10, e11, e12 = b * x * y + a * z, c + b * y * y, b * y * z - a * x
    e20, e21, e22 = b * x * z - a * y, b * y * z + a * x, c + b * z * z
    for i in range(0, 9, 3):
        p, s, u = r[at + i], r[at + i + 1], r[at + i + 2]
        out[i] = p * e00 + s * e10 + u * e20
        out[i + 1] = p * e01 + s * e11 + u * e21
        out[i + 2] = p * e02 + s * e12 + u * e22


@kernel
def identity_first(pose: np.ndarray) -> None:
    """Put the base's pose into row 0."""
    pose[0, :] = 0.0
    pose[0, 0] = pose[0, 4] = pose[0, 8] = 1.0
