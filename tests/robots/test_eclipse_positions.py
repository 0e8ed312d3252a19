"""Eclipse and Eclipse-II: description and closed-form positions, each against the other."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from conftest import Reference
from eclipse_cases import LOWERED, load, of_mode, posture, random_poses
from numpy.testing import assert_allclose

import closedchain as cc
from closedchain.robots.eclipse import (
    ECLIPSE,
    ECLIPSE2,
    PHASES,
    Geometry,
    Mode,
    carriages,
    direct,
    inverse,
    joints_S,
    plate_points,
    plate_pose,
    trajectory,
    working_modes,
    wrist_angles,
)
from closedchain.robots.eclipse.davies import exact_joints

ROBOTS = pytest.mark.parametrize(("name", "g"), [("eclipse", ECLIPSE), ("eclipse2", ECLIPSE2)])
UP = Mode((-1, -1, -1), (1, 1, 1))
CM = np.array([1, 1, 1, 0.01, 0.01, 0.01])  # of the reference's inputs
CM2 = np.array([1, 1, 1, 1, 0.01, 0.01])


def geometry_of(entry: dict[str, Any]) -> Geometry:
    sizes = [entry[name] / 100 for name in ("r_g", "r", "a")]
    return Geometry(*sizes, z_c=entry["z_c"] / 100 if entry["variant"] == "II" else None)


# --- description ------------------------------------------------------------------------------


@ROBOTS
def test_home_and_named_points(name: str, g: Geometry) -> None:
    m = load(name)
    second = "beta_a" if name == "eclipse2" else "d_a"
    assert m.inputs == ("th_a", "th_b", "th_c", second, "d_b", "d_c")
    assert (m.model.nq, m.model.nv, m.rows, m.length) == (16, 15, 9, 0.1)
    assert np.abs(cc.residual(m, m.home)).max() < 1e-12
    inputs, q_r = of_mode(inverse([0.0, 0.0, 0.1], np.eye(3), g))
    assert_allclose(m.input_values(m.home), inputs, atol=1e-12)
    assert_allclose(m.home, posture(m, [0, 0, 0.1], np.eye(3), inputs, q_r), atol=1e-12)
    assert_allclose(m.point(m.home, "P"), [0, 0, 0.1], atol=1e-12)
    hinges, _, _ = carriages(inputs, g)
    for leg, phase, hinge in zip("abc", PHASES, hinges, strict=True):
        s = 0.1 * np.array([np.cos(phase), np.sin(phase), 1.0])
        assert_allclose(m.point(m.home, f"S{leg}"), s, atol=1e-12)
        assert_allclose(m.point(m.home, f"{leg}_tip"), s, atol=1e-12)
        assert_allclose(m.point(m.home, f"R{leg}"), hinge, atol=1e-12)


@pytest.mark.parametrize(("name", "prismatic"), [("eclipse", 3), ("eclipse2", 2)])
def test_mobility_is_six(name: str, prismatic: int) -> None:
    """11 bodies, 12 pairs, 18 freedoms; also where both guides' axes meet in the centre."""
    for sizes in ({}, {"z_c": 0.05}) if name == "eclipse2" else ({},):
        count = cc.mobility(load(name, **sizes))
        assert (count.links, count.pairs, count.freedoms) == (11, 12, 18)
        assert (count.gruebler, count.mobility, count.redundant_rows) == (6, 6, 0)
        assert count.pair_counts == {"P": prismatic, "R": 9 - prismatic, "S": 3}


@pytest.mark.parametrize(
    ("name", "sizes", "words"),
    [
        ("eclipse", {"r": -0.1}, "parameter r = -0.1 must be positive"),
        ("eclipse", {"a": 0}, "parameter a = 0 must be positive"),
        ("eclipse2", {"r_g": -1.0}, "parameter r_g = -1.0 must be positive"),
        ("eclipse", {"a": 0.5}, "closures a_S, b_S, c_S: the link r = 0.2"),
        ("eclipse2", {"r": 0.05}, "closures b_S, c_S: the link r = 0.05"),
        ("eclipse2", {"z_c": 2.0}, "closure a_S: height and z_c"),
        ("eclipse", {"height": 3.0}, "a_Pv"),
        ("eclipse", {"radius": 0.2}, "r_g"),
        ("eclipse", {"r": float("nan")}, "'r'"),
    ],
)
def test_bad_parameters(name: str, sizes: dict[str, float], words: str) -> None:
    with pytest.raises(cc.DescriptionError, match=words):
        cc.load(name, **sizes)


