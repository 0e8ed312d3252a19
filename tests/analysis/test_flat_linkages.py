"""Linkages that lie flat at home, where closures hold to the second order in false directions."""

from __future__ import annotations

import linkage_text
import numpy as np
import pytest
from conftest import Tolerances
from linkage_text import Cut, J
from rounded_files import rounded_urdf

import closedchain as cc
from closedchain.urdf import ClosureType


def side_by_side(
    count: int, prefix: str = "", base: str = "base", kind: ClosureType = "revolute"
) -> tuple[list[J], list[Cut]]:
    """``count`` parallelograms in a row: equal cranks of 0.1 m, 0.4 m apart, on one bar."""
    joints = [
        J(f"{prefix}A", base, f"{prefix}crank"),
        J(f"{prefix}B", f"{prefix}crank", f"{prefix}bar", "0.1 0 0"),
    ]
    cuts = []
    for i in range(1, count + 1):
        joints.append(J(f"{prefix}D{i}", base, f"{prefix}crank{i}", f"{0.4 * i!r} 0 0"))
        axis = "0 1 0" if kind == "universal" else linkage_text.Z
        ends = (f"{prefix}bar", f"{prefix}crank{i}", f"{0.4 * i!r} 0 0", "0.1 0 0")
        cuts.append(Cut(f"{prefix}C{i}", *ends, type=kind, child_axis=axis))
    return joints, cuts


def flat(count: int, kind: ClosureType = "revolute") -> cc.Mechanism:
    joints, cuts = side_by_side(count, kind=kind)
    return linkage_text.load("flat", joints, cuts, inputs={"q1": "A"}, tip="bar", outputs="y")


@pytest.mark.parametrize("count", [1, 2, 3, 4])
def test_parallelograms_side_by_side_have_one_freedom(count: int) -> None:
    m = flat(count)
    found = cc.mobility(m)
    assert (found.mobility, found.finite) == (1, 1)
    assert found.redundant_rows == 4 * count - 1
    assert found.rank.gap > 1e8
    assert "At home the rank drops" in found.text
    assert cc.classify(m, m.home).kinds == {"direct", "constraint"}
    aside = cc.close(m, fixed={"A": 0.3}).raise_if_failed().q
    moved = cc.direct(m, [0.4], guess=aside).raise_if_failed().q
    assert np.abs(moved - [0.4, -0.4, *[0.4] * count]).max() < 1e-9
    assert cc.classify(m, moved).kinds == frozenset()


def test_a_flat_part_among_others() -> None:
    """On a slide, under a wrist: what moves freely beside it does not hide that it lies flat."""
    joints, cuts = side_by_side(2, base="carriage")
    m = linkage_text.load(
        "carried",
        [
            J("S", "base", "carriage", type="prismatic"),
            *joints,
            J("W", "bar", "hand", axis="1 0 0"),
        ],
        cuts,
        inputs={"q1": "S", "q2": "A", "q3": "W"},
        tip="hand",
        outputs="y z rx",
    )
    found = cc.mobility(m)
    assert (found.mobility, found.finite) == (3, 3)


def test_a_flat_linkage_on_another() -> None:
    """Either may open alone, and only where both have is the rank that of the mechanism."""
    lower, upper = side_by_side(2, "a"), side_by_side(2, "b", "abar")
    m = linkage_text.load(
        "stacked",
        lower[0] + upper[0],
        lower[1] + upper[1],
        inputs={"q1": "aA", "q2": "bA"},
        tip="bbar",
        outputs="x y",
    )
    found = cc.mobility(m)
    assert (found.mobility, found.finite) == (2, 2)


def test_an_isolated_posture_is_judged_beside_itself() -> None:
    """Two bars stretched between two feet: nothing moves, and any other sizes would make it."""
    m = linkage_text.load(
        "stretched",
        [
            J("A", "base", "one"),
            J("B", "one", "two", "0.3 0 0"),
        ],
        [Cut("C", "base", "two", "0.5 0 0", "0.2 0 0", type="spherical")],
        inputs={"q1": "A"},
        tip="two",
        outputs="y",
    )
    found = cc.mobility(m)
    assert (found.mobility, found.finite) == (0, 0)
    assert "constraint" in cc.classify(m, m.home).kinds


@pytest.mark.parametrize(
    ("count", "kind", "decimals"),
    [
        (1, "revolute", 6),
        (2, "revolute", 8),
        (2, "revolute", 5),
        (3, "revolute", 6),
        (1, "spherical", 6),
        (2, "spherical", 5),
        (2, "cylindrical", 6),
        (2, "universal", 5),
    ],
)
def test_rounded(count: int, kind: ClosureType, decimals: int, tol: Tolerances) -> None:
    """Frames turned at random, numbers rounded: still what they were rounded from."""
    exact = flat(count, kind)
    names = list(exact.model.names)[1:]
    stated = {name: (float(value),) for name, value in zip(names, exact.home, strict=True)}
    text = rounded_urdf(exact.description, decimals, np.random.default_rng(3), stated)
    m = cc.load_urdf(text, xacro=False)
    assert not m.home_open, m.notes
    expected, found = cc.mobility(exact), cc.mobility(m)
    assert (found.mobility, found.redundant_rows) == (1, expected.redundant_rows)
    assert m.rounding is not None
    assert m.misfit < 100.0 * 10.0**-decimals
    assert np.abs(cc.residual(m, m.home)).max() < tol.closure
    aside = cc.close(m, fixed={"A": 0.3}, guess=[0.3, -0.3, *[0.3] * count]).raise_if_failed().q
    moved = cc.direct(m, [0.4], guess=aside).raise_if_failed().q
    assert np.abs(moved - [0.4, -0.4, *[0.4] * count]).max() < 3e3 * 10.0**-decimals


def test_rigid_loops_are_named_and_not_taken_for_rounded() -> None:
    """A four-bar one of whose hinges is 0.1 rad off, in a file of few digits, stands still."""
    joints = [
        J("free", "base", "flag", "0 0 0.1234", axis="1 0 0"),
        J("A", "base", "crank"),
        J("B", "crank", "coupler", "0.15 0 0", axis="0 0.1 0.995"),
        J("D", "base", "rocker", "0.4 0 0"),
    ]
    cut = Cut("C", "coupler", "rocker", "0.35 0 0", "0.32 0 0", type="spherical")
    text = linkage_text.urdf("held", joints, [cut], home={"A": 1.1, "B": -0.8, "D": 1.7})
    m = cc.load_urdf(text, xacro=False)
    assert not m.home_open
    found = cc.mobility(m)
    assert found.mobility == 1
    assert "The loops hold still, in every posture looked at: A, B, D." in found.text
