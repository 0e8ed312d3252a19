"""``closedchain joints``: a line out for each line in, at once, whatever the line says."""

import json
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
from conftest import assert_close
from hypothesis import given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

import closedchain as cc
from closedchain.cli import app


def answers(robot: str, *lines: object, words: tuple[str, ...] = ()) -> list[dict[str, Any]]:
    """What comes back for lines, JSON if they are no text."""
    text = "".join((line if isinstance(line, str) else json.dumps(line)) + "\n" for line in lines)
    done = CliRunner().invoke(app, ["joints", robot, *words], input=text, catch_exceptions=False)
    assert done.exit_code == 0, done.stderr
    return [json.loads(line) for line in done.stdout.splitlines()]


def test_both_spellings_of_a_line_say_the_same() -> None:
    m = cc.load("linear_delta")
    first, second, state = answers(
        "linear_delta",
        {"q1": -0.16},
        {"name": ["leg2_P", "q3"], "position": [-0.12, -0.1]},
        {"header": {}, "name": ["q1", "q2", "q3"], "position": [-0.16, -0.12, -0.1], "effort": []},
    )
    home = m.input_values(m.home)
    assert_close(first["position"], cc.direct(m, [-0.16, *home[1:]]).q, 1e-12)
    assert second["name"] == list(m.model.names)[1:]
    assert_close(second["position"], cc.direct(m, [-0.16, -0.12, -0.1]).q, 1e-12)
    assert_close(state["position"], second["position"], 1e-12)
    assert second["arrived"]
    assert second["residual"] < 1e-12
    assert "floating" not in second


def test_it_stops_at_a_singularity_and_goes_on() -> None:
    m = cc.load("d1")
    home = m.input_values(m.home)
    far = home + np.array([0.1, -0.05, 0.15, 0.3, -0.3, 0.1])
    there, stopped, back = (
        answers("d1", *(dict(zip(m.inputs, map(float, q), strict=True)) for q in (home, far, home)))
    )  # fmt: skip
    assert stopped["kinds"] == ["direct"]
    assert not stopped["arrived"]
    assert "stopped: the way meets a direct singularity after 54.0%" in stopped["message"]
    for one in (stopped, back):
        assert_close(one["position"], there["position"], 1e-9)
        assert one["branch"] == there["branch"] != 0
    assert back["arrived"]
    assert_close(back["floating"]["platform_pose"][:3], m.point(m.home, "platform"), 1e-9)


def test_it_starts_in_the_mode_that_was_asked_for() -> None:
    m = cc.load("linear_delta")
    (one,) = answers("linear_delta", "{}", words=("--mode", "+--"))
    assert_close(one["position"], m.posture("+--"), 1e-12)
    (moved,) = answers("linear_delta", "{}", words=("q1=-0.2",))
    assert moved["position"][0] == -0.2


def test_wrong_lines_are_answered_with_what_would_do() -> None:
    wrong = {
        "nonsense": "this is not JSON",
        "[1, 2]": "this is a list, not an object",
        '{"q1": "far"}': "the value of q1 is a text",
        '{"q1": true}': "the value of q1 is true",
        '{"q1": NaN}': "the value of q1 is not finite",
        '{"q1": 1e999}': "the value of q1 is not finite",
        '{"q1": ' + 400 * "9" + "}": "the value of q1 is not finite",
        '{"q1": ' + 5000 * "9" + "}": "this is no number",
        '{"q9": 1}': "unknown driven joint 'q9'",
        '{"q1": 1, "q1": 2}': "q1 is given twice",
        '{"name": ["q1"]}': '"name" has 1 entries and "position" no',
        '{"name": ["q1", "q1"], "position": [1, 2]}': "q1 is given twice",
        '{"name": [[]], "position": [1]}': '"name" holds a list',
        '{"name": [], "position": [], "speed": 1}': '"speed" has no place',
        40000 * "[": "nested too deep",
    }
    found = answers("linear_delta", *wrong, "", "{}")
    assert len(found) == len(wrong) + 1
    for number, (one, words) in enumerate(zip(found, wrong.values(), strict=False), start=1):
        assert one["error"].startswith(f"line {number}: "), one
        assert words in one["error"]
        assert 'a line is {"q1": -0.142} or {"name": ["q1"]' in one["error"]
        assert "q1, q2, q3 (or leg1_P, leg2_P, leg3_P), in m or rad" in one["error"]
    assert found[-1]["arrived"]


JSON = st.recursive(
    st.none() | st.booleans() | st.floats() | st.text(max_size=5) | st.sampled_from(["name", "q1"]),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner),
)
LINE = st.binary(max_size=40).map(lambda b: b.replace(b"\n", b"")) | JSON.map(
    lambda value: json.dumps(value).encode()
)


@settings(max_examples=5, deadline=None)
@given(st.lists(LINE, min_size=20, max_size=60))
def test_no_bytes_end_it(lines: list[bytes]) -> None:
    text = b"".join(line + b"\n" for line in lines) + b"{}\n"
    done = CliRunner().invoke(app, ["joints", "linear_delta"], input=text, catch_exceptions=False)
    found = [json.loads(line) for line in done.stdout.splitlines()]
    assert done.exit_code == 0
    assert len(found) == sum(bool(line.strip()) for line in lines) + 1
    assert found[-1]["arrived"]


def test_each_line_is_answered_before_the_next_is_sent() -> None:
    command = [sys.executable, "-m", "closedchain.cli", "joints", "linear_delta"]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    with subprocess.Popen(command, **pipes) as process:
        for value in np.linspace(-0.15, -0.2, 5).tolist():
            process.stdin.write(json.dumps({"q1": value}) + "\n")
            process.stdin.flush()
            answer = json.loads(process.stdout.readline())
            assert answer["position"][0] == value
        process.stdin.close()
        assert process.wait(timeout=60) == 0


def test_a_robot_without_inputs_is_refused(tmp_path: Path) -> None:
    text = cc.load("linear_delta").description.text
    driven = re.compile(r"<transmission.*?</transmission>", re.S)
    assert len(driven.findall(text)) == 3
    bare = tmp_path / "bare.urdf"
    bare.write_text(driven.sub("", text))
    runner = CliRunner()
    done = runner.invoke(app, ["joints", str(bare)], input="{}\n", catch_exceptions=False)
    assert done.exit_code == 1
    assert "has no inputs: add" in done.stderr
