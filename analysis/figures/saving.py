"""Writing figures: the image, and beside it in a file of text what it shows."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import os

    from matplotlib.figure import Figure, SubFigure

ALT = ".alt.txt"


def alt_file(image: str | os.PathLike[str]) -> Path:
    """Where the words of an image lie: map.alt.txt beside map.png."""
    return Path(image).with_suffix(ALT)


def save_figure(
    figure: Figure | SubFigure, image: str | os.PathLike[str], words: str, dpi: float
) -> None:
    """Write a figure, and its words both into the image and beside it.

    Raises
    ------
    OSError
        They cannot be written.
    """
    from matplotlib.figure import Figure

    if not isinstance(figure, Figure):
        raise TypeError("a part of a figure is written with the whole of it")
    path = Path(image)
    key = {".png": "Description", ".svg": "Description", ".pdf": "Subject"}.get(path.suffix.lower())
    if key is None:
        figure.savefig(path, dpi=dpi)
    else:
        figure.savefig(path, dpi=dpi, metadata={key: words})
    alt_file(path).write_text(words + "\n", encoding="utf-8")
