"""The command line as a user meets it: answers, JSON, exit codes, one line for an error."""

import json
import math
import re
import signal
import socket
import subprocess
import sys
import urllib.request
from pathlib import Path

import numpy as np
import pytest
from commands import data, good, run

import closedchain as cc

COMMAND = [sys.executable, "-m", "closedchain.cli"]


@pytest.fixture
def slider(tmp_path: Path) -> Path:
    """A plain URDF of a user's own: a crank that moves a slider, without task."""
    limit = '<limit lower="-7" upper="7" effort="1" velocity="1"/>'
    path = tmp_path / "crank.urdf"
    path.write_text(
        f"""<robot name="crank slider">
  <link name="base"/><link name="crank"/><link name="rod"/><link name="slider"/>
  <joint name="a" type="revolute"><parent link="base"/><child link="crank"/>
    <axis xyz="0 0 1"/>{limit}</joint>
  <joint name="b" type="revolute"><parent link="crank"/><child link="rod"/>
    <origin xyz="0.1 0 0"/><axis xyz="0 0 1"/>{limit}</joint>
  <joint name="s" type="prismatic"><parent link="base"/><child link="slider"/>
    <axis xyz="1 0 0"/>{limit}</joint>
  <constraint name="pin" type="revolute">
    <parent link="rod"/><parent_origin xyz="0.3 0 0"/><parent_axis xyz="0 0 1"/>
    <child link="slider"/></constraint>
  <transmission name="angle"><joint name="a"/></transmission>
  <group_state name="home"><joint name="a" value="1"/><joint name="b" value="-1.3"/>
    <joint name="s" value="0.33"/></group_state>
</robot>
"""
    )
    return path


def test_list() -> None:
    assert "d1" in good("list")
    (entry,) = [e for e in data("list") if e["name"] == "d1"]
    assert "printed_u" in entry["variants"]


def test_version_and_help() -> None:
    assert good("--version") == f"closedchain {cc.__version__}\n"
    text = good("--help")
    for command in ("list", "info", "direct", "inverse", "classify", "view", "urdf"):
        assert f"\n  {command} " in text


def test_info(d1: cc.Mechanism) -> None:
    text = good("info", "d1")
    for piece in ("q1", "leg1_P", "0.522015", "radius_R", "mobility 6", "spherical"):
        assert piece in text
    found = data("info", "d1")
    assert [i["name"] for i in found["inputs"]] == list(d1.inputs)
    assert found["inputs"][0]["home"] == d1.input_values(d1.home)[0]  # every digit
    assert found["mobility"]["mobility"] == 6
    assert found["tip"]["frame"] == "T"


def test_info_of_a_file_of_ones_own(slider: Path) -> None:
    assert "angle" in good("info", str(slider))
    found = data("info", str(slider))
    assert found["name"] == "crank slider"
    assert found["task"] is None
    assert found["mobility"]["mobility"] == 1
    assert found["inputs"][0]["unit"] == "rad"


def test_info_of_rods_and_relations(tmp_path: Path) -> None:
    limit = '<limit lower="-7" upper="7" effort="1" velocity="1"/>'
    joints = "".join(
        f'<link name="l{n}"/><joint name="{n}" type="revolute"><parent link="base"/>'
        f'<child link="l{n}"/><origin xyz="{x} 0 0"/><axis xyz="0 0 1"/>{limit}</joint>'
        for n, x in (("a", 0), ("d", 0.4), ("e", 0.8))
    )
    path = tmp_path / "rods.urdf"
    path.write_text(
        f"""<robot name="rods"><link name="base"/>{joints}
  <constraint name="rod" type="distance" length="0.35">
    <parent link="la"/><parent_origin xyz="0.15 0 0"/>
    <child link="ld"/><child_origin xyz="0.3 0 0"/></constraint>
  <constraint name="sum" type="linear">
    <joint name="e"/><joint name="a" multiplier="-2"/><joint name="d"/></constraint>
  <transmission name="q"><joint name="a"/></transmission>
  <group_state name="home"><joint name="a" value="1.1"/><joint name="d" value="1.7"/>
  </group_state></robot>"""
    )
    found = data("info", str(path))["closures"]
    assert [tuple(c.values()) for c in found] == [
        ("rod", "distance", 1, "la", "ld"),
        ("sum", "linear", 1, "a d", "e"),
    ]
    text = good("info", str(path))
    for piece in ("distance", "linear", "mobility 1", "1SS", "SS is a rod between two balls"):
        assert piece in text


