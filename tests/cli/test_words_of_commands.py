"""How numbers are written, and what people read."""

from __future__ import annotations

import json
import math

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
