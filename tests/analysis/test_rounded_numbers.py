"""Overconstrained mechanisms with rounded numbers load, move and solve as the exact ones do."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from dataclasses import replace

import linkage_text
import linkages
import numpy as np
import pinocchio as pin
import point_linkages
import pytest
from conftest import Tolerances
from rounded_checks import check, values
from rounded_files import rounded_urdf

import closedchain as cc
from closedchain.closure.build import as_stated
from closedchain.closure.rounding.sensitivity import Sensitivity
from closedchain.urdf import ClosureType, digits, read

HINGE = '<limit lower="-7" upper="7" effort="1" velocity="1"/>'


def quarter_turned(turn: str, third: str = "0.20") -> str:
    """Four-bar in the x-z plane whose rocker's branch is turned by a quarter, written ``turn``."""

    def joint(name: str, parent: str, child: str, origin: str, axis: str) -> str:
        return (
            f'<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/>'
            f'<origin {origin}/><axis xyz="{axis}"/>{HINGE}</joint>'
        )

    return (
        '<robot name="rounded"><link name="ground"/><link name="crank"/><link name="coupler"/>'
        '<link name="rocker"/>'
        + joint("A", "ground", "crank", 'xyz="0 0 0"', "0 -1 0")
        + joint("B", "crank", "coupler", 'xyz="0.10 0 0"', "0 -1 0")
        + joint("D", "ground", "rocker", f'xyz="0.30 0 0" rpy="{turn} 0 0"', "0 0 1")
        + '<constraint name="C" type="revolute"><parent link="coupler"/>'
        '<parent_origin xyz="0.25 0 0"/><parent_axis xyz="0 1 0"/><child link="rocker"/>'
        f'<child_origin xyz="{third} 0 0"/><child_axis xyz="0 0 -1"/></constraint>'
        '<transmission name="q1"><joint name="A"/></transmission>'
        '<task base="ground" tip="coupler" outputs="ry"/>'
        '<group_state name="home"><joint name="A" value="1.0"/><joint name="B" value="-0.6"/>'
        '<joint name="D" value="1.7"/></group_state></robot>'
    )


# circles about the crank's end and the rocker's foot, by hand
B, D = -0.5245106, 1.6895884


@pytest.mark.parametrize("turn", ["1.5708", "1.570796", "1.571", "1.57"])
def test_a_quarter_turn_of_few_digits_is_one(turn: str, tol: Tolerances) -> None:
    m = cc.load_urdf(quarter_turned(turn))
    off = abs(float(turn) - math.pi / 2)
    assert not m.home_open
    assert 0.3 * off < m.misfit < 2.0 * off
    assert m.home.tolist() == pytest.approx([1.0, B, D], abs=1e-7)
    assert np.abs(cc.residual(m, m.home)).max() < tol.closure
    assert cc.mobility(m).mobility == 1
    assert m.rounding is not None
    (change,) = m.rounding.changed
    assert (change.where, change.read) == ("D origin rpy", pytest.approx(math.pi / 2, abs=1e-15))
    assert (m.rounding.kept, m.rounding.redundant) == ((0, 1), (2, 3, 4))
    assert m.rounding.rank.above > 0.5
    assert m.rounding.rank.below < 3.0 * off
    assert any("the numbers are rounded" in note for note in m.notes)
    s = cc.direct(m, [1.4]).raise_if_failed()
    assert s.residual < tol.closure


def test_a_mobility_that_rounding_takes_away_though_the_count_is_right(tol: Tolerances) -> None:
    """With a ball in place of a hinge there are as many rows as joints, and nothing would move."""
    start, end = quarter_turned("1.5708").split('<constraint name="C" type="revolute">')
    end = end.replace('<parent_axis xyz="0 1 0"/>', "").replace('<child_axis xyz="0 0 -1"/>', "")
    text = f'{start}<constraint name="C" type="spherical">{end}'
    m = cc.load_urdf(text)
    assert cc.mobility(m).mobility == 1
    assert 0.0 < m.misfit < 5e-6
    assert cc.direct(m, [1.3]).raise_if_failed().residual < tol.closure


def test_exact_numbers_are_never_touched() -> None:
    text = quarter_turned(repr(math.pi / 2))
    m = cc.load_urdf(text)
    assert (m.rounding, m.misfit) == (None, 0.0)
    assert m.description.joints == read(text).joints


