"""The page that leads through a folder of results: text, the page that moves, figures, files."""

from __future__ import annotations

import html
from collections.abc import Mapping, Sequence
from pathlib import Path

from closedchain.analysis.figures.saving import alt_file

INDEX = "index.html"
HOLDS = {
    ".csv": "a table, one line a point",
    ".nc": "NetCDF, for xarray",
    ".png": "a figure",
    ".svg": "a figure",
    ".pdf": "a figure",
    ".html": "a page that moves; it needs no network",
    ".txt": "what a figure shows, in words",
}
FIGURES = (".png", ".svg")
STYLE = """
body { margin: 0 auto; max-width: 70em; padding: 8px 16px 32px; color: #222;
  font: 15px/1.5 system-ui, sans-serif; }
iframe { width: 100%; height: 640px; border: 1px solid #888; }
img { max-width: 100%; height: auto; }
table { border-collapse: collapse; display: block; overflow-x: auto; }
th, td { text-align: left; padding: 2px 12px 2px 0; font-variant-numeric: tabular-nums; }
@media (max-width: 700px) { iframe { height: 85vh; } }
"""


def write_index(
    title: str,
    files: Mapping[str, Path],
    lines: Sequence[str],
    table: Sequence[Mapping[str, object]] = (),
) -> Path:
    """Write ``index.html`` beside some files; return its path.

    Parameters
    ----------
    files : mapping of name to path
        All in one folder, at least one.
    lines : sequence of str
        Sentences on the results.
    table : sequence of mappings
        Rows with the same keys.

    Raises
    ------
    OSError
        It cannot be written.
    """
    paths = list(files.values())
    parts = [*(f"<p>{html.escape(line)}</p>" for line in lines if line), _table(table)]
    parts += [_frame(path) for path in paths if path.suffix == ".html"]
    parts += [_figure(path, title) for path in paths if path.suffix in FIGURES]
    parts.append("<h2>files</h2><ul>" + "".join(map(_file, paths)) + "</ul>")
    name = html.escape(title)
    index = paths[0].parent / INDEX
    index.write_text(
        '<!DOCTYPE html>\n<html lang="en">\n<head><meta charset="utf-8">\n'
        '<meta http-equiv="Content-Security-Policy" content="script-src \'none\'">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{name}</title>\n<style>{STYLE}</style></head>\n"
        f"<body><h1>{name}</h1>\n" + "\n".join(filter(None, parts)) + "\n</body></html>\n",
        encoding="utf-8",
    )
    return index


def _table(rows: Sequence[Mapping[str, object]]) -> str:
    if not rows:
        return ""
    head = "".join(f"<th>{html.escape(str(key))}</th>" for key in rows[0])
    body = "".join(
        "<tr>"
        + "".join(f"<td>{html.escape(_cell(value))}</td>" for value in row.values())
        + "</tr>"
        for row in rows
    )
    return f"<table><tr>{head}</tr>{body}</table>"


def _cell(value: object) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def _frame(path: Path) -> str:
    name = html.escape(path.name)
    return (
        f'<iframe src="{name}" title="{name}: a page that moves" loading="lazy"></iframe>\n'
        f'<p><a href="{name}">{name} alone</a></p>'
    )


def _figure(path: Path, title: str) -> str:
    beside = alt_file(path)
    text = beside.read_text(encoding="utf-8").strip() if beside.exists() else title
    name = html.escape(path.name)
    return f'<p><img src="{name}" alt="{html.escape(" ".join(text.split()))}"></p>'


def _file(path: Path) -> str:
    name = html.escape(path.name)
    return f'<li><a href="{name}">{name}</a>: {HOLDS.get(path.suffix, "a file")}</li>'
