"""Three points on three circles with given mutual distances: all solutions, by elimination.

This is the direct problem of every platform that three legs hold at spherical joints, where the
driven joints leave each spherical joint one circle: the stages of D1 (a plane from the passive
pairs, a sphere from a leg length) and Eclipse with its carriages locked (a link that turns about
a hinge). The triangle of the platform gives the three distances.

With ``z_i = exp(j theta_i)`` the three distance equations are biquadratic and no finite angle is
exceptional (the tangent of the half angle would send ``theta = pi`` to infinity). Sylvester's
dialytic elimination of ``z_3`` and ``z_2`` leaves a polynomial of degree 16 in ``z_1``, sampled
on the unit circle, where it is best conditioned for real angles. Symmetric postures make roots of
this eliminant coincide although the 16 solutions differ: so every pair ``(z_2, z_3)`` that
belongs to a root is polished by Newton's method on the three equations and duplicates are
removed among full solutions, not among roots.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

BEZOUT = 16
"""Number of complex solutions of three generic biquadratics of this pattern."""

_SAMPLES = 32
# z (1, cos, sin) as polynomials in z: columns are the powers 0, 1, 2.
_TRIG = np.array([[0.0, 1.0, 0.0], [0.5, 0.0, 0.5], [0.5j, 0.0, -0.5j]])


@dataclass(frozen=True, eq=False)
class CircleSolutions:
    """Solutions of :func:`three_points_on_circles`.

    Attributes
    ----------
    angles : ndarray (complex_count, 3), complex
        Distinct solutions, angles in rad, real parts in (-pi, pi].
    complex_points : ndarray (complex_count, 3, 3), complex
        ``[k, i]`` is point ``i`` of solution ``k``, m, in the frame of the circles.
    real : ndarray (complex_count,), bool
        Which of them are real.
    points : ndarray (k, 3, 3)
        The real solutions, m, in the frame of the circles.
    complex_count : int
        Number of distinct complex solutions found; 16 unless ``status`` says otherwise.
    residual : float
        Largest violation of a distance equation over the real solutions, m^2.
    gap : float
        Smallest distance between two distinct solutions, rad (``inf`` with fewer than two).
    condition : ndarray (complex_count,)
        Lower bound of the smallest singular value of the scaled equations at each solution; 0
        at a multiple one.
    eliminant_noise : float
        Largest coefficient of the sampled eliminant beyond degree 16, relative to the largest.
    status : str
        ``"ok"``; ``"unreachable"``: some circle has an imaginary radius, so no solution is real;
        ``"multiple"``: fewer than 16 distinct solutions (some coincide or are at infinity);
        ``"degenerate"``: a circle of zero radius or an eliminant that vanishes identically, so
        the solutions are not counted at all.
    """

    angles: ComplexArray
    complex_points: ComplexArray
    real: NDArray[np.bool_]
    points: FloatArray
    complex_count: int
    residual: float
    gap: float
    condition: FloatArray
    eliminant_noise: float
    status: str


def _forms(
    centres: FloatArray, us: FloatArray, vs: FloatArray, radii: ComplexArray, sides: FloatArray
) -> ComplexArray:
    """Bilinear forms (3, 3, 3): row k is ``|P_k - P_k+1|^2 - side_k^2`` in (1, cos, sin)^2."""
    forms = np.zeros((3, 3, 3), dtype=np.complex128)
    for k in range(3):
        a, b = k, (k + 1) % 3
        d = centres[a] - centres[b]
        one = radii[a] * np.array([us[a], vs[a]])
        two = radii[b] * np.array([us[b], vs[b]])
        forms[k, 0, 0] = d @ d + radii[a] ** 2 + radii[b] ** 2 - sides[k] ** 2
        forms[k, 1:, 0] = 2.0 * one @ d
        forms[k, 0, 1:] = -2.0 * two @ d
        forms[k, 1:, 1:] = -2.0 * one @ two.T
    return forms


def _times(a: ComplexArray, b: ComplexArray) -> ComplexArray:
    """Product of polynomials along the last axis, ascending powers, batched."""
    out = np.zeros(
        (*np.broadcast_shapes(a.shape[:-1], b.shape[:-1]), a.shape[-1] + b.shape[-1] - 1),
        dtype=np.complex128,
    )
    for k in range(a.shape[-1]):
        out[..., k : k + b.shape[-1]] += a[..., k : k + 1] * b
    return out


def _resultant(polys: ComplexArray, z: ComplexArray) -> ComplexArray:
    """Sylvester eliminant of the three biquadratics ``polys`` (3, 3, 3) at ``z_1 = z`` (n,)."""
    powers = z[:, None] ** np.arange(3)
    a = powers @ polys[2].T  # |P3 P1|: coefficients in z_3, one row per sample
    b = polys[1].T[None, :, :]  # |P2 P3|: coefficients in z_3, each a quadratic in z_2
    c = powers @ polys[0]  # |P1 P2|: coefficients in z_2

    def minor(i: int, j: int) -> ComplexArray:
        return np.asarray(a[:, i, None] * b[:, j] - a[:, j, None] * b[:, i], dtype=np.complex128)

    h = _times(minor(2, 0), minor(2, 0)) - _times(minor(2, 1), minor(1, 0))
    sylvester = np.zeros((z.size, 6, 6), dtype=np.complex128)
    for row in range(2):
        sylvester[:, row, row : row + 5] = h
    for row in range(4):
        sylvester[:, 2 + row, row : row + 3] = c
    return np.asarray(np.linalg.det(sylvester), dtype=np.complex128)


def _coefficients(forms: ComplexArray) -> tuple[ComplexArray, ComplexArray, float]:
    """Biquadratics in z (3, 3, 3), eliminant (17,) ascending with largest modulus 1, noise."""
    polys = np.asarray(_TRIG.T @ forms @ _TRIG)
    z = np.exp(2j * np.pi * np.arange(_SAMPLES) / _SAMPLES)
    values = np.fft.fft(_resultant(polys, z)) / _SAMPLES
    size = float(np.abs(values).max())
    if size == 0.0:
        return polys, np.zeros(BEZOUT + 1, dtype=np.complex128), np.inf
    values = values / size
    return polys, values[: BEZOUT + 1], float(np.abs(values[BEZOUT + 1 :]).max())


def _quadratic(c: ComplexArray) -> ComplexArray:
    """Both roots (n, 2) of quadratics (n, 3), ascending powers; stable form."""
    root = np.sqrt(c[:, 1] ** 2 - 4.0 * c[:, 2] * c[:, 0])
    root = np.where((np.conj(c[:, 1]) * root).real < 0.0, -root, root)
    s = -0.5 * (c[:, 1] + root)
    tiny = 1e-300
    return np.stack([s / (c[:, 2] + tiny), c[:, 0] / (s + tiny)], axis=-1)


def _candidates(polys: ComplexArray, eliminant: ComplexArray) -> ComplexArray:
    """Angles (n, 3) of every root with every pair that satisfies two of the equations."""
    keep = np.flatnonzero(np.abs(eliminant) > 1e-15)
    z1 = np.roots(eliminant[keep[0] : keep[-1] + 1][::-1]).astype(np.complex128)
    powers = z1[:, None] ** np.arange(3)
    z2, z3 = _quadratic(powers @ polys[0]), _quadratic(powers @ polys[2].T)
    z = np.stack(
        [np.repeat(z1, 4), np.repeat(z2, 2, axis=1).ravel(), np.tile(z3, (1, 2)).ravel()], axis=-1
    )
    z = z[np.all(np.isfinite(z) & (np.abs(z) > 1e-12) & (np.abs(z) < 1e12), axis=1)]
    return np.asarray(-1j * np.log(z), dtype=np.complex128)


def _equations(
    forms: ComplexArray, theta: ComplexArray
) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
    """Values (n, 3) and partial derivatives (n, 3) w.r.t. the first, the second angle."""
    cos, sin = np.cos(theta), np.sin(theta)
    x = np.stack([np.ones_like(cos), cos, sin], axis=-1)
    dx = np.stack([np.zeros_like(cos), -sin, cos], axis=-1)
    y, dy = np.roll(x, -1, axis=1), np.roll(dx, -1, axis=1)
    left, right = np.einsum("nki,kij->nkj", x, forms), np.einsum("kij,nkj->nki", forms, y)
    return (left * y).sum(-1), (dx * right).sum(-1), (left * dy).sum(-1)


def _newton(
    forms: ComplexArray, theta: ComplexArray, steps: int
) -> tuple[ComplexArray, FloatArray]:
    """Newton's method on all candidates at once: angles (n, 3), size of the last step (n,)."""
    last = np.full(len(theta), np.inf)
    for _ in range(steps):
        value, p, s = _equations(forms, theta)
        det = p.prod(axis=1) + s.prod(axis=1)
        p1, s1 = np.roll(p, -1, axis=1), np.roll(s, -1, axis=1)
        p2, v2 = np.roll(p, -2, axis=1), np.roll(value, -2, axis=1)
        v1 = np.roll(value, -1, axis=1)
        # Cramer's rule for the cyclic matrix [[p0, s0, 0], [0, p1, s1], [s2, 0, p2]]
        step = (value * p1 * p2 - s * v1 * p2 + s * s1 * v2) / (det + 1e-300)[:, None]
        size = np.abs(step).max(axis=1)
        step = step * np.minimum(1.0, 0.5 / np.maximum(size, 1e-300))[:, None]
        theta = theta - np.where(np.abs(step) > 0.0, step, 0.0)
        theta = theta.real + 1j * np.clip(theta.imag, -30.0, 30.0)
        last = size
    wrapped = np.pi - np.mod(np.pi - theta.real, 2.0 * np.pi)
    return wrapped + 1j * theta.imag, last