@pytest.mark.parametrize(
    ("sizes", "words"),
    [({"r": 0.0}, "'r' must be positive"), ({"z_c": float("inf")}, "'z_c' must be a finite")],
)
def test_bad_geometry(sizes: dict[str, float], words: str) -> None:
    with pytest.raises(cc.DescriptionError, match=words):
        Geometry(**sizes)


def test_arguments_of_the_wrong_shape_are_refused() -> None:
    with pytest.raises(ValueError, match="position"):
        inverse([0.0, 0.1], np.eye(3), ECLIPSE)
    with pytest.raises(ValueError, match="six finite inputs"):
        direct([0.0, np.nan, 0, 0, 0, 0], ECLIPSE)
    with pytest.raises(ValueError, match="not a batch"):
        direct(np.zeros((2, 6)), ECLIPSE)


@ROBOTS
def test_other_sizes_close(name: str, g: Geometry) -> None:
    m = cc.load(name, r_g=0.3, r=0.25, a=0.12, height=0.15)
    big = Geometry(0.3, 0.25, 0.12, z_c=g.z_c)
    inputs, _ = of_mode(inverse([0.0, 0.0, 0.15], np.eye(3), big))
    assert_allclose(m.input_values(m.home), inputs, atol=1e-12)


def test_arc_lengths() -> None:
    """The paper's L is an arc: home's beta_a is L_a = 39.8965473257 cm."""
    inputs, _ = of_mode(inverse([0.0, 0.0, 0.1], np.eye(3), ECLIPSE2))
    assert_allclose(ECLIPSE2.arc_length(inputs[3]), 0.398965473257, atol=1e-12)
    assert_allclose(ECLIPSE2.arc_angle(ECLIPSE2.arc_length(inputs[:3])), inputs[:3], atol=1e-15)


# --- inverse problem --------------------------------------------------------------------------


def test_poses_of_the_reference(reference: Reference, tol: Any) -> None:
    ref = reference("eclipse")
    for entry in ref["poses"] + ref["singularities"]:
        g = geometry_of(entry)
        q = tuple(entry.get("branch", {}).get("s_q", (1, 1, 1)))
        inputs, q_r = of_mode(
            inverse(np.array(entry["P"]) / 100, entry["R"], g), Mode(q, (1, 1, 1))
        )
        scale = CM if g.z_c is None else CM2
        assert_allclose(inputs, np.array(entry["actuated_natural"]) * scale, atol=tol.reference)
        assert_allclose(q_r, [leg[2] for leg in entry["q"]], atol=tol.reference)
        if "sph" not in entry.get("branch", {}):
            wrist = wrist_angles(inputs, q_r, entry["R"], g)
            assert_allclose(wrist, [leg[3:] for leg in entry["q"]], atol=tol.reference)


@ROBOTS
def test_closed_forms_close_the_mechanism(name: str, g: Geometry) -> None:
    """1000 random poses, every working mode: the closures of the description hold."""
    m = load(name)
    position, rotation = random_poses(1000, seed=1)
    found = inverse(position, rotation, g)
    assert found.exists.all()
    assert_allclose(
        joints_S(found.inputs, found.q_r, g),
        np.repeat(plate_points(position, rotation, g)[:, None], len(found.modes), axis=1),
        atol=1e-14,
    )
    worst = 0.0
    for i in range(1000):
        for k in range(len(found.modes)):
            q = posture(m, position[i], rotation[i], found.inputs[i, k], found.q_r[i, k])
            worst = max(worst, float(np.abs(cc.residual(m, q)).max()))
    assert worst < 1e-10


