"""The page that leads through a folder of results: text, the page that moves, figures, files."""

from __future__ import annotations

import html
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType

from closedchain.analysis.figures.saving import alt_file

INDEX = "index.html"
NAMED = {
    "map.nc": "the maps, a group for each slice (NetCDF, for xarray)",
    "sets.nc": "the singular sets, a group for each slice and kind (NetCDF, for xarray)",
    "singularities.csv": "the singular points, one a row",
    "map.png": "the maps and sets",
    "path.csv": "one row a sample: tip, inputs, speeds, singular values",
    "path.nc": "the same, and all joints (NetCDF, for xarray)",
    "path.png": "inputs, speeds and singular values over time",
    "inputs.png": "each input over time",
    "efforts.nc": "efforts and powers, and what every joint carries (NetCDF, for xarray)",
    "efforts.png": "efforts and powers over time",
    "motion.nc": "states and energies over time (NetCDF, for xarray)",
}
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
_NOTHING: Mapping[str, Sequence[str]] = MappingProxyType({})
STYLE = """
body { margin: 0 auto; max-width: 70em; padding: 8px 16px 32px; color: #222;
  font: 15px/1.5 system-ui, sans-serif; }
iframe { width: 100%; height: 640px; border: 1px solid #888; }
img { max-width: 100%; height: auto; }
table { border-collapse: collapse; display: block; overflow-x: auto; }
th, td { text-align: right; padding: 2px 0 2px 16px; font-variant-numeric: tabular-nums;
  vertical-align: bottom; }
th:first-child, td:first-child { text-align: left; padding-left: 0; white-space: nowrap; }
iframe, figure, table, details { margin: 16px 0; }
summary { cursor: pointer; }
@media (max-width: 700px) { iframe { height: 85vh; } h1 { font-size: 1.5em; } }
"""


def write_index(
    title: str,
    files: Mapping[str, Path],
    lines: Sequence[str],
    table: Sequence[Mapping[str, object]] = (),
    details: Mapping[str, Sequence[str]] = _NOTHING,
) -> Path:
    """Write ``index.html`` beside some files; return its path.

    Parameters
    ----------
    files : mapping of name to path
        All in one folder, at least one.
    lines : sequence of str
        Sentences on the results.
    table : sequence of mappings
        Rows with the same keys; columns after the first that hold but zeros are left out.
    details : mapping of heading to sentences
        What only some want to read: folded away below the figures.

    Raises
    ------
    OSError
        It cannot be written.
    """
    paths = list(files.values())
    parts = [*(f"<p>{html.escape(line)}</p>" for line in lines if line), _table(table)]
    parts += [_frame(path) for path in paths if path.suffix == ".html"]
    parts += [_figure(path, title) for path in paths if path.suffix in FIGURES]
    parts += [_folded(heading, sentences) for heading, sentences in details.items() if sentences]
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
    first, *others = rows[0]
    shown = [first, *(key for key in others if any(row[key] != 0 for row in rows))]
    head = "".join(f"<th>{html.escape(key)}</th>" for key in shown)
    body = "".join(
        "<tr>" + "".join(f"<td>{html.escape(_cell(row[key]))}</td>" for key in shown) + "</tr>"
        for row in rows
    )
    return f"<table><tr>{head}</tr>{body}</table>"


def _folded(heading: str, sentences: Sequence[str]) -> str:
    body = "".join(f"<p>{html.escape(sentence)}</p>" for sentence in sentences)
    return f"<details><summary>{html.escape(heading)}</summary>{body}</details>"


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
    return f'<figure><img src="{name}" alt="{html.escape(" ".join(text.split()))}"></figure>'


def _file(path: Path) -> str:
    name = html.escape(path.name)
    holds = NAMED.get(path.name) or HOLDS.get(path.suffix, "a file")
    return f'<li><a href="{name}">{name}</a>: {holds}</li>'
