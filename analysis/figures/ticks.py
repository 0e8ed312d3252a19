"""Ticks that do not touch."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MOST = 9  # intervals along an axis to begin with
FEWEST = 1
APART = 2.0  # pixels between labels


def calm_ticks(ax: Any, most: int = MOST) -> None:
    """Round ticks, a few of them, along both axes of a plot in linear scale."""
    for axis in (ax.xaxis, ax.yaxis):
        if axis.get_scale() == "linear":
            _limit(axis, most)


def part_ticks(figure: Figure) -> None:
    """Take ticks away until no labels along an axis touch."""
    most = MOST
    while most > FEWEST:
        figure.draw_without_rendering()
        crowded = [axis for axis in _axes(figure) if _touch(axis)]
        if not crowded:
            return
        most -= 1
        for axis in crowded:
            _limit(axis, most)


def touching_labels(figure: Figure) -> list[str]:
    """Labels along an axis that touch the one before them, as drawn."""
    figure.draw_without_rendering()
    return [text for axis in _axes(figure) for text in _touch(axis)]


def _limit(axis: Any, most: int) -> None:
    from matplotlib.ticker import AutoLocator, MaxNLocator

    if isinstance(axis.get_major_locator(), AutoLocator | MaxNLocator):
        axis.set_major_locator(MaxNLocator(most, steps=[1, 2, 5, 10]))


def _axes(figure: Figure) -> list[Any]:
    found = []
    for ax in figure.axes:
        if ax.name in ("polar", "3d"):
            continue
        for one in (ax, *ax.child_axes):
            found += [one.xaxis, one.yaxis]
    return found


def _touch(axis: Any) -> list[str]:
    across = axis.axis_name == "x"
    before: float | None = None
    found = []
    boxes = []
    for tick in axis.get_major_ticks():
        low, high = sorted(axis.get_view_interval())
        slack = 1e-9 * (high - low)
        if not low - slack <= tick.get_loc() <= high + slack:
            continue
        for label in (tick.label1, tick.label2):
            if label.get_visible() and label.get_text():
                box = label.get_window_extent()
                ends = (box.x0, box.x1) if across else (box.y0, box.y1)
                boxes.append((*ends, label.get_text()))
    for start, end, text in sorted(boxes):
        if before is not None and start < before + APART:
            found.append(text)
        before = end
    return found
