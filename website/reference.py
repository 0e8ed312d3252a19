"""The reference: public names by topic, from their docstrings, and commands, from their help."""

from __future__ import annotations

import dataclasses
import inspect
import re
import sys
from importlib.util import find_spec
from pathlib import Path

from typer.testing import CliRunner

import closedchain as cc
from closedchain.cli import app

TOPICS = {
    "loading": (
        "Mechanisms and files",
        "A mechanism comes from the catalogue or a file, and leaves as a file or as a program.",
    ),
    "positions": (
        "Positions",
        "Postures that close the loops: near a guess, along a branch, or all there are.",
    ),
    "structure": (
        "Structure and mobility",
        "What follows from how bodies and joints are connected: freedoms, loops, redundant rows.",
    ),
    "velocity": (
        "Velocity, acceleration and screws",
        "How the tip and the joints move when the inputs do, by Jacobians and by screws.",
    ),
    "singularities": (
        "Singularities",
        "Of one posture, over a grid, as curves and surfaces, and in closed form.",
    ),
    "motion": (
        "Motion and redundancy",
        "Paths, tasks, and the freedoms that a task leaves.",
    ),
    "forces": (
        "Forces and dynamics",
        "Efforts, loop forces, inertia, transmissions and states for simulators.",
    ),
    "errors": (
        "Errors",
        "What is raised when a question is wrong. What has no answer is a result that says why.",
    ),
}
HOMES = {  # the first part of a module's name that fits says which topic its names belong to
    "urdf.errors": "errors",
    "closure.position": "positions",
    "closure.nearest": "positions",
    "closure.modes": "positions",
    "closure.solution": "positions",
    "closure.constraints": "positions",
    "analysis.motion.joint_positions": "positions",
    "analysis.structure": "structure",
    "analysis.screws": "velocity",
    "analysis.velocity": "velocity",
    "analysis.acceleration": "velocity",
    "analysis.motion": "motion",
    "analysis.redundancy": "motion",
    "analysis.forces": "forces",
    "analysis": "singularities",
    "": "loading",
}


def topic(name: str) -> str:
    """Topic of a public name, by the module that defines it."""
    module = getattr(cc, name).__module__.removeprefix("closedchain").removeprefix(".")
    return next(
        found
        for home, found in HOMES.items()
        if not home or module == home or module.startswith(f"{home}.")
    )


def members(wanted: str) -> list[str]:
    """Public names of a topic, functions first."""
    names = [name for name in cc.__all__ if topic(name) == wanted]
    return sorted(names, key=lambda name: (inspect.isclass(getattr(cc, name)), name.lower()))


def path(name: str) -> str:
    """Full name under which a public name is documented: ``cc.robots`` is not the folder."""
    if find_spec(f"closedchain.{name}") is None:
        return f"closedchain.{name}"
    return f"{getattr(cc, name).__module__}.{name}"


def parts() -> list[str]:
    """Classes that the fields of public ones hold and ``cc`` does not name, by their full names."""
    found = set()
    for public in (getattr(cc, name) for name in cc.__all__):
        if not dataclasses.is_dataclass(public):
            continue
        names = vars(sys.modules[public.__module__])
        shown = [f for f in dataclasses.fields(public) if f.repr or f.name == "description"]
        for word in re.findall(r"[A-Za-z_]\w*", " ".join(str(field.type) for field in shown)):
            held = names.get(word)
            if inspect.isclass(held) and held.__module__.startswith("closedchain."):
                found.add(f"{held.__module__}.{held.__name__}")
    public_ones = {f"{getattr(cc, name).__module__}.{name}" for name in cc.__all__}
    return sorted(found - public_ones, key=lambda name: name.rpartition(".")[2].lower())


def write(root: Path, source: Path) -> None:
    """Write the pages of the reference."""
    folder = source / "reference"
    folder.mkdir(parents=True, exist_ok=True)
    (source / "reference.md").write_text(_overview(), encoding="utf-8")
    for key, (title, sentence) in TOPICS.items():
        entries = "\n\n".join(f"::: {path(name)}" for name in members(key))
        (folder / f"{key}.md").write_text(f"# {title}\n\n{sentence}\n\n{entries}\n")
    sentence = "What the fields of results hold. Nobody makes these by hand."
    entries = "\n\n".join(f"::: {name}" for name in parts())
    (folder / "parts.md").write_text(f"# Parts of results\n\n{sentence}\n\n{entries}\n")
    (folder / "commands.md").write_text(_commands(), encoding="utf-8")


def _overview() -> str:
    told = [
        "# Reference",
        "Every public name, with an example that the tests run. The examples begin with",
        "```python\nimport numpy as np\n\nimport closedchain as cc\n```",
        "Units, frames and the order of six-vectors are those of [conventions](conventions.md). "
        "[Commands](reference/commands.md) has the command line.",
    ]
    for key, (title, _) in TOPICS.items():
        rows = [
            f"| [`cc.{name}`](reference/{key}.md#{path(name)}) | {_first_sentence(name)} |"
            for name in members(key)
        ]
        told += [f"## {title}", "\n".join(["| name | what it is |", "|---|---|", *rows])]
    text = "\n\n".join(told) + "\n"
    return text + "\n[Parts of results](reference/parts.md) has the classes of their fields.\n"


def _first_sentence(name: str) -> str:
    text = (getattr(cc, name).__doc__ or "").strip().split("\n\n")[0]
    return re.sub(r"\s+", " ", text).replace("|", "\\|").replace("<", "&lt;")


def _commands() -> str:
    runner = CliRunner()
    overview = runner.invoke(app, ["--help"], prog_name="closedchain").stdout
    names = re.findall(r"^ *\W? *([a-z][a-z-]+) {2,}\S", overview.split("Commands")[-1], re.M)
    page = ["# Commands", "What `closedchain COMMAND --help` prints."]
    for name in names:
        told = runner.invoke(app, [name, "--help"], prog_name="closedchain").stdout.strip("\n")
        page += [f"## closedchain {name}", f"```text\n{told}\n```"]
    return "\n\n".join(page) + "\n"
