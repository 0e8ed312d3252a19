"""Triangles of tubes and balls, thinning of polylines, the colour map and its numbers."""

from __future__ import annotations

from functools import cache

import numpy as np

from closedchain.urdf.extras import require

_SIDES = 6  # of a tube
_GOLDEN = 0.5 * (1.0 + 5.0**0.5)
# an icosahedron of radius 1: one corner for each sign and cyclic order of (0, 1, golden ratio)
_CORNERS = np.array(
    [
        np.roll([0.0, s, t * _GOLDEN], shift)
        for shift in range(3)
        for s in (-1.0, 1.0)
        for t in (-1.0, 1.0)
    ]
) / np.hypot(1.0, _GOLDEN)
_FACES = np.array(
    [
        (i, j, k) if np.linalg.det(_CORNERS[[i, j, k]]) > 0.0 else (i, k, j)
        for i in range(12)
        for j in range(i + 1, 12)
        for k in range(j + 1, 12)
        # neighbours have the scalar product 1/sqrt(5), the next nearest its negative
        if min(_CORNERS[i] @ _CORNERS[j], _CORNERS[j] @ _CORNERS[k], _CORNERS[k] @ _CORNERS[i])
        > 0.0
    ]
)


def thinned(rows: np.ndarray, tolerance: float) -> np.ndarray:
    """Indices of the rows (n, k) that a polyline needs to stay within ``tolerance`` of all.

    Ramer, Douglas and Peucker's division at the farthest point. First and last are kept.
    """
    keep = np.zeros(len(rows), dtype=bool)
    keep[[0, -1]] = True
    pieces = [(0, len(rows) - 1)]
    while pieces:
        first, last = pieces.pop()
        if last - first < 2:
            continue
        begin, along = rows[first], rows[last] - rows[first]
        inner = rows[first + 1 : last] - begin
        length2 = float(along @ along)
        share = np.clip(inner @ along / length2, 0.0, 1.0) if length2 > 0.0 else np.zeros(1)
        gaps = np.linalg.norm(inner - share[:, None] * along, axis=1)
        worst = int(gaps.argmax())
        if gaps[worst] > tolerance:
            middle = first + 1 + worst
            keep[middle] = True
            pieces += [(first, middle), (middle, last)]
    return np.flatnonzero(keep)


