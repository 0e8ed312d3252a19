"""Maps, curves and the survey of D1: labels are honest, points lie on the sets, files open."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from conftest import Tolerances

import closedchain as cc
from closedchain.analysis.singularity.maps.grid import STATUSES
from closedchain.analysis.survey.results_folder import write_survey
from closedchain.analysis.survey.surveying import Survey, survey
from closedchain.robots.d1 import forward, geometry

RESOLUTION = 25


@pytest.fixture(scope="module")
def found(d1: cc.Mechanism) -> Survey:
    return survey(d1, resolution=RESOLUTION, kinds=("direct", "inverse", "combined"))


def test_cells_agree_with_the_closed_form(d1: cc.Mechanism, found: Survey) -> None:
    """A posture that is ok is one of the assemblies that elimination finds for its inputs."""
    part = found.slices[0]
    keys = part.over
    status = part.map["status"].to_numpy()
    kept = cc.singularity_map(
        d1, {k: part.map[k].to_numpy() for k in keys}, progress=False, keep_q=True
    )
    assert np.array_equal(kept["status"].to_numpy(), status)  # the same again
    geo = geometry()
    rng = np.random.default_rng(0)
    ok = np.argwhere(status == 0)
    for i, j in ok[rng.permutation(len(ok))[:6]]:
        q = kept["q"].to_numpy()[i, j]
        assemblies = forward(d1.input_values(q), geo).assemblies
        place = d1.pose(q, "platform").translation
        gaps = [np.linalg.norm(a.platform.position - place) for a in assemblies]
        assert min(gaps) < 1e-9


def test_measures_are_missing_exactly_where_the_status_is_not_ok(found: Survey) -> None:
    for part in found.slices:
        ok = part.map["status"].to_numpy() == 0
        for name in ("sigma_direct", "sigma_inverse", "det_direct", "det_inverse", "residual"):
            assert np.array_equal(np.isfinite(part.map[name].to_numpy()), ok)
        assert float(part.map["residual"].max()) < 1e-12
        assert float(part.map["sigma_direct"].min()) > 0.0
        signs = np.unique(np.sign(part.map["det_direct"].to_numpy()[ok]))
        assert signs.size == 1  # one branch: the sign never changes


def test_measures_are_those_of_classify(d1: cc.Mechanism, found: Survey) -> None:
    part = found.slices[0]
    centre = dict.fromkeys(part.over, RESOLUTION // 2)
    cell = part.map.isel(centre)
    here = cc.classify(d1, d1.home)
    for name in ("sigma_direct", "sigma_constraint", "det_direct"):
        assert float(cell[name]) == pytest.approx(getattr(here, name), rel=1e-9)


def test_points_lie_on_their_sets(d1: cc.Mechanism, found: Survey, tol: Tolerances) -> None:
    for part in found.slices:
        for curve in part.sets:
            for q, kinds in zip(curve.q, curve.kinds, strict=True):
                assert np.abs(cc.residual(d1, q)).max() < 1e-10
                wanted = {"direct", "inverse"} if curve.kind == "combined" else {curve.kind}
                assert wanted <= kinds
                held = [n for n in d1.inputs if n not in part.over]
                index = [d1.inputs.index(n) for n in held]
                home = d1.input_values(d1.home)
                assert np.allclose(d1.input_values(q)[index], home[index], atol=1e-15)
            if len(curve.q):
                column = {"direct": 0, "inverse": 1}.get(curve.kind)
                worst = curve.sigmas[:, column if column is not None else [0, 1]].max()
                assert worst < tol.singular


def test_inverse_curves_of_the_first_slice_are_three_symmetry_lines(
    d1: cc.Mechanism, found: Survey
) -> None:
    """One stage tilted along a symmetry direction loses a rotation: q1 = home, q2 = home, q1 = q2.

    They meet the end of the branch in six combined points.
    """
    h = d1.input_values(d1.home)[0]
    part = found.slices[0]
    x, y = part.inverse.coordinates.T
    off = np.min(np.abs([x - h, y - h, x - y]), axis=0)
    assert off.max() < 1e-7  # where the lines meet the measure is flat
    lines = np.argmin(np.abs([x - h, y - h, x - y]), axis=0)
    assert set(lines) == {0, 1, 2}
    assert len(part.combined.q) == 6


def test_second_slice_is_inversely_singular_everywhere(found: Survey) -> None:
    """With the coupler untilted the rotation about the base normal is lost wherever the tool is."""
    part = found.slices[1]
    assert part.inverse.everywhere
    assert float(part.map["sigma_inverse"].max()) < 1e-12
    assert "everywhere" in part.combined.note


def test_direct_curve_is_where_the_branch_ends(d1: cc.Mechanism, found: Survey) -> None:
    """A hair inside the curve the branch is there, a hair outside it is not."""
    part = found.slices[0]
    home = d1.input_values(d1.home)
    points = part.direct.coordinates[part.direct.on_branch]
    for point in points[:: max(1, len(points) // 5)]:
        towards = point - home[:2]
        inside, outside = (home[:2] + s * towards for s in (0.98, 1.02))
        assert cc.direct(d1, [*inside, *home[2:]]).converged
        refused = cc.direct(d1, [*outside, *home[2:]])
        assert not refused.converged
        assert "singularity" in refused.message


def test_axis_task_has_no_inverse_curve_and_says_why(d1: cc.Mechanism) -> None:
    axis = np.linspace(0.50, 0.54, 5)
    found = cc.singularity_set(d1, "inverse", {"q1": axis, "q2": axis}, outputs="x y z rx rz")
    assert len(found.q) == 0
    assert "no signed determinant" in found.note


def test_files_of_the_survey(d1: cc.Mechanism, found: Survey, tmp_path: Path) -> None:
    paths = write_survey(found, tmp_path / "new" / "folder")
    tree = xr.open_datatree(paths["map.nc"], engine="h5netcdf")
    assert set(tree.children) == {"q1_q2", "q4_q5"}
    assert tree["q1_q2"]["q1"].attrs["units"] == "m"
    assert tree["q1_q2"].attrs["parameter_radius_S"] == 0.1
    meanings = tree["q1_q2"]["status"].attrs["flag_meanings"].split()
    assert meanings == [*(s.replace(" ", "_") for s in STATUSES)]
    tree.close()
    with paths["singularities.csv"].open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == sum(len(c.q) for part in found.slices for c in part.sets)
    q = np.array([float(rows[0][f"q[{i}]"]) for i in range(d1.model.nq)])
    assert np.abs(cc.residual(d1, q)).max() < 1e-10
    assert paths["map.png"].read_bytes().startswith(b"\x89PNG")
    assert paths["map.png"].stat().st_size > 30_000


def test_summary_counts_every_cell(found: Survey) -> None:
    for row in found.summary():
        counted = sum(row[k] for k in STATUSES)  # type: ignore[misc]
        assert counted == row["cells"] == RESOLUTION**2
    assert "q1 +0.5774" in found.text
