"""The command follow: what it writes and says, and each option."""

from __future__ import annotations

import csv
import json
import re
from functools import partial
from pathlib import Path
from typing import Any

import commands
import numpy as np
import pytest
import xarray as xr
from conftest import assert_close
from typer.testing import CliRunner, Result

import closedchain as cc
from closedchain.cli import app
from closedchain.robots.named_tasks import named_tasks

run = partial(commands.run, "follow")
good = partial(commands.good, "follow")

HEADER = "t,x,y,z"
DOWN = [(0.0, -1.0), (0.5, -1.01), (1.0, -1.02)]  # time, height of D1's tip
FILES = ("path.csv", "path.nc", "path.png", "inputs.png")


def data(done: str | Result) -> Any:
    return commands.strict(done if isinstance(done, str) else done.stdout)


def rows(folder: Path) -> tuple[list[str], np.ndarray]:
    with (folder / "path.csv").open() as file:
        header, *lines = csv.reader(file)
    return header, np.array(lines, dtype=float).reshape(len(lines), len(header))


def motion(page: Path) -> Any:
    """What the page's player plays; None for a page at rest."""
    found = re.search(
        r'<script type="application/json" id="motion">(.*?)</script>', page.read_text(), re.S
    )
    return None if found is None else json.loads(found[1])


DOCS = Path(__file__).resolve().parents[2] / "docs" / "follow.md"


@pytest.fixture
def dip(tmp_path: Path) -> Path:
    """A CSV task: D1's tip goes down by 20 mm in a second."""
    file = tmp_path / "dip.csv"
    file.write_text("\n".join([HEADER, *(f"{t},0,{y},0" for t, y in DOWN)]))
    return file


def test_a_task_of_a_csv_file(tmp_path: Path, dip: Path, d1: cc.Mechanism) -> None:
    out = tmp_path / "new" / "folder"
    text = good("d1", "--task", str(dip), "--out", str(out))
    assert "samples reached                           3 of 3" in text
    for name in (*FILES, "d1_dip.html"):
        assert (out / name).stat().st_size > 0
        assert str(out / name) in text
    header, table = rows(out)
    assert header[:5] == ["t [s]", "x [m]", "y [m]", "z [m]", "q1 [m]"]
    assert_close(table[:, [0, 2]], DOWN, 1e-12)
    with xr.open_dataset(out / "path.nc", engine="h5netcdf") as saved:
        assert saved["time"].to_numpy().tolist() == [0.0, 0.5, 1.0]
        assert_close(saved["inputs"], table[:, 4:10], 0.0)
        assert saved["inputs"].attrs["units"] == "m m m m m m"
    played = motion(out / "d1_dip.html")
    assert played["times"] == [0.0, 0.5, 1.0]
    page = (out / "d1_dip.html").read_text()
    assert "way of T: distance to a singularity" in page
    assert "not reached" not in page
    for name in (*d1.inputs, "distance", "σ direct", "σ inverse"):
        assert f">{name}<" in page


def test_a_tool_axis_in_the_file(tmp_path: Path, dip: Path, d1: cc.Mechanism) -> None:
    axis = np.array([np.sin(0.02), np.cos(0.02), 0.0])
    lines = [f"{t},0,{y},0,{axis[0]},{axis[1]},{axis[2]}" for t, y in DOWN]
    dip.write_text("\n".join([f"{HEADER},ax,ay,az", *lines]))
    good("d1", "--task", str(dip), "--out", str(tmp_path))
    with xr.open_dataset(tmp_path / "path.nc", engine="h5netcdf") as saved:
        assert saved.attrs["outputs"] == "x y z rx rz"
        for q in saved["q"].to_numpy():
            assert_close(d1.pose(q).rotation[:, 1], axis, 1e-12)


def test_the_file_of_the_docs(tmp_path: Path) -> None:
    (text,) = re.findall(r"^```csv\n(.*?)^```", DOCS.read_text(), re.M | re.S)
    (tmp_path / "task.csv").write_text(text)
    found = data(good("d1", "--task", str(tmp_path / "task.csv"), "--out", str(tmp_path), "--json"))
    assert found["reached"] == len(text.splitlines()) - 1
    assert found["task_error"] < 1e-12


