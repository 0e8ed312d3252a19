"""Options that say how a file is read: --tolerance, --home, --package-dir."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest
from typer.testing import CliRunner

from closedchain.cli import app

BAR = """<robot name="bar">
  <link name="ground"/> <link name="crank"/> <link name="coupler"/> <link name="rocker"/>
  <joint name="A" type="continuous"><parent link="ground"/><child link="crank"/>
    <axis xyz="0 -1 0"/></joint>
  <joint name="B" type="continuous"><parent link="crank"/><child link="coupler"/>
    <origin xyz="0.10 0 0"/><axis xyz="0 -1 0"/></joint>
  <joint name="D" type="continuous"><parent link="ground"/><child link="rocker"/>
    <origin xyz="0.30 0 0" rpy="1.5708 0 0"/><axis xyz="0 0 1"/></joint>
  <constraint name="C" type="revolute">
    <parent link="coupler"/><parent_origin xyz="0.25 0 0"/><parent_axis xyz="0 1 0"/>
    <child link="rocker"/><child_origin xyz="0.20 0 0"/><child_axis xyz="0 0 -1"/></constraint>
  <transmission name="q1"><joint name="A"/></transmission>
  <task base="ground" tip="coupler" outputs="ry"/>
  <group_state name="home"><joint name="A" value="1.0"/><joint name="B" value="-0.6"/>
    <joint name="D" value="1.7"/></group_state>
</robot>"""


@pytest.fixture
def bar(tmp_path: Path) -> str:
    file = tmp_path / "bar.urdf"
    file.write_text(BAR)
    return str(file)


def run(*words: str) -> tuple[int, str, str]:
    done = CliRunner().invoke(app, list(words))
    return done.exit_code, done.stdout, done.stderr


def test_info_tells_misfit_and_relaxation(bar: str) -> None:
    code, text, error = run("info", bar)
    assert (code, error) == (0, "")
    words = " ".join(text.split())
    assert "mobility 1" in words
    assert "note: the numbers are rounded: of 5 closure rows 2 are independent" in words
    assert "1 number changed by up to 3.7e-06" in words
    assert "a ball on a line instead of the hinge C" in words
    assert "home: joint 'B' is stated at -0.6 and closes at -0.524511, 0.0755 away" in words
    assert max(map(len, text.splitlines())) <= 100


def test_info_has_it_all_in_json(bar: str) -> None:
    code, text, _ = run("info", "--json", bar)
    data = json.loads(text)
    assert code == 0
    assert 2e-6 < data["misfit"] < 5e-6
    assert data["open_by"] == 0.0
    assert (data["rounding"]["kept"], data["rounding"]["redundant"]) == ([0, 1], [2, 3, 4])
    assert data["rounding"]["rank"]["below"] < 3e-6 < 1.0 < data["rounding"]["rank"]["above"]
    (change,) = data["rounding"]["changed"]
    assert change["where"] == "D origin rpy"
    assert change["read"] == pytest.approx(math.pi / 2, abs=1e-15)
    assert data["relaxation"]["redundant"] == 3
    assert {one["joint"] for one in data["relaxation"]["single"]} == set("ABCD")
    assert len(data["notes"]) == 3


def test_an_open_home_is_told_and_drawn(bar: str, tmp_path: Path) -> None:
    code, text, _ = run("info", bar, "--tolerance", "0")
    assert code == 0
    assert "home is open by" in text
    assert "the mobility is unknown" in text
    data = json.loads(run("info", "--json", bar, "--tolerance", "0")[1])
    assert 2e-6 < data["open_by"] < 5e-6
    assert data["mobility"] is data["rounding"] is data["relaxation"] is None
    page = tmp_path / "bar.html"
    code, text, error = run("view", bar, "--tolerance", "0", "--html", str(page))
    assert code == 0
    assert error.startswith("note: home is open by")
    assert "drawn in red" in page.read_text()
    code, _, error = run("direct", bar, "q1=1.1", "--tolerance", "0")
    assert code == 1
    assert "needs a closed home" in error


def test_home_is_given_on_the_command_line(bar: str) -> None:
    code, text, _ = run("direct", bar, "--json", "--home", "A=1.2", "--home", "B=-0.4")
    assert code == 0
    assert json.loads(text)["inputs"] == {"q1": 1.2}
    for words, problem in (
        (("--home", "E=1"), "home: unknown joint 'E'; known: A, B, D, q1"),
        (("--home", "A"), "--home: expected name=value"),
        (("--home", "A=x"), "'x' is not a finite number"),
        (("--tolerance", "-1"), "tolerance must be a length"),
    ):
        code, _, error = run("info", bar, *words)
        assert code == 1
        assert problem in error


def test_robots_of_the_catalogue_are_as_they_are() -> None:
    code, _, error = run("info", "d1", "--tolerance", "1e-3")
    assert code == 1
    assert "are for files, not for robots of the catalogue" in error


def test_missing_meshes_are_told_on_the_terminal(tmp_path: Path) -> None:
    file = tmp_path / "part.urdf"
    file.write_text(
        '<robot name="part"><link name="a"><visual><geometry><mesh filename="package://p/a.stl"/>'
        '</geometry></visual></link><link name="b"/><joint name="j" type="continuous">'
        '<parent link="a"/><child link="b"/></joint></robot>'
    )
    code, _, error = run("view", str(file), "--html", str(tmp_path / "page.html"))
    assert code == 0
    assert "mesh 'package://p/a.stl' of link 'a' was not found" in error
    assert "--package-dir" in error
    (tmp_path / "p").mkdir()
    (tmp_path / "p" / "a.stl").write_bytes(b"solid a\nendsolid a\n")
    words = ("view", str(file), "--package-dir", str(tmp_path))
    code, _, error = run(*words, "--html", str(tmp_path / "page.html"))
    assert (code, error) == (0, "")


def test_a_posture_at_a_fold_of_the_inputs_is_classified(bar: str) -> None:
    """The rocker driven back to where crank and rod are stretched: 0.35 m, by the cosine law."""
    text = BAR.replace('<joint name="A"/>', '<joint name="D"/>').replace(
        "1.5708", repr(math.pi / 2)
    )
    Path(bar).write_text(text)
    fold = math.pi - math.acos((0.30**2 + 0.20**2 - 0.35**2) / (2.0 * 0.30 * 0.20))
    code, text, error = run("classify", bar, f"q1={fold!r}")
    assert (code, error) == (0, "")
    assert "direct singularity (type 2)" in text
    code, _, error = run("classify", bar, f"q1={fold - 0.3}")
    assert code == 1
    assert "meets a direct singularity" in error


def test_a_folder_of_packages_must_be_there(bar: str, tmp_path: Path) -> None:
    code, text, error = run("info", bar, "--package-dir", str(tmp_path / "none"))
    assert (code, text) == (1, "")
    assert f"--package-dir {tmp_path / 'none'}: there is no such folder" in error
    assert run("info", bar, "--package-dir", str(tmp_path))[0] == 0
