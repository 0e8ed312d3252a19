"""Many points brought onto a set at once, as ``solution_set.settle`` does it for one."""

from __future__ import annotations

import numpy as np

from closedchain.analysis.singularity.sets.slices import Slice
from closedchain.closure.solve.solution_set import RANK, SHARES, SLOPE, SOLVED

CHUNK = 256  # points whose matrices are held at once
ITERATIONS = 25
LONGEST = 0.3  # dimensionless step
RENEWED = 0.02  # dimensionless: a longer step asks for a new frame


def polished(system: Slice, z: np.ndarray, *, careful: bool = False) -> np.ndarray:
    """Solutions (n, nq + k) near points; NaN where there is none, or none was reached.

    Gauss-Newton steps of least norm. ``careful`` shortens them until the largest row falls: for
    starts that are far away.
    """
    parts = [_chunk(system, z[i : i + CHUNK], careful) for i in range(0, len(z), CHUNK)]
    return np.concatenate(parts) if parts else z.copy()


def _chunk(system: Slice, z: np.ndarray, careful: bool) -> np.ndarray:
    out, index = np.full_like(z, np.nan), np.arange(len(z))
    last = np.full(len(z), np.inf)
    frame = system.frame(z)
    values, jacobian = system.evaluate(z, frame)
    for _ in range(ITERATIONS):
        worst = np.abs(values).max(axis=1, initial=0.0)
        done = (worst < SOLVED) | ((worst < 100.0 * SOLVED) & (worst >= 0.5 * last))
        out[index[done]] = z[done]
        steps = -least_norm(jacobian, values)
        sizes = np.linalg.norm(steps, axis=1)
        going = ~done & np.isfinite(sizes) & (sizes >= 1e-15)
        if not going.any():
            break
        steps *= np.minimum(1.0, LONGEST / np.maximum(sizes, 1e-300))[:, None]
        z, index, last, steps = z[going], index[going], worst[going], steps[going]
        frame, values, jacobian = frame.take(going), values[going], jacobian[going]
        if careful:
            kept, z, values, jacobian = _shortened(system, z, steps, values, jacobian)
            z, index, last = z[kept], index[kept], last[kept]
            frame, values, jacobian = frame.take(kept), values[kept], jacobian[kept]
            continue
        z = system.move(z, steps)
        far = np.linalg.norm(steps, axis=1) > RENEWED
        if far.any():
            frame = frame.replaced(far, system.frame(z[far]))
        values, jacobian = system.evaluate(z, frame)
    return out


def _shortened(
    system: Slice,
    z: np.ndarray,
    steps: np.ndarray,
    values: np.ndarray,
    jacobian: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Which points a share of their step improves, the points, values and Jacobians after it."""
    worst = np.abs(values).max(axis=1, initial=0.0)
    kept = np.zeros(len(z), dtype=bool)
    there, values, jacobian = z.copy(), values.copy(), jacobian.copy()
    for share in SHARES:
        i = np.flatnonzero(~kept)
        if not i.size:
            break
        tried = system.move(z[i], share * steps[i])
        new, slopes = system.evaluate(tried, system.frame(tried))
        with np.errstate(invalid="ignore"):
            better = np.abs(new).max(axis=1, initial=0.0) < (1.0 - SLOPE * share) * worst[i]
        good = i[better]
        kept[good] = True
        there[good], values[good], jacobian[good] = tried[better], new[better], slopes[better]
    return kept, there, values, jacobian


def least_norm(jacobian: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Shortest solutions (n, size) of J x = values, in the sense of least squares.

    NaN where they are no numbers.
    """
    rows, size = jacobian.shape[1:]
    steps = np.full((len(values), size), np.nan)
    good = np.isfinite(values).all(axis=1) & np.isfinite(jacobian).all(axis=(1, 2))
    if rows <= size and good.any():
        q, r = np.linalg.qr(jacobian[good].swapaxes(1, 2))
        pivots = np.abs(np.diagonal(r, axis1=1, axis2=2))
        full = pivots.min(axis=1) > 1e3 * RANK * pivots.max(axis=1)
        i = np.flatnonzero(good)[full]
        if i.size:
            shares = np.linalg.solve(r[full].swapaxes(1, 2), values[i][..., None])
            steps[i] = (q[full] @ shares)[..., 0]
        good[i] = False
    for i in np.flatnonzero(good):
        steps[i] = np.linalg.lstsq(jacobian[i], values[i], rcond=RANK)[0]
    return steps