def test_json_says_everything(tmp_path: Path, dip: Path) -> None:
    found = data(good("d1", "--task", str(dip), "--out", str(tmp_path), "--json"))
    assert found["converged"] is True
    assert found["stopped"] is None
    assert found["samples"] == found["reached"] == 3
    assert found["task"] == "dip"
    assert found["residual"] < 1e-12
    assert found["smallest"] == min(found["sigma_direct"], found["sigma_driven"])
    assert found["files"]["d1_dip.html"] == str(tmp_path / "d1_dip.html")
    _, table = rows(tmp_path)
    assert found["inputs"]["lowest"] == table[:, 4:10].min(axis=0).tolist()


def test_a_lock_at_home_or_at_a_value(tmp_path: Path, dip: Path, d1: cc.Mechanism) -> None:
    common = ("d1", "--task", str(dip), "--out", str(tmp_path))
    home = d1.input_values(d1.home)[2]
    assert f"locked                                    q3 = {home:.6g} m" in good(
        *common, "--lock", "q3"
    )
    assert_close(rows(tmp_path)[1][:, 6], [home] * 3, 0.0)
    found = data(good(*common, "--lock", "q3=0.5", "--json"))
    assert found["locked"] == {"q3": 0.5}
    assert_close(rows(tmp_path)[1][:, 6], [0.5] * 3, 1e-15)


def test_what_cannot_be_followed_is_written_as_far_as_it_was(tmp_path: Path) -> None:
    words = ("d1", "--task", "step", "--lock", "q3", "--out", str(tmp_path))
    done = run(*words)
    assert done.exit_code == 1
    (line,) = done.stderr.splitlines()
    assert line.startswith("closedchain: the task cannot be followed on after t = 2.22085 s")
    assert "an inverse singularity with q3 locked" in line
    assert "23 of 121" in done.stdout
    assert len(rows(tmp_path)[1]) == 23
    assert motion(tmp_path / "d1_step.html")["times"][-1] == pytest.approx(2.2)
    page = (tmp_path / "d1_step.html").read_text()
    assert "task, not reached" in page
    assert "task stops here" in page
    again = run(*words, "--json")
    assert again.exit_code == 1
    found = data(again)
    assert found["converged"] is False
    assert found["stopped"] == pytest.approx(2.2209, abs=1e-3)
    assert found["message"] in line


def test_what_cannot_be_begun_is_written_too(tmp_path: Path) -> None:
    done = run("d1", "--task", "drill", "--lock", "q4", "--out", str(tmp_path), "--json")
    assert done.exit_code == 1
    assert "not to be begun" in done.stderr
    found = data(done)
    assert found["reached"] == 0
    assert found["smallest"] is None
    assert found["inputs"]["lowest"] is None
    for name in FILES:
        assert (tmp_path / name).stat().st_size > 0
    assert motion(tmp_path / "d1_drill.html") is None
    assert "task begins here" in (tmp_path / "d1_drill.html").read_text()
    assert (
        "0 of 101" in run(*("d1", "--task", "drill", "--lock", "q4", "--out", str(tmp_path))).stdout
    )


@pytest.mark.slow
def test_comparison_in_text_and_json(tmp_path: Path, dip: Path) -> None:
    words = ("d1", "--task", str(dip), "--compare", "--out", str(tmp_path))
    text = good(*words)
    for name in ("q1 locked", "q4 locked", "gradient", "path", "until [s]"):
        assert name in text
    found = data(good(*words, "--method", "path", "--json"))
    assert found["method"] == "path"
    table = {row["name"]: row for row in found["comparison"]["rows"]}
    assert list(table) == [*(f"q{i} locked" for i in range(1, 7)), "gradient", "path"]
    assert table["path"]["smallest"] == found["smallest"] == found["comparison"]["best_free"]
    # the three locks of a symmetric robot are equal but for rounding
    assert found["comparison"]["best_locked"] == pytest.approx(
        table["q3 locked"]["smallest"], rel=1e-12
    )
    assert found["comparison"]["gain"] > 0.0
    assert table["q4 locked"]["converged"] is False
    assert table["q4 locked"]["sigma_direct"] is None  # not begun: no number, not zero


