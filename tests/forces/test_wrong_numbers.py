"""What no function about forces takes: each is refused in a sentence that says what would do."""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import closedchain as cc

sys.path.insert(0, str(Path(__file__).parents[1] / "analysis"))

from linkages import four_bar

M = cc.load("linear_delta")
Q, STILL = M.home, np.zeros(M.model.nv)
KNEE = cc.transmission(four_bar(), ["D"])
PATH = np.linspace(0.0, 1.0, 6), np.tile(Q, (6, 1))

CALLS: dict[str, Callable[[Any], object]] = {
    "wrench": lambda x: cc.statics(M, Q, x),
    "wrench at a frame": lambda x: cc.statics(M, Q, {"P": x}),
    "frame": lambda x: cc.statics(M, Q, {x: np.zeros(6)}),
    "payload": lambda x: cc.statics(M, Q, payload=x),
    "mass": lambda x: cc.statics(M, Q, payload={"P": x}),
    "gravity": lambda x: cc.statics(M, Q, gravity=x),
    "posture": lambda x: cc.statics(M, x),
    "postures": lambda x: cc.input_efforts(M, x),
    "input rates": lambda x: cc.inverse_dynamics(M, Q, x, np.zeros(3)),
    "efforts": lambda x: cc.forward_dynamics(M, Q, STILL, x),
    "efforts over time": lambda x: cc.simulate(M, Q, None, lambda t, q, v: x, 0.01),
    "velocity": lambda x: cc.forward_dynamics(M, Q, x),
    "until": lambda x: cc.simulate(M, Q, None, None, x),
    "every": lambda x: cc.simulate(M, Q, None, None, 0.01, every=x),
    "accuracy": lambda x: cc.simulate(M, Q, None, None, 0.01, accuracy=x),
    "stiffness": lambda x: cc.compliance(M, Q, x),
    "density": lambda x: cc.with_inertias(M, x),
    "n": lambda x: cc.resets(M, x),
    "seed": lambda x: cc.resets(M, 2, seed=x),
    "speed": lambda x: cc.resets(M, 2, speed=x),
    "workers": lambda x: cc.resets(M, 2, workers=x),
    "over": lambda x: cc.resets(M, 2, over=x),
    "range": lambda x: cc.resets(M, 2, over={"x": x}),
    "joints": lambda x: cc.transmission(four_bar(), x),
    "joint positions": KNEE.motors,
    "joint rates": lambda x: KNEE.jacobian_rate(KNEE.home, x),
    "rotor inertias": lambda x: KNEE.reflected_inertia(KNEE.home, x),
    "effort limits": lambda x: KNEE.effort_limits(KNEE.home, x),
    "speed limits": lambda x: cc.transmission_table(KNEE, points=3, speeds=x),
    "points": lambda x: cc.transmission_table(KNEE, points=x),
    "range of a joint": lambda x: cc.transmission_table(KNEE, {"D": x}, 3),
    "times": lambda x: cc.efforts_along(M, x, PATH[1]),
}
ALLOWED = {  # values that mean something after all
    ("wrench", None), ("payload", None), ("velocity", None), ("efforts", None), ("every", None),
    ("workers", None), ("over", None), ("points", None), ("rotor inertias", None),
    ("speed limits", None), ("range", None),
    ("mass", 5.0), ("until", 5.0), ("accuracy", 5.0), ("density", 5.0), ("speed", 5.0),
    ("joint positions", 5.0), ("joint rates", 5.0), ("rotor inertias", 5.0), ("speed limits", 5.0),
}  # fmt: skip


@pytest.mark.parametrize("what", CALLS)
def test_wrong_numbers_are_refused(what: str) -> None:
    for wrong in (None, "x", [1.0, 2.0], [[np.nan]], np.nan, 5.0, {"nobody": 1.0}, -1.0 + 2.0j):
        if isinstance(wrong, float | None) and (what, wrong) in ALLOWED:
            continue
        if what == "range of a joint" and wrong == [1.0, 2.0]:
            continue
        if what in ("frame", "range") and wrong in ([1.0, 2.0], [[np.nan]], {"nobody": 1.0}):
            continue  # no key of a mapping, and a range
        with pytest.raises(cc.ClosureError):
            CALLS[what](wrong)


def test_large_loads_are_none_of_our_business() -> None:
    """A press pushes with more than a meganewton; numbers without end are refused."""
    push = [0.0, 0.0, -5e6, 0.0, 0.0, 0.0]
    assert abs(cc.statics(M, Q, push).inputs.sum() / 5e6 - 1.0) < 1e-3
    with pytest.raises(cc.ClosureError, match="beyond 1e"):
        cc.statics(M, Q, [1e300] * 6)


def test_missing_masses_are_said() -> None:
    bare = cc.load("linear_delta", density=0)
    assert "no link that moves has a mass" in cc.statics(bare, Q).text
    assert "mass" not in cc.statics(bare, Q, gravity=False).text
    assert "mass" not in cc.statics(bare, Q, payload={"P": 1.0}).text
    assert "mass" not in cc.statics(M, Q).text
