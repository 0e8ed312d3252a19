"""Points between the points of a curve, all at once: where it was traced in longer steps."""

from __future__ import annotations

import numpy as np

from closedchain.analysis.singularity.sets.slices import Slice
from closedchain.closure.solve.solution_set import SOLVED

CHUNK = 256  # points whose matrices are held at once
ITERATIONS = 6
SPARE = 0.98  # of the largest distance: a curve is longer than its chords
ASIDE = 0.2  # of a distance between points: how far they may lie from a cubic between those known


def filled(
    system: Slice, points: np.ndarray, *, closed: bool, longest: np.ndarray
) -> tuple[np.ndarray, np.ndarray] | None:
    """A curve with neighbours near to each other, and where the points given are in it.

    Parameters
    ----------
    points : (n, nq + k) array
        Of the curve, in order; the last and the first one are neighbours on a loop.
    longest : (size,) array
        Largest change of each unknown from one point to the next.

    Returns
    -------
    (m, nq + k) array of points and (n,) array of int, or None where a point between is not found,
    or a branch point lies between: then shorter steps have to tell.
    """
    n = len(points)
    if n < 3:
        return points, np.arange(n)
    one = points if closed else points[:-1]
    two = np.roll(points, -1, axis=0) if closed else points[1:]
    chords = system.difference(one, two)
    shares = np.abs(chords) / longest
    counts = np.maximum(np.ceil(shares.max(axis=1) / SPARE).astype(int) - 1, 0)
    segment = np.repeat(np.arange(len(one)), counts)
    if not segment.size:
        return points, np.arange(n)
    order = np.arange(segment.size) - np.repeat(np.cumsum(counts) - counts, counts)
    share = (order + 1.0) / (counts[segment] + 1.0)
    lengths = np.linalg.norm(chords, axis=1)
    if not (lengths > 0.0).all():
        return None
    begin, end = _slopes(chords, lengths, closed=closed)
    s, size = share[:, None], lengths[segment][:, None]
    offset = (3.0 * s**2 - 2.0 * s**3) * chords[segment]
    offset += size * (s**3 - 2.0 * s**2 + s) * begin[segment]
    offset += size * (s**3 - s**2) * end[segment]
    guess = system.move(one[segment], offset)
    apart = lengths[segment] / (counts[segment] + 1.0)
    found = np.empty_like(guess)
    for first in range(0, len(guess), CHUNK):
        part = slice(first, first + CHUNK)
        of = segment[part]
        across = chords[of] / lengths[of][:, None]
        new = _onto(system, one, of, guess[part], across, apart[part])
        if new is None:
            return None
        found[part] = new
    places = np.arange(n) + np.concatenate([[0], np.cumsum(counts)])[:n]
    out = np.empty((n + len(found), points.shape[1]))
    out[places] = points
    between = np.ones(len(out), dtype=bool)
    between[places] = False
    out[between] = found
    return out, places


def _slopes(
    chords: np.ndarray, lengths: np.ndarray, *, closed: bool
) -> tuple[np.ndarray, np.ndarray]:
    """Tangents at both ends of each chord, by parabolas through three neighbours."""
    sizes = lengths[:, None]
    unit = chords / sizes
    if closed:
        before, previous = np.roll(unit, 1, axis=0), np.roll(sizes, 1, axis=0)
        begin = (before * sizes + unit * previous) / (sizes + previous)
        return begin, np.roll(begin, -1, axis=0)
    inner = (unit[:-1] * sizes[1:] + unit[1:] * sizes[:-1]) / (sizes[1:] + sizes[:-1])
    first, last = 2.0 * unit[:1] - inner[:1], 2.0 * unit[-1:] - inner[-1:]
    return np.concatenate([first, inner]), np.concatenate([inner, last])


def _onto(
    system: Slice,
    one: np.ndarray,
    of: np.ndarray,
    guess: np.ndarray,
    across: np.ndarray,
    apart: np.ndarray,
) -> np.ndarray | None:
    """Points of the curve near guesses, by Newton's method in planes; None where one is not met."""
    begins, number = np.unique(of, return_inverse=True)
    frame = system.frame(one[begins]).take(number)
    z, last = guess, np.full(len(guess), np.inf)
    for _ in range(ITERATIONS):
        values, jacobian = system.evaluate(z, frame)
        if jacobian.shape[1] != system.size - 1:
            return None
        square = np.concatenate([jacobian, across[:, None]], axis=1)
        worst = np.abs(values).max(axis=1)
        if not np.isfinite(worst).all():
            return None
        done = (worst < SOLVED) | ((worst < 100.0 * SOLVED) & (worst >= 0.5 * last))
        if done.all():
            break
        right = np.concatenate([-values, np.zeros((len(z), 1))], axis=1)
        try:
            steps = np.linalg.solve(square, right[..., None])[..., 0]
        except np.linalg.LinAlgError:
            return None
        if not (np.linalg.norm(steps, axis=1) < ASIDE * apart + 1e-9).all():
            return None
        z, last = system.move(z, np.where(done[:, None], 0.0, steps)), worst
    else:
        return None
    sign = np.linalg.slogdet(square)[0]
    lowest = np.full(len(begins), 2.0)
    highest = -lowest
    np.minimum.at(lowest, number, sign)
    np.maximum.at(highest, number, sign)
    return z if (lowest == highest).all() else None