def _condition(forms: ComplexArray, theta: ComplexArray) -> FloatArray:
    """Lower bound (n,) of the smallest singular value of the equations: 0 where multiple."""
    _, p, s = _equations(forms, theta)
    growth = np.cosh(np.abs(theta.imag).max(axis=1, initial=0.0)) ** 2
    norm2 = (np.abs(p) ** 2 + np.abs(s) ** 2).sum(axis=1) + 1e-300
    det = np.abs(p.prod(axis=1) + s.prod(axis=1))
    return np.asarray(det / norm2 / growth, dtype=np.float64)


def _distance(theta: ComplexArray, other: ComplexArray) -> FloatArray:
    """Largest angular difference (n,), real parts modulo a turn."""
    d = theta - other
    d = np.pi - np.mod(np.pi - d.real, 2.0 * np.pi) + 1j * d.imag
    return np.asarray(np.abs(d).max(axis=-1), dtype=np.float64)


def _distinct(forms: ComplexArray, theta: ComplexArray, last: FloatArray) -> ComplexArray:
    """Converged candidates without duplicates; multiple solutions get a wider tolerance."""
    value, _, _ = _equations(forms, theta)
    growth = np.cosh(np.abs(theta.imag).max(axis=1)) ** 2
    good = (np.abs(value).max(axis=1) < 1e-13 * growth) & (last < 1e-5)
    theta, last = theta[good], last[good]
    condition = _condition(forms, theta)
    tolerance = np.clip(1e-11 / (condition + 1e-300), 1e-8, 3e-3)
    found: list[int] = []
    for i in np.argsort(-condition + last, kind="stable"):
        if not found or np.all(_distance(theta[found], theta[i]) > tolerance[i]):
            found.append(int(i))
    return theta[found]


