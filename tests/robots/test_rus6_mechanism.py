"""The mechanism of rus6 against its closed forms: each is the other's test."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from conftest import Tolerances, assert_close
from rus6_postures import INWARD_M1, G, at, configuration, one, random_poses, stored

import closedchain as cc
from closedchain.robots.rus6 import (
    MODES,
    Pose,
    det_jx,
    inverse,
    j_beta,
    j_inputs,
    j_q,
    mode_of,
    platform_rates,
    posture,
    wrapped,
)


@pytest.fixture(scope="module")
def ref(reference: Callable[[str], dict[str, Any]]) -> dict[str, Any]:
    return reference("rus6")


@pytest.fixture(scope="module")
def robot() -> cc.Mechanism:
    return cc.load("rus6")


@pytest.fixture(scope="module")
def locked() -> cc.Mechanism:
    return cc.load("rus6", variant="locked")


def pose_of(m: cc.Mechanism, q: np.ndarray) -> Pose:
    found = m.pose(q)
    return Pose(found.rotation, found.translation)


# --- home and description -----------------------------------------------------------------------


def test_home(robot: cc.Mechanism, ref: dict[str, Any], tol: Tolerances) -> None:
    assert robot.inputs == (*(f"alpha{i}" for i in range(1, 7)), "beta")
    assert np.abs(cc.residual(robot, robot.home)).max() < tol.closure
    home = ref["home"]["beta=+0 deg"]
    assert_close(robot.input_values(robot.home), [*home["alpha"], 0.0], 1e-11)
    legs = inverse(G.home, 0.0, G)
    for name in "ABC":
        for i in range(6):
            point = robot.point(robot.home, f"{name}{i + 1}")
            assert_close(point, getattr(legs, name)[i], 1e-14, f"{name}{i + 1}")
    for i in range(3):
        assert_close(robot.point(robot.home, f"F{i + 1}"), G.F[i], 1e-15)
    assert_close(robot.point(robot.home, "P"), [0.0, -0.55, 0.0], 1e-15)
    assert_close(robot.pose(robot.home).rotation, np.eye(3), 1e-15)
    assert robot.task is not None
    assert robot.task.tip == "P"


@pytest.mark.parametrize("degrees", [-30, 0, 30])
@pytest.mark.parametrize("how", ["coupled", "free", "locked"])
def test_home_at_other_reconfiguration_angles(how: str, degrees: int, ref: dict[str, Any]) -> None:
    m = cc.load("rus6", reconfiguration=how, beta=np.radians(degrees))
    alpha = ref["home"][f"beta={degrees:+d} deg"]["alpha"]
    betas = {"coupled": 1, "free": 3, "locked": 0}[how]
    assert_close(m.input_values(m.home), [*alpha, *[np.radians(degrees)] * betas], 1e-11)


def test_other_sizes_follow_the_geometry() -> None:
    sizes = {"Rf": 0.22, "Rr": 0.1, "H": -0.05, "h": 0.06, "theta4": 0.9, "psi1": 0.2, "psi4": 0.1}
    from closedchain.robots.rus6 import geometry

    g = geometry(**sizes, LA=0.25, LB=0.55, r=0.15, R2=0.28, height=-0.5)
    m = cc.load("rus6", **sizes, LA=0.25, LB=0.55, r=0.15, R2=0.28, height=-0.5, beta=0.2)
    legs = inverse(g.home, 0.2, g)
    assert_close(m.input_values(m.home), [*legs.alpha, 0.2], 1e-12)
    assert_close(m.point(m.home, "B2"), legs.B[1], 1e-13)


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ({"LA": -0.2}, "'LA' must be positive"),
        ({"Rr": 0.0}, "'Rr' must be positive"),
        ({"height": -1.2}, "closure 'leg1_S' cannot be met at home.*height"),
        ({"R2": 0.8}, "closure 'leg4_S' cannot be met at home.*R2"),
        ({"reconfiguration": "loose"}, "'reconfiguration' must be coupled, free or locked"),
        ({"theta": 0.5}, "unknown parameter 'theta'.*known: Rf, Rr, R2"),
    ],
)
def test_bad_parameters_are_refused_by_name(parameters: dict[str, Any], words: str) -> None:
    with pytest.raises(cc.DescriptionError, match=words):
        cc.load("rus6", **parameters)


def test_reconfiguration_joints_are_tied_by_exact_rows(robot: cc.Mechanism) -> None:
    """Two coupling rows with constant Jacobian: one input moves all three links alike."""
    rng = np.random.default_rng(1)
    v = 0.3 * rng.standard_normal(robot.model.nv)
    q = pin.integrate(robot.model, robot.home, v)
    joints = [robot.model.idx_qs[robot.model.getJointId(f"leg{i}_F")] for i in (1, 2, 3)]
    rows = cc.residual(robot, q)[-2:]
    np.testing.assert_allclose(rows, q[joints[1:]] - q[joints[0]], atol=1e-15)
    step = 1e-6
    numeric = np.zeros((robot.rows, robot.model.nv))
    for k in range(robot.model.nv):
        e = np.zeros(robot.model.nv)
        e[k] = step
        ahead = cc.residual(robot, pin.integrate(robot.model, q, e))
        behind = cc.residual(robot, pin.integrate(robot.model, q, -e))
        numeric[:, k] = (ahead - behind) / (2 * step)
    np.testing.assert_allclose(cc.constraint_jacobian(robot, q), numeric, atol=1e-8)


# --- mobility ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("variant", "links", "pairs", "rows", "mobility"),
    [("free", 17, 21, 18, 9), ("coupled", 17, 21, 20, 7), ("locked", 14, 18, 18, 6)],
)
def test_mobility(variant: str, links: int, pairs: int, rows: int, mobility: int) -> None:
    """9, 7 and 6 freedoms; the count is right each time and no row is redundant."""
    found = cc.mobility(cc.load("rus6", variant=variant))
    assert (found.links, found.pairs) == (links, pairs)
    assert found.generic_rank == rows
    assert found.redundant_rows == 0
    assert found.gruebler == found.mobility == mobility
    assert found.pair_counts["S"] == found.pair_counts["U"] == 6
    counted = "sum f - 2 couplings = 7." in " ".join(found.text.split())
    assert counted == (variant == "coupled")


def test_redundancy_with_the_platform_at_rest(locked: cc.Mechanism) -> None:
    """More inputs than outputs by 1, by 3, and by none: the freedoms of the reconfiguration."""
    assert cc.redundancy(locked, locked.home).dimension == 0
    for variant, dimension in (("coupled", 1), ("free", 3)):
        m = cc.load("rus6", variant=variant)
        assert cc.redundancy(m, m.home).dimension == dimension


# --- positions --------------------------------------------------------------------------------


def test_closed_form_postures_close_the_loops(robot: cc.Mechanism, tol: Tolerances) -> None:
    """1,000 random poses, each in another of the 64 modes."""
    poses, beta = random_poses(1000)
    legs = inverse(poses, beta, G, MODES[np.arange(1000) % 64])
    for i in range(1000):
        pose = one(poses, i)
        q = configuration(robot, pose, inverse(pose, beta[i], G, MODES[i % 64]))
        assert np.abs(cc.residual(robot, q)).max() < tol.closure
        if i % 10 == 0:
            for name in "ABC":
                for k in range(6):
                    found = robot.point(q, f"{name}{k + 1}")
                    np.testing.assert_allclose(found, getattr(legs, name)[i, k], atol=1e-13)


def test_direct_agrees_with_the_closed_form(robot: cc.Mechanism) -> None:
    """1,000 random inputs from the closed form: the platform comes out where they were made."""
    poses, beta = random_poses(1000, seed=2)
    alpha = inverse(poses, beta, G).alpha
    off = 0.0
    for i in range(1000):
        s = cc.direct(robot, [*alpha[i], beta[i]]).raise_if_failed()
        found = robot.pose(s.q)
        off = max(
            off,
            np.abs(found.translation - poses.position[i]).max(),
            np.abs(found.rotation - poses.rotation[i]).max(),
        )
        assert s.rank == 20
    assert off < 1e-10


def test_inverse_agrees_with_the_closed_form(robot: cc.Mechanism, locked: cc.Mechanism) -> None:
    """With seven inputs the solver chooses beta; for that beta the arms are the closed form's."""
    poses, _ = random_poses(200, seed=3)
    for i in range(200):
        pose = one(poses, i)
        target = pin.SE3(pose.rotation, pose.position)
        fixed = cc.inverse(locked, target).raise_if_failed()
        assert_close(locked.input_values(fixed.q), inverse(pose, 0.0, G).alpha, 1e-10)
        s = cc.inverse(robot, target).raise_if_failed()
        *alpha, beta = robot.input_values(s.q)
        assert_close(alpha, inverse(pose, beta, G).alpha, 1e-10)
        assert s.rank == 26


