"""Maps over inputs, tip coordinates and joints: cells are what classify and closed forms say."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest
import xarray as xr
from conftest import Tolerances, assert_close
from oracle.reference_cells import ReferenceCells

import closedchain as cc
from closedchain.analysis.singularity.maps.anchor import anchor_of
from closedchain.analysis.singularity.maps.grid import (
    JOINT_LIMIT,
    NONE_FOUND,
    NOT_CONVERGED,
    OK,
    OTHER_BRANCH,
    STATUSES,
    UNSEEN,
    grid_of,
)
from closedchain.analysis.singularity.measures_table import MEASURES
from closedchain.robots import linear_delta as ld
from closedchain.robots import rpa3t
from closedchain.robots.d1 import forward, geometry

KINDS = ("direct", "inverse", "constraint")


def cells(found: xr.Dataset, status: int = OK, number: int = 6) -> list[tuple[int, ...]]:
    """Some cells of a status, spread over the map."""
    every = np.argwhere(found["status"].to_numpy() == status)
    picked = np.random.default_rng(0).permutation(len(every))[:number]
    return [tuple(int(i) for i in every[k]) for k in picked]


def check_cells(m: cc.Mechanism, found: xr.Dataset, outputs: str | None, tol: Tolerances) -> None:
    """Postures close at their coordinates; measures are those of classify and velocity."""
    chart = grid_of(
        m, {n: found[n].to_numpy() for n in found["status"].dims}, outputs=outputs
    ).chart
    picked = cells(found)
    assert picked
    for cell in picked:
        at = found.isel(dict(zip(found["status"].dims, cell, strict=True)))
        q = at["q"].to_numpy()
        assert np.abs(cc.residual(m, q)).max() < tol.closure
        assert float(at["residual"]) < tol.closure
        wanted = [float(at[n]) for n in found["status"].dims]
        if "tilt" not in found.coords or float(at["tilt"]) > 0.0:
            assert_close(chart.values(q), np.array(wanted), 1e-10)
        is_ = cc.classify(m, q, outputs)
        for kind in KINDS:
            assert_close(at[f"sigma_{kind}"], getattr(is_, f"sigma_{kind}"), 1e-11)
        for kind in ("direct", "inverse"):
            exact = getattr(is_, f"det_{kind}")
            if kind in is_.kinds and exact is not None:
                assert abs(float(at[f"det_{kind}"])) < 1e-8
            elif exact is not None:
                assert abs(float(at[f"det_{kind}"])) == pytest.approx(abs(exact), rel=1e-9)
        twists = cc.velocity(m, q, outputs).twist_map
        assert twists is not None
        unit = np.array([m.length if n in "xyz" else 1.0 for n in is_.outputs])
        unitless = twists / unit[:, None] * m.column_scale[m.input_v]
        if not is_.kinds and len(is_.outputs) <= len(m.inputs):
            assert float(at["condition"]) == pytest.approx(np.linalg.cond(unitless), rel=1e-7)


def test_input_map_is_what_direct_reaches(d1: cc.Mechanism, tol: Tolerances) -> None:
    """The slice of the branch is star-shaped about home: straight ways reach the same cells."""
    home = d1.input_values(d1.home)
    axes = {n: np.linspace(home[i] - 0.09, home[i] + 0.09, 13) for i, n in enumerate(("q1", "q2"))}
    found = cc.singularity_map(d1, axes, progress=False, keep_q=True)
    status = found["status"].to_numpy()
    for cell in np.ndindex(status.shape):
        target = np.array([axes["q1"][cell[0]], axes["q2"][cell[1]], *home[2:]])
        reached = cc.direct(d1, target, guess=d1.home)
        assert (status[cell] == OK) == reached.converged
        if reached.converged:
            assert_close(found["q"].to_numpy()[cell], reached.q, 1e-9)
    assert set(np.unique(status)) <= {OK, OTHER_BRANCH, NONE_FOUND}
    check_cells(d1, found, None, tol)


def test_cells_are_assemblies_of_the_closed_form(d1: cc.Mechanism) -> None:
    """A posture that is ok is one of those that elimination finds for its inputs."""
    home = d1.input_values(d1.home)
    axes = {n: np.linspace(home[i] - 0.2, home[i] + 0.2, 9) for i, n in enumerate(("q4", "q5"), 3)}
    found = cc.singularity_map(d1, axes, progress=False, keep_q=True)
    for cell in cells(found):
        q = found["q"].to_numpy()[cell]
        place = d1.pose(q, "platform").translation
        assemblies = forward(d1.input_values(q), geometry()).assemblies
        assert min(np.linalg.norm(a.platform.position - place) for a in assemblies) < 1e-9


@pytest.mark.parametrize(
    ("robot", "over", "at"),
    [
        ("d1", {"q1": np.linspace(0.45, 0.6, 11), "q2": np.linspace(0.45, 0.6, 9)}, None),
        ("rpa3t", {"theta1": np.linspace(-0.4, -0.3, 7)}, None),
        ("linear_delta", {"x": np.linspace(-0.4, 0.4, 7), "y": np.linspace(-0.4, 0.4, 6)}, None),
        ("eclipse", {"tilt": np.linspace(0, 1.4, 6), "azimuth": np.linspace(-3, 3, 5)}, None),
    ],
)
@pytest.mark.slow
def test_a_slow_second_implementation_agrees(
    robot: str, over: Mapping[str, np.ndarray], at: Mapping[str, float] | None
) -> None:
    m = cc.load(robot)
    found = cc.singularity_map(m, over, at, progress=False, keep_q=True)
    grid = grid_of(m, over, at)
    cells_, anchor = ReferenceCells(grid.chart), anchor_of(grid)
    values = np.stack(np.meshgrid(*grid.values, indexing="ij"), axis=-1)
    status, q = np.full(grid.shape, UNSEEN, dtype=np.int8), np.zeros((*grid.shape, m.model.nq))
    q[anchor.cell] = anchor.q
    seed = np.array([np.ravel_multi_index(anchor.cell, grid.shape)])
    cells_.spread(values, status, q, seed, OK)
    inside = found["status"].to_numpy() == OK
    assert np.array_equal(inside, status == OK)
    expected = cells_.measures(q[inside], m.outputs())
    assert list(found.data_vars) == [
        "status",
        "joined",
        *(n for n in MEASURES if n in expected),
        "q",
    ]
    assert_close(found["q"].to_numpy()[inside], q[inside], 1e-10)
    for name in ("sigma_direct", "sigma_inverse", "sigma_constraint", "residual"):
        assert_close(found[name].to_numpy()[inside], expected[name], 1e-10)
    for name in {"det_direct", "det_inverse"} & set(found.data_vars):
        one, two = found[name].to_numpy()[inside], expected[name]
        assert_close(one, two, 1e-10 * float(np.abs(two).max()))
    regular = expected["condition"] < 1e6
    ratio = found["condition"].to_numpy()[inside][regular] / expected["condition"][regular]
    assert_close(ratio, np.ones(ratio.size), 1e-8)


def test_workspace_of_the_linear_delta(tol: Tolerances) -> None:
    """Reachable where every rod can bridge its way to the rail; slices are star-shaped."""
    m, g = cc.load("linear_delta"), ld.Geometry()
    axis = np.linspace(-0.5, 0.5, 15)
    found = cc.singularity_map(m, {"x": axis, "y": axis}, progress=False, keep_q=True)
    x, y = np.meshgrid(axis, axis, indexing="ij")
    places = np.stack([x, y, np.full_like(x, m.point(m.home, "P")[2])], axis=-1)
    bridged = (ld.margins(places, g) > 0.0).all(axis=-1)
    assert np.array_equal(found["status"].to_numpy() == OK, bridged)
    assert set(np.unique(found["status"].to_numpy())) == {OK, NONE_FOUND}
    check_cells(m, found, None, tol)
    # [K; J] keeps its sign where all outputs are prescribed: the branch ends where it vanishes
    assert float(found["det_inverse"].min()) > 0.0
    for cell in cells(found):
        q = found["q"].to_numpy()[cell]
        drops = ld.inverse_factors(ld.rods(places[cell], m.input_values(q), g))
        assert (drops < 0.0).all() or (drops > 0.0).all()  # same-side mode, no direct singularity


def test_workspace_of_rpa3t(tol: Tolerances) -> None:
    """Cells are on the working mode of home, with the inverse solution's input values."""
    m = cc.load("rpa3t")
    g = rpa3t.Geometry()
    p = m.point(m.home, "P")
    over = {"x": p[0] + np.linspace(-0.1, 0.1, 7), "y": p[1] + np.linspace(-0.1, 0.1, 9)}
    found = cc.singularity_map(m, over, progress=False, keep_q=True)
    check_cells(m, found, None, tol)
    for cell in cells(found):
        q = found["q"].to_numpy()[cell]
        theta = rpa3t.inverse(m.point(q, "P"), g).theta.reshape(-1, 3)
        off = np.abs((theta - m.input_values(q) + np.pi) % (2 * np.pi) - np.pi).max(axis=1)
        assert np.nanmin(off) < 1e-9


