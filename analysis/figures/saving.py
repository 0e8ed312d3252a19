"""Writing figures: the image, and beside it in a file of text what it shows."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import os

    from matplotlib.figure import Figure, SubFigure

ALT = ".alt.txt"


def alt_file(image: str | os.PathLike[str]) -> Path:
    """Where the words of an image lie: map.alt.txt beside map.png."""
    return Path(image).with_suffix(ALT)


def save_figure(figure: Figure, image: str | os.PathLike[str], words: str, dpi: float) -> None:
    """Write a figure, and its words both into the image and beside it.

    Raises
    ------
    OSError
        They cannot be written.
    """
    path = Path(image)
    key = {".png": "Description", ".svg": "Description", ".pdf": "Subject"}.get(path.suffix.lower())
    if key is None:
        figure.savefig(path, dpi=dpi)
    else:
        figure.savefig(path, dpi=dpi, metadata={key: words})
    alt_file(path).write_text(words + "\n", encoding="utf-8")


def words_of(figure: Figure) -> str:
    """What a figure of curves and coloured maps shows: titles, axes, and the range of each line."""
    said = _headings(figure)
    for ax in figure.axes:
        title = ax.get_title() or ax.get_title("left") or ax.get_ylabel()
        if not title:
            continue
        across, up = ax.get_xlabel(), ax.get_ylabel()
        if lines := _words_of_lines(ax):
            beside = "" if up in ("", title) else f" {up}" if up.startswith("[") else f", {up},"
            over = f" over {across}" if across else ""
            said.append(f"{title}{beside}{over}: {', '.join(lines)}")
        if colours := _words_of_colours(ax):
            over = f" over {' and '.join(filter(None, (across, up)))}" if across or up else ""
            said.append(f"{title}{over}: {', '.join(colours)}")
    return " ".join(f"{one.rstrip('.')}." for one in said)


def _headings(figure: Figure | SubFigure) -> list[str]:
    """Headings of a figure and its parts, and what stands below these."""
    parts = [figure, *figure.subfigs]
    texts = [text for part in parts for text in (part.get_suptitle(), part.get_supxlabel())]
    return [" ".join(text.split()) for text in texts if text]


def _words_of_lines(ax: Any) -> list[str]:
    """Names and ranges of the lines; without those that only guide the eye beside named ones."""
    lines = [
        (str(line.get_label()), np.asarray(line.get_ydata(), dtype=float)) for line in ax.lines
    ]
    named = any(not label.startswith("_") for label, _ in lines)
    said = []
    for label, values in lines:
        finite = values[np.isfinite(values)]
        if finite.size < 2 or (named and label.startswith("_")):
            continue
        name = "a line" if label.startswith("_") else label
        said.append(f"{name} from {finite.min():.3g} to {finite.max():.3g}")
    return said


def _words_of_colours(ax: Any) -> list[str]:
    """Ranges of the coloured cells, without cells of one colour, which only fill."""
    said = []
    for part in ax.collections:
        array = part.get_array()
        finite = np.zeros(0) if array is None else np.ma.masked_invalid(array).compressed()
        if finite.size and finite.min() < finite.max():
            said.append(f"colours from {finite.min():.3g} to {finite.max():.3g}")
    return said
