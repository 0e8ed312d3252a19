"""All postures: searched, counted, told apart by shape, proved; small cases against geometry."""

from __future__ import annotations

import math

import numpy as np
import pinocchio as pin
import pytest
from conftest import Tolerances
from small_linkages import GRASHOF, ROCKING, build, four_bar, four_bar_angles, joint, loop

import closedchain as cc
from closedchain.closure.modes.complex_equations import ComplexEquations
from closedchain.closure.modes.shapes import Shapes
from closedchain.closure.position import driven, posed
from closedchain.urdf.errors import ClosureError


def turned(angles: np.ndarray) -> np.ndarray:
    return (angles + np.pi) % (2.0 * np.pi) - np.pi


# -- small cases ----------------------------------------------------------------------------------


@pytest.mark.parametrize(("bars", "crank"), [(GRASHOF, 0.3), (GRASHOF, -2.0), (ROCKING, 0.9)])
def test_a_four_bar_has_two(bars: tuple[float, ...], crank: float, tol: Tolerances) -> None:
    m = four_bar(bars, crank)
    found = cc.postures(m, inputs=[crank])
    assert (found.complete, found.complex_count, len(found)) == ("counted", 2, 2)
    expected = [turned(np.array(four_bar_angles(bars, crank, side))) for side in (1, -1)]
    for angles in expected:
        assert min(np.abs(turned(q - angles)).max() for q in found.q) < tol.algebra
    assert found.certified.all()
    assert found.names[0] == "home"
    assert set(found.branch.tolist()) == {-1, 1}
    assert "Counted: 2 complex solutions" in found.text


def test_out_of_reach_there_are_none_and_complex_ones_are_counted() -> None:
    m = four_bar(ROCKING, 0.9)
    found = cc.postures(m, inputs=[math.pi])
    assert (found.complete, found.complex_count, len(found)) == ("counted", 2, 0)
    assert found.text.startswith("0 postures")


def test_with_nothing_held_a_linkage_is_one_family() -> None:
    found = cc.postures(four_bar(GRASHOF, 0.3))
    assert [f.dimension for f in found.families] == [1] * len(found)
    assert found.complete == "searched"
    assert found.complex_count is None
    assert "family of postures, of dimension 1" in found.text


def test_any_joint_may_be_held(tol: Tolerances) -> None:
    m = four_bar(GRASHOF, 0.3)
    held = float(m.home[2])
    found = cc.postures(m, fixed={"rocker_joint": held})
    assert (found.complete, len(found)) == ("counted", 2)
    assert np.abs(found.q[:, 2] - held).max() < tol.algebra
    assert np.abs([m.workspace.residual(q).max() for q in found.q]).max() < tol.closure


def test_each_is_a_solution_that_solvers_take() -> None:
    m = four_bar(GRASHOF, 0.3)
    found = cc.postures(m, inputs=[0.3], count=False)
    for name, one in zip(found.names, found, strict=True):
        assert np.array_equal(one.q, found[name].q)
        again = cc.direct(m, [0.35], guess=one)
        assert np.array_equal(again.q, cc.direct(m, [0.35], guess=one.q).q)
        assert again.converged
        assert np.abs(again.q - one.q).max() < 0.3
        assert cc.classify(m, one.q).kinds == frozenset()
    with pytest.raises(KeyError, match="no posture is called"):
        found["nowhere"]
    with pytest.raises(IndexError):
        found[7]


# -- shapes ---------------------------------------------------------------------------------------


def test_shapes_on_complex_numbers_are_those_on_real_ones(tol: Tolerances) -> None:
    m = cc.load("eclipse")
    q = np.array([m.home, m.posture("-+-")])
    assert np.abs(Shapes(m).of(q + 0j) - Shapes(m).of(q)).max() < tol.algebra


# -- equations on complex numbers -----------------------------------------------------------------