@pytest.mark.slow
@pytest.mark.parametrize("task", ["drill", "hexagon", "step", "periodic"])
def test_each_task_of_d1(task: str, tmp_path: Path) -> None:
    found = data(good("d1", "--task", task, "--out", str(tmp_path), "--json"))
    least = {"drill": 0.131, "hexagon": 0.131, "step": 0.091, "periodic": 0.070}[task]
    assert least < found["smallest"] < least + 0.002
    assert found["task_error"] < 1e-12
    assert (tmp_path / f"d1_{task}.html").is_file()
    assert motion(tmp_path / f"d1_{task}.html")["times"][-1] == pytest.approx(
        {"drill": 10.0, "hexagon": 10.0, "step": 12.0, "periodic": 2.0 * np.pi}[task]
    )


@pytest.mark.slow
def test_another_robot_reconfigures_within_limits(tmp_path: Path) -> None:
    words = ("rus6", "--task", "turn", "--limit", "beta=-1.5:1.5", "--out", str(tmp_path))
    assert "direct singularity" in run(*words).stderr
    kept = data(good(*words, "--gain", "2000", "--json"))
    assert 0.04 < kept["smallest"] < 0.06
    best = data(good(*words, "--method", "path", "--json"))
    assert best["smallest"] > 0.05 > kept["smallest"]  # by the rates of all joints
    assert best["inputs"]["highest"][6] <= 1.5 + 1e-6
    header, _ = rows(tmp_path)
    assert "beta [rad]" in header


@pytest.mark.slow
def test_objectives(tmp_path: Path, dip: Path) -> None:
    common = ("d1", "--task", str(dip), "--out", str(tmp_path), "--json", "--objective")
    found = {name: data(good(*common, name)) for name in ("singularity", "range", "speed")}
    assert {name: f["objective"] for name, f in found.items()} == {name: name for name in found}
    fastest = {name: max(f["inputs"]["fastest"]) for name, f in found.items()}
    assert fastest["speed"] == min(fastest.values())
    assert found["range"]["measure"] >= 0.6
    assert found["singularity"]["smallest"] == max(f["smallest"] for f in found.values())


@pytest.mark.slow
def test_speed_limits(tmp_path: Path, dip: Path) -> None:
    common = ("d1", "--task", str(dip), "--out", str(tmp_path))
    free = data(good(*common, "--json"))
    assert free["inputs"]["fastest"][0] > 0.025
    slow = data(good(*common, "--speed-limit", "0.2", "--speed-limit", "q1=0.01", "--json"))
    # the limit binds from sample to sample, "fastest" is a true rate in between
    assert slow["inputs"]["fastest"][0] <= 0.01 * (1.0 + 1e-5)
    done = run(*common, "--speed-limit", "0.01")
    assert done.exit_code == 1
    assert "t = " in done.stderr
    assert "m/s, allowed 0.01" in done.stderr


@pytest.mark.slow
def test_outputs_variant_and_parameters(tmp_path: Path, dip: Path) -> None:
    common = ("d1", "--task", str(dip), "--out", str(tmp_path), "--json")
    found = data(good(*common, "--outputs", "x y z", "--variant", "printed_u"))
    assert found["outputs"] == ["x", "y", "z"]
    assert found["inputs"]["highest"][3] > 0.59  # home of that variant
    short = data(good(*common, "--set", "tip=-0.24"))
    assert short["reached"] == 3


def test_a_folder_that_is_a_file(tmp_path: Path, dip: Path) -> None:
    done = run("d1", "--task", str(dip), "--out", str(dip))
    assert done.exit_code == 1
    assert "is a file; results need a folder" in done.stderr


@pytest.mark.parametrize("words", [["d1"], ["d1", "--task", "drill"], ["d1", "--out", "x"]])
def test_task_and_folder_are_required(words: list[str]) -> None:
    assert run(*words).exit_code == 2


def test_help_names_every_task() -> None:
    text = " ".join(CliRunner().invoke(app, ["follow", "--help"]).stdout.split())
    listed = (
        f"{name}: {', '.join(named_tasks(name))}" for name in cc.robots() if named_tasks(name)
    )
    assert f"({'; '.join(listed)})" in text


