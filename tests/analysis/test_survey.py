"""Surveys of other robots than D1: slices, ranges, files, and what is refused before any work."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import closedchain as cc
from closedchain.analysis.figures.drawing import draw_survey
from closedchain.analysis.survey.plan import Wanted, axes_of_slice, default_slices
from closedchain.analysis.survey.results_folder import read_results, write_survey
from closedchain.analysis.survey.surveying import Survey, survey

CURVES = ("direct", "inverse", "combined")


@pytest.fixture(scope="module")
def plane(delta: cc.Mechanism) -> Survey:
    ranges = {"x": (-0.4, -0.2), "y": (-0.1, 0.1)}  # a piece of the boundary
    return survey(delta, [("x", "y")], ranges=ranges, resolution=7, kinds=CURVES)


@pytest.fixture(scope="module")
def volume(delta: cc.Mechanism) -> Survey:
    ranges = {"x": (-0.4, 0.4), "y": (-0.4, 0.4), "z": (-0.7, -0.5)}
    return survey(delta, [("x", "y", "z")], ranges=ranges, resolution=7, kinds=("inverse",))


def test_default_slices() -> None:
    d1, delta = cc.load("d1"), cc.load("linear_delta")
    assert default_slices(d1, d1.outputs(None)) == [
        ("q1", "q2"),
        ("q4", "q5"),
        ("x", "y"),
        ("tilt", "azimuth"),
    ]
    assert default_slices(delta, ("x", "y", "z")) == [("q1", "q2"), ("x", "y")]
    assert default_slices(d1, ("y", "rx", "rz"))[2:] == [("y",), ("tilt", "azimuth")]
    assert default_slices(d1, ("rx",))[2:] == [("rx",)]


def test_a_workspace_slice_has_its_boundary(delta: cc.Mechanism, plane: Survey) -> None:
    """Its points are inversely singular postures with the tip at the held height."""
    (part,) = plane.slices
    assert part.over == ("x", "y")
    assert part.name == "x_y"
    assert part.map.attrs["start"] == "home"
    x, y, _ = delta.pose(delta.home).translation
    assert (part.map.attrs["start_x"], part.map.attrs["start_y"]) == pytest.approx((x, y))
    found = part.inverse
    assert len(found.q) > 5
    for q, kinds in zip(found.q, found.kinds, strict=True):
        assert "inverse" in kinds
        assert delta.pose(q).translation[2] == pytest.approx(part.map.attrs["held_z"], abs=1e-11)
    assert len(part.direct.q) == 0
    row = plane.summary()[0]
    assert row["slice"] == "x x y"
    assert row["inverse points"] == len(found.q)
    assert sum(int(row[k]) for k in ("ok", "none found", "other branch", "joint limit")) == 49  # type: ignore[call-overload]


def test_ranges_are_fitted_to_a_narrow_branch() -> None:
    """The strip that rpa3t's first two inputs leave is much narrower than a radian."""
    m = cc.load("rpa3t")
    names = m.outputs(None)
    fitted = axes_of_slice(m, ("theta1", "theta2"), {}, Wanted(resolution=5), outputs=names)
    wide = axes_of_slice(m, ("theta1", "theta2"), {}, Wanted(resolution=5, span=1.0), outputs=names)
    home = m.input_values(m.home)
    for i, name in enumerate(("theta1", "theta2")):
        assert np.ptp(fitted[name]) < 0.7 * np.ptp(wide[name])
        assert fitted[name][0] < home[i] < fitted[name][-1]
    given = Wanted({"theta1": (-0.45, -0.25)}, {"theta1": 4}, 0.1)
    axes = axes_of_slice(m, ("theta1", "theta2"), {}, given, outputs=names)
    assert axes["theta1"].tolist() == np.linspace(-0.45, -0.25, 4).tolist()
    assert axes["theta2"].size == 101
    assert np.ptp(axes["theta2"]) == pytest.approx(0.2)


