"""``closedchain export``, and files of every format as robots of the commands."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from closedchain.cli import app


def run(*words: object) -> tuple[int, str, str]:
    result = CliRunner().invoke(app, [str(word) for word in words])
    return result.exit_code, result.stdout, result.stderr


@pytest.mark.parametrize("form", ["urdf", "urdf+", "robot.yaml", "mjcf", "sdf"])
def test_a_robot_goes_out_and_every_command_takes_it(form: str, tmp_path: Path) -> None:
    if form == "mjcf":
        pytest.importorskip("mujoco")
    file = tmp_path / "delta.anything"
    code, out, _ = run("export", "linear_delta", "--format", form, "--out", file)
    assert code == 0
    assert out.splitlines()[0] == str(file)
    code, out, _ = run("info", file, "--json")
    assert code == 0
    found = json.loads(out)
    assert found["mobility"]["mobility"] == 3
    assert len(found["closures"]) == 5
    assert isinstance(found["notes"], list)
    code, out, _ = run("direct", file, "--json")
    assert code == 0


def test_text_goes_to_standard_output_and_notes_do_not(tmp_path: Path) -> None:
    code, out, err = run("export", "linear_delta", "--format", "urdf")
    assert code == 0
    assert out.startswith("<robot")
    assert out.rstrip().endswith("</robot>")
    assert "note: " in err
    code, out, _ = run("export", "linear_delta", "--format", "urdf", "--json")
    answer = json.loads(out)
    assert answer["text"].startswith("<robot")
    assert len(answer["losses"]) == 1


def test_an_unknown_format_is_one_line() -> None:
    code, _, err = run("export", "d1", "--format", "usd")
    assert code == 1
    assert "unknown format 'usd' (did you mean 'sdf'?); known: urdf" in err


def test_programs(tmp_path: Path) -> None:
    folder = tmp_path / "made" / "here"
    code, out, _ = run("export", "linear_delta", "--c", folder, "--number", "float")
    assert code == 0
    assert [Path(line).name for line in out.splitlines()] == [
        "linear_delta.h", "linear_delta.c", "linear_delta_test.c"
    ]  # fmt: skip
    assert "typedef float linear_delta_real;" in (folder / "linear_delta.h").read_text()
    code, out, _ = run("export", "linear_delta", "--js", folder, "--name", "delta", "--json")
    assert code == 0
    (path,) = json.loads(out)["files"]
    assert "export function direct(" in Path(path).read_text()


@pytest.mark.parametrize("words", [(), ("--c", "a", "--js", "b"), ("--c", "a", "--format", "urdf")])
def test_one_thing_is_exported_at_a_time(words: tuple[str, ...]) -> None:
    code, _, err = run("export", "linear_delta", *words)
    assert code == 1
    assert "one of --format, --c and --js" in err
    assert len(err.splitlines()) == 1
