"""rpa3t as a mechanism: closure against closed forms, mobility with redundant rows, velocity."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from conftest import assert_close
from rpa3t_postures import BOX, DEFAULT, WIDE, G, configuration, near, sample

import closedchain as cc
from closedchain.robots import rpa3t


@pytest.fixture(scope="module")
def m() -> cc.Mechanism:
    return cc.load("rpa3t")


def goal(position: np.ndarray) -> pin.SE3:
    return pin.SE3(np.eye(3), position)


# --- description ------------------------------------------------------------------------------


def test_home(m: cc.Mechanism) -> None:
    path = Path(__file__).parents[1] / "reference" / "rpa3t.json"
    pose = json.loads(path.read_text())["poses"]["home"]
    mode = pose["ik"][pose["default_index"]]
    assert m.inputs == ("theta1", "theta2", "theta3")
    assert np.abs(cc.residual(m, m.home)).max() < 1e-14
    assert_close(m.input_values(m.home), mode["theta"], 1e-14)
    for name, xyz in pose["points"].items():
        assert_close(m.point(m.home, name), 1e-3 * np.array(xyz), 1e-14, name)
    assert_close(m.pose(m.home, "platform").rotation, np.eye(3), 1e-14)
    assert_close(m.pose(m.home, "link3p").rotation, np.eye(3), 1e-14)
    assert_close(m.point(m.home, "Sa") - m.point(m.home, "B1"), [G.w4s, 0, 0], 1e-14)
    assert_close(m.point(m.home, "Sd") - m.point(m.home, "C1"), [-G.w4s, 0, 0], 1e-14)


def test_every_working_mode_is_a_home(m: cc.Mechanism) -> None:
    home = rpa3t.inverse(rpa3t.HOME, G)
    for theta, signs in zip(home.theta, home.modes, strict=True):
        there = cc.load("rpa3t", mode=" ".join(f"{s:g}" for s in signs))
        assert_close(near(there.input_values(there.home), theta), theta, 1e-13)
        assert_close(there.point(there.home, "P"), rpa3t.HOME, 1e-14)


def test_working_variant_limits_the_inputs() -> None:
    limited = cc.load("rpa3t", variant="working")
    lower, upper = (bound[limited.input_q] for bound in limited.limits)
    assert_close(np.degrees(lower), [-60, 110, -60], 1e-9)
    assert_close(np.degrees(upper), [10, 230, 65], 1e-9)
    found = rpa3t.inverse(sample(BOX, 500, seed=0), G)
    assert found.real[:, DEFAULT].all()
    theta = near(found.theta[:, DEFAULT], limited.input_values(limited.home))
    assert ((theta > lower) & (theta < upper)).all()
    f = rpa3t.factors(found.q[:, DEFAULT], theta, G)
    for factor in (f.sin_beta, f.kappa, f.M, f.s1, f.s2, f.s3, f.cos_beta, f.drop):
        assert abs(np.sign(factor).sum()) == factor.size  # one sign in all of the box


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"l3": -0.35}, r"parameter 'l3'"),
        ({"w4r": 0.0}, r"parameter 'w4r'"),
        ({"l7": float("nan")}, r"parameter 'l7'"),
        ({"l4": 0.2}, r"'home': leg R11 does not reach"),
        ({"home": "0.1 -0.03 -2"}, r"parameter 'home': leg R11 does not reach"),
        ({"home": "-0.9 -0.03 -0.6", "l1": 0.7}, r"'home': leg R11 does not reach"),
        ({"home": "0.1 -0.06 -0.6"}, r"parameter 'home' needs x y z .* within l7 = 0\.05"),
        ({"mode": "1 1 0 1"}, r"parameter 'mode' needs four signs"),
        ({"theta1_range": "0.5 -0.5"}, r"'R11'.*lower=0\.5 is greater"),
        ({"l8": 0.1}, r"unknown parameter 'l8'.*known: l1, l2"),
    ],
)
def test_bad_parameters_are_named(parameters: dict[str, float | str], message: str) -> None:
    with pytest.raises(cc.DescriptionError, match=message):
        cc.load("rpa3t", **parameters)


def test_widths_of_the_parallelograms_do_not_matter(m: cc.Mechanism) -> None:
    wide = cc.load("rpa3t", w4s=0.08, w4r=0.03)
    assert_close(wide.home, m.home, 1e-14)
    target = m.input_values(m.home) + np.array([0.003, -0.02, 0.01])
    one, two = (cc.direct(r, target).raise_if_failed() for r in (m, wide))
    assert_close(one.q, two.q, 1e-11)


# --- mobility ---------------------------------------------------------------------------------


def test_mobility_three_with_four_redundant_rows(m: cc.Mechanism) -> None:
    found = cc.mobility(m)
    assert found.pair_counts == {"R": 13, "U": 2, "S": 2}
    assert (found.links, found.pairs, found.freedoms, found.gruebler) == (14, 17, 23, -1)
    assert (found.generic_rank, found.redundant_rows, found.mobility) == (12, 4, 3)
    assert found.rank.gap > 1e10
    assert "each rod also spins" in found.text.replace("\n", " ")


def test_spherical_joints_at_both_ends_let_the_rods_spin(m: cc.Mechanism) -> None:
    """The paper's pairs: 13 R and 4 S, Gruebler 1, mobility 3 + 2 spins, 4 redundant rows."""
    text = m.description.text
    for rod in ("Ua", "Ub"):
        text, n = re.subn(
            rf'(<joint name="{rod}_end_point") type="fixed">(.*?)</joint>',
            r'\1 type="revolute">\2<axis xyz="1 0 0"/>'
            r'<limit lower="-7" upper="7" effort="1" velocity="1"/></joint>',
            text,
            flags=re.S,
        )
        assert n == 1
    found = cc.mobility(cc.load_urdf(text))
    assert (found.gruebler, found.mobility, found.redundant_rows) == (1, 5, 4)


