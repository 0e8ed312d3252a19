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
        lines = [words for line in ax.lines if (words := _words_of_line(line))]
        for part in ax.collections:
            array = part.get_array()
            if array is None or not (finite := np.ma.masked_invalid(array).compressed()).size:
                continue
            if finite.min() < finite.max():  # no cells of one colour, which only fill
                lines.append(f"colours from {finite.min():.3g} to {finite.max():.3g}")
        if lines and title:
            beside = f" [{ax.get_ylabel()}]" if ax.get_ylabel() not in ("", title) else ""
            over = f" over {ax.get_xlabel()}" if ax.get_xlabel() else ""
            said.append(f"{title}{beside}{over}: {', '.join(lines)}")
    return " ".join(f"{one.rstrip('.')}." for one in said)


def _headings(figure: Figure | SubFigure) -> list[str]:
    """Headings of a figure and its parts, and what stands below these."""
    parts = [figure, *figure.subfigs]
    texts = [text for part in parts for text in (part.get_suptitle(), part.get_supxlabel())]
    return [" ".join(text.split()) for text in texts if text]


def _words_of_line(line: Any) -> str:
    values = np.asarray(line.get_ydata(), dtype=float)
    finite = values[np.isfinite(values)]
    if finite.size < 2:
        return ""
    label = str(line.get_label())
    name = "a line" if label.startswith("_") else label
    return f"{name} from {finite.min():.3g} to {finite.max():.3g}"