def test_upright_eclipse_is_not_singular(tol: Tolerances) -> None:
    """Tilt and azimuth fail at tilt 0, the robot does not; its type-2 tilts are where they are."""
    m = cc.load("eclipse")
    tilt = np.radians(np.linspace(0.0, 80.0, 17))
    azimuth = np.radians(np.array([-180.0, -60.0, 0.0, 60.0, 90.0]))
    found = cc.singularity_map(m, {"tilt": tilt, "azimuth": azimuth}, progress=False, keep_q=True)
    assert (found["status"] == OK).all()
    for kind in KINDS:
        upright = found[f"sigma_{kind}"].to_numpy()[0]
        assert_close(upright, np.full(5, upright[0]), 1e-11)
    home = cc.classify(m, m.home)
    assert float(found["sigma_inverse"][0, 0]) == pytest.approx(home.sigma_inverse, rel=1e-9)
    assert home.sigma_inverse > 0.1
    check_cells(m, found, None, tol)
    # det K_p changes sign once on the way out; at the azimuths of the legs at one of three tilts
    sign = np.sign(found["det_direct"].to_numpy())
    exact = np.radians([48.1897, 69.9786, 48.1897, 69.9786, 54.0070])
    flips = [np.flatnonzero(np.diff(column)) for column in sign.T]
    for where, column in zip(flips, range(5), strict=True):
        assert len(where) == 1
        between = tilt[where[0]], tilt[where[0] + 1]
        options = [t for t in exact if between[0] <= t <= between[1]]
        assert options, (np.degrees(between), column)