def eliminant(
    centres: ArrayLike, axes_u: ArrayLike, axes_v: ArrayLike, radii: ArrayLike, sides: ArrayLike
) -> ComplexArray:
    """Eliminant of the three distance equations in ``z_1 = exp(j theta_1)``.

    Parameters are those of :func:`three_points_on_circles`.

    Returns
    -------
    ndarray (17,), complex
        Coefficients, ascending powers, largest modulus 1.
    """
    return _coefficients(_scaled(*_checked(centres, axes_u, axes_v, radii, sides))[0])[1]


def _checked(
    centres: ArrayLike, axes_u: ArrayLike, axes_v: ArrayLike, radii: ArrayLike, sides: ArrayLike
) -> tuple[FloatArray, FloatArray, FloatArray, ComplexArray, FloatArray]:
    arrays = [np.asarray(a, dtype=np.float64) for a in (centres, axes_u, axes_v)]
    r = np.asarray(radii, dtype=np.complex128)
    d = np.asarray(sides, dtype=np.float64)
    if any(a.shape != (3, 3) for a in arrays) or r.shape != (3,) or d.shape != (3,):
        raise ValueError("expected centres, axes (3, 3) and radii, sides (3,)")
    return arrays[0], arrays[1], arrays[2], r, d


def _scaled(
    c: FloatArray, u: FloatArray, v: FloatArray, r: ComplexArray, d: FloatArray
) -> tuple[ComplexArray, FloatArray]:
    """Forms scaled to largest coefficient 1, and the three scales (m^2)."""
    forms = _forms(c, u, v, r, d)
    scale = np.abs(forms).max(axis=(1, 2))
    return forms / np.maximum(scale, 1e-300)[:, None, None], scale


