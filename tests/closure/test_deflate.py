"""Postures where closures hold to the second order: found to rounding, and told from crossings."""

from __future__ import annotations

import math

import numpy as np
import pinocchio as pin
import pytest
from conftest import Tolerances

import closedchain as cc
from closedchain.closure.equations import Equations
from closedchain.closure.solve.deflate import deflated
from closedchain.closure.solve.descend import descend

FLOOR = 1e-5
RANK = 3  # of Wren's six rods in every posture


@pytest.fixture(scope="module")
def wren() -> cc.Mechanism:
    return cc.load("wren")


def on_a_sphere(wren: cc.Mechanism) -> np.ndarray:
    """The platform moved aside without turning, all rods parallel."""
    q = np.array(wren.home)
    q[:3] = 2.0 * np.array([0.3, 0.2, math.sqrt(1.0 - 0.13)])
    return q


def turned(wren: cc.Mechanism, angle: float = 0.8) -> np.ndarray:
    """The platform turned about its axis and lowered, the rods on a hyperboloid."""
    q = np.array(wren.home)
    q[2] = math.sqrt(4.0 - 4.0 * math.sin(angle / 2.0) ** 2)
    q[5:7] = math.sin(angle / 2.0), math.cos(angle / 2.0)
    return q


@pytest.mark.parametrize(("place", "dimension"), [(on_a_sphere, 2), (turned, 1)])
def test_wrens_branches(wren: cc.Mechanism, place: object, dimension: int, tol: Tolerances) -> None:
    """Rows of 1e-13 tell a posture to 1e-6 only; the loss of rank tells it to rounding."""
    q = place(wren)  # type: ignore[operator]
    equations = Equations(wren, np.arange(6))
    motions = np.linalg.svd(equations.evaluate(q)[1])[2][RANK:]
    for sign in (1.0, -1.0):
        off = equations.move(q, sign * 1e-3 * np.array([1.0, -0.7, 0.4]) @ motions)
        by_rows = descend(equations, off).q
        found = deflated(equations, off, RANK, FLOOR)
        assert found is not None
        assert found.open < 1e-14
        assert found.straight().shape == (3, dimension)
        assert found.alone()
        assert distance(equations, found.q) < 1e-13 < distance(equations, by_rows)
        # aside by no more than it was, and not back along the branch
        assert np.linalg.norm(pin.difference(wren.model, off, found.q)) < 3e-3


def distance(equations: Equations, q: np.ndarray) -> float:
    """Fourth singular value: of the first order in how far a posture is off its branch."""
    return float(np.linalg.svd(equations.evaluate(q)[1], compute_uv=False)[RANK])


def test_where_branches_meet_none_is_alone(wren: cc.Mechanism) -> None:
    found = deflated(Equations(wren, np.arange(6)), wren.home, RANK, FLOOR)
    assert found is not None
    assert found.straight().shape == (3, 3)  # even to the second order closures hold at home
    flat = flat_parallelogram()
    crossing = deflated(Equations(flat, np.arange(3)), flat.home, 1, FLOOR)
    assert crossing is not None
    assert crossing.straight().shape == (2, 0)
    assert not crossing.alone()  # a parallelogram and an antiparallelogram part there


def flat_parallelogram() -> cc.Mechanism:
    hinge = '<axis xyz="0 0 1"/><limit lower="-9" upper="9" effort="1" velocity="1"/>'

    def joint(name: str, parent: str, child: str, x: str) -> str:
        return (
            f'<joint name="{name}" type="revolute"><parent link="{parent}"/>'
            f'<child link="{child}"/><origin xyz="{x} 0 0"/>{hinge}</joint>'
        )

    return cc.load_urdf(
        '<robot name="flat"><link name="base"/><link name="crank"/><link name="bar"/>'
        '<link name="rocker"/>'
        + joint("A", "base", "crank", "0")
        + joint("B", "crank", "bar", "0.1")
        + joint("D", "base", "rocker", "0.4")
        + '<constraint name="C" type="revolute"><parent link="bar"/>'
        '<parent_origin xyz="0.4 0 0"/><parent_axis xyz="0 0 1"/><child link="rocker"/>'
        '<child_origin xyz="0.1 0 0"/></constraint></robot>'
    )


def test_regular_postures_stay_where_they_are(tol: Tolerances) -> None:
    m = cc.load("bennett")
    equations = Equations(m, np.arange(m.model.nv))
    found = deflated(equations, m.home, cc.mobility(m).generic_rank, FLOOR)
    assert found is not None
    assert np.abs(found.q - m.home).max() < tol.closure
    assert found.straight().shape == (1, 1)
    assert found.alone()


def test_a_rank_that_is_nowhere_near_is_not_feigned() -> None:
    """Of rank two in its usual postures, a five-bar cannot be made to be of one."""
    m = cc.load("five_bar")
    equations = Equations(m, np.arange(m.model.nv))
    found = deflated(equations, m.home, 1, FLOOR)
    assert found is None or found.open > 1e-3
