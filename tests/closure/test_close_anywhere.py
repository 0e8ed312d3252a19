"""``close`` finds what is there: other assemblies, folds, held joints that agree, turned legs."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from conftest import Tolerances, assert_close
from d1_solutions import check_solution
from small_linkages import (
    ROCKING,
    angle,
    direction,
    four_bar,
    four_bar_angles,
    joint,
    same_angles,
    toggle,
)

import closedchain as cc
from closedchain.closure.equations import Equations
from closedchain.closure.solve.samples import closed_samples
from closedchain.robots.d1 import forward, geometry


def test_all_of_d1s_assemblies_close_with_bodies_placed_and_inputs_held(
    d1: cc.Mechanism, tol: Tolerances
) -> None:
    """Legs that end half a turn off descend to an open posture first."""
    inputs = d1.input_values(d1.home)
    assemblies = forward(inputs, geometry()).assemblies
    assert len(assemblies) == 68
    for one in assemblies:
        poses = {
            "coupler": pin.SE3(one.coupler.rotation, one.coupler.position),
            "platform": pin.SE3(one.platform.rotation, one.platform.position),
        }
        s = cc.close(d1, fixed=dict(zip(d1.inputs, inputs, strict=True)), place=poses)
        check_solution(d1, s, tol)
        assert np.array_equal(d1.input_values(s.q), inputs)
        for body, pose in poses.items():
            assert_close(d1.pose(s.q, body).homogeneous, pose.homogeneous, 1e-12, body)


@pytest.mark.parametrize("robot", cc.robots("papers"))
@pytest.mark.parametrize("start", ["home", "anywhere"])
def test_joints_held_and_bodies_placed_as_in_a_closed_posture_close(
    robot: str, start: str, tol: Tolerances
) -> None:
    """Whatever is held, redundant or not, agrees with a posture, so there is one."""
    m = cc.load(robot)
    rng = np.random.default_rng(11)
    for q in closed_samples(m)[1:]:
        guess = m.home
        if start == "anywhere":
            v = 1.5 * rng.standard_normal(m.model.nv) * m.column_scale
            guess = pin.integrate(m.model, guess, v)
        fixed, place = _some(m, q, rng)
        check_solution(m, cc.close(m, guess, fixed=fixed, place=place), tol)


@pytest.mark.parametrize("robot", cc.robots("papers"))
def test_a_closed_guess_is_not_spoilt(robot: str, tol: Tolerances) -> None:
    """Closed to some 5e-13, with what is held: the answer is no worse, and beside the guess."""
    m = cc.load(robot)
    rng = np.random.default_rng(12)
    worst = 0.0
    for q in closed_samples(m):
        guess = pin.integrate(m.model, q, 2e-13 * rng.standard_normal(m.model.nv))
        before = float(np.abs(cc.residual(m, guess)).max())
        assert before < tol.closure
        worst = max(worst, before)
        fixed, place = _some(m, guess, rng)
        s = cc.close(m, guess, fixed=fixed, place=place)
        check_solution(m, s, tol)
        goals = Equations(m, np.arange(m.model.nv))
        assert np.abs(goals.residual(s.q)).max() <= max(before, 1e-13)
        assert_close(pin.difference(m.model, guess, s.q), np.zeros(m.model.nv), 1e-8)
    assert worst > 1e-13


@pytest.mark.parametrize("asked", ["fixed", "points", "place"])
def test_a_fold_is_found_to_rounding(asked: str) -> None:
    """Rod and rocker in line: rows of 1e-16 tell the angles to 1e-8 only, the Jacobian to 1e-15."""
    m = four_bar(ROCKING, 0.9)
    crank = toggle(ROCKING)
    tip = ROCKING[0] * direction(crank)
    line = angle(np.array([ROCKING[3], 0.0]) - tip)
    exact = [crank, line - crank, line + np.pi]
    tip_pose = pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, crank), np.zeros(3))
    question: dict[str, Any] = {
        "fixed": {"crank_joint": crank},
        "points": {"rod": np.array([*tip, 0.0])},
        "place": {"crank": tip_pose},
    }[asked]
    rng = np.random.default_rng(13)
    for spread in (0.0, 0.2, 0.4):
        guess = m.home + spread * rng.standard_normal(3)
        s = cc.close(m, guess, **{asked: question})
        assert s.converged, s.message
        assert s.residual < 1e-15
        same_angles(s.q, exact, 1e-13)


@pytest.mark.parametrize("off", [1e-4, 1e-5, 2e-6])
def test_a_posture_beside_a_fold_is_not_taken_for_it(off: float) -> None:
    """Two roots on both sides of the fold, told apart by the crank's value."""
    m = four_bar(ROCKING, 0.9)
    crank = toggle(ROCKING) - off**2
    exact = [four_bar_angles(ROCKING, crank, side) for side in (1, -1)]
    s = cc.close(m, fixed={"crank_joint": crank})
    assert s.converged, s.message
    turns = [(s.q - one + np.pi) % (2 * np.pi) - np.pi for one in exact]
    assert min(np.abs(t).max() for t in turns) < 1e-4 * off
    assert np.abs(np.subtract(*exact)).max() > off


