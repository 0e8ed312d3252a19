"""Self-motion of D1 under a vertical tool (R_AC = I): the members at a given coupler height.

With the coupler's quaternion ``(1, u m)``, ``m = (cos f, 0, sin f)`` its horizontal tilt axis and
``u`` the tangent of half its tilt, the second stage is tilted back by the same rotation and both
lateral offsets are multiples of one quadratic, of the direction ``g(f)`` in the plane. The two
remaining closure conditions are a cubic curve in (u, f) and the height of the coupler.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .geometry import FloatArray

_SAMPLES = 64
_DEGREE = 14  # of the eliminant, a trigonometric polynomial in f


def _direction(f: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Parts of the lateral offset per ``radius u^2 / (1 + u^2)`` along m and along m x y."""
    # eq. (2) for the equilateral rings: the offset is radius (R_xx - R_zz, -2 R_xz) / 2
    x, z = np.cos(2.0 * f), -np.sin(2.0 * f)
    cos, sin = np.cos(f), np.sin(f)
    return np.asarray(cos * x + sin * z), np.asarray(cos * z - sin * x)


def _conditions(
    f: FloatArray, u: FloatArray, p: FloatArray, drop: float, a: float, c: float
) -> tuple[FloatArray, FloatArray]:
    """Closure along m and the height equation; zero for a member."""
    along, across = _direction(f)
    mu = p[0] * np.cos(f) + p[2] * np.sin(f)
    eta = p[2] * np.cos(f) - p[0] * np.sin(f)
    u2 = u * u
    first = (a + c) * along * u2 - mu * (1.0 + u2)
    second = (
        2.0 * u * drop * (1.0 + u2)
        + u2 * across * (c * (1.0 + u2) + a * (1.0 - u2))
        - eta * (1.0 - u2 * u2)
    )
    return np.asarray(first), np.asarray(second)


def _polished(
    guess: FloatArray, p: FloatArray, drop: float, a: float, c: float
) -> FloatArray | None:
    """Newton's method on (f, u) with complex-step derivatives; None where it does not settle."""
    x = guess.astype(np.float64)
    for _ in range(20):
        value = np.array(_conditions(x[0], x[1], p, drop, a, c))
        columns = []
        for k in range(2):
            y: NDArray[np.complex128] = x.astype(np.complex128)
            y[k] += 1e-30j
            # complex step: the formulas are analytic
            columns.append(np.imag(_conditions(y[0], y[1], p, drop, a, c)) / 1e-30)
        step = np.linalg.lstsq(np.stack(columns, axis=-1), value, rcond=None)[0]
        x = x - step
        if np.abs(step).max() < 1e-15:
            break
    value = np.array(_conditions(x[0], x[1], p, drop, a, c))
    value = value / (1.0 + x[1] ** 2) ** np.array([1.0, 2.0])
    return x if np.abs(value).max() < 1e-13 else None


def _generic(p: FloatArray, drop: float, a: float, c: float) -> list[FloatArray]:
    """Members (f, u) when the platform's centre is off the base axis."""
    k = a + c
    f = 2.0 * np.pi * np.arange(_SAMPLES) / _SAMPLES
    along, across = _direction(f)
    mu = p[0] * np.cos(f) + p[2] * np.sin(f)
    eta = p[2] * np.cos(f) - p[0] * np.sin(f)
    # u^2 = mu / q with q = k along - mu turns the height equation into left u = right; its square
    # is freed of the denominator
    left = 2.0 * drop * k * along
    right = eta * k * along * (k * along - 2.0 * mu) - mu * across * (k * k * along - 2 * a * mu)
    values = left**2 * (k * along - mu) * mu - right**2
    spectrum = np.fft.fft(values) / _SAMPLES
    ascending = np.concatenate([spectrum[-_DEGREE:], spectrum[: _DEGREE + 1]])
    keep = np.flatnonzero(np.abs(ascending) > 1e-14 * np.abs(ascending).max())
    roots = np.roots(ascending[keep[0] : keep[-1] + 1][::-1])
    found: list[FloatArray] = []
    for angle in np.angle(roots[np.abs(np.abs(roots) - 1.0) < 1e-2]):
        g, h = (float(part) for part in _direction(np.array(angle)))
        mu1 = float(p[0] * np.cos(angle) + p[2] * np.sin(angle))
        eta1 = float(p[2] * np.cos(angle) - p[0] * np.sin(angle))
        # near g = mu = 0 the first condition says nothing about u: take u from the height too
        quartic = np.array([h * (c - a) + eta1, 2.0 * drop, h * (c + a), 2.0 * drop, -eta1])
        starts = np.roots(quartic)
        starts = starts[np.abs(starts.imag) < 1e-2 * (1.0 + np.abs(starts))].real
        ratio = mu1 / (k * g - mu1) if k * g != mu1 else 0.0
        root = np.sqrt(max(ratio, 0.0))
        for u in (root, -root, *starts):
            member = _polished(np.array([angle, u]), p, drop, a, c)
            if member is not None:
                found.append(member)
    return found


def _axial(drop: float, a: float, c: float) -> list[FloatArray]:
    """Members (f, u) with the platform's centre on the axis: untilted, or one of three axes."""
    found = [np.zeros(2)]
    for f in np.pi / 3.0 * np.arange(3) + np.pi / 6.0:
        _, across = _direction(np.array(f))
        g = float(across)
        cubic = np.array([g * (c - a), 2.0 * drop, g * (c + a), 2.0 * drop])
        roots = np.roots(cubic)
        found += [np.array([f, u]) for u in roots[np.abs(roots.imag) < 1e-9].real if abs(u) > 1e-9]
    return found


def vertical_tool_quaternions(
    platform_position: FloatArray, height: float, radius_S: float, radius_S4: float
) -> list[FloatArray]:
    """Coupler quaternions (w, x, 0, z) of the ZT-ZT self-motion at one coupler height.

    Parameters
    ----------
    platform_position : ndarray (3,)
        Centre of the platform, m, frame A; the platform is parallel to the base.
    height : float
        y of the coupler's centre, m, frame A.
    radius_S, radius_S4 : float
        Ring radii of S1..S3 and S4..S6, m.
    """
    p = np.asarray(platform_position, dtype=np.float64)
    drop = float(p[1] - height)
    lateral = float(np.hypot(p[0], p[2]))
    pairs = (
        _axial(drop, radius_S, radius_S4)
        if lateral < 1e-12
        else _generic(p, drop, radius_S, radius_S4)
    )
    found: list[FloatArray] = []
    for f, u in pairs:
        q = np.array([1.0, u * np.cos(f), 0.0, u * np.sin(f)]) / np.hypot(1.0, u)
        if all(np.abs(q - other).max() > 1e-8 for other in found):
            found.append(q)
    return found
