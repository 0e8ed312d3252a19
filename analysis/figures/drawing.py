"""Figures of singularity maps: filled measures, singular sets by kind, the rest hatched.

No window opens and no state of pyplot is touched: figures are made, written and returned.
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from closedchain.analysis.figures.legend import legend_of
from closedchain.analysis.figures.lines import by_unit, draw_line
from closedchain.analysis.figures.palette import (
    COLOURED,
    PRINTED,
    Scheme,
    measure_of,
    statuses_of,
)
from closedchain.analysis.figures.panels import draw_panel, is_polar
from closedchain.analysis.figures.saving import save_figure
from closedchain.analysis.figures.space import draw_space, planes
from closedchain.analysis.figures.ticks import part_ticks
from closedchain.analysis.survey.captions import account, description, heading, method
from closedchain.analysis.survey.set_tables import DrawableSet
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
_HEIGHTS = {1: 3.7, 2: 5.4, 3: 6.4}  # by the number of coordinates, for two measures
_LEGEND = 1.2  # inches
_TALLEST = 17.5  # inches of one page
_COLUMNS = 140  # characters of a line of small print


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
    grey: bool = False,
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
        Image to write, its format by its ending (png, svg, pdf), and beside it, in a file that
        ends in .alt.txt, what it shows in words.
    axes : matplotlib Axes, optional
        Where to draw one measure of a map over one or two coordinates; polar axes show tilt
        outwards and azimuth around. A figure is made by default.
    dpi : float
        Dots per inch of the image.
    grey : bool
        For print: no colours, kinds of singularity differ by dashes and markers alone.

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
    scheme = PRINTED if grey else COLOURED
    if axes is None:
        part = _Drawn(data, sets)
        figure = _drawn([part], wanted, "", scheme)
        if path is not None:
            save_figure(figure, path, description(data, sets, wanted), dpi)
        return figure
    if path is not None:
        raise ClosureError("give either path or axes: who made the axes writes their figure")
    if data["status"].ndim == 1:
        draw_line(axes, data, sets, wanted, scheme)
    elif data["status"].ndim == 2:
        name = wanted[0]
        draw_panel(axes, data, sets, name, measure_of(data, name), scheme)
    else:
        raise ClosureError("a map over three coordinates needs a figure of its own: leave out axes")
    return axes.figure


def draw_survey(
    result: DrawnSurvey,
    path: str | os.PathLike[str] | Path,
    *,
    measures: str | Sequence[str] | None = None,
    dpi: float = DPI,
    grey: bool = False,
) -> tuple[Path, ...]:
    """Draw a survey, one row a slice, and write an image, or several pages of it.

    Parameters
    ----------
    result : Survey, or Results read from a folder
    path : path
        Image to write, its format by its ending (png, svg, pdf), and beside it what it shows in
        words. Slices that do not fit go on to pages: map.png, map-2.png and so on.
    measures : str or sequence of str, optional
        Variables of the maps; sigma_direct and sigma_inverse by default.
    dpi : float
        Dots per inch.
    grey : bool
        For print, as for ``draw_map``.

    Returns
    -------
    tuple of Path
        The images.

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
    pages = _pages(result.slices, wanted)
    images = tuple(_page_file(Path(path), i) for i in range(len(pages)))
    for i, (page, image) in enumerate(zip(pages, images, strict=True)):
        title = result.title + (f" ({i + 1} of {len(pages)})" if len(pages) > 1 else "")
        figure = _drawn(page, wanted, title, PRINTED if grey else COLOURED)
        words = [f"{title}.", *(description(part.map, part.sets, wanted) for part in page)]
        save_figure(figure, image, " ".join(words), dpi)
    return images


def _pages(slices: Sequence[DrawnSlice], measures: Sequence[str]) -> list[list[DrawnSlice]]:
    """Slices that are drawn on one page each."""
    pages: list[list[DrawnSlice]] = []
    room = 0.0
    for part in slices:
        height = _height(part, measures)
        if not pages or height > room:
            pages.append([])
            room = _TALLEST
        pages[-1].append(part)
        room -= height
    return pages


def _page_file(path: Path, i: int) -> Path:
    return path if not i else path.with_name(f"{path.stem}-{i + 1}{path.suffix}")


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


