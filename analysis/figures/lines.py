"""Figures of maps over one coordinate: measures along a line."""

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
    Scheme,
    axis_label,
    blank_colour,
    measure_of,
    start_within,
    statuses_of,
)
from closedchain.analysis.figures.panels import add_degrees
from closedchain.analysis.figures.ticks import calm_ticks
from closedchain.analysis.survey.set_tables import DrawableSet

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes


def draw_line(
    ax: Axes,
    data: xr.Dataset,
    sets: Sequence[DrawableSet],
    measures: Sequence[str],
    scheme: Scheme = COLOURED,
) -> None:
    """Draw measures over one coordinate; what has no posture is hatched, singular points marked."""
    (dim,) = data["status"].dims
    name = str(dim)
    x = data[name].to_numpy()
    _draw_blanks(ax, x, data, scheme)
    others = iter([GREY, *(f"C{k}" for k in range(4, 4 + len(measures)))])
    for variable in measures:
        measure = measure_of(data, variable)
        values = data[variable].to_numpy()
        colour = scheme.kinds[measure.kind] if measure.kind else next(others)
        dashes = DASHES[measure.kind] if measure.kind else "-."
        shown = np.where(np.isfinite(values), values, np.nan)
        words = "\n".join(textwrap.wrap(f"{variable}, {measure.label}", 40))
        ax.plot(x, shown, color=colour, lw=1.8, ls=dashes, label=words)
    scales = {measure_of(data, variable).scale for variable in measures}
    if scales == {"log"}:
        ax.set_yscale("log")
    elif scales == {"zero"}:
        ax.set_ylim(bottom=0.0)
    else:
        ax.axhline(0.0, color="black", lw=0.8)
    for found in sets:
        for at in found.coordinates[:, 0]:
            ax.axvline(at, color=scheme.kinds[found.kind], lw=1.4, ls=DASHES[found.kind])
    whole = [f"{found.kind}ly singular everywhere" for found in sets if found.everywhere]
    ax.set_title(", ".join(whole), fontsize=10)
    start = start_within(data)
    if start is not None:
        across: Any = ax.get_xaxis_transform()
        ax.plot(
            start[1], [0.0], "*", ms=13, mfc="white", mec="black", zorder=5,
            transform=across, clip_on=False,
        )  # fmt: skip
    unit = data[measures[0]].attrs.get("units", "1")
    ax.set(xlabel=axis_label(data, name), xlim=(x[0], x[-1]))
    ax.set_ylabel("dimensionless" if unit == "1" else f"[{unit}]")
    ax.legend(fontsize=8, loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False)
    calm_ticks(ax)
    add_degrees(ax, x=data[name].attrs.get("units") == "rad", y=False)


def by_unit(data: xr.Dataset, measures: Sequence[str]) -> list[list[str]]:
    """Measures that share an axis: those of one unit, in the order of their first."""
    found: dict[str, list[str]] = {}
    for name in measures:
        measure_of(data, name)
        found.setdefault(str(data[name].attrs.get("units", "1")), []).append(name)
    return list(found.values())


def _draw_blanks(ax: Axes, x: np.ndarray, data: xr.Dataset, scheme: Scheme) -> None:
    status = data["status"].to_numpy()
    edges = np.concatenate([x[:1], 0.5 * (x[1:] + x[:-1]), x[-1:]])
    for name, code in statuses_of(data).items():
        if name not in BLANKS:
            continue
        blank = BLANKS[name]
        change = np.flatnonzero(np.diff(np.concatenate([[0], status == code, [0]]).astype(int)))
        for begin, end in change.reshape(-1, 2):
            ax.axvspan(
                edges[begin], edges[end], fc=blank_colour(name, scheme), ec="#BBBBBB",
                hatch=blank.hatch, lw=0.0, zorder=0,
            )  # fmt: skip
