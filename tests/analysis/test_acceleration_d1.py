"""Second-order motion of D1: reference numbers, and finite differences of the position solution."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from conftest import Tolerances, assert_close

import closedchain as cc


def test_reference_accelerations(
    d1: cc.Mechanism, reference: Callable[[str], Any], tol: Tolerances
) -> None:
    for sample in reference("d1")["kinematics"]:
        q = cc.direct(d1, sample["q"]).raise_if_failed().q
        found = cc.acceleration(d1, q, sample["qd"], sample["qdd"])
        assert_close(found.tip_twist, sample["v_tip"] + sample["omega"], tol.reference)
        assert_close(found.tip_acceleration, sample["a_tip"] + sample["alpha"], tol.reference)


def test_periodic_motion(
    d1: cc.Mechanism, reference: Callable[[str], Any], tol: Tolerances
) -> None:
    for s in reference("d1")["periodic"]["samples"]:
        inputs, rates, second = (
            [s[f"{prefix}{i}"] for i in range(1, 7)] for prefix in ("q", "qd", "qdd")
        )
        q = cc.direct(d1, inputs).raise_if_failed().q
        found = cc.acceleration(d1, q, rates, second)
        tip = [s[f"{n}_{x}"] for n in ("atip", "alpha") for x in "xyz"]
        assert_close(found.tip_acceleration, tip, 10 * tol.reference, f"t = {s['t']:.3f}")


def test_against_finite_differences_of_positions(d1: cc.Mechanism) -> None:
    """Along inputs q0 + v t + a t^2 / 2, second differences of the posture give qdot and qddot."""
    rng = np.random.default_rng(2)
    start = d1.input_values(d1.home) + 0.01 * rng.standard_normal(6)
    q = cc.direct(d1, start).raise_if_failed().q
    v, a = 0.1 * rng.standard_normal(6), rng.standard_normal(6)
    found = cc.acceleration(d1, q, v, a)
    h = 1e-3
    ahead, behind = (
        cc.direct(d1, start + s * h * v + 0.5 * h**2 * a, q).raise_if_failed().q for s in (1, -1)
    )
    forth, back = pin.difference(d1.model, q, ahead), pin.difference(d1.model, q, behind)
    assert_close((forth - back) / (2 * h), found.qdot, 1e-4 * (1 + np.abs(found.qdot).max()))
    assert_close((forth + back) / h**2, found.qddot, 1e-4 * (1 + np.abs(found.qddot).max()))
    loops = cc.constraint_jacobian(d1, q) @ found.qddot + cc.constraint_drift(d1, q, found.qdot)
    assert_close(loops, np.zeros(27), 1e-12)


def test_singular_posture_is_refused(d1: cc.Mechanism, reference: Callable[[str], Any]) -> None:
    example = reference("d1")["singular"]["S1_flat"]
    placed = {
        "coupler": pin.SE3(np.eye(3), np.array(example["pB"])),
        "platform": pin.SE3(np.eye(3), np.array(example["pC"])),
    }
    q = cc.close(d1, place=placed).raise_if_failed().q
    with pytest.raises(cc.ClosureError, match="rank 24"):
        cc.acceleration(d1, q, np.zeros(6), np.zeros(6))


def test_inputs_by_name(d1: cc.Mechanism) -> None:
    rates = dict.fromkeys(d1.inputs, 0.01)
    by_name = cc.acceleration(d1, d1.home, rates, dict.fromkeys(d1.inputs, 0.0))
    by_order = cc.acceleration(d1, d1.home, [0.01] * 6, [0.0] * 6)
    assert_close(by_name.tip_twist, by_order.tip_twist, 0.0)
    with pytest.raises(cc.ClosureError, match="no value for input q6"):
        cc.acceleration(d1, d1.home, dict.fromkeys(d1.inputs[:5], 0.0), [0.0] * 6)
