"""The examples of README and docs/ run: every robot loads, every Python block is executed."""

import re
from pathlib import Path

import pytest
from typer.testing import CliRunner

import closedchain as cc
from closedchain.cli import app

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
PAGES = {str(path.relative_to(DOCS)): path for path in sorted(DOCS.rglob("*.md"))}
PAGES["README.md"] = ROOT / "README.md"


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
