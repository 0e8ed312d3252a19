"""In which order, and under which headings, the pages stand."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from website.reference import TOPICS

START = "index tutorial glossary conventions"
GUIDES = {
    "Describe a robot": "urdf real_files formats",
    "Positions": "postures track joints",
    "Singularities": "singularities maps sets symbolic",
    "Motion": "self_motion follow",
    "Forces": "forces transmissions resets",
    "Show and hand on": "view figures export_code examples",
}
REST = "Further"
"""Heading of guides that stand nowhere else."""
THEORY = "theory structure tape"
REFERENCE = [*(f"reference/{topic}" for topic in TOPICS), "reference/parts", "reference/commands"]
PROJECT = "architecture benchmarks contributing changelog"


def navigation(source: Path) -> list[Any]:
    """Entries of the menu for the pages in a folder; a page that no table names is a guide."""
    there = {p.relative_to(source).with_suffix("").as_posix() for p in source.rglob("*.md")}
    placed: set[str] = set()

    def pages(*names: str) -> list[str]:
        found = [name for name in names if name in there]
        placed.update(found)
        return [f"{name}.md" for name in found]

    def inside(folder: str) -> list[str]:
        return pages(*sorted(name for name in there if name.startswith(f"{folder}/")))

    guides: list[Any] = [{title: pages(*names.split())} for title, names in GUIDES.items()]
    menu: list[Any] = [
        {"Start": pages(*START.split())},
        {"Guides": guides},
        {"Gallery": pages("gallery")},
        {"Robots": inside("robots")},
        {"Notebooks": inside("notebooks")},
        {"Theory": [*pages(*THEORY.split()), {"The papers' equations": inside("papers")}]},
        {"Reference": pages("reference", *REFERENCE)},
        {"Project": pages(*PROJECT.split())},
    ]
    rest = sorted(there - placed, key=lambda name: title(source / f"{name}.md"))
    if rest:
        guides.append({REST: pages(*rest)})
    return [entry for entry in menu if all(entry.values())]


def title(page: Path) -> str:
    """First heading of a page."""
    found = re.search(r"^# (.+)$", page.read_text(encoding="utf-8"), re.M)
    return found[1] if found else page.stem