def test_held_coordinates_and_modes(delta: cc.Mechanism) -> None:
    """A held value goes to the slices that hold that coordinate."""
    found = survey(
        delta,
        [("q1", "q2"), ("x", "y")],
        at={"z": -0.65, "q3": -1.0},
        mode="---",
        span=0.05,
        resolution=3,
        kinds=("direct",),
    )
    first, second = found.slices
    assert first.map.attrs["held_q3"] == pytest.approx(-1.0)
    assert second.map.attrs["held_z"] == pytest.approx(-0.65)
    assert "held_q3" not in second.map.attrs
    assert bool((first.map["status"] == 0).all())
    other = survey(delta, [("x",)], mode="---", span=0.05, resolution=3, kinds=())
    assert other.slices[0].map.attrs["start"] == "mode ---"


def test_a_line(delta: cc.Mechanism) -> None:
    """Both ends of the posture's range in q1 are found to rounding on a coarse line."""
    found = survey(delta, [("q1",)], resolution=21, kinds=("inverse",))
    points = found.slices[0].inverse
    assert points.coordinates.shape == (len(points.q), 1)
    assert len(points.q) == 2
    for q in points.q:
        assert "inverse" in cc.classify(delta, q).kinds


def test_progress_names_the_slice(delta: cc.Mechanism) -> None:
    said: set[str] = set()
    survey(
        delta, [("x", "y")], span=0.1, resolution=3, kinds=(), progress=lambda w, d, n: said.add(w)
    )
    assert said
    assert all(what.startswith("x x y: ") for what in said)


def test_slices_that_cannot_be_followed_are_left_out_with_a_reason(d1: cc.Mechanism) -> None:
    """D1's home has lost a rotation, so no workspace slice starts there."""
    found = survey(d1, resolution=3, span=0.02, kinds=())
    assert [part.over for part in found.slices] == [("q1", "q2"), ("q4", "q5")]
    (note,) = found.notes
    assert note.startswith("no slice over x × y, nor tilt × azimuth: ")
    assert "singular" in note
    assert note in found.text
    with pytest.raises(cc.ClosureError, match="singular"):
        survey(d1, [("x", "y")], kinds=())


@pytest.mark.parametrize("which", ["plane", "volume"])
def test_what_is_written_is_read_and_drawn_again(
    which: str, request: pytest.FixtureRequest, tmp_path: Path
) -> None:
    found: Survey = request.getfixturevalue(which)
    paths = write_survey(found, tmp_path)
    again = read_results(tmp_path)
    assert again.title == found.title
    (before,), (after,) = found.slices, again.slices
    assert after.name == before.name
    xr.testing.assert_identical(after.map, before.map)
    for one, two in zip(before.sets, after.sets, strict=True):
        assert two.kind == one.kind
        assert two.kinds == one.kinds
        assert np.array_equal(two.coordinates, one.coordinates)
        assert np.array_equal(two.q, one.q)
        assert [p.tolist() for p in two.pieces] == [p.tolist() for p in one.pieces]
    draw_survey(again, tmp_path / "again.png")
    assert (tmp_path / "again.png").read_bytes() == paths["map.png"].read_bytes()
    with paths["singularities.csv"].open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == sum(len(s.q) for s in before.sets)
    for row in rows[:3]:
        q = np.array([float(row[f"q[{i}]"]) for i in range(found.mechanism.model.nq)])
        assert np.abs(cc.residual(found.mechanism, q)).max() < 1e-10
        place = found.mechanism.pose(q).translation
        assert float(row["x [m]"]) == pytest.approx(place[0], abs=1e-10)
        assert row["set"] in row["kinds"]


def test_a_volume_has_a_surface(volume: Survey) -> None:
    (found,) = volume.slices[0].sets
    (mesh,) = found.pieces
    assert mesh.shape[1] == 3
    assert max(found.sigmas[:, 1]) < 1e-8


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"slices": [("q1", "q9")]}, "unknown coordinate 'q9'"),
        ({"slices": [("q1", "q1")]}, "different coordinates"),
        ({"slices": [("q1", "q2", "q3", "x")]}, "one to three"),
        ({"slices": [("q1", "q2"), ("q2", "q1")]}, "asked for twice"),
        ({"slices": [("q1", "q2")], "at": {"q1": 0.0}}, "every slice varies it"),
        ({"at": {"q9": 0.0}}, "unknown coordinate 'q9'"),
        ({"kinds": ["direct", "odd"]}, "unknown kind of singularity 'odd'"),
        ({"mode": "+-"}, "unknown mode '\\+-'"),
        ({"resolution": 2}, "between 3 and 5000 points"),
        ({"span": 0.0}, "above zero"),
        ({"slices": [("q1",)], "ranges": {"q1": (0.2, 0.2)}}, "must rise"),
        ({"slices": [("q1",)], "ranges": {"q1": (0.0, float("nan"))}}, "finite"),
        ({"outputs": "x q"}, "unknown output 'q'"),
        ({"slices": [("x", "rx")]}, "rx"),
    ],
)
def test_bad_requests_are_refused(
    delta: cc.Mechanism, arguments: dict[str, object], message: str
) -> None:
    with pytest.raises(cc.ClosureError, match=message):
        survey(delta, **arguments)  # type: ignore[arg-type]


