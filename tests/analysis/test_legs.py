"""Legs, their reciprocal screws: against the constraint Jacobian and robots' closed forms."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from conftest import assert_close
from linkage_text import J, urdf
from linkages import arm_with_parallelogram, five_bar, four_bar, three_rrr

import closedchain as cc
from closedchain.analysis import screws
from closedchain.analysis.screws.legs import Leg, LegVelocity, leg_velocity
from closedchain.analysis.structure.postures import wander
from closedchain.robots import d1, eclipse, linear_delta, rus6
from closedchain.robots.d1 import screws as d1_screws
from closedchain.robots.eclipse import screws as eclipse_screws
from closedchain.robots.linear_delta import screws as delta_screws

ROBOTS = ("d1", "eclipse", "eclipse2", "rpa3t", "linear_delta", "rus6")
TWIST = "x y z rx ry rz"
# how far inputs are moved at random from those of a posture near home [m, rad]
SPREAD = {
    "d1": 0.02,
    "eclipse": 0.05,
    "eclipse2": 0.05,
    "rpa3t": 0.02,
    "linear_delta": 0.1,
    "rus6": 0.2,
}
load = cache(cc.load)


def row_space(jx: np.ndarray, jq: np.ndarray, m: cc.Mechanism) -> np.ndarray:
    """Projector on the dimensionless rows [Jx -Jq]."""
    twist = np.repeat([m.length, 1.0], 3)
    rows = np.hstack([jx * twist, -jq * m.column_scale[m.input_v]])
    _, s, vt = np.linalg.svd(rows, full_matrices=False)
    rank = np.count_nonzero(s > 1e-9 * s[0])
    return vt[:rank].T @ vt[:rank]


def misfit(m: cc.Mechanism, q: np.ndarray) -> float:
    """Distance of the row spaces of the two velocity equations."""
    legs, whole = leg_velocity(m, q), cc.velocity(m, q, TWIST)
    return float(np.abs(row_space(legs.Jx, legs.Jq, m) - row_space(whole.Jx, whole.Jq, m)).max())


def parallel(ours: np.ndarray, theirs: np.ndarray, tol: float = 1e-9) -> None:
    """Each row of ``ours`` is a multiple of that of ``theirs``."""
    assert ours.shape == theirs.shape
    for a, b in zip(ours, theirs, strict=True):
        factor = (a @ b) / (b @ b)
        assert abs(factor) > 1e-3
        assert_close(a, factor * b, tol * np.abs(a).max())


def stacked(v: LegVelocity, kind: str, chosen: slice | None = None) -> np.ndarray:
    return np.vstack([getattr(leg, kind) for leg in v.legs[chosen or slice(None)]])


def check_duality(leg: Leg) -> None:
    """Permission + restriction and actuation + constraint, dual to each other."""
    freedoms = leg.permission.shape[0]
    assert freedoms == leg.rank.value == leg.actuation.shape[0]
    assert leg.restriction.shape == leg.constraint.shape == (6 - freedoms, 6)

    def pairing(wrenches: np.ndarray, twists: np.ndarray) -> np.ndarray:
        return screws.klein(wrenches[:, None], twists[None])

    for wrenches, twists in (
        (leg.constraint, leg.permission),
        (leg.constraint, leg.screws),
        (leg.actuation, leg.restriction),
    ):
        assert np.abs(pairing(wrenches, twists)).max(initial=0.0) < 1e-9
    for wrenches, twists in ((leg.constraint, leg.restriction), (leg.actuation, leg.permission)):
        assert np.linalg.matrix_rank(pairing(wrenches, twists)) == len(wrenches)


@pytest.mark.parametrize("robot", ROBOTS)
def test_equal_to_the_constraint_jacobian(robot: str) -> None:
    m = load(robot)
    for q in wander(m, 3, seed=11):
        assert misfit(m, q) < 1e-9
        v = leg_velocity(m, q)
        assert len(v.owners) == len(v.rows) == len(v.right)
        for leg in v.legs:
            check_duality(leg)
        # the rows before elimination hold for the joints of their legs
        for row, owner in zip(v.rows, v.owners, strict=True):
            assert np.abs(row).max() > 0.0
            assert v.legs[owner].end in v.platforms


@pytest.mark.slow
@pytest.mark.parametrize("robot", ROBOTS)
def test_equal_at_a_thousand_random_postures(robot: str) -> None:
    m = load(robot)
    rng = np.random.default_rng(2024)
    start = wander(m, 1, seed=5)[0]
    centre, done = m.input_values(start), 0
    q, inputs, worst = start, centre, 0.0
    while done < 1000:  # a random walk in a box: short ways are fast to solve
        strayed = inputs + 0.3 * SPREAD[robot] * rng.standard_normal(centre.size)
        strayed = np.clip(strayed, centre - SPREAD[robot], centre + SPREAD[robot])
        found = cc.direct(m, strayed, q)
        if found.converged:
            q, inputs, done = found.q, strayed, done + 1
            worst = max(worst, misfit(m, q))
    assert worst < 1e-9


# --- the robots' closed forms ------------------------------------------------------------------


def test_d1_rows_are_eqs_23_and_28() -> None:
    """Legs 1 to 3 give J1 for the coupler, legs 4 to 6 and the passive ones J2."""
    m, g = load("d1"), d1.geometry()
    for q in wander(m, 5, seed=3):
        coupler, platform = (
            d1.Pose(np.array(m.pose(q, b).rotation), m.point(q, b)) for b in ("coupler", "platform")
        )
        v = leg_velocity(m, q)
        assert v.platforms == ("platform", "coupler")
        of = {leg.joints[0].removesuffix("_R").removesuffix("_U1"): leg for leg in v.legs}
        first = [of[f"leg{i}"] for i in (1, 2, 3)]
        assert all((leg.start, leg.end) == ("base", "coupler") for leg in first)
        rows = [row for leg in first for row in (leg.constraint[0], leg.driving[0])]
        j1 = d1_screws.j1(coupler, g)
        parallel(np.array(rows), j1.T)
        last = [of[f"leg{i}"].driving[0] for i in (4, 5, 6)]
        last += [of[f"passive{i}"].constraint[0] for i in (1, 2, 3)]
        j2 = d1_screws.j2(coupler, platform, g)
        parallel(np.array(last), j2.T)
        for i in range(6):
            assert_close(of[f"leg{i + 1}"].levers, np.eye(6)[[i]], 1e-9)
        # eqs (22)-(28): q1 to q3 move the coupler, whose twist the passive legs hand on
        swap = [3, 4, 5, 0, 1, 2]
        pick = np.zeros((6, 6))
        pick[[1, 3, 5], [0, 1, 2]] = 1.0
        of_coupler = np.linalg.solve(j1.T[:, swap], pick)
        right = np.vstack([np.eye(6)[3:], j2.T[3:, swap] @ of_coupler])
        # about the tip: (linear at the tip, angular) against (angular, linear at O)
        tip = m.point(q, "T")
        shift = np.array([screws.shifted(e, -tip) for e in np.eye(6)[swap]]).T
        assert_close(row_space(j2.T[:, swap] @ shift, right, m), row_space(v.Jx, v.Jq, m), 1e-9)


def test_rus6_rows_are_eq_5() -> None:
    """The rods' lines, Jq on the diagonal and J'q for the common beta of legs 1 to 3."""
    m, g = load("rus6"), rus6.geometry()
    for q in wander(m, 5, seed=3):
        pose = rus6.Pose(np.array(m.pose(q).rotation), m.point(q, "P"))
        inputs = m.input_values(q)
        legs = rus6.posture(pose, inputs[:6], inputs[6], g)
        v = leg_velocity(m, q)
        assert (v.Jx.shape, v.Jq.shape) == ((6, 6), (6, 7))
        theirs = rus6.j_x(legs).T
        ours = stacked(v, "driving")
        parallel(ours, theirs)
        sign = np.sign((ours * theirs).sum(axis=1))[:, None]
        assert_close(ours, sign * theirs, 1e-9)  # both of unit force
        assert_close(v.Jq, sign * rus6.j_inputs(legs), 1e-9)
        assert_close(stacked(v, "levers"), v.Jq, 1e-9)
        assert [set(leg.inputs) for leg in v.legs[2:4]] == [{"alpha3", "beta"}, {"alpha4"}]


def test_linear_delta_rows_are_eqs_21_to_26() -> None:
    """The generalised Jacobian 9 x 6 and the subspaces of the limbs."""
    m, g = load("linear_delta"), linear_delta.Geometry()
    for q in wander(m, 5, seed=3):
        ends = [m.point(q, f"C{i}") - m.point(q, f"B{i}") for i in (1, 2, 3)]
        bhat = np.array(ends) / g.b
        limb = delta_screws.limbs(bhat, g)
        exact = delta_screws.generalized_jacobian(bhat, g)
        v = leg_velocity(m, q)
        assert v.Jx.shape == (9, 6)
        parallel(v.Jx[:3], exact.Jx[:3])
        sign = np.sign((v.Jx[:3] * exact.Jx[:3]).sum(axis=1))
        assert_close(v.Jx[:3], sign[:, None] * exact.Jx[:3], 1e-9)
        assert_close(v.Jq, np.vstack([np.diag(sign * exact.Ja), np.zeros((6, 3))]), 1e-9)
        at = m.point(q, "P")
        for k, leg in enumerate(v.legs):
            assert leg.joints[2] == f"[leg{k + 1}_D leg{k + 1}_G | leg{k + 1}_E leg{k + 1}_F]"
            permitted = screws.shifted(leg.permission, at)[:, [3, 4, 5, 0, 1, 2]]
            same_space(permitted, limb.twists[k, :4])
            same_space(screws.shifted(leg.constraint, at), limb.wrenches[k, 4:])
            same_space(v.Jx[3 + 2 * k : 5 + 2 * k], exact.Jx[3 + 2 * k : 5 + 2 * k])
            # the paper's complements are other ones, but each is dual to its own half
            assert np.linalg.matrix_rank(np.vstack([leg.restriction, leg.permission])) == 6


def same_space(one: np.ndarray, two: np.ndarray) -> None:
    a, b = (np.linalg.qr(x.T)[0] for x in (one, two))
    assert_close(a @ a.T, b @ b.T, 1e-9)


def test_eclipse_rows_are_the_legs_inverse_screws() -> None:
    """Rows of M_j^-1 for the two inputs of a leg, up to scale."""
    m, g = load("eclipse"), eclipse.ECLIPSE
    swap = [3, 4, 5, 0, 1, 2]
    for q in wander(m, 5, seed=3):
        inputs = m.input_values(q)
        q_r = np.array([q[m.model.joints[m.model.getJointId(f"{x}_R")].idx_q] for x in "abc"])
        wrist = eclipse.wrist_angles(inputs, q_r, m.pose(q).rotation, g, 1.0)
        of_paper = eclipse_screws.leg_screws(inputs, q_r, wrist, g, 1.0)
        v = leg_velocity(m, q)
        for leg, columns in zip(v.legs, of_paper, strict=True):
            rows = np.linalg.solve(columns, np.eye(6))[:2]
            parallel(leg.driving[:, swap], rows)
            assert_close(leg.screws[:3], columns.T[:3], 1e-9)


# --- which joints are a leg, and what is none ----------------------------------------------------


def test_platforms_and_legs_of_rpa3t() -> None:
    """Its limbs 1 and 2 meet in link 3', a platform between."""
    m = load("rpa3t")
    v = leg_velocity(m, wander(m, 1)[0])
    assert v.platforms == ("platform", "link3p")
    assert {(leg.start, leg.end, leg.inputs) for leg in v.legs} == {
        ("base", "link3p", ("theta1",)),
        ("base", "link3p", ("theta2",)),
        ("link3p", "platform", ()),
        ("base", "platform", ("theta3",)),
    }


