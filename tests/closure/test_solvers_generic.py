"""Position solvers on small mechanisms with known closed forms, most with redundant rows."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pinocchio as pin
import pytest
from conftest import Tolerances, assert_close

import closedchain as cc
from closedchain.closure.equations import Equations, Range, correct
from closedchain.urdf.errors import ClosureError, DescriptionError

# -- writing small mechanisms ---------------------------------------------------------------------


def joint(
    name: str, parent: str, child: str, xyz: str = "0 0 0", *, kind: str = "revolute",
    axis: str = "0 0 1", rpy: str = "0 0 0", more: str = "",
) -> str:  # fmt: skip
    limit = '<limit lower="-30" upper="30" effort="1" velocity="1"/>'
    body = "" if kind in ("fixed", "floating") else f'<axis xyz="{axis}"/>{limit}'
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{xyz}" rpy="{rpy}"/>{body}{more}</joint>'
    )


def loop(
    kind: str, parent: str, at1: str, child: str, at2: str,
    axis1: str = "0 0 1", axis2: str = "0 0 1",
) -> str:  # fmt: skip
    one = two = ""
    if kind not in ("spherical", "fixed"):
        one, two = f'<parent_axis xyz="{axis1}"/>', f'<child_axis xyz="{axis2}"/>'
    return (
        f'<constraint name="loop" type="{kind}">'
        f'<parent link="{parent}"/><parent_origin xyz="{at1}"/>{one}'
        f'<child link="{child}"/><child_origin xyz="{at2}"/>{two}</constraint>'
    )


def build(
    links: str, parts: list[str], home: dict[str, float], inputs: str = "", task: str = ""
) -> cc.Mechanism:
    bodies = "".join(f'<link name="{name}"/>' for name in links.split())
    drives = "".join(
        f'<transmission name="{n}"><joint name="{n}"/></transmission>' for n in inputs.split()
    )
    values = "".join(f'<joint name="{n}" value="{v!r}"/>' for n, v in home.items())
    text = (
        f'<robot name="small">{bodies}{"".join(parts)}{drives}{task}'
        f'<group_state name="home" group="all">{values}</group_state></robot>'
    )
    return cc.load_urdf(text, xacro=False)


def apex(a: np.ndarray, b: np.ndarray, from_a: float, from_b: float, side: int) -> np.ndarray:
    """Intersection of two circles about ``a`` and ``b``; ``side`` 1 is left of the way a to b."""
    way = b - a
    distance = float(np.hypot(*way))
    along = (from_a**2 - from_b**2 + distance**2) / (2 * distance)
    across = math.sqrt(from_a**2 - along**2)
    return np.asarray(a + (along * way + side * across * np.array([-way[1], way[0]])) / distance)


def direction(angle: float) -> np.ndarray:
    return np.array([math.cos(angle), math.sin(angle)])


def angle(vector: np.ndarray) -> float:
    return math.atan2(vector[1], vector[0])


def same_angles(actual: np.ndarray, expected: list[float], atol: float) -> None:
    """Angles agree up to whole turns."""
    off = (np.asarray(actual) - expected + np.pi) % (2 * np.pi) - np.pi
    assert_close(off, np.zeros(len(expected)), atol)


def four_bar_angles(bars: tuple[float, ...], crank: float, side: int = 1) -> list[float]:
    """Crank, rod against crank, rocker [rad]; apex left (1) or right (-1) of the diagonal."""
    a, b, c, d = bars
    tip, foot = a * direction(crank), np.array([d, 0.0])
    top = apex(tip, foot, b, c, side)
    return [crank, angle(top - tip) - crank, angle(top - foot)]


def four_bar(
    bars: tuple[float, ...], crank: float, kind: str = "revolute", axis2: str = "0 0 1",
    task: str = '<task base="base" tip="rod" outputs="rz"/>',
) -> cc.Mechanism:  # fmt: skip
    """Crank a, rod b, rocker c on the ground bar d; the loop is cut between rod and rocker."""
    a, b, c, d = bars
    parts = [
        joint("crank_joint", "base", "crank"),
        joint("rod_joint", "crank", "rod", f"{a} 0 0"),
        joint("rocker_joint", "base", "rocker", f"{d} 0 0"),
        loop(kind, "rod", f"{b} 0 0", "rocker", f"{c} 0 0", "0 0 1", axis2),
    ]
    names = ("crank_joint", "rod_joint", "rocker_joint")
    home = dict(zip(names, four_bar_angles(bars, crank), strict=True))
    return build("base crank rod rocker", parts, home, "crank_joint", task)


GRASHOF = (0.3, 1.0, 0.8, 1.0)
ROCKING = (1.0, 0.5, 0.7, 1.1)
"""Not Grashof: the crank swings between two toggles where rod and rocker are in line."""
PARALLELOGRAM = (0.5, 1.0, 0.5, 1.0)


def toggle(bars: tuple[float, ...]) -> float:
    """Crank angle at which rod and rocker are stretched out."""
    a, b, c, d = bars
    return math.acos((a * a + d * d - (b + c) ** 2) / (2 * a * d))


# -- four-bar -------------------------------------------------------------------------------------


@pytest.mark.parametrize(("kind", "rows"), [("revolute", 5), ("cylindrical", 4), ("spherical", 3)])
def test_four_bar_against_the_closed_form(kind: str, rows: int, tol: Tolerances) -> None:
    """Two unknowns: the rows out of the plane are redundant and do no harm."""
    m = four_bar(GRASHOF, 0.5, kind)
    assert m.rows == rows
    same_angles(m.home, four_bar_angles(GRASHOF, 0.5), tol.closure)
    for crank in np.linspace(-3.0, 3.5, 30):
        s = cc.direct(m, [crank])
        assert s.converged, s.message
        assert s.residual < tol.closure
        assert s.rank == 2
        assert s.rank_decision.gap > 1e6
        assert s.branch is None
        same_angles(s.q, four_bar_angles(GRASHOF, crank), 1e-11)


@pytest.mark.parametrize("side", [1, -1])
def test_a_crank_turns_round_on_its_branch(side: int, tol: Tolerances) -> None:
    """Step by step and in one call, both ways round."""
    m = four_bar(GRASHOF, 0.5)
    guess = np.array(four_bar_angles(GRASHOF, 0.5, side))
    start = guess
    for crank in 0.5 + np.linspace(0.0, 2 * np.pi, 73)[1:]:
        s = cc.direct(m, [crank], guess)
        assert s.converged, s.message
        same_angles(s.q, four_bar_angles(GRASHOF, crank, side), 1e-11)
        assert np.abs(s.q - guess).max() < 0.6, "angles run on, they do not wrap"
        guess = s.q
    for turns in (1, -1, 3):
        whole = cc.direct(m, [0.5 + 2 * np.pi * turns], start)
        assert whole.converged, whole.message
        assert whole.residual < tol.closure
        same_angles(whole.q, list(start), 1e-11)
        # against the ground the rod does not turn round: its joint runs against the crank's
        assert_close(whole.q[0] + whole.q[1], start[0] + start[1], 1e-9)


def test_toggle_of_a_rocking_crank() -> None:
    """The path ends at the fold, with the angle at which it is."""
    m = four_bar(ROCKING, 0.6)
    limit = toggle(ROCKING)
    for crank in (limit + 0.01, 1.5, 3.0, 0.6 + 2 * np.pi):
        s = cc.direct(m, [crank])
        assert not s.converged
        assert np.isfinite(s.q).all()
        assert f"direct singularity after {(limit - 0.6) / (crank - 0.6):.1%}" in s.message
        assert f"crank_joint={limit:.4f}"[:-1] in s.message
    out = cc.direct(m, [1.5])
    assert out.residual > 0.1
    assert "out of reach: closure 'loop' (revolute, rod to rocker)" in out.message
    near = cc.direct(m, [limit - 1e-4])
    assert near.converged, near.message
    same_angles(near.q, four_bar_angles(ROCKING, limit - 1e-4), 1e-9)


def test_a_leap_over_a_fold_is_refused() -> None:
    """Beyond both toggles the loop closes again, as if a whole turn had passed."""
    m = four_bar(ROCKING, 0.6)
    around = cc.direct(m, [0.6 + 2 * np.pi])
    assert not around.converged
    mirrored = cc.direct(m, [-0.6])
    assert not mirrored.converged
    assert "direct singularity" in mirrored.message


def test_a_narrow_gap_is_not_leapt_over() -> None:
    """Feasible on both sides, by a gap of a fiftieth of a radian: nothing there to see but rank."""
    bars = (1.0, 0.9, 0.6, 0.7005)
    m = four_bar(bars, 0.3)
    for crank in (-0.02, -0.1, -0.3, -1.0, -2.0):
        s = cc.direct(m, [crank])
        assert not s.converged, crank
        assert "direct singularity" in s.message


def test_parallelogram_stays_one_and_stops_at_its_change_point(tol: Tolerances) -> None:
    """Flat, it could go on as an antiparallelogram: the answer must not choose."""
    m = four_bar(PARALLELOGRAM, 1.0)
    for crank in (0.05, 0.5, 2.0, 3.1):
        s = cc.direct(m, [crank])
        assert s.converged, s.message
        assert_close(s.q, [crank, -crank, crank], 1e-9)
        assert_close(m.pose(s.q, "rod").rotation, np.eye(3), 1e-9, "the rod stays parallel")
    for crank, share in ((3.5, (np.pi - 1) / 2.5), (5.0, (np.pi - 1) / 4), (-1.0, 0.5)):
        s = cc.direct(m, [crank])
        assert not s.converged
        assert f"direct singularity after {share:.1%}" in s.message
    flat = cc.close(m, guess=np.zeros(3))
    assert flat.converged
    held = cc.close(m, guess=np.zeros(3), fixed={"crank_joint": 0.0})
    assert (held.converged, held.rank) == (True, 1)


def test_newton_is_quadratic_with_redundant_rows(tol: Tolerances) -> None:
    m = four_bar(GRASHOF, 0.5)
    equations = Equations(m, m.passive_v)
    expected = np.array(four_bar_angles(GRASHOF, 0.5))
    q = expected + np.array([0.0, 0.05, -0.05])
    errors = [np.abs(q - expected).max()]
    for _ in range(4):
        values, matrix = equations.evaluate(q)
        q = equations.move(q, Range.of(matrix).step(values / equations.row_scale))
        errors.append(np.abs(q - expected).max())
    for before, after in pairwise(errors):
        assert after < 3.0 * before**2 + 1e-14
    found = correct(equations, expected + np.array([0.0, 0.05, -0.05]))
    assert found.refusal is None
    assert found.evaluations <= 5
    assert_close(found.q, expected, tol.closure)


def test_redundant_steps_are_those_of_least_squares(tol: Tolerances) -> None:
    rng = np.random.default_rng(1)
    for shape, rank in (((5, 2), 2), ((7, 4), 3), ((3, 6), 3), ((6, 8), 4)):
        matrix = rng.standard_normal((shape[0], rank)) @ rng.standard_normal((rank, shape[1]))
        values = rng.standard_normal(shape[0])
        bases = Range.of(matrix)
        assert bases.s.size == rank
        expected = -np.linalg.lstsq(matrix, values, rcond=1e-9)[0]
        assert_close(bases.step(values), expected, tol.algebra)
        assert not bases.left_by(Range.of(matrix))
        assert not bases.left_by(Range.of(1.5 * matrix))
        assert bases.left_by(Range.of(-matrix)), "a singular one lies in between"


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
    with pytest.raises(DescriptionError, match=r"home posture of 'small' cannot be closed.*'loop'"):
        build("base one two", parts, {})
    # a revolute closure with opposed axes closes its rows, mirrored
    with pytest.raises(DescriptionError, match=r"mirrored joint: closure 'loop'"):
        four_bar(GRASHOF, 0.5, axis2="0 0 -1")


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
    with pytest.raises(DescriptionError, match=r"'loop' .*stays open by 0\.001"):
        build("base crank rod rocker", parts, dict(zip(names, angles, strict=True)))
