"""Position solvers on small linkages of every closure kind, and what cannot be asked."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest
from conftest import Tolerances, assert_close
from small_linkages import (
    GRASHOF,
    angle,
    apex,
    build,
    direction,
    four_bar,
    four_bar_angles,
    joint,
    loop,
    same_angles,
)

import closedchain as cc
from closedchain.urdf.errors import ClosureError

# -- five-bar -------------------------------------------------------------------------------------

FIVE = (0.4, 0.7, 0.8, 0.45, 0.6)
"""Left crank and rod, right rod and crank, distance of the feet."""


def five_bar_angles(one: float, two: float) -> list[float]:
    a, b, c, d, e = FIVE
    left, right = a * direction(one), np.array([e, 0.0]) + d * direction(two)
    top = apex(left, right, b, c, 1)
    return [one, angle(top - left) - one, two, angle(top - right) - two]


def five_bar(inputs: str = "a d") -> cc.Mechanism:
    a, b, c, d, e = FIVE
    parts = [
        joint("a", "base", "left"), joint("b", "left", "left_rod", f"{a} 0 0"),
        joint("d", "base", "right", f"{e} 0 0"), joint("c", "right", "right_rod", f"{d} 0 0"),
        joint("tip_point", "left_rod", "tip", f"{b} 0 0", kind="fixed"),
        loop("revolute", "left_rod", f"{b} 0 0", "right_rod", f"{c} 0 0"),
    ]  # fmt: skip
    home = dict(zip("abdc", five_bar_angles(2.0, 0.9), strict=True))
    task = '<task base="base" tip="tip" outputs="x y"/>'
    return build("base left left_rod right right_rod tip", parts, home, inputs, task)


def test_five_bar_direct_and_inverse(tol: Tolerances) -> None:
    m = five_bar()
    a, b, c, d, e = FIVE
    rng = np.random.default_rng(2)
    for _ in range(30):
        inputs = np.array([2.0, 0.9]) + rng.uniform(-0.4, 0.4, 2)
        s = cc.direct(m, inputs)
        assert s.converged, s.message
        same_angles(s.q, five_bar_angles(*inputs), 1e-11)
        top = m.point(s.q, "tip")
        # inverse: each crank is the elbow of a two-bar, on the side it has at home
        back = cc.inverse(m, pin.SE3(np.eye(3), top))
        assert back.converged, back.message
        assert back.rank == 4
        foot = np.array([e, 0.0])
        elbows = [apex(np.zeros(2), top[:2], a, b, 1), apex(foot, top[:2], d, c, -1) - foot]
        same_angles(m.input_values(back.q), [angle(x) for x in elbows], 1e-10)
        same_angles(m.input_values(back.q), list(inputs), 1e-10)


def test_five_bar_out_of_reach() -> None:
    m = five_bar()
    s = cc.inverse(m, pin.SE3(np.eye(3), np.array([0.0, 2.0, 0.0])))
    assert not s.converged
    assert np.isfinite(s.q).all()
    assert "meets a singularity after" in s.message
    assert "out of reach" in s.message
    assert s.residual > 0.1
    off_plane = cc.inverse(m, pin.SE3(np.eye(3), np.array([0.3, 0.8, 0.1])), outputs="x y z")
    assert not off_plane.converged
    assert "out of reach" in off_plane.message


def test_fewer_inputs_than_freedoms_still_close(tol: Tolerances) -> None:
    """One input of two: the posture is one of many, the loop is closed."""
    m = five_bar("a")
    s = cc.direct(m, [2.3])
    assert s.converged, s.message
    assert s.residual < tol.closure
    assert (s.q[0], s.rank) == (2.3, 2)


# -- slider-crank ---------------------------------------------------------------------------------

CRANK, ROD = 0.3, 0.8


def slider_crank(kind: str) -> cc.Mechanism:
    """The slider hangs on the rod; its guide along x is cut."""
    parts = [
        joint("crank_joint", "base", "crank"),
        joint("rod_joint", "crank", "rod", f"{CRANK} 0 0"),
        joint("wrist", "rod", "slider", f"{ROD} 0 0"),
        loop(kind, "base", "0 0 0", "slider", "0 0 0", "1 0 0", "1 0 0"),
    ]
    lift = math.asin(CRANK * math.sin(0.7) / ROD)
    home = {"crank_joint": 0.7, "rod_joint": -0.7 - lift, "wrist": lift}
    task = '<task base="base" tip="slider" outputs="x"/>'
    return build("base crank rod slider", parts, home, "crank_joint", task)


@pytest.mark.parametrize(("kind", "rows"), [("prismatic", 5), ("cylindrical", 4)])
def test_slider_crank(kind: str, rows: int, tol: Tolerances) -> None:
    m = slider_crank(kind)
    assert m.rows == rows
    for crank in np.linspace(-6.0, 7.0, 27):
        s = cc.direct(m, [crank])
        assert s.converged, s.message
        lift = math.asin(CRANK * math.sin(crank) / ROD)
        reach = CRANK * math.cos(crank) + ROD * math.cos(lift)
        assert_close(m.point(s.q, "slider"), [reach, 0.0, 0.0], 1e-11)
        assert_close(s.q, [crank, -crank - lift, lift], 1e-10)
    far = cc.inverse(m, pin.SE3(np.eye(3), np.array([CRANK + ROD + 0.1, 0.0, 0.0])))
    assert not far.converged
    assert "out of reach" in far.message


# -- coupling, fixed, universal, planar -----------------------------------------------------------


def test_mimic_is_a_closure(tol: Tolerances) -> None:
    """Screw and gear: one row each, exact."""
    gear = '<mimic joint="a" multiplier="-2" offset="0.5"/>'
    screw = '<mimic joint="a" multiplier="0.01"/>'
    parts = [
        joint("a", "base", "one"), joint("b", "base", "two", "1 0 0", more=gear),
        joint("c", "one", "nut", kind="prismatic", more=screw),
    ]  # fmt: skip
    m = build("base one two nut", parts, {}, "a")
    assert [c.kind for c in m.closures] == ["coupling", "coupling"]
    assert np.abs(cc.residual(m, m.home)).max() < tol.closure
    for value in (-3.0, 0.2, 7.0):
        s = cc.direct(m, {"a": value})
        assert s.converged, s.message
        named = {n: s.q[j.idx_q] for n, j in zip(m.model.names, m.model.joints, strict=True)}
        assert named["b"] == pytest.approx(-2 * value + 0.5, abs=1e-12)
        assert named["c"] == pytest.approx(0.01 * value, abs=1e-12)
        assert s.branch in (-1, 1)


def test_fixed_closure_carries_a_floating_body(tol: Tolerances) -> None:
    """A plate welded to the end of an arm: a full turn takes log6 past its half turn."""
    parts = [
        joint("arm_joint", "base", "arm"),
        joint("plate_joint", "base", "plate", kind="floating"),
        loop("fixed", "arm", "0.5 0 0.1", "plate", "0 0 0"),
    ]
    m = build("base arm plate", parts, {"arm_joint": 0.3}, "arm_joint")
    assert m.rows == 6
    for arm in (0.3, 1.0, 3.3, 6.5, -2.0):
        s = cc.direct(m, [arm])
        assert s.converged, s.message
        assert s.rank == 6
        expected = pin.SE3(pin.exp3(np.array([0, 0, arm])), np.array([*0.5 * direction(arm), 0.1]))
        assert_close(m.pose(s.q, "plate").homogeneous, expected.homogeneous, 1e-11)


def test_universal_closure_is_a_cardan_joint(tol: Tolerances) -> None:
    """tan(out) = cos(bend) tan(in), in the same quadrant, over two turns."""
    bend = 0.6
    parts = [
        joint("shaft_in", "base", "one"),
        joint("shaft_out", "base", "two", rpy=f"{bend} 0 0"),
        loop("universal", "one", "0 0 0", "two", "0 0 0", "1 0 0", "0 1 0"),
    ]
    m = build("base one two", parts, {}, "shaft_in")
    assert m.rows == 4
    for turn in np.linspace(-6.0, 6.0, 25):
        s = cc.direct(m, [turn])
        assert s.converged, s.message
        assert s.rank == 1
        expected = math.atan2(math.cos(bend) * math.sin(turn), math.cos(turn))
        same_angles(s.q[1:], [expected], 1e-11)
        assert abs(s.q[1] - turn) < 0.3, "both shafts turn together"


def test_planar_closure_keeps_a_plate_on_the_table(tol: Tolerances) -> None:
    parts = [
        joint("plate_joint", "base", "plate", kind="floating"),
        loop("planar", "base", "0 0 0.2", "plate", "0 0 0"),
    ]
    m = build("base plate", parts, {})
    assert m.point(m.home, "plate")[2] == pytest.approx(0.2, abs=1e-12)
    tilt = pin.exp3(np.array([0.2, 0.0, 0.0]))
    guess = pin.SE3ToXYZQUAT(pin.SE3(tilt, np.array([0.5, -0.3, 0.4])))
    s = cc.close(m, guess)
    assert s.converged, s.message
    pose = m.pose(s.q, "plate")
    assert_close(pose.translation[2:], [0.2], tol.closure)
    assert_close(pose.rotation[:, 2], [0.0, 0.0, 1.0], tol.closure)
    assert_close(pose.rotation, np.eye(3), 1e-6, "the shortest way up: no turn about the normal")
    assert_close(pose.translation[:2], [0.5, -0.3], 0.05)


# -- what cannot be asked -------------------------------------------------------------------------


def test_mechanism_without_inputs_or_task() -> None:
    parts = [joint("a", "base", "one"), joint("b", "one", "two", "1 0 0")]
    m = build("base one two", parts, {})
    with pytest.raises(ClosureError, match=r"'small' has no inputs \(<transmission> elements\)"):
        cc.direct(m, [])
    calls: list[Callable[[], object]] = [
        lambda: cc.inverse(m, pin.SE3.Identity()),
        lambda: cc.inverse(m, pin.SE3.Identity(), outputs="x"),
        lambda: m.pose(m.home),
    ]
    for call in calls:
        with pytest.raises(ClosureError, match="'small' has no task: add <task"):
            call()
    assert_close(m.pose(m.home, "two").translation, [1.0, 0.0, 0.0], 1e-15)


def test_open_chain_is_a_mechanism_without_rows() -> None:
    parts = [joint("a", "base", "one"), joint("b", "one", "two", "1 0 0")]
    for inputs in ("a b", "a"):
        m = build("base one two", parts, {"b": 0.4}, inputs)
        assert cc.residual(m, m.home).shape == (0,)
        assert cc.constraint_jacobian(m, m.home).shape == (0, 2)
        assert cc.constraint_drift(m, m.home, np.ones(2)).shape == (0,)
        target = [0.7, -0.2][: len(m.inputs)]
        s = cc.direct(m, target)
        assert s.converged, s.message
        assert_close(s.q[: len(target)], target, 0.0)
        assert s.residual == 0.0
        assert s.rank == 0
        closed = cc.close(m, fixed={"a": 0.3})
        assert closed.converged
        assert_close(closed.q, [0.3, 0.4], 0.0)


def test_every_joint_an_input(tol: Tolerances) -> None:
    """Nothing left to solve: inputs that fit converge, others do not."""
    parts = [
        joint("a", "base", "one", kind="prismatic", axis="1 0 0"),
        joint("b", "base", "two", kind="prismatic", axis="1 0 0"),
        loop("fixed", "one", "0 0 0", "two", "0 0 0"),
    ]
    m = build("base one two", parts, {}, "a b")
    fit = cc.direct(m, [0.3, 0.3])
    assert fit.converged, fit.message
    assert_close(fit.q, [0.3, 0.3], 0.0)
    clash = cc.direct(m, [0.3, 0.4])
    assert not clash.converged
    assert clash.residual == pytest.approx(0.1)
    assert "'loop'" in clash.message
    held = cc.close(m, fixed={"a": 0.2, "b": 0.2})
    assert held.converged, held.message
    apart = cc.close(m, fixed={"a": 0.2, "b": 0.5})
    assert not apart.converged
    assert "does not close: closure 'loop'" in apart.message
    assert apart.residual == pytest.approx(0.3)


def test_home_that_cannot_be_closed_names_the_closure() -> None:
    parts = [
        joint("a", "base", "one"), joint("b", "base", "two", "5 0 0"),
        loop("spherical", "one", "1 0 0", "two", "1 0 0"),
    ]  # fmt: skip
    m = build("base one two", parts, {})
    assert m.home_open
    assert m.open_by == pytest.approx(3.0)  # stretched towards each other
    assert "home is open: closure 'loop'" in m.notes[-1]
    with pytest.raises(
        ClosureError, match=r"needs a closed home, and that of 'small' is open by 3"
    ):
        cc.mobility(m)
    # a revolute closure with opposed axes closes its rows, mirrored
    mirrored = four_bar(GRASHOF, 0.5, axis2="0 0 -1")
    assert mirrored.home_open
    assert "mirrored joint: closure 'loop'" in mirrored.notes[-1]


def test_contradictory_closure_is_told_from_a_redundant_one() -> None:
    """Rocker a millimetre out of the plane: the redundant row cannot be met."""
    a, b, c, d = GRASHOF
    angles = four_bar_angles(GRASHOF, 0.5)
    names = ("crank_joint", "rod_joint", "rocker_joint")
    parts = [
        joint(names[0], "base", "crank"), joint(names[1], "crank", "rod", f"{a} 0 0"),
        joint(names[2], "base", "rocker", f"{d} 0 0.001"),
        loop("revolute", "rod", f"{b} 0 0", "rocker", f"{c} 0 0"),
    ]  # fmt: skip
    m = build("base crank rod rocker", parts, dict(zip(names, angles, strict=True)))
    assert m.open_by == pytest.approx(0.001)
    assert "'loop' (revolute, rod to rocker) stays open by 0.001" in m.notes[-1]
