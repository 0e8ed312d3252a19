"""Benchmarks: median times on one thread beside named peers in the same run, with versions.

Run by ``make bench``. Ratios carry over between machines; times do not. Peers other than SciPy are
optional: ``pip install closedchain[bench]`` brings MuJoCo, ``pip install drake`` Drake.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
from dataclasses import asdict
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

# before NumPy is there: its threads would be timed too
os.environ.update(dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1"))

from rich.console import Console
from rich.table import Table

from benchmarks import batch
from benchmarks.cases import CASES, OURS, map_rate, rows
from benchmarks.timing import Row

PACKAGES = ("closedchain", "pin", "numpy", "scipy", "mujoco", "drake")


def versions() -> dict[str, str]:
    """Version of Python and of every package that is timed."""
    found = {"python": platform.python_version()}
    for name in PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "not installed"
    return found


def report(measured: list[Row]) -> dict[str, object]:
    """Rows with the ratio of each tool's time to ours for the same work, and the versions."""
    ours = {(r.robot, r.work): r.seconds for r in measured if r.tool == OURS}
    out = []
    for r in measured:
        own = ours[r.robot, r.work]
        ratio = r.seconds / own if r.seconds is not None and own and r.tool != OURS else None
        out.append(asdict(r) | {"ratio": ratio})
    return {"versions": versions(), "rows": out}


def table(measured: list[dict[str, object]]) -> Table:
    """Rows of ``report`` as a table."""
    out = Table(title="Median of one call, one thread")
    for column in ("robot", "work", "tool"):
        out.add_column(column)
    for column in ("time [us]", "/ ours", "largest residual", "tip error [m]"):
        out.add_column(column, justify="right")
    formats = (("seconds", "{:.1f}", 1e6), ("ratio", "{:.2f}", 1.0))
    errors = (("residual", "{:.0e}", 1.0), ("tip_error", "{:.0e}", 1.0))
    for r in measured:
        numbers = [
            "" if r[key] is None else text.format(scale * float(r[key]))  # type: ignore[arg-type]
            for key, text, scale in (*formats, *errors)
        ]
        tool = f"{r['tool']}: {r['note']}" if r["note"] else str(r["tool"])
        out.add_row(str(r["robot"]), str(r["work"]), tool, *numbers)
    return out


def measure(repeats: int, cells: int) -> list[Row]:
    """Every row; no map and no bulk work for ``cells`` 0."""
    measured = [row for case in CASES for row in rows(case, repeats)]
    return [*measured, *batch.rows(cells), map_rate(cells)] if cells else measured


def main() -> None:
    """Measure, print the table, and write it as JSON where asked to."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--repeats", type=int, default=2000, help="calls of fast functions")
    parser.add_argument("--cells", type=int, default=60, help="map cells along an axis, 0 for none")
    parser.add_argument("--json", type=Path, help="also write the rows to this file")
    options = parser.parse_args()
    found = report(measure(options.repeats, options.cells))
    console = Console(width=120)
    console.print(table(found["rows"]))  # type: ignore[arg-type]
    console.print(", ".join(f"{k} {v}" for k, v in versions().items()))
    if options.json is not None:
        options.json.write_text(json.dumps(found, indent=2))


if __name__ == "__main__":
    main()
