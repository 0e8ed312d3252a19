"""Figures of followed tasks: inputs, speeds and measures over time, alone or beside other runs.

No window opens and no state of pyplot is touched: figures are made, written and returned.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from closedchain.analysis.figures.saving import save_figure, words_of
from closedchain.analysis.figures.strokes import COLOURS, DASHES
from closedchain.analysis.motion.follow.result import Follow
from closedchain.urdf.errors import ClosureError
from closedchain.urdf.extras import require

if TYPE_CHECKING:
    import os

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

DPI = 130
GREY = "#666666"
_STILL = 1e-9  # m or rad: inputs that move less are drawn at rest


def draw_follow(
    run: Follow,
    others: Mapping[str, Follow] | None = None,
    *,
    name: str | None = None,
    title: str | None = None,
    path: str | os.PathLike[str] | None = None,
    dpi: float = DPI,
) -> Figure:
    """Draw inputs and their speeds, the singular values, and the distance beside other runs.

    Parameters
    ----------
    run : Follow
    others : mapping of name to Follow, optional
        Runs of the same task, drawn with broken lines. Those that did not begin are left out.
    name : str, optional
        Of the run in the legend; what is locked, or the method, by default.
    title : str, optional
        What the heading begins with; the mechanism's name by default.
    path : path, optional
        Image to write, its format by its ending (png, svg, pdf).
    dpi : float
        Dots per inch of the image.

    Returns
    -------
    matplotlib Figure

    Raises
    ------
    ClosureError
        Other runs with other inputs.
    OSError
        The image cannot be written.
    """
    require("figures are drawn with matplotlib", "figures")
    from matplotlib.figure import Figure

    m, others = run.problem.mechanism, _drawable(run, others)
    units = tuple(dict.fromkeys(m.input_units))
    with_measure = run.objective != "singularity"
    rows = max(2 * len(units), 3 if with_measure else 2)
    figure = Figure(figsize=(12.0, 2.6 * rows), layout="constrained")
    sides = figure.add_gridspec(1, 2)
    axes = []
    grid = sides[0, 0].subgridspec(2 * len(units), 1)
    for i, unit in enumerate(units):
        which = [k for k, u in enumerate(m.input_units) if u == unit]
        kind = {"m": "lengths", "rad": "angles"}.get(unit, "inputs")
        for j, (values, what, per) in enumerate(
            ((run.inputs, f"input {kind}", ""), (run.input_speeds, f"speeds of {kind}", "/s"))
        ):
            ax = figure.add_subplot(grid[2 * i + j])
            _lines(ax, run.times, values, m.inputs, which)
            ax.set(ylabel=f"[{unit}{per}]", title=what)
            axes.append(ax)
    grid = sides[0, 1].subgridspec(3 if with_measure else 2, 1)
    ax = figure.add_subplot(grid[0])
    _sigmas(ax, run)
    axes.append(ax)
    ax = figure.add_subplot(grid[1])
    _beside(ax, {name or way_of(run): run, **others}, "distance")
    ax.set(title="distance to the nearest singularity", ylabel="smaller singular value [-]")
    axes.append(ax)
    if with_measure:
        ax = figure.add_subplot(grid[2])
        same = {n: o for n, o in others.items() if o.objective == run.objective}
        _beside(ax, {name or way_of(run): run, **same}, "measure")
        ax.set(title=f"objective: {run.objective}", ylabel="measure (larger is better)")
        axes.append(ax)
    _frame(axes, run)
    figure.suptitle(_heading(run, title))
    if path is not None:
        save_figure(figure, path, words_of(figure), dpi)
    return figure


def draw_inputs(
    run: Follow,
    others: Mapping[str, Follow] | None = None,
    *,
    name: str | None = None,
    title: str | None = None,
    path: str | os.PathLike[str] | None = None,
    dpi: float = DPI,
) -> Figure:
    """Draw each input over time in a panel of its own; panels of one unit have one scale.

    Parameters and errors are those of ``draw_follow``.
    """
    require("figures are drawn with matplotlib", "figures")
    from matplotlib.figure import Figure

    m, others = run.problem.mechanism, _drawable(run, others)
    runs = {name or way_of(run): run, **others}
    columns = min(3, len(m.inputs))
    rows = -(-len(m.inputs) // columns)
    figure = Figure(figsize=(4.0 * columns, 2.5 * rows + 0.5), layout="constrained")
    grid = figure.subplots(rows, columns, squeeze=False)
    axes = list(grid.ravel()[: len(m.inputs)])
    for ax in grid.ravel()[len(m.inputs) :]:
        ax.set_axis_off()
    spans = _spans([r.inputs for r in runs.values() if r.reached], m.input_units)
    for i, ax in enumerate(axes):
        locked = " (locked)" if m.inputs[i] in run.locked else ""
        for k, (label, one) in enumerate(runs.items()):
            ax.plot(one.times, one.inputs[:, i], label=label, **_style(k, first=k == 0))
        ax.set(title=f"{m.inputs[i]}{locked}", ylabel=f"[{m.input_units[i]}]")
        if spans:
            ax.set_ylim(*spans[i])
    _frame(axes, run, legends=False)
    if len(runs) > 1:
        entries = axes[0].get_legend_handles_labels()
        figure.legend(*entries, loc="outside lower center", ncols=6, frameon=False, fontsize=9)
    figure.suptitle(_heading(run, title))
    if path is not None:
        save_figure(figure, path, words_of(figure), dpi)
    return figure


def way_of(run: Follow) -> str:
    """What a run did with the freedoms: "q3 locked", or its method."""
    return f"{' '.join(run.locked)} locked" if run.locked else run.method


def _drawable(run: Follow, others: Mapping[str, Follow] | None) -> dict[str, Follow]:
    inputs = run.problem.mechanism.inputs
    for name, other in (others or {}).items():
        if other.problem.mechanism.inputs != inputs:
            raise ClosureError(f"run {name!r} has other inputs than the one it is drawn beside")
    return {name: other for name, other in (others or {}).items() if other.reached}


def _lines(
    ax: Axes, times: np.ndarray, values: np.ndarray, names: Sequence[str], which: Iterable[int]
) -> None:
    """Columns of values over time; wide lines below narrow ones, so that equal ones all show."""
    for n, i in enumerate(which):
        width = (3.0, 2.0, 1.2)[n % 3]
        ax.plot(
            *(times, values[:, i]),
            color=COLOURS[n % len(COLOURS)],
            ls=DASHES[n // 3 % len(DASHES)],
            lw=width,
            marker="" if len(times) > 1 else "o",
            label=names[i],
        )


def _sigmas(ax: Axes, run: Follow) -> None:
    series = {"direct": run.sigma_direct}
    if run.locked:
        series["inverse, as locked"] = run.sigma_driven
        series["inverse, all inputs"] = run.sigma_inverse
    else:
        series["inverse"] = run.sigma_inverse
    styles = (("#D55E00", "-"), ("#0072B2", "-"), ("#56B4E9", "--"))
    for (label, values), (colour, dash) in zip(series.items(), styles, strict=False):
        ax.plot(run.times, values, color=colour, ls=dash, lw=1.8, label=label)
    ax.set(title="singular values, 0 at a singularity", ylabel="[-]")
    _from_zero(ax, series.values())


def _beside(ax: Axes, runs: Mapping[str, Follow], what: str) -> None:
    for k, (label, one) in enumerate(runs.items()):
        stopped = "" if one.converged else " (stops)"
        ax.plot(one.times, getattr(one, what), label=label + stopped, **_style(k, first=k == 0))
        if not one.converged and one.reached:
            ax.plot(one.times[-1], getattr(one, what)[-1], "x", ms=7, mew=2, color=_colour(k))
    if what == "distance":
        _from_zero(ax, [one.distance for one in runs.values()])


def _from_zero(ax: Axes, series: Iterable[np.ndarray]) -> None:
    most = max((float(values.max(initial=0.0)) for values in series), default=0.0)
    ax.set_ylim(0.0, 1.08 * most or 1.0)


def _style(k: int, *, first: bool) -> dict[str, Any]:
    """Line of run number k: the first one whole, wide and at the bottom, the others broken."""
    dash = "-" if first else DASHES[1 + (k - 1) % (len(DASHES) - 1)]
    return {"color": _colour(k), "ls": dash, "lw": 3.0 if first else 1.5}


def _colour(k: int) -> str:
    return COLOURS[k % len(COLOURS)]


def _spans(tables: Sequence[np.ndarray], units: Sequence[str]) -> list[tuple[float, float]]:
    """Ends of the vertical scale of each input: as long for all of one unit."""
    if not tables:
        return []
    values = np.concatenate(tables)
    low, high = values.min(axis=0), values.max(axis=0)
    found = []
    for i, unit in enumerate(units):
        same = [k for k, u in enumerate(units) if u == unit]
        half = 0.55 * float((high - low)[same].max())
        half = half if half > _STILL else 0.05
        middle = 0.5 * float(low[i] + high[i])
        found.append((middle - half, middle + half))
    return found


def _frame(axes: Sequence[Axes], run: Follow, *, legends: bool = True) -> None:
    times = run.problem.times
    for ax in axes:
        ax.grid(alpha=0.3)
        if len(times) > 1:
            ax.set_xlim(times[0], times[-1])
        ax.set_xlabel("t [s]", fontsize=9)
        ax.tick_params(labelsize=8)
        ax.title.set_fontsize(10)
        if run.stopped is not None:
            ax.axvline(run.stopped, color=GREY, ls=":", lw=1.2)
        handles, labels = ax.get_legend_handles_labels()
        if legends and handles:
            # beside the panel: lines may be anywhere in it
            ax.legend(
                *(handles, labels), loc="center left", bbox_to_anchor=(1.0, 0.5),
                frameon=False, fontsize=8,
            )  # fmt: skip


def _heading(run: Follow, title: str | None) -> str:
    way = way_of(run)
    how = way if run.locked else f"{way}, objective {run.objective}"
    ended = "" if run.stopped is None else f"; stops at {run.stopped:.4g} s"
    return f"{title or run.problem.mechanism.name}: {how}{ended}"
