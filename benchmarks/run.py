"""Benchmarks: processor time on one core beside named peers in the same run, with versions.

Run by ``make bench``. Ratios carry over between machines; times do not. Peers other than SciPy are
optional: ``pip install closedchain[bench]`` brings MuJoCo, ``pip install drake`` Drake. placo runs
in a Python of its own that ``PLACO_PYTHON`` names; msolve is the program that ``MSOLVE`` names.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import sys
from collections.abc import Callable, Iterable, Iterator
from dataclasses import asdict
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

# before NumPy is there: its threads would be timed too
os.environ.update(dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1"))

from rich.console import Console
from rich.table import Table

from benchmarks import (
    batch,
    cases,
    cold,
    exported,
    forces,
    modes,
    msolve_peer,
    placo_peer,
    sets,
    stacks,
)
from benchmarks.timing import OURS, Row
from closedchain.robots.catalogue import robots

PACKAGES = ("closedchain", "pin", "numpy", "scipy", "llvmlite", "mujoco", "drake")
TITLE = "Processor time on one core: least of several repeats where a note does not say otherwise"


def versions() -> dict[str, str]:
    """Processor, and version of Python and of every package that is timed."""
    found = {"processor": processor(), "python": platform.python_version()}
    for name in PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "not installed"
    return found | {"placo": placo_peer.installed(), "msolve": msolve_peer.installed()}


def processor() -> str:
    """Model of the processor, and how busy the machine is."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        model = next(line.split(":")[1].strip() for line in lines if line.startswith("model name"))
    except (OSError, StopIteration):
        model = platform.processor() or platform.machine()
    return f"{model} ({os.cpu_count()} cores, load {os.getloadavg()[0]:.1f})"


SECTIONS: dict[str, Callable[[argparse.Namespace], Iterable[Row]]] = {
    "calls": lambda o: (row for case in cases.CASES for row in cases.rows(case, o.repeats)),
    "exported": lambda o: (row for case in cases.CASES for row in exported.rows(case, o.repeats)),
    "forces": lambda o: (row for case in cases.CASES for row in forces.rows(case, o.repeats)),
    "batch": lambda o: batch.rows(o.cells),
    "sets": lambda o: sets.rows(o.cells, o.surveys),
    "modes": lambda o: modes.rows(),
    "cold": lambda o: cold.rows(("d1", "linear_delta"), 5),
    "stacks": lambda o: stacks.rows(o.stacks, min(o.cells, 25)),
}
"""Parts of a run, each a function of the options."""


def measure(options: argparse.Namespace) -> Iterator[Row]:
    """Every row of the sections that are asked for."""
    for name in options.sections:
        for row in SECTIONS[name](options):
            print(f"{row.robot}: {row.work}, {row.tool}", file=sys.stderr)
            yield row


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
    out = Table(title=TITLE)
    for column in ("robot", "work", "tool"):
        out.add_column(column)
    for column in ("time", "/ ours", "largest residual", "tip error [m]"):
        out.add_column(column, justify="right")
    for r in measured:
        numbers = [
            "" if r[key] is None else say(float(r[key]))  # type: ignore[arg-type]
            for key, say in (
                ("seconds", duration),
                ("ratio", "{:.2g}".format),
                ("residual", "{:.0e}".format),
                ("tip_error", "{:.0e}".format),
            )
        ]
        tool = f"{r['tool']}: {r['note']}" if r["note"] else str(r["tool"])
        out.add_row(str(r["robot"]), str(r["work"]), tool, *numbers)
    return out


def markdown(found: dict[str, object]) -> str:
    """Rows of ``report`` as the table of docs/benchmarks.md: peers beside ours in one line."""
    measured: list[dict[str, object]] = found["rows"]  # type: ignore[assignment]
    lines = ["| robot | work | time | beside it, and how many times as long |", "|---|---|---|---|"]
    for own in (r for r in measured if r["tool"] == OURS):
        said = duration(float(own["seconds"])) if own["seconds"] is not None else ""  # type: ignore[arg-type]
        if own["note"]:
            said = f"{said} ({own['note']})" if said else str(own["note"])
        peers = []
        for r in measured:
            if (r["robot"], r["work"]) == (own["robot"], own["work"]) and r["tool"] != OURS:
                ratio = "-" if r["ratio"] is None else f"{r['ratio']:.2g}"
                peers.append(f"{r['tool']} {ratio}")
        lines.append(f"| {own['robot']} | {own['work']} | {said} | {', '.join(peers)} |")
    return "\n".join(lines) + "\n"


def duration(seconds: float) -> str:
    """Three digits and a unit."""
    scale, unit = next(u for u in UNITS if seconds < 999.5 * u[0] or u is UNITS[-1])
    return f"{seconds / scale:#.3g} {unit}"


UNITS = ((1e-9, "ns"), (1e-6, "us"), (1e-3, "ms"), (1.0, "s"))


def main() -> None:
    """Measure, print the table, and write it as JSON where asked to."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--repeats", type=int, default=2000, help="calls of fast functions")
    parser.add_argument("--cells", type=int, default=61, help="map cells along an axis")
    parser.add_argument("--surveys", nargs="*", default=robots("papers"), help="robots to survey")
    parser.add_argument("--stacks", nargs="*", type=int, default=(1, 2, 4, 8, 16))
    parser.add_argument("--sections", nargs="*", choices=SECTIONS, default=tuple(SECTIONS))
    parser.add_argument("--json", type=Path, help="also write the rows to this file")
    parser.add_argument("--markdown", type=Path, help="also write a table as in docs/benchmarks.md")
    options = parser.parse_args()
    found = report(list(measure(options)))
    console = Console(width=140)
    console.print(table(found["rows"]))  # type: ignore[arg-type]
    console.print(", ".join(f"{k} {v}" for k, v in versions().items()))
    if options.json is not None:
        options.json.write_text(json.dumps(found, indent=2))
    if options.markdown is not None:
        options.markdown.write_text(markdown(found))


if __name__ == "__main__":
    main()