def test_parameters_and_variants() -> None:
    assert data("info", "d1", "--set", "radius_R=0.24")["parameters"]["radius_R"] == 0.24
    printed = data("info", "d1", "--variant", "printed_u")["inputs"]
    assert printed[3]["home"] == pytest.approx(math.sqrt(0.32**2 + 0.5**2), abs=1e-12)
    both = data("info", "d1", "--variant", "printed_u", "--set", "tip=-0.3")
    assert both["tip"]["xyz"][1] == pytest.approx(-1.05)


def test_direct(d1: cc.Mechanism) -> None:
    text = good("direct", "d1", "q1=0.5", "q6=0.55")
    assert text.count("home value, not given") == 4
    found = data("direct", "d1", "q1=0.5", "q6=0.55")
    values = d1.input_values(d1.home).copy()
    values[[0, 5]] = 0.5, 0.55
    q = cc.direct(d1, values).q
    assert found["q"] == q.tolist()
    assert found["converged"] is True
    assert found["at_home"] == ["q2", "q3", "q4", "q5"]
    assert found["tip"]["xyz"] == pytest.approx(d1.pose(q).translation.tolist(), abs=1e-15)


def test_negative_input_values(slider: Path) -> None:
    found = data("direct", str(slider), "angle=-0.5")
    assert found["inputs"] == {"angle": -0.5}
    assert found["tip"] is None


def test_a_failed_solution_is_still_printed_as_json() -> None:
    done = run("direct", "d1", "q1=-0.1", "--json")
    assert done.exit_code == 1
    assert json.loads(done.stdout)["converged"] is False
    assert len(done.stderr.splitlines()) == 1
    assert "leg1_S" in done.stderr


def test_inverse_undoes_direct() -> None:
    forward = data("direct", "d1", "q1=0.53", "q2=0.51", "q5=0.55")
    words = [str(x) for x in (*forward["tip"]["xyz"], "--rpy", *forward["tip"]["rpy"])]
    back = data("inverse", "d1", "--xyz", *words, "--outputs", "x y z rx rz")
    assert back["converged"]
    assert back["outputs"] == ["x", "y", "z", "rx", "rz"]
    assert back["tip"]["xyz"] == pytest.approx(forward["tip"]["xyz"], abs=1e-10)


def test_inverse_keeps_homes_orientation_and_position() -> None:
    five = ("--outputs", "x y z rx rz")
    moved = data("inverse", "d1", "--xyz", "-0.02", "-1.02", "0.01", *five)
    assert moved["tip"]["xyz"] == pytest.approx([-0.02, -1.02, 0.01], abs=1e-11)
    assert moved["tip"]["rpy"][0] == pytest.approx(0.0, abs=1e-11)
    assert moved["tip"]["rpy"][2] == pytest.approx(0.0, abs=1e-11)
    turned = data("inverse", "d1", "--rpy", "-0.05", "0", "0.02", *five)
    assert turned["tip"]["xyz"] == pytest.approx([0.0, -1.0, 0.0], abs=1e-11)
    assert "outputs prescribed" in good("inverse", "d1", "--xyz", "0", "-1.01", "0", *five)


