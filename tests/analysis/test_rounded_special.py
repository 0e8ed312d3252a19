"""Rounded files where numbers fit in several ways, or closures hold to the second order."""

from __future__ import annotations

import math
from dataclasses import replace

import linkages
import numpy as np
import pytest
from conftest import Tolerances
from rounded_checks import check, rounded, values
from rounded_files import rounded_urdf

import closedchain as cc
from closedchain.closure import mechanism_from_description
from closedchain.closure.rounding.relations import (
    AT_RIGHT_ANGLES,
    MEETING,
    ONE,
    PARALLEL,
    WITHOUT_OFFSET,
    Relations,
    relations,
)
from closedchain.urdf import digits, read


@pytest.fixture(scope="module")
def wren() -> cc.Mechanism:
    """Two regular hexagons of radius 1, six equal rods of 2 between their corners."""
    return cc.load("wren")


@pytest.mark.slow
@pytest.mark.parametrize(("decimals", "seed"), [(8, 33), (6, 2), (5, 12)])
def test_wren_keeps_its_three_freedoms_and_its_two_ways(
    wren: cc.Mechanism, decimals: int, seed: int, tol: Tolerances
) -> None:
    """Of rank three everywhere, and never as many motions: 2 and 1 (see the classics)."""
    m = check(wren, decimals, seed, tol)
    assert cc.mobility(m).mobility == 3
    assert m.rounding is not None
    assert len(m.rounding.kept) == 3
    # both plates are congruent again, which is what lets the rods stay parallel
    base = distances([closure.placement1.translation for closure in m.closures])
    platform = distances([closure.placement2.translation for closure in m.closures])
    assert np.abs(base - platform).max() < 1e-12


def distances(points: list[np.ndarray]) -> np.ndarray:
    """Distances (n, n) of points."""
    return np.asarray(np.linalg.norm(np.array(points)[:, None] - np.array(points), axis=2))


@pytest.mark.parametrize("between", [0.5, 1.1, math.pi / 2])
@pytest.mark.parametrize("seed", [11, 18, 22, 23])
def test_legs_of_parallel_hinges(between: float, seed: int, tol: Tolerances) -> None:
    """Beside those whose hinges meet far away: numbers fit between the two, but never well."""
    check(linkages.sarrus(between), 5, seed, tol)


@pytest.mark.parametrize("decimals", [8, 6])
def test_legs_of_parallel_hinges_with_more_digits(decimals: int, tol: Tolerances) -> None:
    m = check(linkages.sarrus(1.1), decimals, 18, tol)
    assert cc.mobility(m).mobility == 1


@pytest.mark.parametrize("seed", [1, 2])
def test_rings_of_right_angles(seed: int, tol: Tolerances) -> None:
    check(linkages.bricard(), 5, seed, tol)


# -- told apart ------------------------------------------------------------------------------------


def test_a_hinge_that_leans_holds_a_platform_fast() -> None:
    """By 35 times what five decimals leave open: it is no rounding."""
    exact = linkages.sarrus(1.1, lean=math.radians(0.2))
    assert exact.rounding is None
    m = rounded(exact, 5, 18)
    assert m.rounding is None
    assert cc.mobility(m).mobility == cc.mobility(exact).mobility == 0


def test_a_longer_rod_contradicts_wrens_others(wren: cc.Mechanism) -> None:
    """By 3 mm: twenty times what five decimals leave open, and nothing closes."""
    closures = tuple(
        replace(spec, sizes=(("length", 2.003),)) if spec.name == "rod1" else spec
        for spec in wren.description.closures
    )
    longer = replace(wren.description, closures=closures, text="")
    exact = mechanism_from_description(longer)
    m = cc.load_urdf(rounded_urdf(longer, 5, np.random.default_rng(1), values(wren)), xacro=False)
    assert m.rounding is None
    assert m.home_open
    assert m.open_by == pytest.approx(exact.open_by, rel=0.05)
    assert exact.open_by == pytest.approx(5e-4, rel=0.05)  # six rows share the 3 mm


# -- how axes lie to each other --------------------------------------------------------------------


def asked(m: cc.Mechanism, decimals: int, seed: int = 4) -> tuple[Relations, cc.Mechanism]:
    text = rounded_urdf(m.description, decimals, np.random.default_rng(seed), values(m))
    description = read(text)
    numbers = digits.numbers(description)
    slack = np.array([number.unit for number in numbers])
    owners = frozenset(number.owner for number in numbers)
    return relations(description, numbers, slack, owners, 0.3), description


def counts(found: Relations) -> tuple[int, ...]:
    """Of axes that are parallel, one, at right angles, meet, and of hinges without offset."""
    kinds = (PARALLEL, ONE, AT_RIGHT_ANGLES, MEETING, WITHOUT_OFFSET)
    return tuple(len(found.groups[kind]) for kind in kinds)


@pytest.mark.parametrize("decimals", [8, 5])
def test_relations_are_those_of_the_drawing(decimals: int) -> None:
    """Counted by hand: on the links, the base and the platform or coupler."""
    assert counts(asked(linkages.four_bar(), decimals)[0]) == (4, 0, 0, 0, 0)
    # Bennett's hinges are turned against each other, and the normals of each meet in one point
    assert counts(asked(linkages.bennett(), decimals)[0]) == (0, 0, 0, 0, 4)
    # two parallel hinges on each of four links; the feet of both legs lie in one plane, as the
    # ends do, and so their hinges meet
    assert counts(asked(linkages.sarrus(1.1), decimals)[0]) == (4, 0, 0, 2, 0)
    assert counts(asked(linkages.sarrus(), decimals)[0]) == (4, 0, 2, 2, 0)
    # six hinges, each at right angles to the next, along whose normals the links lead
    assert counts(asked(linkages.bricard(), decimals)[0]) == (0, 0, 6, 0, 6)


@pytest.mark.parametrize("name", ["sarrus", "bricard", "rpa3t"])
def test_relations_have_their_derivative(name: str, tol: Tolerances) -> None:
    m = cc.load(name) if name == "rpa3t" else getattr(linkages, name)()
    found, description = asked(m, 5)
    printed = np.array([number.value for number in found.numbers])
    rows, slopes = found.at(description)
    h = 1e-6
    for i in range(0, len(printed), 3):
        moved = []
        for sign in (1.0, -1.0):
            other = printed.copy()
            other[i] += sign * h
            moved.append(found.at(digits.with_numbers(description, found.numbers, other))[0])
        difference = (moved[0] - moved[1]) / (2.0 * h)
        assert np.abs(difference - slopes[:, i]).max(initial=0.0) < tol.finite_difference
    assert rows.size >= found.count


# -- every overconstrained mechanism of the catalogue and the classics -----------------------------

OVERCONSTRAINED = [
    "rpa3t", "linear_delta", "five_bar", "three_rrr", "three_rpr", "agile_eye", "bennett", "wren",
    "double_butterfly", "excavator",
]  # fmt: skip


@pytest.mark.slow
def test_the_list_is_complete() -> None:
    found = {name for name in cc.robots() if cc.mobility(cc.load(name)).redundant_rows and name}
    assert found == set(OVERCONSTRAINED)


@pytest.mark.slow
@pytest.mark.parametrize(("decimals", "seed"), [(8, 21), (6, 22), (5, 23)])
@pytest.mark.parametrize("name", OVERCONSTRAINED)
def test_robots_are_read_as_they_are_drawn(
    name: str, decimals: int, seed: int, tol: Tolerances
) -> None:
    check(cc.load(name), decimals, seed, tol)
