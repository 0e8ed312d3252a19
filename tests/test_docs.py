"""The examples of README and docs/ run: every robot loads, every Python block is executed."""

import re
import shlex
from dataclasses import asdict
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest
import typer
from conftest import Tolerances
from typer.testing import CliRunner

import closedchain as cc
from closedchain.cli import app

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
TOP = ("README.md", "CONTRIBUTING.md", "CHANGELOG.md", "examples/README.md")
PAGES = {str(path.relative_to(DOCS)): path for path in sorted(DOCS.rglob("*.md"))}
PAGES |= {name: ROOT / name for name in TOP}
FOLDERS = (
    *("urdf", "closure", "robots", "analysis", "src"),
    *("tests", "benchmarks", "docs", "examples", "notebooks", "website"),
)


def blocks(page: Path, language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", page.read_text(), re.M | re.S)


def full_robots(page: Path) -> dict[str, str]:
    """Robots of a page, by name."""
    texts = [text for text in blocks(page, "xml") if text.lstrip().startswith("<robot")]
    return {re.findall(r'<robot name="(\w+)"', text)[0]: text for text in texts}


@pytest.mark.parametrize("page", PAGES)
def test_examples_run(page: str) -> None:
    """Python blocks of a page share their names; its robots are there under theirs, as text."""
    robots = full_robots(PAGES[page])
    for name, text in robots.items():
        mechanism = cc.load_urdf(text)
        assert mechanism.name == name
        assert max(abs(cc.residual(mechanism, mechanism.home))) < 1e-12
    names: dict[str, object] = dict(robots)
    for code in blocks(PAGES[page], "python"):
        exec(compile(code, page, "exec"), names)


@pytest.mark.parametrize("page", PAGES)
def test_links_between_pages_lead_somewhere(page: str) -> None:
    for target in re.findall(r"\]\((?!https?:)([^)\s]+)\)", PAGES[page].read_text()):
        path, _, anchor = target.partition("#")
        linked = (PAGES[page].parent / path).resolve() if path else PAGES[page]
        assert linked.exists(), target
        if anchor:
            titles = re.findall(r"^#+ (.*)$", linked.read_text(), re.M)
            slugs = {re.sub(r"[^\w\- ]", "", t.lower()).replace(" ", "-") for t in titles}
            assert anchor in slugs, target


@pytest.mark.parametrize("page", PAGES)
def test_commands_are_written_as_they_are_taken(page: str) -> None:
    """Each line of a shell block is parsed, required options and all; none is run."""
    group: Any = typer.main.get_command(app)
    for line in shell(PAGES[page]):
        words = shlex.split(line, comments=True)
        for end in ("|", ">", "&&"):
            words = words[: words.index(end)] if end in words else words
        if words[:1] != ["closedchain"] or len(words) < 2 or words[1].startswith("-"):
            continue
        name, rest = words[1], words[2:]
        assert name in group.commands, line
        if not {"--help", "..."} & set(rest):
            group.commands[name].make_context(name, rest)


def shell(page: Path) -> list[str]:
    """Lines of a page's blocks that are in no language, or the shell's; continued ones joined."""
    found, language = [], None
    for line in page.read_text().replace("\\\n", " ").splitlines():
        if line.startswith("```"):
            language = line[3:] if language is None else None
        elif language in ("", "sh", "bash", "console"):
            found.append(line.removeprefix("$ ").removeprefix(".venv/bin/"))
    return found


def test_pages_show_commands() -> None:
    assert (
        sum(line.startswith("closedchain ") for page in PAGES.values() for line in shell(page)) > 9
    )


def there(name: str) -> bool:
    """Whether a dotted name is a module, or something in one."""
    parts = name.split(".")
    for k in range(len(parts), 0, -1):
        try:
            found: object = import_module(".".join(parts[:k]))
        except ModuleNotFoundError:
            continue
        for part in parts[k:]:
            found = getattr(found, part, None)
        return found is not None
    return False


@pytest.mark.parametrize("page", PAGES)
def test_what_a_page_names_is_there(page: str) -> None:
    """Modules and what is in them by dotted name, files and folders by their path."""
    text = PAGES[page].read_text()
    for name in set(re.findall(r"`(closedchain(?:\.\w+)+)", text)):
        assert there(name), name
    for path in set(re.findall(rf"`((?:{'|'.join(FOLDERS)})/[\w./-]*)`", text)):
        assert (ROOT / path).exists(), path


def bare(text: str) -> str:
    """Lines without their indentation, for comparing."""
    return "\n".join(line.strip() for line in text.strip().splitlines())


def test_contributing_quotes_the_repository() -> None:
    """Fragments marked ``py`` and ``xml`` are word for word in a file that the page names."""
    page = PAGES["CONTRIBUTING.md"]
    named = {ROOT / path for path in re.findall(r"`([\w/.-]+\.(?:py|xacro))`", page.read_text())}
    sources = [bare(path.read_text()) for path in named if path.is_file()]
    quotes = blocks(page, "py") + blocks(page, "xml")
    assert len(quotes) >= 5
    for quote in quotes:
        assert any(bare(quote) in source for source in sources), quote


def test_the_table_of_tolerances_is_the_one_in_force() -> None:
    text = PAGES["CONTRIBUTING.md"].read_text()
    table = re.findall(r"^\| `(\w+)` \| (\S+) \| .* \|$", text, re.M)
    assert {name: float(value) for name, value in table} == asdict(Tolerances())


def test_there_are_examples() -> None:
    assert full_robots(PAGES["urdf.md"])
    assert len(blocks(PAGES["urdf.md"], "python")) >= 2


def test_what_the_readme_names_exists() -> None:
    """Functions and commands of its table, and the make targets of its two commands."""
    text = PAGES["README.md"].read_text()
    assert set(re.findall(r"`cc\.(\w+)", text)) <= set(cc.__all__)
    targets = re.findall(r"^(\w+):", (ROOT / "Makefile").read_text(), re.M)
    assert {"demo", "test", "env", "check", "bench", "clean"} <= set(targets)
    assert set(re.findall(r"make (\w+)", text)) <= set(targets)
    commands = set(re.findall(r"`closedchain (\w+)", text))
    help_page = CliRunner().invoke(app, ["--help"]).stdout
    assert commands
    assert all(re.search(rf"^ *\W? *{name}\b", help_page, re.M) for name in commands)
