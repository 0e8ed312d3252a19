"""Figures of maps over three coordinates: surfaces in space, and planes through the start."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from closedchain.analysis.figures.palette import (
    COLOURED,
    DASHES,
    EDGES,
    MARKERS,
    Scheme,
    axis_label,
    start_of,
    start_within,
)
from closedchain.analysis.figures.panels import mark_start
from closedchain.analysis.singularity.sets.mesh_fit import Fit
from closedchain.analysis.survey.set_tables import DrawableSet, polylines

if TYPE_CHECKING:
    import xarray as xr

MEET = 1e-7  # share of the range: ends nearer than this are one

MOST_TRIANGLES = 20_000
"""Triangles of one set drawn in space; of larger meshes evenly chosen ones."""


@dataclass(frozen=True, eq=False)
class PlaneCut:
    """What a plane leaves of a set: line segments, drawn like the set's curves.

    The attributes are those of ``DrawableSet``.
    """

    kind: str
    over: tuple[str, ...]
    coordinates: np.ndarray
    pieces: tuple[np.ndarray, ...]
    ends: tuple[tuple[str, str], ...]
    on_branch: np.ndarray
    everywhere: bool
    note: str = ""
    missed: int | None = None
    fit: Fit | None = None
    grid: tuple[int, ...] = ()


def draw_space(
    ax: Any, data: xr.Dataset, sets: Sequence[DrawableSet], scheme: Scheme = COLOURED
) -> None:
    """Draw meshes, curves and points of sets in three-dimensional axes."""
    from matplotlib.ticker import MaxNLocator
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection  # type: ignore[import-untyped]

    names = [str(d) for d in data["status"].dims]
    for found in sets:
        columns = [found.over.index(n) for n in names]
        points, colour = found.coordinates[:, columns], scheme.kinds[found.kind]
        face = scheme.faces[found.kind]
        for piece in found.pieces:
            if piece.ndim != 2 or not len(piece):
                continue
            step = -(-len(piece) // MOST_TRIANGLES)
            mesh = Poly3DCollection(
                points[piece[::step]], facecolors=face, alpha=0.45, shade=True,
                edgecolor=colour if EDGES[found.kind] else "none",
                linewidth=EDGES[found.kind],
            )  # fmt: skip
            ax.add_collection3d(mesh)
        for line, _ in polylines(found):
            style: dict[str, Any] = {"lw": 2.0, "ls": DASHES[found.kind]}
            if len(line) == 1:
                style = {"marker": MARKERS[found.kind], "ms": 4}
            ax.plot(*points[line].T, color=colour, **style)
    start = start_within(data)
    if start is not None:
        mark_start(ax, *start[1])
    for artist in (*ax.lines, *ax.collections):
        artist.set_in_layout(False)  # extents on paper are not known before the first drawing
    for axis, name in zip("xyz", names, strict=True):
        values = data[name].to_numpy()
        getattr(ax, f"set_{axis}lim")(values[0], values[-1])
        getattr(ax, f"set_{axis}label")(axis_label(data, name))
    ax.tick_params(labelsize=7)
    for axis in (ax.xaxis, ax.yaxis, ax.zaxis):
        axis.set_major_locator(MaxNLocator(4))


def planes(
    data: xr.Dataset, sets: Sequence[DrawableSet]
) -> list[tuple[str, xr.Dataset, list[DrawableSet]]]:
    """Three planes of a map, through its start or else its middle: title, map and cut sets."""
    names = [str(d) for d in data["status"].dims]
    start = start_of(data)
    inside = start_within(data) is not None
    found: list[tuple[str, xr.Dataset, list[DrawableSet]]] = []
    for held in reversed(range(3)):
        axis = data[names[held]].to_numpy()
        middle = 0.5 * (axis[0] + axis[-1]) if start is None else start[1][held]
        index = int(np.abs(axis - middle).argmin())
        value = float(axis[index])
        rest = tuple(n for i, n in enumerate(names) if i != held)
        unit = data[names[held]].attrs.get("units", "")
        title = f"{names[held]} = {value + 0.0:.4g} {unit}".rstrip()
        flat = data.isel({names[held]: index})
        if not inside:  # no plane goes through it
            flat.attrs = {k: v for k, v in data.attrs.items() if not k.startswith("start_")}
        found.append((title, flat, [cut(s, names[held], value, rest) for s in sets]))
    return found


def cut(found: DrawableSet, name: str, value: float, rest: tuple[str, ...]) -> PlaneCut:
    """Intersection of the meshes of a set with the plane ``name = value``."""
    k = found.over.index(name)
    columns = [found.over.index(n) for n in rest]
    segments = [np.zeros((0, 2, 2))]
    for piece in found.pieces:
        if piece.ndim == 2 and len(piece):
            corners = found.coordinates[piece]
            segments.append(_crossings(corners[..., k] - value, corners[..., columns]))
    lines = np.concatenate(segments)
    chains = _chains(lines)
    ends = np.cumsum([0, *(len(chain) for chain in chains)])
    whole = np.concatenate([np.zeros((0, 2)), *chains])
    return PlaneCut(
        kind=found.kind,
        over=rest,
        coordinates=whole,
        pieces=tuple(np.arange(i, j) for i, j in pairwise(ends.tolist())),
        ends=(),
        on_branch=np.ones(len(whole), dtype=bool),
        everywhere=found.everywhere,
    )


def _chains(segments: np.ndarray) -> list[np.ndarray]:
    """Polylines (n, 2) that segments (s, 2, 2) make where their ends meet: dashes run on there."""
    if not len(segments):
        return []
    span = np.ptp(segments.reshape(-1, 2), axis=0)
    size = max(float(np.abs(segments).max()), 1e-300)
    keys = np.round(segments / np.maximum(span, 1e-6 * size) / MEET).astype(np.int64)
    _, number = np.unique(keys.reshape(-1, 2), axis=0, return_inverse=True)
    at: dict[int, list[int]] = {}
    both = number.reshape(-1, 2).tolist()
    for i, pair in enumerate(both):
        for end in pair:
            at.setdefault(end, []).append(i)
    chains, used = [], np.zeros(len(segments), dtype=bool)

    def onward(i: int, end: int) -> list[np.ndarray]:
        """Points beyond one end of a segment, as far as no other chain meets there."""
        points = []
        while len(at[end]) == 2:
            i = at[end][0] if at[end][1] == i else at[end][1]
            if used[i]:
                break
            used[i] = True
            side = 1 if both[i][0] == end else 0
            points.append(segments[i, side])
            end = both[i][side]
        return points

    for i in range(len(segments)):
        if not used[i]:
            used[i] = True
            after = onward(i, both[i][1])
            before = onward(i, both[i][0])
            chains.append(np.array([*before[::-1], *segments[i], *after]))
    return chains


def _crossings(height: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Segments (s, 2, 2) where triangles of heights (t, 3) and corners (t, 3, 2) cross zero."""
    above = height >= 0.0
    crossed = above.any(axis=1) & ~above.all(axis=1)
    height, corners, above = height[crossed], corners[crossed], above[crossed]
    # the corner that is alone on its side of the plane comes first
    alone = np.where(above.sum(axis=1) == 1, above.argmax(axis=1), (~above).argmax(axis=1))
    order = (alone[:, None] + np.arange(3)) % 3
    rows = np.arange(len(order))[:, None]
    height, corners = height[rows, order], corners[rows, order]
    share = height[:, :1] / (height[:, :1] - height[:, 1:])
    return corners[:, :1] + share[..., None] * (corners[:, 1:] - corners[:, :1])