@pytest.mark.slow
@ROBOTS
def test_the_solver_finds_the_closed_form(name: str, g: Geometry) -> None:
    """1000 random poses from home: links stay lowered, as no mode changes without type 1."""
    m = load(name)
    position, rotation = random_poses(1000, seed=2)
    inputs, q_r = of_mode(inverse(position, rotation, g))
    for i in range(1000):
        found = cc.inverse(m, pin.SE3(rotation[i], position[i])).raise_if_failed()
        expected = posture(m, position[i], rotation[i], inputs[i], q_r[i])
        assert np.abs(pin.difference(m.model, expected, found.q)).max() < 1e-10


@ROBOTS
def test_the_solver_stays_in_every_working_mode(name: str, g: Geometry) -> None:
    m = load(name)
    position, rotation = random_poses(6, seed=3)
    found = inverse(position, rotation, g)
    for k, mode in enumerate(found.modes):
        inputs, q_r = of_mode(inverse([0.0, 0.0, 0.1], np.eye(3), g), mode)
        start = posture(m, [0, 0, 0.1], np.eye(3), inputs, q_r)
        for i in range(6):
            s = cc.inverse(m, pin.SE3(rotation[i], position[i]), guess=start).raise_if_failed()
            turns = (m.input_values(s.q) - found.inputs[i, k]) / (2 * np.pi)
            turns[3:] = np.where(g.arc, np.round(turns[3:]), 0.0)
            turns[:3] = np.round(turns[:3])
            expected = found.inputs[i, k] + 2 * np.pi * turns
            assert_allclose(m.input_values(s.q), expected, atol=1e-10, err_msg=mode.label)


def test_working_modes_and_their_labels() -> None:
    assert len(working_modes(ECLIPSE)) == 8
    assert len(working_modes(ECLIPSE2)) == 16
    assert len(working_modes(Geometry(r=0.25))) == 64
    assert working_modes(ECLIPSE2)[0] == LOWERED
    assert [mode.label for mode in working_modes(ECLIPSE)] == [
        "+++", "++-", "+-+", "+--", "-++", "-+-", "--+", "---",
    ]  # fmt: skip
    assert working_modes(ECLIPSE2)[-1].label == "---/-++"
    for g in (ECLIPSE, ECLIPSE2, Geometry(r=0.25), Geometry(r=0.15, z_c=0.05)):
        found = inverse([0.0, 0.01, 0.1], np.eye(3), g)
        rho = (plate_points([0.0, 0.01, 0.1], np.eye(3), g) * _u(found.inputs)).sum(axis=-1)
        for k in np.flatnonzero(found.exists):
            assert found.modes[k].q == tuple(np.sign(np.sin(found.q_r[k])))
            assert found.modes[k].rho == tuple(np.sign(rho[k]))


def _u(inputs: np.ndarray) -> np.ndarray:
    theta = inputs[..., :3]
    return np.stack([np.cos(theta), np.sin(theta), 0 * theta], axis=-1)


def test_a_column_beyond_the_axis_needs_a_long_link() -> None:
    """Two of the leg's four branches ask for r > r_g, and then only near the axis."""
    long = Geometry(r=0.25)
    near = inverse([-0.08, 0, 0.1], np.eye(3), long)  # S_a 20 mm from the axis
    far = inverse([0.0, 0, 0.1], np.eye(3), long)
    across = [mode.rho[0] < 0 and mode.rho[1:] == (1, 1) for mode in near.modes]
    assert near.exists[across].all()
    assert not far.exists[across].any()
    assert np.isfinite(far.inputs).all()


def test_the_arc_leg_has_every_carriage_point_twice() -> None:
    """(theta, beta, q) and (theta + pi, pi - beta, -q) put the hinge on the same point."""
    position, rotation = random_poses(50, seed=4)
    found = inverse(position, rotation, ECLIPSE2)
    hinge, _, _ = carriages(found.inputs, ECLIPSE2)
    for k, mode in enumerate(found.modes):
        twin = Mode((-mode.q[0], *mode.q[1:]), (-mode.rho[0], *mode.rho[1:]))
        assert_allclose(hinge[:, k], hinge[:, found.modes.index(twin)], atol=1e-14)


