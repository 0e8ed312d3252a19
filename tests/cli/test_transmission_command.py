"""``closedchain transmission``: files, programs, and words that are refused."""

import csv
import json
from functools import partial
from pathlib import Path

import commands
import numpy as np
import pytest
import xarray as xr
from conftest import assert_close

import closedchain as cc

run = partial(commands.run, "transmission")

KNEE = """<robot name="knee"><link name="base"/><link name="crank"/><link name="shin"/>
  <joint name="motor" type="continuous"><parent link="base"/><child link="crank"/>
    <axis xyz="0 0 1"/></joint>
  <joint name="knee" type="revolute"><parent link="base"/><child link="shin"/>
    <origin xyz="0.4 0 0"/><axis xyz="0 0 1"/>
    <limit lower="1.2" upper="1.9" effort="1" velocity="1"/></joint>
  <constraint name="rod" type="distance" length="0.35"><parent link="crank"/>
    <parent_origin xyz="0.15 0 0"/><child link="shin"/><child_origin xyz="0.3 0 0"/></constraint>
  <transmission name="q"><joint name="motor"/></transmission>
  <group_state name="home"><joint name="motor" value="1.1"/><joint name="knee" value="1.649231"/>
  </group_state></robot>"""


@pytest.fixture
def knee(tmp_path: Path) -> Path:
    path = tmp_path / "knee.urdf"
    path.write_text(KNEE)
    return path


def test_files(knee: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    done = run(str(knee), "--joints", "knee", "--out", str(out), "--over", "knee=1.6:1.8:5",
               "--effort", "q=2", "--speed", "q=10", "--code", "c", "--json")  # fmt: skip
    assert done.exit_code == 0, done.stderr
    told = json.loads(done.stdout)
    assert told["motors"] == ["q"]
    assert (told["positions"], told["reached"], told["within"]) == (5, 5, 5)
    assert all(Path(name).stat().st_size for name in told["files"])
    assert {"motors.c", "joints.c"} <= {Path(name).name for name in told["files"]}
    t = cc.transmission(cc.load_urdf(knee), ["knee"])
    with (out / "transmission.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 5
    for row in rows:
        x = float(row["knee"])
        assert_close(float(row["motor q"]), t.motors([x])[0], 1e-12)
        largest = 2 * t.jacobian([x])[0, 0]
        assert_close(float(row["largest effort knee"]), largest, 1e-9)
    saved = xr.open_dataset(out / "transmission.nc", engine="h5netcdf")
    assert_close(saved["knee"].values, np.linspace(1.6, 1.8, 5), 1e-15)


def test_the_range_is_that_of_the_joint(knee: Path, tmp_path: Path) -> None:
    done = run(str(knee), "--joints", "knee", "--out", str(tmp_path))
    assert done.exit_code == 0, done.stderr
    assert "distance from a toggle" in done.stdout
    saved = xr.open_dataset(tmp_path / "transmission.nc", engine="h5netcdf")
    assert_close(saved["knee"].values[[0, -1]], [1.2, 1.9], 1e-15)
    reached = saved["reached"].values
    assert f"{reached.sum()} of {reached.size} positions are reached" in done.stdout
    assert not saved["reached"].values.all()  # the knee's limits are wider than its loop allows


def test_wrong_words_are_one_line(knee: Path, tmp_path: Path) -> None:
    for words in (
        ["--joints", "nobody"],
        ["--joints", "knee", "--over", "knee=1"],
        ["--joints", "knee", "--over", "knee=2:1"],
        ["--joints", "knee", "--effort", "x=1"],
        ["--joints", "knee", "--effort", "q=-1"],
        ["--joints", "knee", "--motor", "x"],
        ["--joints", "knee", "--code", "fortran"],
    ):
        done = run(str(knee), "--out", str(tmp_path), *words)
        assert done.exit_code == 1, words
        assert len(done.stderr.strip().splitlines()) == 1