def _nothing(status: str) -> CircleSolutions:
    empty = np.zeros((0, 3, 3))
    return CircleSolutions(
        angles=np.zeros((0, 3), dtype=np.complex128),
        complex_points=empty.astype(np.complex128),
        real=np.zeros(0, dtype=np.bool_),
        points=empty,
        complex_count=0,
        residual=0.0,
        gap=np.inf,
        condition=np.zeros(0),
        eliminant_noise=np.inf,
        status=status,
    )


def three_points_on_circles(
    centres: ArrayLike, axes_u: ArrayLike, axes_v: ArrayLike, radii: ArrayLike, sides: ArrayLike
) -> CircleSolutions:
    """All triples ``P_i = c_i + r_i (cos theta_i u_i + sin theta_i v_i)`` with given distances.

    Parameters
    ----------
    centres : array_like (3, 3)
        Centres ``c_i``, m, any common frame.
    axes_u, axes_v : array_like (3, 3)
        Orthonormal axes ``u_i``, ``v_i`` of each circle's plane, same frame.
    radii : array_like (3,)
        Radii, m; an imaginary one (sphere that misses the plane) is allowed and counted.
    sides : array_like (3,)
        ``|P1 P2|, |P2 P3|, |P3 P1|``, m.

    Returns
    -------
    CircleSolutions
        All complex solutions, and the real ones polished to rounding.
    """
    c, u, v, r, d = _checked(centres, axes_u, axes_v, radii, sides)
    size = max(float(np.abs(r).max()), float(d.max()))
    if np.any(np.abs(r) <= 1e-12 * size):
        return _nothing("degenerate")
    forms, scale = _scaled(c, u, v, r, d)
    found = np.zeros((0, 3), dtype=np.complex128)
    noise = 0.0
    for turn in range(3):  # one hidden angle is enough unless roots lose accuracy
        polys, coefficients, noise_now = _coefficients(np.roll(forms, -turn, axis=0))
        noise = max(noise, noise_now)
        if noise_now > 1e-3:
            return _nothing("degenerate")
        theta = np.roll(_candidates(polys, coefficients), turn, axis=1)
        for steps in (8, 50):
            theta, last = _newton(forms, theta, steps)
            done = _distinct(forms, theta, last)
            union = np.concatenate([found, done])
            found_now = _distinct(forms, union, np.zeros(len(union)))
            if len(found_now) >= BEZOUT:
                break
        found = found_now
        if len(found) >= BEZOUT:
            break
    return _report(forms, scale, (c, u, v, r), found, noise)


def _report(
    forms: ComplexArray,
    scale: FloatArray,
    circles: tuple[FloatArray, FloatArray, FloatArray, ComplexArray],
    found: ComplexArray,
    noise: float,
) -> CircleSolutions:
    c, u, v, r = circles
    found = found[np.lexsort(np.round(found.real, 6).T[::-1])]
    condition = _condition(forms, found)
    reachable = bool(np.all(r.imag == 0.0))
    tolerance = np.clip(1e-12 / (condition + 1e-300), 1e-10, 1e-3)
    real = (np.abs(found.imag).max(axis=1, initial=0.0) < tolerance) & reachable
    polished, _ = _newton(forms, found[real].real.astype(np.complex128), 2)
    wild = _distance(polished, found[real]) > 1e-3  # a multiple solution: keep what was found
    found[real] = np.where(wild[:, None], found[real].real, polished.real)
    cos, sin = np.cos(found)[..., None], np.sin(found)[..., None]
    points = c + r[:, None] * (cos * u + sin * v)
    value, _, _ = _equations(forms, found[real])
    n = len(found)
    pairs = [_distance(found[i + 1 :], found[i]).min() for i in range(n - 1)]
    status = "ok" if n == BEZOUT else "multiple"
    return CircleSolutions(
        angles=found,
        complex_points=points,
        real=real,
        points=np.ascontiguousarray(points[real].real),
        complex_count=n,
        residual=float((np.abs(value) * scale).max(initial=0.0)),
        gap=float(min(pairs, default=np.inf)),
        condition=condition,
        eliminant_noise=noise,
        status=status if reachable else "unreachable",
    )