def test_a_wanted_beta_is_held_by_close(robot: cc.Mechanism) -> None:
    poses, beta = random_poses(20, seed=4)
    for i in range(20):
        pose = one(poses, i)
        target = pin.SE3(pose.rotation, pose.position)
        s = cc.close(robot, fixed={"beta": beta[i]}, place={"platform": target}).raise_if_failed()
        expected = inverse(pose, beta[i], G).alpha
        assert_close(robot.input_values(s.q), [*expected, beta[i]], 1e-10)


def test_inverse_keeps_the_working_mode_of_the_guess(locked: cc.Mechanism) -> None:
    poses, _ = random_poses(64, seed=5)
    for i in range(0, 64, 3):
        guess, _ = at(locked, G.home, 0.0, MODES[i])
        pose = one(poses, i)
        target = pin.SE3(pose.rotation, pose.position)
        s = cc.inverse(locked, target, guess=guess).raise_if_failed()
        alpha = locked.input_values(s.q)
        expected = inverse(pose, 0.0, G, MODES[i])
        assert np.abs(wrapped(alpha - expected.alpha)).max() < 1e-10
        assert np.array_equal(mode_of(expected), MODES[i])


def test_all_stored_assemblies_are_found(robot: cc.Mechanism, ref: dict[str, Any]) -> None:
    """Eight real assemblies for one set of inputs; from home the direct problem meets its own."""
    fk = ref["fk"][0]
    inputs = [*fk["alpha"], fk["beta"]]
    signs = set()
    for number, entry in enumerate(fk["real"]):
        w, x, y, z = entry["quat_wxyz"]
        pose = Pose(pin.Quaternion(w, x, y, z).toRotationMatrix(), np.array(entry["P"]))
        near = configuration(robot, pose, posture(pose, fk["alpha"], fk["beta"], G))
        s = cc.direct(robot, inputs, guess=near).raise_if_failed()
        assert_close(robot.point(s.q, "P"), entry["P"], 1e-9, f"assembly {number}")
        assert np.sign(s.branch) == np.sign(entry["det_Jx"])
        signs.add(s.branch)
    assert signs == {-1, 1}
    from_home = cc.direct(robot, inputs).raise_if_failed()
    assert_close(robot.point(from_home.q, "P"), fk["real"][0]["P"], 1e-9)