def test_folders_without_results_are_refused(tmp_path: Path, plane: Survey) -> None:
    with pytest.raises(cc.ClosureError, match="there is no folder"):
        read_results(tmp_path / "none")
    with pytest.raises(cc.ClosureError, match=r"holds no map\.nc"):
        read_results(tmp_path)
    (tmp_path / "map.nc").write_text("no netCDF")
    (tmp_path / "sets.nc").write_text("no netCDF")
    with pytest.raises(cc.ClosureError, match=r"map\.nc cannot be read"):
        read_results(tmp_path)
    write_survey(plane, tmp_path)
    whole = (tmp_path / "map.nc").read_bytes()
    (tmp_path / "map.nc").write_bytes(whole[: len(whole) // 3])
    with pytest.raises(cc.ClosureError, match=r"map\.nc cannot be read"):
        read_results(tmp_path)
    xr.Dataset({"a": ("b", [1.0])}).to_netcdf(tmp_path / "map.nc", engine="h5netcdf")
    with pytest.raises(cc.ClosureError, match="holds no maps"):
        read_results(tmp_path)
    odd = xr.DataTree.from_dict({"one": xr.Dataset({"a": ("b", [1.0])})})
    odd.to_netcdf(tmp_path / "map.nc", engine="h5netcdf")
    with pytest.raises(cc.ClosureError, match="one is no singularity map"):
        read_results(tmp_path)
    (tmp_path / "map.nc").write_bytes(whole)
    (tmp_path / "sets.nc").unlink()
    with pytest.raises(cc.ClosureError, match=r"holds no sets\.nc"):
        read_results(tmp_path)


def test_a_saved_map_is_read_from_its_store(delta: cc.Mechanism, tmp_path: Path) -> None:
    axis = np.linspace(-0.1, 0.1, 4)
    store = tmp_path / "map.zarr"
    kept = cc.singularity_map(delta, {"x": axis, "y": axis}, save=store, progress=False)
    (part,) = read_results(store).slices
    assert np.array_equal(part.map["sigma_direct"], kept["sigma_direct"])
    draw_survey(read_results(store), tmp_path / "map.svg")
    assert (tmp_path / "map.svg").stat().st_size > 10_000
    (store / "zarr.json").write_text("{}")
    with pytest.raises(cc.ClosureError, match="map"):
        read_results(store)


def test_names_that_files_would_take_for_paths_are_refused_before_any_work() -> None:
    text = cc.load("linear_delta").description.text
    slashed = cc.load_urdf(text.replace('"q1"', '"leg/q1"'))
    with pytest.raises(cc.ClosureError, match="'leg/q1' has a '/' in its name"):
        survey(slashed)


@pytest.mark.parametrize(("robot", "over"), [("delta", ("q1", "q2")), ("excavator", ("ry",))])
def test_default_ranges_reach_what_ends_in_them(robot: str, over: tuple[str, ...]) -> None:
    """A radian to either side shows neither a singular set nor an end: the range is widened."""
    m = cc.load(robot)
    names = m.outputs(None)
    span = Wanted(resolution=15, span=1.0)
    narrow = axes_of_slice(m, over, {}, span, outputs=names)
    wide = axes_of_slice(m, over, {}, Wanted(resolution=15), outputs=names)
    ended = []
    for axes in (narrow, wide):
        found = cc.singularity_map(m, axes, outputs=names, progress=False)
        ended.append(bool((found["status"] != 0).any()))
    assert ended == [False, True]
    for name in over:
        assert np.ptp(wide[name]) <= 2.0 * np.pi + 1e-9
