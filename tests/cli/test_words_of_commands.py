"""How numbers are written, and what people read."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest
from commands import run

from closedchain import _arguments as arguments


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("0.3", 0.3),
        ("-1e-2", -0.01),
        ("30deg", math.pi / 6.0),
        ("-90deg", -math.pi / 2.0),
        ("pi", math.pi),
        ("-pi/2", -math.pi / 2.0),
        ("2pi/3", 2.0 * math.pi / 3.0),
        ("0.5*pi", math.pi / 2.0),
    ],
)
def test_numbers(text: str, value: float) -> None:
    assert arguments.number(text, "angle") == pytest.approx(value, abs=1e-15)


@pytest.mark.parametrize("text", ["", "x", "nan", "inf", "pi/0", "1..2pi", "deg", "1e400", "2pipi"])
def test_what_is_no_number(text: str) -> None:
    with pytest.raises(arguments.BadArgumentError, match="is not a finite number"):
        arguments.number(text, "angle")


def test_angles_in_degrees_and_passive_joints() -> None:
    shown = run("direct", "eclipse", "th_a=5deg")
    assert shown.exit_code == 0
    assert "0.0872665" in shown.stdout
    assert "passive joint" in shown.stdout
    for name in ("platform_pose", "a_R", "b_R", "c_R"):
        assert f"\n{name}" in shown.stdout
    data = json.loads(run("direct", "eclipse", "th_a=5deg", "--json").stdout)
    assert data["inputs"]["th_a"] == pytest.approx(math.radians(5.0))


def test_the_list_names_the_family() -> None:
    assert "(list --family delia)" in run("list").stdout


def test_commands_take_a_mode() -> None:
    one = json.loads(run("direct", "eclipse", "--mode", "-+-", "--json").stdout)
    home = json.loads(run("direct", "eclipse", "--json").stdout)
    assert one["converged"]
    assert one["q"] != home["q"]
    tip = [str(x) for x in one["tip"]["xyz"]]
    back = json.loads(run("inverse", "eclipse", "--mode", "-+-", "--xyz", *tip, "--json").stdout)
    assert back["inputs"] == pytest.approx(one["inputs"], abs=1e-9)
    assert run("classify", "eclipse", "--mode", "-+-").exit_code == 0
    unknown = run("classify", "eclipse", "--mode", "up")
    assert unknown.exit_code == 1
    assert "unknown mode 'up'" in unknown.stderr


def test_gravity_is_given_or_left_out_not_both() -> None:
    both = run("statics", "linear_delta", "--gravity", "0 0 -1", "--no-gravity")
    assert both.exit_code == 1
    assert "--gravity and --no-gravity contradict each other" in both.stderr


@pytest.mark.parametrize(
    ("word", "says"),
    [
        ("q1=nan", "--effort q1: 'nan' is not a finite number"),
        ("q9=1", "--effort: unknown input 'q9'; known: q1, q2, q3"),
        ("q1", "--effort: expected name=value, got 'q1'"),
    ],
)
def test_a_wrong_effort_is_named_by_its_option(word: str, says: str, tmp_path: Path) -> None:
    done = run("simulate", "linear_delta", "--effort", word, "--out", str(tmp_path))
    assert done.exit_code == 1
    assert says in done.stderr


def test_one_of_a_thing_is_told_in_the_singular(tmp_path: Path) -> None:
    """A planar four-bar closed by a ball has one row too many; with its output held, it rests."""
    hinge = '<axis xyz="0 0 1"/></joint>'
    file = tmp_path / "bar.urdf"
    file.write_text(
        f"""<robot name="bar"><link name="o"/><link name="a"/><link name="b"/><link name="c"/>
  <joint name="A" type="continuous"><parent link="o"/><child link="a"/>{hinge}
  <joint name="B" type="continuous"><parent link="a"/><child link="b"/>
    <origin xyz="0.1 0 0"/>{hinge}
  <joint name="D" type="continuous"><parent link="o"/><child link="c"/>
    <origin xyz="0.3 0 0"/>{hinge}
  <constraint name="C" type="spherical"><parent link="b"/><parent_origin xyz="0.28 0 0"/>
    <child link="c"/><child_origin xyz="0.2 0 0"/></constraint>
  <transmission name="q"><joint name="A"/></transmission>
  <task base="o" tip="c" outputs="rz"/></robot>"""
    )
    told = " ".join(run("info", str(file)).stdout.split())
    assert "1 closure row is redundant and consistent" in told
    assert "a universal joint instead of the hinge A" in told
    rest = run("singularities", str(file), "--over", "q=0.5:0.6:3", "--out", str(tmp_path / "out"))
    assert "no freedoms of motion remain" in rest.stdout
    assert "(s)" not in told + rest.stdout
