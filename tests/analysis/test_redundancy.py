"""Which inputs may be locked, the split V = G Q + Q_*, redundancy of motion and of actuation."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from conftest import Tolerances, assert_close
from overdriven import overdriven_eclipse

import closedchain as cc

AXIS_TASK = "x y z rx rz"


def sample_posture(d1: cc.Mechanism, reference: Callable[[str], Any]) -> np.ndarray:
    return cc.direct(d1, reference("d1")["kinematics"][0]["q"]).raise_if_failed().q


def test_only_three_inputs_of_d1_may_be_locked_at_home(d1: cc.Mechanism) -> None:
    found = cc.redundancy(d1, d1.home, AXIS_TASK)
    assert (found.dimension, found.generic, found.surplus) == (1, 1, 0)
    assert list(found.locks) == [(f"q{i}",) for i in range(1, 7)]
    values = np.array(list(found.locks.values()))
    assert_close(values[:3], np.full(3, 0.6307667292), 1e-9)
    assert_close(values[3:], np.zeros(3), 1e-12)
    assert found.lockable == (("q1",), ("q2",), ("q3",))
    assert "may be locked (smallest singular value left): q1 0.6308, q2" in found.text
    assert "must not be locked: q4, q5, q6" in found.text
    assert found.rank.gap > 1e10


def test_away_from_vertical_tools_every_input_may_be_locked(
    d1: cc.Mechanism, reference: Callable[[str], Any]
) -> None:
    found = cc.redundancy(d1, sample_posture(d1, reference), AXIS_TASK)
    assert len(found.lockable) == 6
    assert min(found.locks.values()) > 1e-4


def test_split_for_any_choice_of_the_free_input(
    d1: cc.Mechanism, reference: Callable[[str], Any], tol: Tolerances
) -> None:
    """Equation (30): five outputs from five inputs, and Q_* from the sixth."""
    q = sample_posture(d1, reference)
    found = cc.redundancy(d1, q, AXIS_TASK)
    rates = np.array([0.1, -0.2, 0.05, 0.3, -0.1, 0.2])
    wanted = cc.velocity(d1, q, AXIS_TASK).twist_map @ rates
    for i, name in enumerate(d1.inputs):
        split = found.split(name)
        assert split.G.shape == (5, 5)
        assert split.chosen == tuple(n for n in d1.inputs if n != name)
        others = np.delete(rates, i)
        assert_close(split.G @ others + split.q_star([rates[i]]), wanted, tol.algebra)
        assert_close(split.rates(wanted, rates[i]), others, 1e-9)
        assert split.sigma == pytest.approx(found.locks[(name,)], rel=1e-12)
    # the null motion is what keeps V at zero whatever the free input does
    null = found.inputs[:, 0]
    assert_close(found.split("q3").rates(np.zeros(5), null[2]), np.delete(null, 2), 1e-9)


def test_a_singular_split_says_so(d1: cc.Mechanism) -> None:
    split = cc.redundancy(d1, d1.home, AXIS_TASK).split("q5")
    with pytest.raises(cc.ClosureError, match="G is singular with q5 free"):
        split.rates(np.ones(5))


@pytest.mark.parametrize(
    ("free", "message"),
    [
        ("q9", "q9"),
        ("q1 q2", "G is square with 1 distinct input"),
        ((), "got none"),
    ],
)
def test_splits_that_make_no_sense(d1: cc.Mechanism, free: Any, message: str) -> None:
    with pytest.raises(cc.ClosureError, match=message):
        cc.redundancy(d1, d1.home, AXIS_TASK).split(free)


def test_without_redundancy_there_is_no_choice_of_locks(d1: cc.Mechanism) -> None:
    found = cc.redundancy(d1, d1.home)  # six outputs; home is an inverse singularity
    assert (found.dimension, found.generic, dict(found.locks)) == (1, 0, {})


def test_choices_of_three_inputs() -> None:
    """rus6 with three reconfiguration angles: 84 choices, those of stage M2 never among them."""
    m = cc.load("rus6", variant="free")
    found = cc.redundancy(m, m.home)
    assert (found.dimension, found.generic, len(found.locks)) == (3, 3, 84)
    assert len(found.lockable) == 8  # alpha_i or beta_i, for each leg of M1
    for choice in found.lockable:
        assert {name[-1] for name in choice} == {"1", "2", "3"}
    split = found.split("beta1 beta2 beta3")
    locked = cc.load("rus6", variant="locked")
    assert_close(split.G, cc.velocity(locked, locked.home).twist_map, 1e-9)
    assert "and 68 other choices" in found.text


def test_redundancy_of_actuation_is_not_of_motion() -> None:
    m = overdriven_eclipse()
    found = cc.redundancy(m, m.home)
    assert (found.dimension, found.generic, found.surplus) == (0, 0, 3)
    assert "9 inputs drive 6 freedoms: redundancy of actuation, degree 3" in found.text
    with pytest.raises(cc.ClosureError, match="9 inputs for 6 freedoms, so they have to agree"):
        found.split("th_a th_b th_c")