def test_a_robot_without_redundancy_or_without_task(tmp_path: Path) -> None:
    file = tmp_path / "line.csv"
    m = cc.load("linear_delta")
    x, y, z = m.pose(m.home).translation
    file.write_text(f"{HEADER}\n0,{x},{y},{z}\n1,{x},{y},{z - 0.02}\n")
    common = ("--task", str(file), "--out", str(tmp_path))
    assert "leave no freedom for the objective" in " ".join(good("linear_delta", *common).split())
    bare = tmp_path / "bare.urdf"
    text = m.description.text
    bare.write_text(re.sub(r"<task\b.*?(/>|</task>)", "", text, flags=re.S))
    done = run(str(bare), *common)
    assert done.exit_code == 1
    assert "no task" in done.stderr


def test_efforts_along_a_task(tmp_path: Path) -> None:
    """Those of the samples' spline, under weights along D1's vertical and a wrench at the tip."""
    words = ["d1", "--task", "hexagon", "--out", str(tmp_path), "--efforts"]
    text = good(*words, "--wrench", "0 50 0 0 0 0", "--payload", "T=1")
    assert str(tmp_path / "efforts.png") in text
    with xr.open_dataset(tmp_path / "efforts.nc", engine="h5netcdf") as found:
        m = cc.load("d1")
        motion = xr.open_dataset(tmp_path / "path.nc", engine="h5netcdf")
        expected = cc.efforts_along(
            m, motion["time"].values, motion["q"].values, wrench=[0, 50, 0, 0, 0, 0],
            gravity=[0, -9.81, 0], payload={"T": 1.0},
        )  # fmt: skip
        assert_close(found["effort"].values, expected.inputs, 1e-9)
    for more in (["--wrench", "1 2"], ["--payload", "nobody=1"]):
        done = run(*words, *more)
        assert done.exit_code == 1
        assert len(done.stderr.strip().splitlines()) == 1
    assert "are for --efforts" in run(*words[:-1], "--payload", "T=1").stderr


def path_file(tmp_path: Path, rows: str) -> str:
    file = tmp_path / "task.csv"
    file.write_text("t, x, y, z\n" + rows)  # blanks after commas are no part of names
    return str(file)


def test_efforts_are_among_what_the_index_leads_to(tmp_path: Path) -> None:
    file = path_file(tmp_path, "".join(f"{0.1 * k},0,{-1 - 0.001 * k},0\n" for k in range(5)))
    out = tmp_path / "out"
    told = good("d1", "--task", file, "--out", str(out), "--efforts")
    index = (out / "index.html").read_text()
    named = set(re.findall(r'(?:href|src)="([^"]*)"', index))
    assert {"efforts.nc", "efforts.png", "path.csv", "d1_task.html"} <= named
    assert str(out / "index.html") in told


def test_what_cannot_have_efforts_is_written_all_the_same(tmp_path: Path) -> None:
    file = path_file(tmp_path, "0,0,-1,0\n")
    out = tmp_path / "out"
    done = run("d1", "--task", file, "--out", str(out), "--efforts")
    assert done.exit_code == 1
    (line,) = done.stderr.splitlines()
    assert line == "closedchain: no efforts: they need 4 samples or more, and 1 were reached"
    assert "1 of 1" in done.stdout
    assert (out / "index.html").is_file()


def test_a_task_that_cannot_begin_with_a_freedom_to_spare(tmp_path: Path) -> None:
    file = path_file(tmp_path, "0,3,-1,0\n1,3,-1,0\n2,3,-1,0\n")
    out = tmp_path / "out"
    done = run("d1", "--task", file, "--out", str(out))
    assert done.exit_code == 1
    assert "0 of 3 samples reached" in done.stderr
    assert rows(out)[1].shape[0] == 0


def test_loads_are_checked_before_the_work(tmp_path: Path) -> None:
    out = tmp_path / "out"
    done = run("d1", "--task", "drill", "--out", str(out), "--efforts", "--payload", "nobody=1")
    assert done.exit_code == 1
    assert "unknown frame 'nobody'" in done.stderr
    assert not out.exists()