def test_classify() -> None:
    assert "inverse singularity (type 1)" in good("classify", "d1")
    home = data("classify", "d1")
    assert home["distance"] == 0.0 < home["accuracy"]
    assert home["nearest"]["direct"]["distance"] is None  # no singular value of that kind is small
    assert home["kinds"] == ["inverse"]
    assert home["combined"] is False
    assert len(home["lost_twists"]) == 1
    assert len(home["lost_twists"][0]) == 6
    assert data("classify", "d1", "--outputs", "x y z rx rz")["kinds"] == []
    moved = data("classify", "d1", "q1=0.5", "q2=0.53", "q4=0.53", "q5=0.56")
    assert moved["kinds"] == []
    assert moved["inputs"]["q1"] == 0.5


def test_urdf_is_the_text_that_errors_count_lines_of(d1: cc.Mechanism) -> None:
    assert good("urdf", "d1") == d1.description.text.rstrip("\n") + "\n"
    assert "xacro" not in good("urdf", "d1").replace("xmlns:xacro", "")


def test_view_writes_a_page(tmp_path: Path, slider: Path) -> None:
    page = tmp_path / "d1.html"
    assert good("view", "d1", "q1=0.5", "--no-modes", "--html", str(page)) == f"{page}\n"
    text = page.read_text()
    (data,) = re.findall(r'id="instrument">(.*?)</script>', text, re.S)
    first = int(cc.load("d1").input_q[0])
    assert json.loads(data)["start"][first] == 0.5
    words = ["view", str(slider), "--up", "y", "--no-modes"]
    good(*words, "--html", str(tmp_path / "slider.html"))
    assert "no visuals" in (tmp_path / "slider.html").read_text()


