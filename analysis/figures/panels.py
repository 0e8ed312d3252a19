"""One panel of a figure: a map over two coordinates, with its singular curves on top."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from closedchain.analysis.figures.palette import (
    BLANKS,
    COLOURED,
    DASHES,
    GREY,
    HATCHES,
    MARKERS,
    Measure,
    Scheme,
    axis_label,
    blank_colour,
    colour_range,
    start_within,
    statuses_of,
)
from closedchain.analysis.figures.ticks import calm_ticks
from closedchain.analysis.survey.set_tables import DrawableSet, polylines

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes

MOST_UNEQUAL = 2.5
"""Ratio of two ranges with one unit up to which lengths are drawn alike along both axes."""


def is_polar(names: Sequence[str], data: xr.Dataset) -> bool:
    """Whether a map is drawn as directions: tilt from the centre, azimuth around it."""
    if set(names) != {"tilt", "azimuth"}:
        return False
    azimuth = data["azimuth"].to_numpy()
    return bool(azimuth[-1] - azimuth[0] <= 2.0 * np.pi + 1e-9)


def draw_panel(
    ax: Axes,
    data: xr.Dataset,
    sets: Sequence[DrawableSet],
    name: str,
    measure: Measure,
    scheme: Scheme = COLOURED,
    *,
    small: bool = False,
) -> None:
    """Fill the axes, polar ones for tilt and azimuth, with one variable of a map.

    A ``small`` panel has no second scale in degrees.
    """
    first, second = _order(ax, [str(d) for d in data["status"].dims])
    x, y = data[first].to_numpy(), data[second].to_numpy()
    edges = _edges(x), _edges(y)
    cells = data.transpose(first, second)
    ax.grid(False)
    _draw_blanks(ax, edges, cells, scheme)
    whole = [s for s in sets if s.everywhere and s.kind == measure.kind]
    values = cells[name].to_numpy()
    if whole:
        there = np.where(np.isfinite(values), 1.0, np.nan)
        kind = str(measure.kind)
        _fill(ax, edges, there, scheme.faces[kind], alpha=0.35)
        _hatch(ax, edges, np.isfinite(values), HATCHES[kind])
        ax.set_title(f"every posture is {measure.kind}ly singular", fontsize=10)
    else:
        shown, how, open_end = colour_range(values, measure.scale)
        mesh = ax.pcolormesh(
            *edges, shown.T, cmap=scheme.maps[measure.scale], rasterized=True, **how
        )
        unit = data[name].attrs.get("units", "1")
        unit = "dimensionless" if unit == "1" else f"[{unit}]"
        # an inset is as high as the panel, whatever its aspect
        beside = ax.inset_axes(_bar_place(ax, data, first, second, small=small))
        bar = ax.figure.colorbar(mesh, cax=beside, extend=open_end)
        about = f"{measure.label}" if unit in measure.label else f"{measure.label} ({unit})"
        bar.set_label("\n".join(textwrap.wrap(about, 48)), fontsize=8)
        bar.ax.tick_params(labelsize=8)
        ax.set_title(name.replace("_", " "), fontsize=10)
    for found in sets:
        draw_set(ax, found, [found.over.index(n) for n in (first, second)], scheme)
    start = start_within(data)
    if start is not None:
        place = dict(zip(data["status"].dims, start[1], strict=True))
        mark_start(ax, place[first], place[second])
    _frame(ax, data, first, second, degrees=not small)


def draw_set(
    ax: Axes, found: DrawableSet, columns: Sequence[int], scheme: Scheme = COLOURED
) -> None:
    """Draw the polylines and points of a set; ``columns`` of its coordinates go to the axes.

    What the branch reaches is drawn with a white seam, the rest thin and without.
    """
    from matplotlib.collections import LineCollection

    colour, dashes, shape = scheme.kinds[found.kind], DASHES[found.kind], MARKERS[found.kind]
    lines: dict[bool, list[np.ndarray]] = {True: [], False: []}
    for line, on_branch in polylines(found):
        at = found.coordinates[line][:, columns]
        if len(line) > 1:
            lines[on_branch].append(at)
        else:
            ax.plot(*at.T, shape, ms=6, mfc=colour if on_branch else "white", mec="white", zorder=4)
    # all halos below all lines: a piece must not cut into the next one
    ax.add_collection(
        LineCollection(lines[True], colors="white", linewidths=3.6, alpha=0.8, zorder=2.8)
    )
    ax.add_collection(
        LineCollection(
            lines[True],
            colors=colour,
            linewidths=2.0,
            linestyles=[dashes],
            zorder=3,
            capstyle="butt" if found.kind != "direct" else "round",
        )
    )
    ax.add_collection(
        LineCollection(lines[False], colors=colour, linewidths=0.8, linestyles=[dashes], zorder=2.5)
    )


def mark_start(ax: Any, *place: float) -> None:
    """Mark the posture that the branch starts from."""
    ax.plot(*([v] for v in place), "*", ms=13, mfc="white", mec="black", zorder=5, clip_on=False)


def add_degrees(ax: Axes, *, x: bool, y: bool) -> None:
    """Add a second scale in degrees."""
    if x:
        scale = ax.secondary_xaxis("top", functions=(np.degrees, np.radians))
        scale.tick_params(labelsize=7, colors=GREY)
        scale.xaxis.set_major_formatter("{x:g}°")
    if y:
        scale = ax.secondary_yaxis("right", functions=(np.degrees, np.radians))
        scale.tick_params(labelsize=7, colors=GREY)
        scale.yaxis.set_major_formatter("{x:g}°")


def _order(ax: Axes, names: list[str]) -> tuple[str, str]:
    """Coordinates along the first and second axis; around and outwards in polar axes."""
    return ("azimuth", "tilt") if ax.name == "polar" else (names[0], names[1])


def _edges(values: np.ndarray) -> np.ndarray:
    """Edges (n + 1,) of cells around values (n,); the outer cells are cut at their values."""
    return np.concatenate([values[:1], 0.5 * (values[1:] + values[:-1]), values[-1:]])


def _fill(
    ax: Axes, edges: tuple[np.ndarray, np.ndarray], where: np.ndarray, colour: str, alpha: float
) -> None:
    from matplotlib.colors import ListedColormap

    ax.pcolormesh(*edges, where.T, cmap=ListedColormap([colour]), alpha=alpha, rasterized=True)


def _draw_blanks(
    ax: Axes, edges: tuple[np.ndarray, np.ndarray], data: xr.Dataset, scheme: Scheme
) -> None:
    status = data["status"].to_numpy()
    for name, code in statuses_of(data).items():
        where = status == code
        if name not in BLANKS or not where.any():
            continue
        _fill(ax, edges, np.where(where, 1.0, np.nan), blank_colour(name, scheme), alpha=1.0)
        _hatch(ax, edges, where, BLANKS[name].hatch)


def _hatch(ax: Axes, edges: tuple[np.ndarray, np.ndarray], where: np.ndarray, pattern: str) -> None:
    """Hatch the cells that hold, all of each: one path round every run of cells in a column."""
    from matplotlib.collections import PolyCollection

    x, y = edges
    boxes = []
    for i, column in enumerate(where):
        change = np.flatnonzero(np.diff(np.concatenate([[0], column, [0]]).astype(int)))
        for begin, end in change.reshape(-1, 2):
            low, high = y[begin], y[end]
            boxes.append([(x[i], low), (x[i + 1], low), (x[i + 1], high), (x[i], high)])
    hatched = PolyCollection(boxes, facecolors="none", edgecolors="#999999", linewidths=0.0)
    hatched.set_hatch(pattern)
    ax.add_collection(hatched, autolim=False)


def _bar_place(
    ax: Axes, data: xr.Dataset, first: str, second: str, *, small: bool
) -> tuple[float, float, float, float]:
    """Left, bottom, width, height of the colour bar in panels: beyond a scale in degrees.

    In panels that are narrower than high all widths count for more.
    """
    if ax.name == "polar":
        return 1.14, 0.0, 0.04, 1.0
    width = min(1.0, _proportion(data, first, second) or 1.0)
    gap = 0.12 if data[second].attrs.get("units") == "rad" and not small else 0.03
    return 1.0 + gap / width, 0.0, 0.04 / width, 1.0


def _proportion(data: xr.Dataset, first: str, second: str) -> float | None:
    """Width by height of a panel with one scale for both axes; None where that suits it badly."""
    one, two = data[first], data[second]
    ratio = float((one[-1] - one[0]) / (two[-1] - two[0]))
    alike = one.attrs.get("units") == two.attrs.get("units")
    return ratio if alike and 1.0 / MOST_UNEQUAL <= ratio <= MOST_UNEQUAL else None


def _frame(ax: Axes, data: xr.Dataset, first: str, second: str, *, degrees: bool) -> None:
    x, y = data[first].to_numpy(), data[second].to_numpy()
    if ax.name == "polar":
        _frame_polar(ax, x, y)
        return
    ax.set(
        xlabel=axis_label(data, first),
        ylabel=axis_label(data, second),
        xlim=(x[0], x[-1]),
        ylim=(y[0], y[-1]),
    )
    ax.set_aspect("auto" if _proportion(data, first, second) is None else "equal")
    calm_ticks(ax)
    turns = [degrees and data[name].attrs.get("units") == "rad" for name in (first, second)]
    add_degrees(ax, x=turns[0], y=turns[1])


def _frame_polar(ax: Any, azimuth: np.ndarray, tilt: np.ndarray) -> None:
    """Degrees on both scales: that is how directions are read."""
    from matplotlib.patheffects import withStroke

    if azimuth[-1] - azimuth[0] < 2.0 * np.pi - 1e-6:
        ax.set_thetamin(np.degrees(azimuth[0]))
        ax.set_thetamax(np.degrees(azimuth[-1]))
    ax.set_rlim(0.0, tilt[-1])
    most = float(np.degrees(tilt[-1]))
    step = next((s for s in (1, 2, 5, 10, 15, 30) if most / s <= 5), 45)
    rings = np.arange(step, most + 1e-6, step)
    halo = [withStroke(linewidth=2.5, foreground="white", alpha=0.8)]
    _, texts = ax.set_rgrids(np.radians(rings), labels=[f"{r:g}°" for r in rings], fontsize=8)
    for text in texts:
        text.set_path_effects(halo)
    ax.grid(True, color="white", alpha=0.5, lw=0.6)
    ax.tick_params(labelsize=8)
    ax.set_xlabel("azimuth around, tilt outwards [deg]", fontsize=9)
