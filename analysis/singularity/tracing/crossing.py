"""Branch points on a traced curve: where the smallest singular value of [J; t] vanishes."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from closedchain.analysis.singularity.tracing.corrector import Here, System, correct_across

CROSSING = 1e-4  # of the usual smallest singular value: below it, two branches cross
CLOSE = 1e-3  # of that: near enough
PATIENCE = 6  # halvings after which a least value that is no zero has shown itself

_Seen = tuple[float, np.ndarray]
_Between = Callable[[np.ndarray, np.ndarray, float], _Seen | None]


def crossing_within(system: System, here: Here, h: float, *, signed: bool) -> np.ndarray | None:
    """Branch point within a step of length h: zero of the smallest singular value of [J; t].

    ``signed``: the determinant changes sign, so the zero is bracketed; else the least value is
    sought, and must be almost zero.
    """
    usual = here.least
    target = np.zeros(system.size)
    target[-1] = 1.0

    def look(guess: np.ndarray) -> _Seen | None:
        found = correct_across(system, here, guess, 4.0 * h)
        if found is None:
            return None
        z, jacobian, _ = found
        tangent = np.linalg.lstsq(np.vstack([jacobian, here.tangent]), target, rcond=1e-13)[0]
        square = np.vstack([jacobian, tangent / np.linalg.norm(tangent)])
        least = float(np.linalg.svd(square, compute_uv=False)[-1])
        return least * float(np.linalg.slogdet(square)[0]) * here.sign, z

    def between(one: np.ndarray, two: np.ndarray, share: float) -> _Seen | None:
        return look(system.move(one, share * system.difference(one, two)))

    ends = look(here.z), look(system.move(here.z, h * here.tangent))
    if ends[0] is None or ends[1] is None:
        return None
    search = _bracketed if signed else _least
    value, z = search(between, ends[0], ends[1], usual)
    return z if abs(value) < CROSSING * usual else None


def _bracketed(between: _Between, low: _Seen, high: _Seen, usual: float) -> _Seen:
    """Zero of a function of points on a path, of opposite sign at its ends, by Illinois steps."""
    best = min(low, high, key=_size)
    weights = [1.0, 1.0]
    for _ in range(40):
        if _size(best) < CLOSE * CROSSING * usual or low[0] * high[0] > 0.0:
            break
        a, b = low[0] * weights[0], high[0] * weights[1]
        found = between(low[1], high[1], float(np.clip(a / (a - b), 0.01, 0.99)))
        if found is None:
            break  # the equations are singular at the branch point itself: near enough
        best = min(best, found, key=_size)
        if found[0] * low[0] > 0.0:
            low, weights = found, [1.0, 0.5 * weights[1]]
        else:
            high, weights = found, [0.5 * weights[0], 1.0]
    return best


def _least(between: _Between, low: _Seen, high: _Seen, usual: float) -> _Seen:
    """Least size of a function of points on a path, by shrinking around the best of three."""
    best = between(low[1], high[1], 0.5) or min(low, high, key=_size)
    earlier = [np.inf] * PATIENCE
    for _ in range(40):
        if _size(best) < CLOSE * CROSSING * usual or _size(best) > 0.5 * earlier[-PATIENCE]:
            break  # a zero is halved with its bracket; what stays is none
        earlier.append(_size(best))
        beside = between(low[1], best[1], 0.5), between(best[1], high[1], 0.5)
        before, after = beside
        if before is None or after is None:
            break
        if min(_size(before), _size(after)) >= _size(best):
            low, high = before, after
        elif _size(before) < _size(after):
            best, high = before, best
        else:
            low, best = best, after
    return best


def _size(seen: _Seen) -> float:
    return abs(seen[0])