def test_axis_task_of_d1(d1: cc.Mechanism, tol: Tolerances) -> None:
    """Five outputs leave one freedom: the first input that adds to them is held."""
    p = d1.point(d1.home, "T")
    over = {"x": p[0] + np.linspace(-0.1, 0.1, 7), "z": p[2] + np.linspace(-0.05, 0.05, 5)}
    found = cc.singularity_map(d1, over, outputs="x y z rx rz", progress=False, keep_q=True)
    assert (found["status"] == OK).all()
    assert found.attrs["held_q1"] == d1.input_values(d1.home)[0]
    assert (found.attrs["held_y"], found.attrs["held_y_units"]) == (p[1], "m")
    assert found.attrs["outputs"] == "x y z rx rz"
    assert "det_inverse" not in found  # five outputs of six freedoms: not square
    check_cells(d1, found, "x y z rx rz", tol)
    corner = found.isel(x=0, z=-1)["q"].to_numpy()
    assert_close(d1.point(corner, "T"), np.array([over["x"][0], p[1], over["z"][-1]]), 1e-11)
    assert_close(d1.pose(corner).rotation[:, 1], d1.pose(d1.home).rotation[:, 1], 1e-11)


def test_map_over_a_passive_joint(d1: cc.Mechanism, tol: Tolerances) -> None:
    over = {"passive1_P": np.linspace(-0.02, 0.02, 5) + d1.home[joint_q(d1, "passive1_P")]}
    found = cc.singularity_map(d1, over, progress=False, keep_q=True)
    assert found["passive1_P"].attrs == {"units": "m", "long_name": "joint passive1_P"}
    assert (found["status"] == OK).any()
    check_cells(d1, found, None, tol)


def joint_q(m: cc.Mechanism, name: str) -> int:
    return int(m.model.joints[m.model.getJointId(name)].idx_q)


def test_one_and_three_coordinates(d1: cc.Mechanism, tol: Tolerances) -> None:
    one = cc.singularity_map(d1, {"q4": np.linspace(0.5, 0.6, 11)}, progress=False)
    assert one["status"].dims == ("q4",)
    assert (one["status"] == OK).all()
    m = cc.load("linear_delta")
    axis = np.linspace(-0.15, 0.15, 4)
    over = {"x": axis, "y": axis, "z": axis - 0.6}
    three = cc.singularity_map(m, over, progress=False, keep_q=True, chunk={"z": 2})
    assert three["status"].shape == (4, 4, 4)
    check_cells(m, three, None, tol)
    flat = cc.singularity_map(m, {"x": axis, "y": axis}, {"z": over["z"][2]}, progress=False)
    for name in ("sigma_direct", "sigma_inverse", "condition"):
        assert_close(flat[name], three[name][:, :, 2], 1e-9)