def test_out_of_reach_is_said() -> None:
    found = inverse([0.0, 0.0, 0.9], np.eye(3), ECLIPSE2)
    assert not found.exists.any()
    assert np.isfinite(found.inputs).all()
    assert inverse([0.0, 0.0, 0.9], np.eye(3), ECLIPSE).exists.all()  # columns have no end here
    assert not inverse([0.4, 0.0, 0.1], np.eye(3), ECLIPSE).exists.any()


# --- direct problem ---------------------------------------------------------------------------


def test_assemblies_of_the_reference(reference: Reference, tol: Any) -> None:
    for entry in reference("eclipse")["fk"]:
        found = direct(np.array(entry["actuated_natural"]) * CM, ECLIPSE)
        assert found.circles.complex_count == entry["degree"] == 16
        assert len(found.assemblies) == entry["n_real"] == len(entry["solutions"])
        for expected in entry["solutions"]:
            gaps = [
                max(
                    np.abs(one.position - np.array(expected["P"]) / 100).max(),
                    np.abs(one.rotation - expected["R"]).max(),
                    np.abs(one.q_r - expected["q_r"]).max(),
                )
                for one in found.assemblies
            ]
            assert min(gaps) < tol.reference


@ROBOTS
def test_every_assembly_is_an_inverse_solution(name: str, g: Geometry) -> None:
    """Random inputs: the planted pose is found; each assembly gives the inputs in its own mode."""
    m = load(name)
    position, rotation = random_poses(40, seed=5)
    found = inverse(position, rotation, g)
    counts = set()
    for i in range(40):
        k = i % len(found.modes)
        solved = direct(found.inputs[i, k], g)
        assert solved.circles.complex_count == 16
        counts.add(len(solved.assemblies))
        assert any(
            np.abs(one.position - position[i]).max() + np.abs(one.rotation - rotation[i]).max()
            < 1e-9
            for one in solved.assemblies
        )
        for one in solved.assemblies:
            q = posture(m, one.position, one.rotation, found.inputs[i, k], one.q_r)
            assert np.abs(cc.residual(m, q)).max() < 1e-10
            back, q_r = of_mode(inverse(one.position, one.rotation, g), one.mode)
            turns = np.mod(back - found.inputs[i, k] + np.pi, 2 * np.pi) - np.pi
            assert_allclose(turns, 0.0, atol=2e-7)  # a root of the rounding near sin q = 0
            assert_allclose(np.cos(q_r - one.q_r), 1.0, atol=1e-12)
    assert counts <= {2, 4, 6, 8, 10, 12, 14, 16}
    assert len(counts) > 1


@ROBOTS
def test_the_solver_finds_the_assembly_of_its_branch(name: str, g: Geometry) -> None:
    m = load(name)
    position, rotation = random_poses(40, seed=6)
    inputs, _ = of_mode(inverse(position, rotation, g))
    for x in inputs:
        near = m.input_values(m.home) + 0.3 * (x - m.input_values(m.home))
        s = cc.direct(m, near).raise_if_failed()
        pose = m.pose(s.q)
        gaps = [
            np.abs(one.position - pose.translation).max()
            + np.abs(one.rotation - pose.rotation).max()
            for one in direct(near, g).assemblies
        ]
        assert min(gaps) < 1e-10


def test_plate_pose_inverts_plate_points() -> None:
    position, rotation = random_poses(100, seed=7)
    p, rot = plate_pose(plate_points(position, rotation, ECLIPSE))
    assert_allclose(p, position, atol=1e-14)
    assert_allclose(rot, rotation, atol=1e-14)


# --- the trajectory of eq. (20) ----------------------------------------------------------------


