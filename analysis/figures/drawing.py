"""Figures of singularity maps: filled measures, singular sets by kind, the rest hatched.

No window opens and no state of pyplot is touched: figures are made, written and returned.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from closedchain.analysis.figures.lines import draw_line
from closedchain.analysis.figures.palette import (
    BLANKS,
    COLOURS,
    KIND_LABELS,
    measure_of,
    start_of,
    statuses_of,
)
from closedchain.analysis.figures.panels import draw_panel, is_polar
from closedchain.analysis.figures.space import draw_space, planes
from closedchain.analysis.survey.set_tables import DrawableSet, polylines
from closedchain.urdf.errors import ClosureError
from closedchain.urdf.extras import require

if TYPE_CHECKING:
    import os

    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

MEASURES_DRAWN = ("sigma_direct", "sigma_inverse")
DPI = 130
_WIDTH = 12.0  # inches
_HEIGHTS = {1: 3.4, 2: 5.0, 3: 6.0}  # by the number of coordinates, for two measures


class DrawnSlice(Protocol):
    """A map and the singular sets over the same coordinates."""

    @property
    def map(self) -> xr.Dataset:
        """Of ``singularity_map``."""

    @property
    def sets(self) -> Sequence[DrawableSet]:
        """Over the coordinates of the map."""


class DrawnSurvey(Protocol):
    """Slices and a heading."""

    @property
    def title(self) -> str:
        """Heading."""

    @property
    def slices(self) -> Sequence[DrawnSlice]:
        """In the order of the figure."""


def draw_map(
    data: xr.Dataset,
    sets: Iterable[DrawableSet] = (),
    *,
    measures: str | Sequence[str] | None = None,
    path: str | os.PathLike[str] | None = None,
    axes: Axes | None = None,
    dpi: float = DPI,
) -> Figure | SubFigure:
    """Draw a singularity map with singular sets on top.

    One coordinate gives lines; two a filled map, round where they are tilt and azimuth; three
    surfaces in space and the three planes through the start.

    Parameters
    ----------
    data : xarray.Dataset
        Of ``singularity_map``, over one to three coordinates.
    sets : SingularitySet, any number
        Of ``singularity_set`` over the same coordinates.
    measures : str or sequence of str, optional
        Variables of the map; sigma_direct and sigma_inverse by default.
    path : path, optional
        Image to write, its format by its ending (png, svg, pdf).
    axes : matplotlib Axes, optional
        Where to draw one measure of a map over one or two coordinates; polar axes show tilt
        outwards and azimuth around. A figure is made by default.
    dpi : float
        Dots per inch of the image.

    Returns
    -------
    matplotlib Figure

    Raises
    ------
    ClosureError
        No singularity map, unknown measures, sets over other coordinates, more than three
        coordinates.
    OSError
        The image cannot be written.
    """
    sets = tuple(sets)
    wanted = _wanted(measures)
    _check(data, sets, wanted)
    if axes is None:
        part = _Drawn(data, sets)
        figure = _drawn([part], wanted, "")
        if path is not None:
            figure.savefig(path, dpi=dpi)
        return figure
    if path is not None:
        raise ClosureError("give either path or axes: who made the axes writes their figure")
    if data["status"].ndim == 1:
        draw_line(axes, data, sets, wanted)
    elif data["status"].ndim == 2:
        name = wanted[0]
        draw_panel(axes, data, sets, name, measure_of(data, name))
    else:
        raise ClosureError("a map over three coordinates needs a figure of its own: leave out axes")
    return axes.figure


def draw_survey(
    result: DrawnSurvey,
    path: str | os.PathLike[str] | Path,
    *,
    measures: str | Sequence[str] | None = None,
    dpi: float = DPI,
) -> None:
    """Draw a survey, one row a slice, and write an image.

    Parameters
    ----------
    result : Survey, or Results read from a folder
    path : path
        Image to write, its format by its ending (png, svg, pdf).
    measures : str or sequence of str, optional
        Variables of the maps; sigma_direct and sigma_inverse by default.
    dpi : float
        Dots per inch.

    Raises
    ------
    ClosureError
        Unknown measures.
    OSError
        The image cannot be written.
    """
    wanted = _wanted(measures)
    for part in result.slices:
        _check(part.map, part.sets, wanted)
    _drawn(result.slices, wanted, result.title).savefig(path, dpi=dpi)


class _Drawn:
    """A map and its sets."""

    def __init__(self, data: xr.Dataset, sets: Sequence[DrawableSet]) -> None:
        self.map = data
        self.sets = sets


def _wanted(measures: str | Sequence[str] | None) -> tuple[str, ...]:
    if measures is None:
        return MEASURES_DRAWN
    return (measures,) if isinstance(measures, str) else tuple(measures)


def _check(data: xr.Dataset, sets: Sequence[DrawableSet], measures: Sequence[str]) -> None:
    statuses_of(data)
    names = [str(d) for d in data["status"].dims]
    if not 1 <= len(names) <= 3:
        raise ClosureError(
            f"a figure shows one to three coordinates, the map has {len(names)}: "
            f"{' '.join(names)}; choose values of the others, as in data.sel({names[-1]}=0.1, "
            'method="nearest")'
        )
    if not measures:
        raise ClosureError("at least one measure must be drawn")
    for name in measures:
        measure_of(data, name)
    for found in sets:
        if set(found.over) != set(names):
            raise ClosureError(
                f"the map is over {' x '.join(names)}, the {found.kind} set over "
                f"{' x '.join(found.over)}"
            )


def _drawn(slices: Sequence[DrawnSlice], measures: Sequence[str], title: str) -> Figure:
    """Figure with a row for each slice and one legend."""
    require("figures are drawn with matplotlib", "figures")
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    heights = [_height(part, len(measures)) for part in slices]
    figure = Figure(figsize=(_WIDTH, sum(heights) + 1.2), layout="constrained")
    FigureCanvasAgg(figure)
    # one more row, of text: the legend
    rows = figure.subfigures(len(slices) + 1, 1, height_ratios=[*heights, 0.9], squeeze=False)
    for part, row in zip(slices, rows[:, 0], strict=False):
        _draw_row(row, part, measures)
    rows[-1, 0].legend(handles=_legend(slices), loc="center", ncols=3, frameon=False, fontsize=9)
    if title:
        figure.suptitle(title)
    return figure


def _height(part: DrawnSlice, measures: int) -> float:
    k = part.map["status"].ndim
    if k == 3:
        return _HEIGHTS[3] * measures / 2
    return _HEIGHTS[k] * (1 if k == 1 else -(-measures // 2))


def _draw_row(row: SubFigure, part: DrawnSlice, measures: Sequence[str]) -> None:
    data, sets = part.map, part.sets
    k = data["status"].ndim
    if k == 1:
        draw_line(row.subplots(), data, sets, measures)
    elif k == 2:
        _draw_slice(row, data, sets, measures)
    else:
        _draw_volume(row, data, sets, measures)


def _draw_slice(
    row: SubFigure, data: xr.Dataset, sets: Sequence[DrawableSet], measures: Sequence[str]
) -> None:
    names = [str(d) for d in data["status"].dims]
    kind = "polar" if is_polar(names, data) else "rectilinear"
    columns = min(2, len(measures))
    lines = -(-len(measures) // columns)
    for i, name in enumerate(measures):
        ax = row.add_subplot(lines, columns, i + 1, projection=kind)
        draw_panel(ax, data, sets, name, measure_of(data, name))


def _draw_volume(
    row: SubFigure, data: xr.Dataset, sets: Sequence[DrawableSet], measures: Sequence[str]
) -> None:
    """Surfaces on the left; for each measure a line of three planes on the right."""
    halves = row.subfigures(1, 2, squeeze=False, width_ratios=[1.0, 2.2])
    left, right = halves[0]
    draw_space(left.add_subplot(projection="3d"), data, sets)
    cuts = planes(data, sets)
    for i, name in enumerate(measures):
        for j, (title, flat, flat_sets) in enumerate(cuts):
            names = [str(d) for d in flat["status"].dims]
            kind = "polar" if is_polar(names, flat) else "rectilinear"
            ax = right.add_subplot(len(measures), 3, 3 * i + j + 1, projection=kind)
            draw_panel(ax, flat, flat_sets, name, measure_of(data, name))
            ax.set_title(f"{name.replace('_', ' ')} at {title}", fontsize=9)


def _legend(slices: Sequence[DrawnSlice]) -> list[Any]:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    handles: list[Any] = []
    everything = [found for part in slices for found in part.sets]
    for kind in KIND_LABELS:
        of_kind = [found for found in everything if found.kind == kind]
        if not any(len(found.coordinates) or found.everywhere for found in of_kind):
            continue
        handles.append(_kind_handle(kind, of_kind))
    if any(not on for found in everything for _, on in polylines(found)):
        label = "the same, not reached by the branch"
        handles.append(Line2D([], [], color="#777777", lw=1.0, ls=(0, (4, 2)), label=label))
    starts = {start[0] for part in slices if (start := start_of(part.map)) is not None}
    if starts:
        label = ", ".join(sorted(starts))
        handles.append(Line2D([], [], ls="", marker="*", ms=11, mfc="w", mec="k", label=label))
    for name, blank in BLANKS.items():
        if any(_shows(part, name) for part in slices):
            handles.append(
                Patch(fc=blank.colour, ec="#999999", hatch=blank.hatch, label=blank.label)
            )
    return handles


def _kind_handle(kind: str, sets: Sequence[DrawableSet]) -> Any:
    """What stands for a kind in the legend: the line, the marker, or both, that its sets show."""
    from matplotlib.lines import Line2D

    colour, label = COLOURS[kind], KIND_LABELS[kind]
    if all(len(found.over) == 1 for found in sets):
        return Line2D([], [], color=colour, lw=1.4, ls="--", label=label)
    points = any(piece.size == 1 for found in sets for piece in found.pieces)
    whole = any(found.everywhere for found in sets)
    lines = whole or any(piece.size > 1 for found in sets for piece in found.pieces)
    shape = ("D" if kind == "combined" else "o") if points else None
    return Line2D(
        [],
        [],
        color=colour,
        lw=2.2 if lines else 0.0,
        marker=shape,
        mec="white",
        label=label,
    )


def _shows(part: DrawnSlice, status: str) -> bool:
    codes = statuses_of(part.map)
    return status in codes and bool((part.map["status"] == codes[status]).any())
