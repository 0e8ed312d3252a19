"""What lies around the code agrees with it: versions, workflows, examples, the README's picture."""

import re
import tomllib
from pathlib import Path
from typing import Any

import pytest
import yaml
from PIL import Image

import closedchain as cc

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="module")
def project() -> dict[str, Any]:
    return tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


def test_one_version_everywhere(project: dict[str, Any]) -> None:
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    assert project["version"] == cc.__version__ == str(citation["version"])
    assert citation["license"] == project["license"] == "BSD-2-Clause"
    assert {"cff-version", "message", "title", "authors"} <= set(citation)


def test_workflows_try_every_python_that_is_claimed(project: dict[str, Any]) -> None:
    claimed = re.findall(r"Python :: (3\.\d+)", "\n".join(project["classifiers"]))
    workflow = yaml.safe_load((ROOT / ".github" / "workflows" / "tests.yml").read_text())
    matrix = workflow["jobs"]["tests"]["strategy"]["matrix"]
    assert matrix["python"] == claimed == ["3.11", "3.12", "3.13"]
    assert {system.split("-")[0] for system in matrix["os"]} == {"ubuntu", "macos"}
    steps = [step.get("run", "") for job in workflow["jobs"].values() for step in job["steps"]]
    for words in ("pytest", "make check", "python -m website", "twine check"):
        assert any(words in step for step in steps), words


def test_extras_that_are_asked_for_exist(project: dict[str, Any]) -> None:
    extras = project["optional-dependencies"]
    text = "".join(path.read_text() for path in (ROOT / ".github").rglob("*.yml"))
    asked = re.findall(r"\.\[([\w,]+)\]", text)
    asked += re.findall(r"closedchain\[([\w,]+)\]", str(extras))
    assert asked
    assert {name for names in asked for name in names.split(",")} <= set(extras)


def test_every_example_is_run_by_a_test() -> None:
    tests = "".join(path.read_text() for path in (ROOT / "tests").glob("test_*example*.py"))
    found = [path for path in (ROOT / "examples").rglob("*") if path.suffix in (".py", ".c")]
    assert found
    for path in found:
        assert f'"{path.name}"' in tests, path.name


def test_the_moving_picture_moves_and_is_light() -> None:
    picture = ROOT / "docs" / "images" / "eclipse.webp"
    assert picture.stat().st_size < 1e6
    with Image.open(picture) as frames:
        assert frames.n_frames > 30
    assert "docs/images/eclipse.webp" in (ROOT / "README.md").read_text()