def tube(
    points: np.ndarray, radius: float, closed: bool
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Tube around a polyline (n, 3): vertices, triangles, and the point each vertex belongs to.

    Repeated points are passed over. Where all points are one, it is a ball.
    """
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    kept = np.flatnonzero(np.r_[True, steps > 1e-3 * radius])
    if closed and len(kept) > 1:
        gap = np.linalg.norm(points[kept[-1]] - points[kept[0]])
        kept = kept[:-1] if gap <= 1e-3 * radius else kept
    if len(kept) < 2:
        vertices, triangles, _ = balls(points[:1], 2.0 * radius)
        return vertices, triangles, np.zeros(len(vertices), dtype=int)
    closed = closed and len(kept) > 2
    tangents = _tangents(points[kept], closed)
    normals = _normals(tangents, closed)
    sides = np.cross(tangents, normals)
    angles = 2.0 * np.pi * np.arange(_SIDES) / _SIDES
    ring = np.cos(angles)[:, None] * normals[:, None] + np.sin(angles)[:, None] * sides[:, None]
    vertices = (points[kept][:, None] + radius * ring).reshape(-1, 3)
    count = len(kept) if closed else len(kept) - 1
    i, j = np.divmod(np.arange(count * _SIDES), _SIDES)
    here, there = i * _SIDES, (i + 1) % len(kept) * _SIDES
    after = (j + 1) % _SIDES
    triangles = np.vstack(
        [
            np.column_stack([here + j, here + after, there + j]),
            np.column_stack([here + after, there + after, there + j]),
        ]
    )
    return vertices, triangles, np.repeat(kept, _SIDES)


def dashed(points: np.ndarray, pattern: tuple[float, ...]) -> list[np.ndarray]:
    """Pieces (k, 3) of a polyline (n, 3); ``pattern`` are lengths of dashes and gaps in turn."""
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    along = np.r_[0.0, np.cumsum(steps)]
    ends = [along[0]]
    while ends[-1] < along[-1]:
        ends.append(ends[-1] + pattern[(len(ends) - 1) % len(pattern)])
    pieces = []
    for begin, end in zip(ends[::2], ends[1::2], strict=False):
        inner = along[(along > begin) & (along < end)]
        at = np.r_[begin, inner, min(end, along[-1])]
        pieces.append(np.column_stack([np.interp(at, along, x) for x in points.T]))
    return pieces


def balls(points: np.ndarray, radius: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Icosahedra at points (n, 3): vertices, triangles, and the point each vertex belongs to."""
    vertices = (points[:, None] + radius * _CORNERS).reshape(-1, 3)
    triangles = (12 * np.arange(len(points))[:, None, None] + _FACES).reshape(-1, 3)
    return vertices, triangles, np.repeat(np.arange(len(points)), 12)


@cache
def cividis() -> np.ndarray:
    """The colour map as (256, 3) shares of red, green and blue."""
    require("colours of a set come from matplotlib", "figures")
    from matplotlib import colormaps

    table: np.ndarray = colormaps["cividis"](np.arange(256))[:, :3]
    table.setflags(write=False)
    return table


def shares(values: np.ndarray, limits: tuple[float, float]) -> np.ndarray:
    """Places 0 to 1 of values between limits; the middle where the limits are one."""
    low, high = limits
    if high <= low:
        return np.full(values.shape, 0.5)
    return np.clip((values - low) / (high - low), 0.0, 1.0)


def mapped(values: np.ndarray, limits: tuple[float, float]) -> np.ndarray:
    """Colours (n, 3) of values (n,)."""
    return cividis()[np.rint(255.0 * shares(values, limits)).astype(int)]


def spelled(values: np.ndarray, limits: tuple[float, float]) -> list[str]:
    """Numbers between limits as texts with three digits of the distance between the limits."""
    low, high = limits
    greatest, span = max(abs(low), abs(high)), high - low
    digits = 3
    if span > 0.0:
        digits += max(0, int(np.log10(greatest / span)))
    exact = [0.0 if abs(value) < 5e-4 * span else float(value) for value in values]
    return [f"{value:.{min(digits, 15)}g}" for value in exact]


def _tangents(points: np.ndarray, closed: bool) -> np.ndarray:
    """Unit directions (n, 3) at the points: halfway between those of the pieces beside them."""
    following = np.roll(points, -1, axis=0) - points
    if not closed:
        following[-1] = following[-2]
    following /= np.linalg.norm(following, axis=1, keepdims=True)
    before = np.roll(following, 1, axis=0)
    if not closed:
        before[0] = following[0]
    both = before + following
    length = np.linalg.norm(both, axis=1, keepdims=True)
    return np.where(length > 1e-6, both / np.maximum(length, 1e-6), before)  # a turning back


def _normals(tangents: np.ndarray, closed: bool) -> np.ndarray:
    """Unit normals (n, 3), turned along the line no more than they must be."""
    normals = np.empty_like(tangents)
    normals[0] = _any_normal(tangents[0])
    for i in range(1, len(tangents)):
        normals[i] = _projected(normals[i - 1], tangents[i])
    if closed:  # the turn that is left over is shared out
        last = _projected(normals[-1], tangents[0])
        left_over = np.arctan2(np.cross(last, normals[0]) @ tangents[0], last @ normals[0])
        turns = left_over * np.arange(len(tangents))[:, None] / len(tangents)
        normals = np.cos(turns) * normals + np.sin(turns) * np.cross(tangents, normals)
    return normals


def _projected(normal: np.ndarray, tangent: np.ndarray) -> np.ndarray:
    across = normal - (normal @ tangent) * tangent
    length = float(np.linalg.norm(across))
    return across / length if length > 1e-6 else _any_normal(tangent)


def _any_normal(tangent: np.ndarray) -> np.ndarray:
    across: np.ndarray = np.cross(tangent, np.eye(3)[np.abs(tangent).argmin()])
    return across / np.linalg.norm(across)