def test_trajectory_starts_at_the_reference(reference: Reference, tol: Any) -> None:
    entry = reference("eclipse")["fk"][1]
    inputs, _ = of_mode(inverse(trajectory.position(0.0), trajectory.rotation(), ECLIPSE))
    assert_allclose(inputs, np.array(entry["actuated_natural"]) * CM, atol=tol.reference)
    assert trajectory.TIMES.size == 101  # 0 <= t <= 1 in steps of 0.01: not 100 points
    step = 1e-6
    for t in (0.1, 0.4, 0.77):
        slope = (trajectory.position(t + step) - trajectory.position(t - step)) / (2 * step)
        assert_allclose(trajectory.velocity(t), slope, atol=1e-9)


@ROBOTS
def test_trajectory_all_joints(name: str, g: Geometry, tol: Any) -> None:
    """The solver, step by step, against the closed form; every joint, links lowered and raised."""
    printed = 0.01 * np.array([[5, 0, 10], [4.330127018922193, 1.5, 11], [0, 3, 9], [-5, 0, 10]])
    assert_allclose(trajectory.position([0, 1 / 12, 1 / 4, 1 / 2]), printed, atol=1e-15)
    tilt = pin.rpy.rpyToMatrix(0.5, 0.0, 0.0)
    assert_allclose(trajectory.rotation(), tilt @ pin.rpy.rpyToMatrix(0.0, 0.0, 0.1), atol=1e-15)
    m = load(name)
    rotation = np.broadcast_to(trajectory.rotation(), (101, 3, 3))
    position = trajectory.position(trajectory.TIMES)
    found = inverse(position, rotation, g)
    assert found.exists.all()  # feasible in every working mode
    for mode in (LOWERED, UP):
        inputs, q_r = of_mode(found, mode)
        inputs = np.unwrap(inputs, axis=0)
        q = posture(m, position[0], rotation[0], inputs[0], q_r[0])
        for k in range(101):
            q = cc.inverse(m, pin.SE3(rotation[k], position[k]), guess=q).raise_if_failed().q
            expected = posture(m, position[k], rotation[k], inputs[k], q_r[k])
            assert np.abs(pin.difference(m.model, expected, q)).max() < tol.reference


def test_trajectory_ranges() -> None:
    """Arc lengths and heights in cm, links lowered; raised links would pass below the guide."""
    one, two = 100 * exact_joints(ECLIPSE), exact_joints(ECLIPSE2)
    arcs = 0.2 * np.stack([one[:, :, 0].min(axis=0), one[:, :, 0].max(axis=0)])
    assert_allclose(arcs.T, [[-4.634, 8.809], [33.729, 53.037], [-49.777, -29.173]], atol=6e-4)
    heights = np.stack([one[:, :, 1].min(axis=0), one[:, :, 1].max(axis=0)])
    assert_allclose(heights.T, [[23.116, 30.714], [26.872, 33.748], [19.031, 24.876]], atol=6e-4)
    beta = np.degrees(two[:, 0, 1])
    assert_allclose([beta.min(), beta.max()], [97.18, 137.48], atol=6e-3)
    assert_allclose(two[:, 1:], one[:, 1:] / 100, atol=1e-15)  # legs b and c are the same
    rotation = np.broadcast_to(trajectory.rotation(), (101, 3, 3))
    found = inverse(trajectory.position(trajectory.TIMES), rotation, ECLIPSE)
    raised = 100 * of_mode(found, UP)[0][:, 3:]
    assert_allclose([raised.min(), raised.max()], [-14.0, 0.14], atol=6e-2)


@ROBOTS
def test_trajectory_rates(name: str, g: Geometry) -> None:
    """Rates of the inputs by the velocity equation, against differences of the closed form."""
    m = load(name)
    rotation, h = trajectory.rotation(), 1e-5
    for t in (0.0, 0.23, 0.5, 0.81):
        around = trajectory.position(np.array([t - h, t, t + h]))
        inputs, q_r = of_mode(inverse(around, np.broadcast_to(rotation, (3, 3, 3)), g))
        rates = (inputs[2] - inputs[0]) / (2 * h)
        q = posture(m, around[1], rotation, inputs[1], q_r[1])
        twist = np.concatenate([trajectory.velocity(t), np.zeros(3)])
        v = cc.velocity(m, q)
        assert v.twist_map is not None
        assert_allclose(v.twist_map @ rates, twist, atol=2e-8)