def test_tolerance_zero_takes_numbers_as_they_stand() -> None:
    m = cc.load_urdf(quarter_turned("1.5708"), tolerance=0.0)
    assert m.home_open
    assert m.open_by == pytest.approx(3.5e-6, rel=0.3)
    with pytest.raises(cc.DescriptionError, match="tolerance must be a length"):
        cc.load_urdf(quarter_turned("1.5708"), tolerance=-1.0)


def test_what_is_off_by_more_than_rounding_is_contradictory() -> None:
    """A rocker's foot a tenth of a millimetre out of the plane is no rounding of three digits."""
    text = quarter_turned(repr(math.pi / 2)).replace('"0.30 0 0"', '"0.30 0.0001 0"')
    m = cc.load_urdf(text, tolerance=1e-5)
    assert m.rounding is None
    assert m.open_by == pytest.approx(1e-4, rel=0.1)
    wide = cc.load_urdf(text, tolerance=3e-4)
    assert not wide.home_open
    assert wide.misfit == pytest.approx(1e-4, rel=0.1)
    assert cc.mobility(wide).mobility == 1


def test_rigid_is_told_from_rounded() -> None:
    """Hinges that are a degree from parallel hold a loop fast; rounded ones do not."""
    tilted = repr(math.pi / 2 + math.radians(1.0))
    m = cc.load_urdf(quarter_turned(tilted), tolerance=1e-6)
    assert m.home_open  # with rigid loops no posture near the stated one is closed
    assert m.rounding is None
    truss = linkages.truss()
    text = rounded_urdf(truss.description, 5, np.random.default_rng(2), values(truss))
    loaded = cc.load_urdf(text)
    assert cc.mobility(loaded).mobility == 0
    assert not loaded.home_open
    assert 0.0 < loaded.misfit < 1e-4


# -- every overconstrained mechanism at hand -------------------------------------------------------


def spherical_four_bar() -> cc.Mechanism:
    """Four hinges through one point: links of 40, 70, 60 and 80 degrees."""
    arcs = [math.radians(x) for x in (40.0, 70.0, 60.0, 80.0)]
    one = 1.0
    joints = [
        linkage_text.J("A", "base", "crank"),
        linkage_text.J("B", "crank", "coupler", rpy=f"{arcs[0]!r} 0 0"),
        linkage_text.J("D", "base", "rocker", rpy=f"{arcs[3]!r} 0 0"),
        linkage_text.J("b", "coupler", "b_end", rpy=f"{arcs[1]!r} 0 0", type="fixed"),
        linkage_text.J("c", "rocker", "c_end", rpy=f"{arcs[2]!r} 0 0", type="fixed"),
    ]
    cut = linkage_text.Cut("C", "b_end", "c_end", "0 0 0.2", "0 0 0.2")
    return linkage_text.load(
        "spherical_four_bar",
        joints,
        [cut],
        inputs={"q1": "A"},
        home={"A": one, "B": 1.5, "D": 1.5},
        tip="coupler",
        outputs="rx ry rz",
    )


def agile_eye() -> cc.Mechanism:
    """Three legs of three hinges through one point, all at right angles at home."""
    e = np.eye(3)

    def words(x: np.ndarray) -> str:
        return " ".join(map(repr, x.tolist()))

    joints, cuts = [], []
    for leg in range(3):
        first, second, third = (0.1 * e[(leg + k) % 3] for k in range(3))
        a, b = f"a{leg}", f"b{leg}"
        joints += [
            linkage_text.J(f"u{leg}", "base", a, words(first), words(10.0 * first)),
            linkage_text.J(f"w{leg}", a, b, words(second - first), words(10.0 * second)),
        ]
        if leg == 0:
            joints.append(
                linkage_text.J("v0", b, "platform", words(third - second), words(10.0 * third))
            )
            origin = third
        else:
            cuts.append(
                linkage_text.Cut(
                    f"v{leg}",
                    b,
                    "platform",
                    words(third - second),
                    words(third - origin),
                    axis=words(10.0 * third),
                    child_axis=words(10.0 * third),
                )
            )
    return linkage_text.load(
        "agile_eye",
        joints,
        cuts,
        inputs={f"q{leg}": f"u{leg}" for leg in range(3)},
        tip="platform",
        outputs="rx ry rz",
    )