@pytest.mark.slow
def test_six_coordinates(tol: Tolerances) -> None:
    m = cc.load("eclipse")
    home = m.pose(m.home).translation
    over = {n: home[i] + np.array([-0.005, 0.005]) for i, n in enumerate("xyz")}
    over |= {n: np.array([-0.05, 0.05]) for n in ("rx", "ry", "rz")}
    found = cc.singularity_map(m, over, progress=False, keep_q=True, chunk=1)
    assert found["status"].shape == (2,) * 6
    assert (found["status"] == OK).all()
    check_cells(m, found, None, tol)


def test_modes_are_branches_of_their_own(tol: Tolerances) -> None:
    m, g = cc.load("linear_delta"), ld.Geometry()
    axis = np.linspace(-0.1, 0.1, 5)
    maps = {
        mode: cc.singularity_map(m, {"x": axis, "y": axis}, mode=mode, progress=False, keep_q=True)
        for mode in ("+++", "++-")
    }
    for mode, found in maps.items():
        assert (found["status"] == OK).all()
        for cell in cells(found, number=4):
            q = found["q"].to_numpy()[cell]
            p = m.point(q, "P")
            sides = np.array([1 if sign == "+" else -1 for sign in mode])
            assert_close(m.input_values(q), ld.sliders(p, g, sides), 1e-9)
    assert float(maps["+++"]["sigma_direct"].min()) != float(maps["++-"]["sigma_direct"].min())
    held = cc.singularity_map(m, {"x": axis}, {"z": -0.5}, mode="++-", progress=False)
    assert held.attrs["held_z"] == -0.5


def test_statuses_tell_why_there_is_no_posture() -> None:
    m = cc.load("linear_delta")
    lower, upper = (float(limit[m.input_q[0]]) for limit in m.limits)
    z = np.linspace(lower - 1.5, upper + 0.5, 41)
    found = cc.singularity_map(m, {"z": z}, progress=False)
    status = found["status"].to_numpy()
    assert (status == JOINT_LIMIT).sum() == 2  # walls on both sides of the branch
    inside = np.flatnonzero(status == OK)
    assert np.array_equal(inside, np.arange(inside[0], inside[-1] + 1))
    assert not (status == NOT_CONVERGED).any()
    assert found["status"].attrs["flag_values"] == list(range(len(STATUSES)))
    names = found["status"].attrs["flag_meanings"].split()
    assert names[:5] == ["ok", "none_found", "other_branch", "joint_limit", "not_converged"]
    assert names[5:] == ["behind_a_limit"]


def test_measures_are_missing_exactly_where_a_cell_is_not_ok(d1: cc.Mechanism) -> None:
    home = d1.input_values(d1.home)
    over = {"q1": home[0] + np.linspace(-0.1, 0.1, 9), "q2": home[1] + np.linspace(-0.1, 0.1, 9)}
    found = cc.singularity_map(d1, over, progress=False, keep_q=True)
    ok = found["status"].to_numpy() == OK
    assert 0 < ok.sum() < ok.size
    for name in set(found.data_vars) - {"status", "joined", "q"}:
        assert np.array_equal(np.isnan(found[name].to_numpy()), ~ok), name
    assert np.array_equal(np.isnan(found["q"].to_numpy()).all(axis=-1), ~ok)


def test_a_map_says_what_it_is_a_map_of(d1: cc.Mechanism) -> None:
    found = cc.singularity_map(
        d1, {"q1": [0.51, 0.52]}, {"q5": 0.53}, outputs="x y z", progress=False
    )
    assert found["q1"].attrs == {"units": "m", "long_name": "input q1"}
    assert found["condition"].attrs["units"] == "1"
    for name, value in {
        "mechanism": "d1",
        "outputs": "x y z",
        "characteristic_length": d1.length,
        "parameter_radius_S": 0.1,
        "held_q5": 0.53,
        "held_q5_units": "m",
        "closedchain_version": cc.__version__,
    }.items():
        assert found.attrs[name] == value
    assert {"pinocchio_version", "numpy_version"} <= set(found.attrs)
    eclipse = cc.load("eclipse")
    tip = cc.singularity_map(eclipse, {"tilt": [0.1, 0.2]}, progress=False)
    assert tip["tilt"].attrs == {"units": "rad", "long_name": "tip tilt"}