@pytest.mark.parametrize("make", [four_bar, five_bar, three_rrr, arm_with_parallelogram])
def test_small_linkages(make: object) -> None:
    m = make()  # type: ignore[operator]
    assert misfit(m, m.home) < 1e-9


def test_serial_arm_is_one_leg() -> None:
    joints = [J("j1", "base", "a"), J("j2", "a", "b", xyz="0.3 0 0", axis="0 1 0")]
    m = cc.load_urdf(urdf("arm", joints, inputs={"q1": "j1", "q2": "j2"}, tip="b"), xacro=False)
    v = leg_velocity(m, m.home)
    (leg,) = v.legs
    assert (leg.joints, leg.inputs, v.Jx.shape) == (("j1", "j2"), ("q1", "q2"), (6, 6))
    assert misfit(m, m.home) < 1e-9


def test_a_body_in_no_leg_is_named() -> None:
    joints = [
        J("j1", "base", "a"),
        J("j2", "a", "b", xyz="0.3 0 0"),
        J("j3", "a", "flag", xyz="0.1 0 0"),
    ]
    m = cc.load_urdf(urdf("arm", joints, inputs={"q1": "j1", "q2": "j2"}, tip="b"), xacro=False)
    with pytest.raises(cc.ClosureError, match="not made of legs: body 'flag' hangs on a single"):
        leg_velocity(m, m.home)