QUICK: dict[str, Callable[[], cc.Mechanism]] = {
    "four_bar": linkages.four_bar,
    "six_bar": lambda: linkages.six_bar("A"),
    "three_rrr": linkages.three_rrr,
    "parallelogram": linkages.parallelogram,
    "wedges": linkages.wedges,
    "bennett": linkages.bennett,
    "five_bar": linkages.five_bar,
    "arm_with_parallelogram": linkages.arm_with_parallelogram,
    "slider_crank": point_linkages.slider_crank,
    "spherical_four_bar": spherical_four_bar,
    "agile_eye": agile_eye,
}


@pytest.mark.parametrize("decimals", [8, 6, 5])
@pytest.mark.parametrize("name", QUICK)
def test_overconstrained_linkages(name: str, decimals: int, tol: Tolerances) -> None:
    check(QUICK[name](), decimals, 7 * decimals, tol)


@pytest.mark.parametrize("name", ["d1", "eclipse", "rus6"])
def test_robots_without_redundant_rows_are_taken_as_they_stand(name: str) -> None:
    exact = cc.load(name)
    text = rounded_urdf(exact.description, 5, np.random.default_rng(1), values(exact))
    m = cc.load_urdf(text, xacro=False)
    assert m.rounding is None
    assert not m.home_open
    assert cc.mobility(m).mobility == cc.mobility(exact).mobility


# -- the parts -------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["rpa3t", "d1", "eclipse2"])
def test_sensitivity_is_the_derivative(name: str, tol: Tolerances) -> None:
    exact = cc.load(name)
    text = rounded_urdf(exact.description, 12, np.random.default_rng(3), values(exact))
    m = as_stated(read(text))
    numbers = digits.numbers(m.description)
    rng = np.random.default_rng(0)
    q = pin.integrate(m.model, m.home, 0.3 * rng.standard_normal(m.model.nv))
    found = Sensitivity(m, numbers).at(q)
    printed = np.array([number.value for number in numbers])
    h = 1e-6
    for i in range(0, len(numbers), 7):
        rows = []
        for sign in (1.0, -1.0):
            moved = printed.copy()
            moved[i] += sign * h
            other = as_stated(digits.with_numbers(m.description, numbers, moved))
            rows.append(other.workspace.residual(q) / m.row_scale)
        difference = (rows[0] - rows[1]) / (2.0 * h)
        assert np.abs(difference - found[:, i]).max() < tol.finite_difference * 10.0


def test_units_of_printed_numbers() -> None:
    for word, unit in {
        "1.5708": 1e-4,
        "-0.70711": 1e-5,
        "0.3": 0.0,
        "0.125": 0.0,
        "12": 0.0,
        "0.300000": 1e-6,
        "1.2345e-3": 1e-7,
        "1.5707963267948966": 0.0,
        "6.123233995736766e-17": 0.0,
    }.items():
        assert digits.last_digit(word) == pytest.approx(unit, abs=0.0), word
    assert digits.last_digit("0.707", digits.COARSE_AXIS) == pytest.approx(1e-3)


def test_the_default_tolerance_is_ten_units_of_the_coarsest_number() -> None:
    def tolerance(text: str, length: float = 0.5) -> float:
        return digits.default_tolerance(read(text), length)

    exact = quarter_turned(repr(math.pi / 2))
    assert tolerance(exact) == pytest.approx(0.0, abs=1e-15)
    assert tolerance(exact.replace("0.30 0 0", "0.30001 0 0")) == pytest.approx(1e-4)
    assert tolerance(exact.replace("0 -1 0", "0 -0.70711 0.70711")) == pytest.approx(5e-5)
    # an angle printed for a multiple of 15 degrees is off by what it is off, no more
    assert tolerance(quarter_turned("1.5708")) == pytest.approx(
        10 * 0.5 * abs(1.5708 - math.pi / 2), rel=1e-9
    )


def test_other_formats_count_by_the_file_as_it_is() -> None:
    """What is read of them has other numbers, with all digits."""
    text = quarter_turned(repr(math.pi / 2))
    plain = read(text)
    for printed, unit in (
        ('<body pos="0.1 0.25 0.30001" quat="1 0 0 0"/>', 1e-5),
        ("<pose>0.1 0 0 0 1.570796 0</pose>", 1e-6),
        ('<body pos="0.1 0.25 0.3" name="1.23456"/>', 0.0),
    ):
        described = dataclasses.replace(plain, printed=printed)
        assert digits.default_tolerance(described, 0.2) == pytest.approx(10 * unit)