@pytest.mark.parametrize("robot", ["eclipse", "linear_delta", "rus6", "d1"])
@pytest.mark.parametrize("tip", [False, True])
def test_complex_jacobian_is_the_derivative(robot: str, tip: bool) -> None:
    m = cc.load(robot)
    problem = posed(m) if tip else driven(m)
    equations, rng = ComplexEquations(problem), np.random.default_rng(2)
    q = m.home[None] + 0.2 * (rng.standard_normal((1, m.model.nq)) + 0.5j)
    targets = problem.targets_at(m.home).astype(complex)
    q[:, problem.pinned_q] = targets[:, : len(problem.pinned)]
    for at in (equations.at, equations.all_rows):
        values, jacobian = at(q, targets)
        step = 1e-6 * (rng.standard_normal((1, equations.size)) * (1.0 + 0.3j))
        one, _ = at(equations.moved(q, step), targets)
        two, _ = at(equations.moved(q, -step), targets)
        # quaternions that are no unit ones are made so by a step: compare from there
        if all(n == 1 for n in list(m.model.nqs)[1:]):
            expected = (jacobian @ step[..., None])[..., 0]
            assert np.abs(0.5 * (one - two) - expected).max() < 1e-11
        assert np.isfinite(values).all()


# -- robots ---------------------------------------------------------------------------------------


def test_working_modes_of_the_linear_delta_are_those_of_its_description() -> None:
    m = cc.load("linear_delta")
    found = cc.postures(m, pose=m.pose(m.home), count=False)
    assert len(found) == 8
    assert set(found.names) | {"+++"} == set(m.postures)  # which is home
    for name in found.names:
        assert np.abs(found[name].q - m.postures[name]).max() < 1e-9
    assert found.certified.all()
    assert "independent rows" in found.text


@pytest.mark.slow
def test_eclipse_has_sixteen_of_which_eight_are_real_at_home() -> None:
    m = cc.load("eclipse")
    found = cc.postures(m, inputs=m.input_values(m.home))
    assert (found.complete, found.complex_count, len(found)) == ("counted", 16, 8)
    assert found.certified.all()
    other = m.input_values(m.home) + np.array([0.02, -0.03, 0.01, 0.02, -0.01, 0.015])
    moved = cc.postures(m, inputs=other)
    assert (moved.complete, moved.complex_count) == ("counted", 16)


@pytest.mark.slow
def test_d1_has_256_of_which_68_are_real_at_home() -> None:
    """The closed form has the same 68."""
    from closedchain.robots import d1

    m = cc.load("d1")
    inputs = m.input_values(m.home)
    found = cc.postures(m, inputs=inputs)
    assert (found.complete, found.complex_count, len(found)) == ("counted", 256, 68)
    assert found.certified.all()
    tips = np.array([m.point(q, "platform") for q in found.q])
    for assembly in d1.forward(inputs, d1.geometry()).assemblies:
        assert np.abs(tips - assembly.platform.position).max(axis=1).min() < 1e-8


# -- singular values, whole turns, relations -------------------------------------------------------


def test_where_two_modes_meet_there_is_one_that_counts_twice() -> None:
    """The rocker drives, crank and rod are stretched out: 0.15 + 0.35 = hypot(0.3, 0.4)."""
    bars = (0.15, 0.35, 0.3, 0.4)
    m = four_bar(bars, math.acos(0.8))
    held = {"rocker_joint": math.pi / 2.0}
    found = cc.postures(m, fixed=held)
    assert (found.complete, found.complex_count, len(found)) == ("counted", 2, 1)
    assert found.multiplicity.tolist() == [2]
    assert not found.certified[0]
    assert abs(float(np.sin(found.q[0][1]))) < 1e-6
    assert "counts 2 times: it is singular" in found.text
    near = cc.postures(m, fixed={"rocker_joint": math.pi / 2.0 - 0.05})
    assert (near.complete, near.complex_count) == ("counted", 2)


def test_a_family_at_special_values_is_told() -> None:
    """A rhombus with its crank on the ground bar: rod and rocker turn together."""
    m = four_bar((0.3, 0.3, 0.3, 0.3), 0.7)
    found = cc.postures(m, inputs=[0.0])
    assert [f.dimension for f in found.families] == [1]
    q = found.families[0].q
    assert np.abs(m.workspace.residual(q)).max() < 1e-9
    assert found.complete == "searched"
    assert "family of postures, of dimension 1" in found.text