def test_view_serves_until_interrupted() -> None:
    with subprocess.Popen(
        [*COMMAND, "view", "d1", "--no-modes"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        try:
            assert process.stdout is not None
            url = process.stdout.readline().split()[0]
            with urllib.request.urlopen(url, timeout=10) as answer:
                assert b"<h1>d1</h1>" in answer.read()
            process.send_signal(signal.SIGINT)
            _, errors = process.communicate(timeout=20)
        finally:
            process.kill()
    assert process.returncode == 0
    assert errors == ""


def test_view_offers_the_assembly_modes(tmp_path: Path) -> None:
    page = tmp_path / "delta.html"
    done = run("view", "linear_delta", "q1=-0.2", "--html", str(page))
    assert done.exit_code == 0, done.stderr
    assert done.stdout == f"{page}\n"
    assert "searching the other assembly modes" in done.stderr
    (data,) = re.findall(r'id="instrument">(.*?)</script>', page.read_text(), re.S)
    modes = json.loads(data)["modes"]
    assert len(modes) == 2
    m = cc.load("linear_delta")
    for mode in modes:
        q = np.array(mode["posture"])
        assert np.abs(cc.residual(m, q)).max() < 1e-12
        assert m.input_values(q)[0] == -0.2


def test_view_refuses_a_taken_port() -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        done = run("view", "d1", "--no-modes", "--port", str(port))
    assert done.exit_code == 1
    assert done.stdout == ""
    assert f"port {port} cannot be served at" in done.stderr
    assert "choose another with --port" in done.stderr
    assert done.stderr.count("\n") == 1


BAD = {
    "unknown robot": (["info", "d2"], "known: d1"),
    "no such file": (["info", "none.urdf"], "there is no file none.urdf"),
    "a folder": (["info", "/"], "is a folder"),
    "unreadable text": (["info", sys.executable], "UTF-8"),
    "unknown parameter": (["info", "d1", "--set", "radius=1"], "radius_R"),
    "a word of load itself": (["info", "d1", "--set", "variant=x"], "unknown parameter"),
    "parameter without value": (["info", "d1", "--set", "tip"], "name=value"),
    "parameter twice": (["info", "d1", "--set", "tip=1", "--set", "tip=2"], "given twice"),
    "parameter that is no number": (
        ["info", "d1", "--set", "radius_R=abc"],
        "parameter 'radius_R' must be a number",
    ),
    "unknown variant": (["info", "d1", "--variant", "v"], "printed_u"),
    "unknown input": (["direct", "d1", "q7=1"], "known: q1, q2"),
    "input twice": (["direct", "d1", "q1=0.5", "q1=0.5"], "given twice"),
    "input without value": (["direct", "d1", "q1"], "name=value"),
    "input that is no number": (["direct", "d1", "q1=long"], "not a finite number"),
    "input that is not finite": (["direct", "d1", "q1=nan"], "not a finite number"),
    "inputs out of reach": (["direct", "d1", "q1=9"], "out of reach"),
    "classify out of reach": (["classify", "d1", "q1=9"], "out of reach"),
    "unknown output": (["classify", "d1", "--outputs", "x q"], "unknown output 'q'"),
    "pose not given": (["inverse", "d1"], "--xyz, --rpy or both"),
    "pose out of reach": (["inverse", "d1", "--xyz", "0", "-9", "0"], "limits"),
    "pose that is not finite": (["inverse", "d1", "--xyz", "0", "inf", "0"], "finite"),
    "unwritable page": (["view", "d1", "--html", "/none/page.html"], "/none/page.html"),
    "unknown axis": (["view", "d1", "--up", "w"], "known: x, y, z"),
    "view out of reach": (["view", "d1", "q1=9"], "out of reach"),
    "urdf of an unknown robot": (["urdf", "d2"], "unknown robot"),
}


@pytest.mark.parametrize("what", BAD)
def test_bad_words_give_one_line(what: str) -> None:
    words, expected = BAD[what]
    done = run(*words)
    assert done.exit_code == 1
    assert done.stdout == ""
    assert len(done.stderr.splitlines()) == 1
    assert done.stderr.startswith("closedchain: ")
    assert expected in done.stderr


def test_a_wrong_description_names_its_line(tmp_path: Path, slider: Path) -> None:
    broken = tmp_path / "broken.urdf"
    broken.write_text(slider.read_text().replace('type="prismatic"', 'type="sliding"'))
    done = run("info", str(broken))
    assert done.exit_code == 1
    assert "line 7" in done.stderr
    assert "'s'" in done.stderr


def test_xacro_can_be_refused(tmp_path: Path, slider: Path) -> None:
    assert "crank slider" in good("info", str(slider), "--no-xacro")
    path = tmp_path / "robot.xacro"
    text = slider.read_text().replace(
        "<robot ", '<robot xmlns:xacro="http://www.ros.org/wiki/xacro" '
    )
    path.write_text(text.replace('xyz="0.1 0 0"', 'xyz="${0.05*2} 0 0"'))
    assert "crank slider" in good("info", str(path))
    done = run("info", str(path), "--no-xacro")
    assert done.exit_code == 1
    assert "switched off" in done.stderr


@pytest.mark.parametrize(
    "words",
    [["frob"], ["singularities", "d1"], ["info"], ["inverse", "d1", "--xyz", "0", "0"]],
)
def test_usage_errors(words: list[str]) -> None:
    done = run(*words)
    assert done.exit_code == 2
    assert done.stdout == ""


def test_a_closed_pipe_is_no_error_message() -> None:
    for words in ("list", "urdf d1"):
        with subprocess.Popen(
            [*COMMAND, *words.split()], stdout=subprocess.PIPE, stderr=subprocess.PIPE
        ) as process:
            assert process.stdout is not None
            assert process.stderr is not None
            process.stdout.close()
            assert process.stderr.read() == b""


def test_output_to_a_file_is_plain_and_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "20")
    done = subprocess.run([*COMMAND, "list"], capture_output=True, text=True, check=True)
    assert "\x1b" not in done.stdout
    assert "…" not in done.stdout
    lines = done.stdout.splitlines()
    assert {line.split()[0] for line in lines if line} >= set(cc.robots())
    classics = lines[lines.index("") + 1 :]
    assert max(map(len, classics)) <= 80
    assert done.stderr == ""