def test_platform_and_link3_only_translate(m: cc.Mechanism) -> None:
    rng = np.random.default_rng(1)
    found = rpa3t.inverse(sample(WIDE, 100, seed=1), G)
    for i, mode in rng.permutation(np.argwhere(found.real))[:100]:
        q = configuration(m, found.q[i, mode], found.theta[i, mode])
        for link in ("platform", "link3p"):
            assert_close(m.pose(q, link).rotation, np.eye(3), 1e-14, link)
        assert abs(m.point(q, "C1")[1]) < 1e-14


# --- position ---------------------------------------------------------------------------------


def test_closed_forms_close_the_loops_in_every_mode(m: cc.Mechanism) -> None:
    p = sample(WIDE, 1000, seed=2)
    found = rpa3t.inverse(p, G)
    modes = 0
    real = found.q[found.real], found.theta[found.real]
    assert np.abs(rpa3t.residuals(*real, G)).max() < 1e-13
    for i, mode in np.argwhere(found.real):
        q = configuration(m, found.q[i, mode], found.theta[i, mode])
        assert np.abs(cc.residual(m, q)).max() < 1e-13
        assert_close(m.point(q, "P"), p[i], 1e-13)
        modes += 1
    assert modes > 12000


@pytest.mark.slow
def test_inverse_agrees_with_the_closed_form(m: cc.Mechanism) -> None:
    p = sample(BOX, 1000, seed=3)
    found = rpa3t.inverse(p, G)
    for i, position in enumerate(p):
        s = cc.inverse(m, goal(position)).raise_if_failed()
        expected = configuration(m, found.q[i, DEFAULT], found.theta[i, DEFAULT])
        turned = (s.q - expected + np.pi) % (2.0 * np.pi) - np.pi
        assert_close(turned, np.zeros(m.model.nq), 1e-10)
        assert_close(m.point(s.q, "P"), position, 1e-12)


@pytest.mark.slow
def test_direct_agrees_with_the_closed_form(m: cc.Mechanism) -> None:
    """On the branch of home, or refused: where the straight path of the inputs leaves it."""
    home = m.input_values(m.home)
    found = rpa3t.inverse(sample(BOX, 150, seed=4), G)
    refused = 0
    for theta in near(found.theta[:, DEFAULT], home):
        s = cc.direct(m, theta)
        path = rpa3t.direct(home + np.linspace(0, 1, 1001)[:, None] * (theta - home), G)
        assert s.converged == path.real[:, 1].all(), s.message
        if s.converged:
            assert_close(m.point(s.q, "P"), path.position[-1, 1], 1e-10)
        else:
            assert "direct singularity" in s.message
            refused += 1
    assert 0 < refused < 40


def test_direct_keeps_each_assembly_mode(m: cc.Mechanism) -> None:
    """Four postures with the same inputs, each found again from a guess on its own branch."""
    theta, step = np.radians([-130.0, 50.0, -120.0]), np.array([0.002, -0.002, 0.001])
    found = rpa3t.direct(theta, G)
    assert found.real.all()
    for q, position in zip(found.q, found.position, strict=True):
        start = configuration(m, q, theta)
        moved = cc.direct(m, theta + step, guess=start).raise_if_failed()
        back = cc.direct(m, theta, guess=moved.q).raise_if_failed()
        assert_close(m.point(back.q, "P"), position, 1e-11)