@pytest.mark.parametrize("turns", [1, -3, 795])
def test_whole_turns_of_what_is_held_change_nothing(turns: int) -> None:
    m = four_bar(GRASHOF, 0.3)
    found = cc.postures(m, inputs=[0.3 + 2.0 * np.pi * turns])
    assert (found.complete, found.complex_count, len(found)) == ("counted", 2, 2)


def tied(multiplier: float, offset: float) -> cc.Mechanism:
    """A five-bar whose second crank follows the first."""
    mimic = f'<mimic joint="A" multiplier="{multiplier}" offset="{offset}"/>'
    parts = [
        joint("A", "base", "left"),
        joint("B", "left", "left_rod", "0.2 0 0"),
        joint("C", "base", "right", "0.2 0 0", more=mimic),
        joint("D", "right", "right_rod", "0.2 0 0"),
        loop("revolute", "left_rod", "0.25 0 0", "right_rod", "0.25 0 0"),
    ]
    home = {"A": 2.0, "B": -1.2, "C": multiplier * 2.0 + offset, "D": 1.2}
    task = '<task base="base" tip="left_rod" outputs="rz"/>'
    return build("base left left_rod right right_rod", parts, home, "A", task)


def test_relations_hold_in_every_posture() -> None:
    """Angles that a mimic ties are not turned back on their own."""
    whole = tied(-2.0, 6.1)
    for value in (0.4, 2.0, 8.0):
        found = cc.postures(whole, inputs=[value])
        assert found.residual.max(initial=0.0) < 1e-9
        assert found.complete == "counted"
    parts = tied(-2.5, 6.1)
    found = cc.postures(parts, fixed={"B": -1.0})
    assert found.complete == "searched"
    assert found.complex_count is None
    assert "count whole turns" in found.text
    assert len(found) >= 4
    assert found.residual.max() < 1e-9


def test_nothing_found_is_not_called_certain() -> None:
    found = cc.postures(four_bar(ROCKING, 0.9), inputs=[math.pi], count=False)
    assert len(found) == 0
    assert "That proves nothing" in found.text


# -- what cannot be asked -------------------------------------------------------------------------


def test_refusals() -> None:
    m = cc.load("linear_delta")
    for asked, why in (
        ({"inputs": {"q1": 0.1}}, "q2"),
        ({"inputs": [0.1, 0.2]}, "3"),
        ({"fixed": {"nowhere": 0.1}}, "nowhere"),
        ({"fixed": {"leg1_P": math.nan}}, "finite"),
        ({"fixed": {"leg1_P": "far"}}, r"finite number \[m\]"),
        ({"fixed": {"leg1_P": -0.1, "q1": -0.1}}, "same joint"),
        ({"pose": "home"}, "pin.SE3"),
        ({"pose": pin.SE3(np.eye(3), np.full(3, math.nan))}, "finite numbers"),
        ({"inputs": [0, 0, 0], "fixed": {}}, "hold one of"),
        ({"inputs": [0, 0, 0], "starts": 0}, "starts must be a whole number from 1 on, got 0"),
        ({"inputs": [0, 0, 0], "seed": -1}, "seed must be a whole number from 0 on, got -1"),
        ({"inputs": [0, 0, 0], "seconds": math.nan}, "seconds must be 0 or above, got nan"),
    ):
        with pytest.raises(ClosureError, match=why):
            cc.postures(m, **asked)  # type: ignore[arg-type]


def test_time_that_runs_out_gives_what_was_found() -> None:
    m = four_bar((0.31, 1.0, 0.8, 1.0), 0.3)
    found = cc.postures(m, inputs=[0.3], seconds=0.0)
    assert (found.complete, len(found)) == ("searched", 2)
    assert "time allowed was used up" in found.text


def test_families_have_the_dimension_of_their_motions_not_of_their_tangents() -> None:
    """Wren's platform: three freedoms to the first order wherever it moves in two."""
    found = cc.postures(cc.load("wren"), fixed={})
    assert len(found)
    assert {f.dimension for f in found.families} == {2}
    rpa3t = cc.load("rpa3t")
    for family in cc.postures(rpa3t, fixed={}).families:
        s = np.linalg.svd(cc.constraint_jacobian(rpa3t, family.q), compute_uv=False)
        assert family.dimension == rpa3t.model.nv - int((s > 1e-6 * s[0]).sum())