def _drawn(
    slices: Sequence[DrawnSlice], measures: Sequence[str], title: str, scheme: Scheme
) -> Figure:
    """Figure with a row for each slice and one legend."""
    require("figures are drawn with matplotlib", "figures")
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    heights = [_height(part, measures) for part in slices]
    figure = Figure(figsize=(_WIDTH, sum(heights) + _LEGEND), layout="constrained")
    FigureCanvasAgg(figure)
    # one more row, of text: the legend
    rows = figure.subfigures(len(slices) + 1, 1, height_ratios=[*heights, 0.9], squeeze=False)
    for part, row in zip(slices, rows[:, 0], strict=False):
        row.suptitle(_headline(part), fontsize=9)
        row.supxlabel(_small_print(part), fontsize=7, color="#444444")
        _draw_row(row, part, measures, scheme)
    handles = legend_of([(part.map, part.sets) for part in slices], scheme)
    rows[-1, 0].legend(handles=handles, loc="center", ncols=3, frameon=False, fontsize=9,
                       handlelength=4.0)  # fmt: skip
    if title:
        figure.suptitle(title)
    part_ticks(figure)
    return figure


def _headline(part: DrawnSlice) -> str:
    return "\n".join(textwrap.wrap(heading(part.map), _COLUMNS))


def _small_print(part: DrawnSlice) -> str:
    """What the sets are, and how they were found."""
    sets = "; ".join(account(found, notes=False) for found in part.sets)
    said = f"{sets}. " if sets else ""
    return "\n".join(textwrap.wrap(f"{said}{method(part.map, part.sets)}", _COLUMNS + 40))


def _height(part: DrawnSlice, measures: Sequence[str]) -> float:
    k = part.map["status"].ndim
    words = 0.14 * (_headline(part).count("\n") + _small_print(part).count("\n"))
    if k == 1:
        return _HEIGHTS[1] * len(by_unit(part.map, measures)) + words
    if k == 3:
        return _HEIGHTS[3] * len(measures) / 2 + words
    return _HEIGHTS[k] * -(-len(measures) // 2) + words


def _draw_row(row: SubFigure, part: DrawnSlice, measures: Sequence[str], scheme: Scheme) -> None:
    data, sets = part.map, part.sets
    k = data["status"].ndim
    if k == 1:
        groups = by_unit(data, measures)
        axes = row.subplots(len(groups), 1, squeeze=False)[:, 0]
        for ax, names in zip(axes, groups, strict=True):
            draw_line(ax, data, sets, names, scheme)
    elif k == 2:
        _draw_slice(row, data, sets, measures, scheme)
    else:
        _draw_volume(row, data, sets, measures, scheme)


def _draw_slice(
    row: SubFigure,
    data: xr.Dataset,
    sets: Sequence[DrawableSet],
    measures: Sequence[str],
    scheme: Scheme,
) -> None:
    names = [str(d) for d in data["status"].dims]
    kind = "polar" if is_polar(names, data) else "rectilinear"
    columns = min(2, len(measures))
    lines = -(-len(measures) // columns)
    for i, name in enumerate(measures):
        ax = row.add_subplot(lines, columns, i + 1, projection=kind)
        draw_panel(ax, data, sets, name, measure_of(data, name), scheme)


def _draw_volume(
    row: SubFigure,
    data: xr.Dataset,
    sets: Sequence[DrawableSet],
    measures: Sequence[str],
    scheme: Scheme,
) -> None:
    """Surfaces on the left; for each measure a line of three planes on the right."""
    halves = row.subfigures(1, 2, squeeze=False, width_ratios=[1.0, 2.2])
    left, right = halves[0]
    draw_space(left.add_subplot(projection="3d"), data, sets, scheme)
    cuts = planes(data, sets)
    for i, name in enumerate(measures):
        for j, (title, flat, flat_sets) in enumerate(cuts):
            names = [str(d) for d in flat["status"].dims]
            kind = "polar" if is_polar(names, flat) else "rectilinear"
            ax = right.add_subplot(len(measures), 3, 3 * i + j + 1, projection=kind)
            draw_panel(ax, flat, flat_sets, name, measure_of(data, name), scheme, small=True)
            ax.set_title(f"{name.replace('_', ' ')} at {title}", fontsize=9)