def test_loops_that_share_no_joint_are_judged_one_by_one() -> None:
    """Two four-bars on each other's coupler, of which one is written with all digits."""
    joints, cuts, home = [], [], {}
    for i, (base, at) in enumerate((("base", "0"), ("k0", "0.3"))):
        joints += [
            linkage_text.J(f"A{i}", base, f"c{i}", f"{at} 0 0"),
            linkage_text.J(f"B{i}", f"c{i}", f"k{i}", "0.15 0 0"),
            linkage_text.J(f"D{i}", base, f"r{i}", f"{float(at) + 0.4!r} 0 0"),
        ]
        cuts.append(linkage_text.Cut(f"C{i}", f"k{i}", f"r{i}", "0.35 0 0", "0.2 0 0"))
        home |= {f"A{i}": 1.0, f"B{i}": -0.8, f"D{i}": 1.2}
    text = linkage_text.urdf(
        "two", joints, cuts, inputs={"q0": "A0", "q1": "A1"}, home=home, tip="k1"
    )
    exact = cc.load_urdf(text, xacro=False)
    assert exact.rounding is None
    # a hinge of the second loop leans by what four decimals leave out
    before, middle, after = text.partition('<joint name="D1"')
    leaning = before + middle + after.replace('axis xyz="0 0 1"', 'axis xyz="0 0.0001 1"', 1)
    m = cc.load_urdf(leaning, xacro=False)
    assert m.rounding is not None
    assert {change.where.split()[0] for change in m.rounding.changed} == {"D1"}
    assert m.rounding.kept == (0, 1, 5, 6)
    assert m.rounding.redundant == (2, 3, 4, 7, 8, 9)
    assert cc.mobility(m).mobility == 2
    assert 5e-5 < m.misfit < 5e-4


def bar_closed_by(kind: ClosureType) -> cc.Mechanism:
    """Planar linkage of mobility 1 (2 where a rod, 3 where nothing closes it) with such a joint."""
    tree = [
        linkage_text.J("A", "base", "crank"),
        linkage_text.J("B", "crank", "coupler", "0.15 0 0"),
        linkage_text.J("D", "base", "rocker", "0.4 0 0"),
    ]
    home = {"A": 1.0, "B": -0.8, "D": 1.2}
    end = linkage_text.J("E", "coupler", "end", "0.35 0 0")
    cut = linkage_text.Cut("C", "coupler", "rocker", "0.35 0 0", "0.2 0 0", type=kind)
    if kind == "fixed":
        tree.append(end)
        cut = linkage_text.Cut("C", "end", "rocker", "0 0 0", "0.2 0 0", type=kind)
    elif kind == "prismatic":
        tree, home = [*tree[:2], end], {"A": 0.7}
        x = "1 0 0"
        cut = linkage_text.Cut("C", "base", "end", type=kind, axis=x, child_axis=x)
    elif kind == "universal":
        cut = replace(cut, child_axis="0 1 0")
    return linkage_text.load(
        "bar", tree, [cut], inputs={"q1": "A"}, home=home, tip="coupler", outputs="x"
    )


@pytest.mark.parametrize("decimals", [8, 6, 5])
@pytest.mark.parametrize(
    "kind",
    ["revolute", "spherical", "cylindrical", "universal", "fixed", "prismatic", "planar"],
)
def test_planar_loops_closed_by_any_joint(
    kind: ClosureType, decimals: int, tol: Tolerances
) -> None:
    exact = bar_closed_by(kind)
    if kind != "planar":
        check(exact, decimals, decimals, tol)
        return
    # a planar joint in a plane asks for nothing at all: three rows, and none of them independent
    text = rounded_urdf(exact.description, decimals, np.random.default_rng(3), values(exact))
    m = cc.load_urdf(text)
    assert m.rounding is not None
    assert (m.rounding.kept, m.rounding.redundant) == ((), (0, 1, 2))
    assert (cc.mobility(exact).mobility, cc.mobility(m).mobility) == (3, 3)