def test_pose_out_of_reach_is_said(m: cc.Mechanism) -> None:
    s = cc.inverse(m, goal(np.array([0.1, -0.06, -0.6])))
    assert not s.converged
    assert "singularity" in s.message
    q = cc.close(m, points={"P": (0.05, -0.02, -0.65)}).raise_if_failed().q
    assert_close(m.point(q, "P"), [0.05, -0.02, -0.65], 1e-12)


# --- velocity ---------------------------------------------------------------------------------


def test_twist_map_is_that_of_the_closed_form(m: cc.Mechanism) -> None:
    found = rpa3t.inverse(sample(WIDE, 60, seed=5), G)
    f = rpa3t.factors(found.q, found.theta, G)
    well = found.real & (np.abs(f.sin_beta) > 0.1) & (np.abs(f.kappa) > 0.05) & (np.abs(f.M) > 0.02)
    tested = 0
    for i, mode in np.argwhere(well)[::5]:
        q = configuration(m, found.q[i, mode], found.theta[i, mode])
        v = cc.velocity(m, q)
        assert v.twist_map is not None
        expected = rpa3t.twist_map(found.q[i, mode], found.theta[i, mode], G)
        assert_close(v.twist_map, expected, 1e-9)
        assert v.Jx.shape == v.Jq.shape == (3, 3)  # redundant rows leave no more equations
        assert_close(v.Jx @ expected, v.Jq, 1e-9)
        assert np.linalg.matrix_rank(v.Jx) == 3
        tested += 1
    assert tested > 40


def test_velocity_equation_is_that_of_the_loop_equations(m: cc.Mechanism) -> None:
    """Jx V = Jq thetadot and A D^-1 V = -B thetadot have the same solutions."""
    found = rpa3t.inverse(sample(BOX, 20, seed=6), G)
    for q, theta in zip(found.q[:, DEFAULT], found.theta[:, DEFAULT], strict=True):
        v = cc.velocity(m, configuration(m, q, theta))
        a, b = rpa3t.parallel_jacobian(q, theta, G), rpa3t.serial_jacobian(q, theta, G)
        by_p = np.linalg.solve(rpa3t.output_jacobian(q, G).T, a.T).T
        one, two = np.hstack([v.Jx, -v.Jq]), np.hstack([by_p, b])
        values = np.linalg.svd(np.vstack([one / np.linalg.norm(one), two / np.linalg.norm(two)]))[1]
        assert values[3] < 1e-12 * values[0]


def test_no_redundancy_and_no_drift_of_redundant_rows(m: cc.Mechanism) -> None:
    found = rpa3t.inverse(sample(BOX, 10, seed=7), G)
    rng = np.random.default_rng(7)
    for q, theta in zip(found.q[:, DEFAULT], found.theta[:, DEFAULT], strict=True):
        x = configuration(m, q, theta)
        free = cc.redundancy(m, x)
        assert free.dimension == 0
        assert free.rank.value == 15
        assert cc.redundancy(m, x, "x z").dimension == 1
        # an admissible motion: Kdot v lies in the range of K, redundant rows or not
        k = cc.constraint_jacobian(m, x)
        v = np.linalg.svd(k)[2][12:].T @ rng.standard_normal(3)
        drift = cc.constraint_drift(m, x, v)
        left = np.linalg.svd(k)[0][:, 12:]
        assert_close(left.T @ drift, np.zeros(4), 1e-12)


def test_acceleration_with_redundant_rows(m: cc.Mechanism) -> None:
    found = rpa3t.inverse(sample(BOX, 10, seed=8), G)
    rng, step = np.random.default_rng(8), 1e-4
    for q, theta in zip(found.q[:, DEFAULT], found.theta[:, DEFAULT], strict=True):
        rate, rise = 0.05 * rng.standard_normal((2, 3))
        times = step * np.array([-1.0, 0.0, 1.0])[:, None]
        path = rpa3t.direct(theta + rate * times + 0.5 * rise * times**2, G).position[:, 1]
        a = cc.acceleration(m, configuration(m, q, theta), rate, rise)
        velocity = (path[2] - path[0]) / (2 * step)
        acceleration = (path[0] - 2 * path[1] + path[2]) / step**2
        assert_close(a.tip_twist, [*velocity, 0, 0, 0], 1e-5)
        scale = 1.0 + np.abs(acceleration).max()
        assert_close(a.tip_acceleration / scale, np.array([*acceleration, 0, 0, 0]) / scale, 1e-4)