def test_direct_stays_on_the_assembly_of_home(robot: cc.Mechanism) -> None:
    """Inputs taken from beyond the yaw root lead to another assembly, on home's side of it."""
    beyond = Pose(pin.rpy.rpyToMatrix(0.0, np.radians(110.0), 0.0), G.home.position)
    legs = inverse(beyond, 0.0, G)
    assert legs.closed
    assert det_jx(legs) > 0.0 > det_jx(inverse(G.home, 0.0, G))
    s = cc.direct(robot, [*legs.alpha, 0.0]).raise_if_failed()
    assert s.branch == -1
    assert det_jx(posture(pose_of(robot, s.q), legs.alpha, 0.0, G)) < 0.0
    assert np.abs(robot.pose(s.q).rotation - beyond.rotation).max() > 0.1


# --- velocity: seven inputs, six outputs ----------------------------------------------------------


@pytest.mark.parametrize("mode", [(1,) * 6, INWARD_M1])
def test_velocity_equation_has_the_papers_rows(robot: cc.Mechanism, mode: Any) -> None:
    """Equation (5) and the generic velocity equation agree up to a regular mix of rows."""
    poses, beta = random_poses(40, seed=6)
    for i in range(40):
        pose = one(poses, i)
        q, legs = at(robot, pose, beta[i], mode)
        v = cc.velocity(robot, q)
        assert (v.Jx.shape, v.Jq.shape) == ((6, 6), (6, 7))
        rows = platform_rates(legs) @ _to_origin(pose)
        mix = np.linalg.solve(v.Jx.T, rows.T).T
        np.testing.assert_allclose(mix @ v.Jq, j_inputs(legs), atol=1e-11)
        assert v.twist_map is not None
        np.testing.assert_allclose(rows @ v.twist_map, j_inputs(legs), atol=1e-11)


def _to_origin(pose: Pose) -> np.ndarray:
    """Matrix (6, 6) from (v_P; omega) to (omega; v_O)."""
    out = np.zeros((6, 6))
    out[:3, 3:] = out[3:, :3] = np.eye(3)
    out[3:, 3:] = -np.cross(np.eye(3), pose.position).T
    return out


def test_null_space_is_the_change_of_alpha_with_beta(
    robot: cc.Mechanism, ref: dict[str, Any]
) -> None:
    """With the platform at rest, dalpha/dbeta = -J'q / Jq in M1 and 0 in M2."""
    poses, beta = random_poses(40, seed=7)
    for i in range(40):
        q, legs = at(robot, one(poses, i), beta[i])
        free = cc.redundancy(robot, q)
        assert free.dimension == 1
        slope = free.inputs[:, 0] / free.inputs[6, 0]
        np.testing.assert_allclose(slope[:3], -j_beta(legs) / j_q(legs)[:3], rtol=1e-10)
        np.testing.assert_allclose(slope[3:6], 0.0, atol=1e-10)
    pose, angle, mode = stored(ref["generic"]["state"])
    q, _ = at(robot, pose, angle, mode)
    free = cc.redundancy(robot, q)
    stated = ref["generic"]["dalpha_dbeta_fixed_pose"]
    assert_close(free.inputs[:3, 0] / free.inputs[6, 0], stated, 1e-9)


def test_locked_velocity_is_the_coupled_one_without_beta(
    robot: cc.Mechanism, locked: cc.Mechanism
) -> None:
    poses, _ = random_poses(20, seed=8)
    for i in range(20):
        q, _ = at(robot, one(poses, i))
        q_locked, _ = at(locked, one(poses, i))
        seven, six = cc.velocity(robot, q), cc.velocity(locked, q_locked)
        assert seven.twist_map is not None
        assert six.twist_map is not None
        np.testing.assert_allclose(seven.twist_map[:, :6], six.twist_map, atol=1e-10)
