"""The commands ``singularities`` and ``plot``: folders, pages, pictures, refusals in one line."""

from __future__ import annotations

import csv
import json
import re
import sys
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from commands import data, good, run

import closedchain as cc

SMALL = ["--resolution", "3", "--span", "0.02"]
LINE = ["singularities", "linear_delta", "--over", "q1=-0.2:-0.1", "--resolution", "3"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Results over one slice of the workspace, with a piece of its boundary."""
    out = tmp_path_factory.mktemp("results") / "new" / "folder"
    words = ["--over", "x=-0.4:-0.2:5", "--over", "y=-0.1:0.1", "--resolution", "4"]
    text = good("singularities", "linear_delta", *words, "--kind", "inverse", "--out", str(out))
    assert "x x y" in text
    for name in ("map.nc", "sets.nc", "singularities.csv", "map.png", "linear_delta.html"):
        assert (out / name).stat().st_size > 0
        assert str(out / name) in text
    return out


def test_a_slice_of_the_workspace(folder: Path) -> None:
    with xr.open_datatree(folder / "map.nc", engine="h5netcdf") as tree:
        found = tree["x_y"].to_dataset()
        assert dict(found.sizes) == {"x": 5, "y": 4}
        assert found["x"].attrs["units"] == "m"
    with (folder / "singularities.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert rows
    assert {row["set"] for row in rows} == {"inverse"}
    assert all(-0.4 <= float(row["x [m]"]) <= -0.2 for row in rows)
    page = (folder / "linear_delta.html").read_text()
    assert "inverse singularities, x × y" in page
    (told,) = re.findall(r'id="instrument">(.*?)</script>', page, re.S)
    (series,) = json.loads(told)["series"]
    m = cc.load("linear_delta")
    for q, point in zip(series["q"], series["points"], strict=True):
        assert np.allclose(m.pose(np.array(q)).translation, point)
        assert cc.classify(m, q).sigma_inverse < 1e-8


def test_plot_draws_again(folder: Path, tmp_path: Path) -> None:
    first = (folder / "map.png").read_bytes()
    assert good("plot", str(folder)) == f"{folder / 'map.png'}\n"
    assert (folder / "map.png").read_bytes() == first
    assert good("plot", str(folder), "--format", "svg") == f"{folder / 'map.svg'}\n"
    assert (folder / "map.svg").read_text().startswith("<?xml")
    out = tmp_path / "condition.pdf"
    good("plot", str(folder), "--measure", "condition", "--dpi", "40", "--out", str(out))
    assert out.read_bytes().startswith(b"%PDF")
    measures = ["--measure", "det_direct", "--measure", "det_inverse"]
    good("plot", str(folder), *measures, "--out", str(tmp_path / "det.png"))
    assert (tmp_path / "det.png").read_bytes() != first


PLOT_BAD = {
    "no such folder": (["plot", "none"], "there is no folder none"),
    "unknown format": (["plot", "FOLDER", "--format", "gif"], "unknown format 'gif'"),
    "ending that is none": (["plot", "FOLDER", "--out", "map.gif"], ".png, .svg or .pdf"),
    "two formats": (["plot", "FOLDER", "--out", "a.png", "--format", "svg"], "do not agree"),
    "unknown measure": (["plot", "FOLDER", "--measure", "s"], "unknown measure 's'"),
    "nowhere to write": (["plot", "FOLDER", "--out", "/none/a.png"], "/none/a.png"),
}


@pytest.mark.parametrize("what", PLOT_BAD)
def test_what_plot_refuses(what: str, folder: Path) -> None:
    words, expected = PLOT_BAD[what]
    refused([str(folder) if word == "FOLDER" else word for word in words], expected)


def test_plot_of_a_folder_that_is_none_of_ours(tmp_path: Path) -> None:
    refused(["plot", str(tmp_path)], "holds no map.nc")
    (tmp_path / "map.nc").write_text("no netCDF")
    refused(["plot", str(tmp_path)], "map.nc cannot be read")


def test_lines_and_volumes(tmp_path: Path) -> None:
    found = data(*LINE, "--out", str(tmp_path / "line"))
    assert found["summary"][0]["slice"] == "q1"
    assert found["summary"][0]["ok"] == 3
    assert found["files"]["map.nc"] == str(tmp_path / "line" / "map.nc")
    over = [w for n in ("q1", "q2", "q3") for w in ("--over", n)]
    words = ["singularities", "linear_delta", *over, *SMALL, "--kind", "direct"]
    found = data(*words, "--out", str(tmp_path / "volume"))
    assert (found["summary"][0]["slice"], found["summary"][0]["cells"]) == ("q1 x q2 x q3", 27)
    assert "box: q1 × q2 × q3" in (tmp_path / "volume" / "linear_delta.html").read_text()


def test_slices_held_values_kinds_and_outputs(tmp_path: Path) -> None:
    over = [w for n in ("q1", "q2", "q4", "q5") for w in ("--over", n)]
    words = ["singularities", "d1", *over, *SMALL, "--at", "q3=0.523", "--workers", "1"]
    kinds = ["--kind", "inverse", "--kind", "direct"]
    found = data(*words, *kinds, "--outputs", "x y z rx rz", "--out", str(tmp_path))
    assert [row["slice"] for row in found["summary"]] == ["q1 x q2", "q4 x q5"]
    assert {"direct points", "inverse points"} <= set(found["summary"][0])
    assert "combined points" not in found["summary"][0]
    with xr.open_datatree(tmp_path / "map.nc", engine="h5netcdf") as tree:
        assert tree["q4_q5"].attrs["held_q3"] == pytest.approx(0.523)
        assert tree["q1_q2"].attrs["outputs"] == "x y z rx rz"


def test_a_mode(tmp_path: Path) -> None:
    words = ["singularities", "linear_delta", "--over", "x", *SMALL, "--mode", "---"]
    data(*words, "--kind", "direct", "--out", str(tmp_path))
    with xr.open_datatree(tmp_path / "map.nc", engine="h5netcdf") as tree:
        assert tree["x"].attrs["start"] == "mode ---"


@pytest.mark.slow
def test_by_default_d1_has_two_slices_and_says_why_no_more(tmp_path: Path) -> None:
    text = good("singularities", "d1", "--out", str(tmp_path), *SMALL)
    assert "q1 x q2" in text
    assert "q4 x q5" in text
    assert "no slice over x × y, nor tilt × azimuth" in text


def test_a_robot_of_ones_own(tmp_path: Path) -> None:
    """A five-bar linkage in a file: two cranks, two rods, the joint of the rods is the tip."""
    limit = '<limit lower="-7" upper="7" effort="1" velocity="1"/>'

    def joint(name: str, parent: str, child: str, x: float) -> str:
        return f"""<joint name="{name}" type="revolute"><parent link="{parent}"/>
          <child link="{child}"/><origin xyz="{x} 0 0"/><axis xyz="0 0 1"/>{limit}</joint>"""

    path = tmp_path / "five_bar.urdf"
    path.write_text(
        f"""<robot name="five bar"><link name="base"/><link name="a"/><link name="b"/>
        <link name="c"/><link name="d"/><link name="tip"/>
        {joint("a1", "base", "a", -0.1)}{joint("b1", "base", "b", 0.1)}
        {joint("a2", "a", "c", 0.2)}{joint("b2", "b", "d", 0.2)}
        <joint name="end" type="fixed"><parent link="c"/><child link="tip"/>
          <origin xyz="0.25 0 0"/></joint>
        <constraint name="pin" type="revolute"><parent link="tip"/>
          <parent_axis xyz="0 0 1"/><child link="d"/><child_origin xyz="0.25 0 0"/></constraint>
        <transmission name="left"><joint name="a1"/></transmission>
        <transmission name="right"><joint name="b1"/></transmission>
        <task base="base" tip="tip" outputs="x y"/>
        <group_state name="home"><joint name="a1" value="1.9"/><joint name="b1" value="1.24"/>
          <joint name="a2" value="-1.0"/><joint name="b2" value="1.0"/></group_state></robot>"""
    )
    out = tmp_path / "out"
    words = ["singularities", str(path), *SMALL, "--kind", "direct", "--out", str(out)]
    found = data(*words)
    assert [row["slice"] for row in found["summary"]] == ["left x right", "x x y"]
    assert all(row["ok"] == 9 for row in found["summary"])
    assert (out / "five_bar.html").exists()


def refused(words: list[str], expected: str) -> None:
    done = run(*words)
    assert done.exit_code == 1
    assert done.stdout == ""
    assert len(done.stderr.splitlines()) == 1
    assert done.stderr.startswith("closedchain: ")
    assert expected in done.stderr


BAD = {
    "unknown coordinate": (["--over", "p"], "--over: unknown coordinate 'p'"),
    "the same twice": (["--over", "q1", "--over", "q1"], "different coordinates"),
    "five of them": ([w for n in "12345" for w in ("--over", f"q{n}")], "got 5: q1 q2"),
    "a range that falls": (["--over", "q1=1:0"], "below"),
    "a range of one number": (["--over", "q1=1"], "lo:hi"),
    "a range without numbers": (["--over", "q1=a:b"], "'a'"),
    "points that are none": (["--over", "q1=0:1:-3"], "number of points"),
    "too few points": (["--over", "q1=0.5:0.53:2"], "between 3 and 5000"),
    "two ranges": (["--over", "q1=0.5:1", "--over", "q1=0.5:2"], "two ranges"),
    "a range beyond the limits": (["--over", "q1=-3:-2"], "limits"),
    "a negative tilt": (["--over", "tilt=-1:1", "--outputs", "x y z rx rz"], "0 to pi"),
    "no output": (["--over", "ry", "--outputs", "x y z rx rz"], "ry"),
    "a singular start": (["--over", "x"], "singular"),
    "held and varied": (["--over", "q1", "--over", "q2", "--at", "q1=0.5"], "varies q1"),
    "held, unknown": (["--at", "q7=0.5"], "--at: unknown coordinate 'q7'"),
    "held, no number": (["--at", "q1=x"], "not a finite number"),
    "held, out of reach": (["--over", "q1", "--at", "q2=9"], "out of reach"),
    "unknown kind": (["--kind", "odd"], "unknown kind of singularity 'odd'"),
    "unknown mode": (["--over", "q1", "--mode", "up"], "unknown mode 'up'"),
    "no width": (["--span", "0"], "above zero"),
    "unknown output": (["--outputs", "x q"], "unknown output 'q'"),
}


@pytest.mark.parametrize("what", BAD)
def test_bad_words_give_one_line(what: str, tmp_path: Path) -> None:
    words, expected = BAD[what]
    refused(["singularities", "d1", *words, "--out", str(tmp_path)], expected)
    assert not list(tmp_path.iterdir())


def test_a_file_for_a_folder() -> None:
    refused([*LINE, "--out", sys.executable], "is a file; results need a folder")


def test_measures_of_forces_by_name(tmp_path: Path) -> None:
    more = ["--measure", "isotropy", "--measure", "least_stiffness=1e5", "--kind", "direct"]
    good(*LINE, *more, "--out", str(tmp_path))
    with xr.open_datatree(tmp_path / "map.nc", engine="h5netcdf") as tree:
        found = tree["q1"].to_dataset()
        assert found["isotropy"].shape == (3,)
        assert found["least_stiffness"].attrs["units"] == "N/m"
    good("plot", str(tmp_path), "--measure", "isotropy", "--out", str(tmp_path / "one.png"))
    for wrong, match in (
        ("speed", "unknown measure"),
        ("largest_compliance", "needs the stiffness"),
        ("isotropy=2", "takes no numbers"),
        ("least_stiffness=soft", "not a finite number"),
    ):
        done = run(*LINE, "--measure", wrong, "--out", str(tmp_path / "none"))
        assert done.exit_code == 1
        assert match in done.stderr
        assert len(done.stderr.strip().splitlines()) == 1