def test_two_legs_stretched_at_once_are_found_to_rounding() -> None:
    """Each leg is a double root of its own."""
    legs = [
        joint(name, *rest)
        for name, *rest in [
            ("A", "base", "a", "0 0 0"),
            ("B", "a", "b", "0.4 0 0"),
            ("C", "base", "c", "1.6 0 0"),
            ("D", "c", "d", "0.4 0 0"),
        ]
    ]
    links = "".join(f'<link name="{n}"/>' for n in ("base", "a", "b", "c", "d", "p", "r"))
    held = [
        joint("bp", "b", "p", "0.3 0 0", kind="fixed"),
        joint("dr", "d", "r", "0.3 0 0", kind="fixed"),
    ]
    m = cc.load_urdf(f'<robot name="two_legs">{links}{"".join(legs + held)}</robot>', xacro=False)
    goals = {"p": [0.7, 0.0, 0.0], "r": [0.9, 0.0, 0.0]}
    s = cc.close(m, [0.3, -0.5, 2.8, 0.6], points=goals)
    assert s.converged, s.message
    same_angles(s.q, [0.0, 0.0, np.pi, 0.0], 1e-13)


def test_a_stationary_guess_is_left(tol: Tolerances) -> None:
    """All bars in one line, pointing away: no small motion brings the ends nearer."""
    m = four_bar(ROCKING, 0.9)
    assert "another start" not in cc.close(m).message
    assert "found from another start" in cc.close(m, [0.0, 0.0, np.pi]).message
    for guess in ([0.0, 0.0, np.pi], [0.0, 0.0, 0.0], [np.pi, 0.0, 0.0], [0.0, np.pi, np.pi]):
        check_solution(m, cc.close(m, guess), tol)
    for crank in (0.7, -0.7):
        exact = [four_bar_angles(ROCKING, crank, side) for side in (1, -1)]
        line = angle(np.array([ROCKING[3], 0.0]) - ROCKING[0] * direction(crank))
        # rod and rocker both straight away from each other
        s = cc.close(m, [crank, line - crank + np.pi, line], fixed={"crank_joint": crank})
        check_solution(m, s, tol)
        turns = [(s.q - one + np.pi) % (2 * np.pi) - np.pi for one in exact]
        assert min(np.abs(t).max() for t in turns) < 1e-12


def test_a_point_behind_a_stretched_arm_turns_it_round() -> None:
    """Straight behind the misfit is stationary, and greatest: it is left for the least."""
    parts = [joint("A", "base", "a"), joint("B", "a", "b", "0.4 0 0")]
    parts.append(joint("bp", "b", "p", "0.3 0 0", kind="fixed"))
    links = "".join(f'<link name="{n}"/>' for n in ("base", "a", "b", "p"))
    m = cc.load_urdf(f'<robot name="arm">{links}{"".join(parts)}</robot>', xacro=False)
    s = cc.close(m, [0.0, 0.0], points={"p": [-1.0, 0.0, 0.0]})
    assert_close(m.point(s.q, "p"), [-0.7, 0.0, 0.0], 1e-8)
    assert "remain off by up to 0.3 m" in s.message
    assert "another start" not in s.message


def test_what_does_not_exist_stays_open(d1: cc.Mechanism) -> None:
    """The search elsewhere makes no posture up; what comes back is the same every time."""
    m = four_bar(ROCKING, 0.9)
    found = [cc.close(m, fixed={"crank_joint": toggle(ROCKING) + 0.01}) for _ in range(2)]
    assert not found[0].converged
    assert "stays open by" in found[0].message
    assert np.array_equal(found[0].q, found[1].q)
    inputs = dict(zip(d1.inputs, d1.input_values(d1.home) + 0.02, strict=True))
    place = {"platform": d1.pose(d1.home, "platform")}
    assert not cc.close(d1, fixed=inputs, place=place).converged


def _some(
    m: cc.Mechanism, q: np.ndarray, rng: np.random.Generator
) -> tuple[dict[str, Any], dict[str, pin.SE3]]:
    """Some joints and bodies, where they are in a posture."""
    fixed = {
        name: q[j.idx_q : j.idx_q + j.nq]
        for name, j in list(zip(m.model.names, m.model.joints, strict=True))[1:]
        if rng.random() < 0.3
    }
    bodies = [link for link in m.frame_ids if link != "base" and rng.random() < 0.15]
    return fixed, {link: m.pose(q, link) for link in bodies}
