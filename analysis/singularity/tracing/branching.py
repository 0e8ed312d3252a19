"""Branch points of one-dimensional solution sets: which curves leave them.

On a small circle in the two-dimensional null space the equations but one are solved for the rest of
the unknowns (Lyapunov-Schmidt reduction); the zeros of the one left out are where curves leave.
This finds any number of curves, tangent ones excepted.
"""

from __future__ import annotations

import numpy as np

from closedchain.analysis.singularity.tracing.corrector import SOLVED, System, settle

RAYS = 48  # directions that are looked at; curves closer than two of them are taken for one
ITERATIONS = 6


def leaving(system: System, z: np.ndarray, radius: float) -> list[np.ndarray]:
    """Points of the solution set about ``radius`` away from a branch point, one for each curve end.

    Empty where the null space is not two-dimensional to the accuracy of the point.
    """
    frame = system.frame(z)
    try:
        _, jacobian = system.evaluate(z, frame)
    except np.linalg.LinAlgError:
        return []
    u, s, vt = np.linalg.svd(jacobian)
    rank = system.size - 2
    if len(s) <= rank or s[rank] > 1e-2 * s[rank - 1]:
        return []
    plane, kept, left = vt[rank:], u[:, :rank].T, u[:, rank]

    def beside(angle: float) -> tuple[float, np.ndarray] | None:
        offset = radius * (np.cos(angle) * plane[0] + np.sin(angle) * plane[1])
        point = system.move(z, offset)
        for _ in range(ITERATIONS):
            try:
                values, matrix = system.evaluate(point, frame)
            except np.linalg.LinAlgError:
                return None
            rest = kept @ values
            if np.abs(rest).max(initial=0.0) < 1e2 * SOLVED:
                return float(left @ values), point
            square = np.vstack([kept @ matrix, plane])
            try:
                step = np.linalg.solve(square, np.append(-rest, [0.0, 0.0]))
            except np.linalg.LinAlgError:
                return None
            if np.linalg.norm(step) > radius:
                return None
            point = system.move(point, step)
        return None

    angles = np.linspace(0.0, 2.0 * np.pi, RAYS + 1) + 0.0123
    seen = [beside(a) for a in angles]
    found: list[np.ndarray] = []
    for a, b, one, two in zip(angles, angles[1:], seen, seen[1:], strict=False):
        if one is None or two is None or one[0] * two[0] > 0.0:
            continue
        low, high, at_low, at_high = a, b, one[0], two[0]
        best = one if abs(one[0]) < abs(two[0]) else two
        for _ in range(5):
            middle = (low * at_high - high * at_low) / (at_high - at_low)
            met = beside(middle)
            if met is None:
                break
            best = met if abs(met[0]) < abs(best[0]) else best
            if met[0] * at_low > 0.0:
                low, at_low = middle, met[0]
            else:
                high, at_high = middle, met[0]
        settled = settle(system, best[1])
        if settled is not None:
            found.append(settled)
    return found
