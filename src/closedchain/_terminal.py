"""What the commands print: tables and JSON on stdout, one line for an error on stderr."""

from __future__ import annotations

import json
import math
import sys
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Literal, NoReturn

import numpy as np
import typer

WIDTH = 80  # columns of sentences
WIDE = 100_000  # columns of tables where the output is no terminal: rows are whole


def fail(message: str) -> NoReturn:
    """End with exit code 1 and one line on stderr."""
    typer.echo(f"closedchain: {' '.join(message.split())}", err=True)
    raise typer.Exit(1)


def remark(text: str) -> None:
    """Print a note on stderr, beside what was asked for."""
    typer.echo(f"note: {text}", err=True)


def say(text: str) -> None:
    """Print text as it is."""
    typer.echo(text)


def tell(text: str) -> None:
    """Print sentences, lines that are too long broken at words and set in by two columns more."""
    for line in text.splitlines():
        inset = line[: len(line) - len(line.lstrip())]
        typer.echo(
            textwrap.fill(
                line,
                WIDTH,
                subsequent_indent=inset + "  " if inset else "",
                break_long_words=False,
                break_on_hyphens=False,
                replace_whitespace=False,
                drop_whitespace=True,
            )
            if len(line) > WIDTH
            else line
        )


def table(columns: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    """Print a table, numbers to six digits; fitted to the width on a terminal only.

    There words are broken, and numbers are whole unless they alone are wider.
    """
    from rich import box
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    values = [list(row) for row in rows]
    grid = Table(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False)
    for i, name in enumerate(columns):
        numeric = bool(values) and all(isinstance(row[i], float | int | None) for row in values)
        side: Literal["right", "left"] = "right" if numeric else "left"
        grid.add_column(Text(name), justify=side, overflow="fold", no_wrap=numeric)
    for row in values:
        grid.add_row(*(Text(_cell(value)) for value in row))
    console = Console(width=None if sys.stdout.isatty() else WIDE, highlight=False)
    with console.capture() as captured:
        console.print(grid)
    typer.echo("\n".join(line.rstrip() for line in captured.get().splitlines()))


def pairs(values: Mapping[str, object]) -> None:
    """Print names and values, one pair a line."""
    width = max(map(len, values), default=0)
    for name, value in values.items():
        typer.echo(f"{name:<{width}}  {_cell(value)}".rstrip())


def print_json(value: Any) -> None:
    """Print JSON at full precision; what is not finite becomes null."""
    typer.echo(json.dumps(plain(value), indent=2, allow_nan=False))


def plain(value: Any) -> Any:
    """Turn arrays, sets and mappings into what JSON knows; numbers that are not finite to None."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    if isinstance(value, set | frozenset):
        return sorted(plain(item) for item in value)
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if value is None or isinstance(value, bool | int | str):
        return value
    return str(value)


def _cell(value: object) -> str:
    if value is None:
        return ""
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, np.ndarray | list | tuple):
        return " ".join(_cell(item) for item in value)
    return str(value)
