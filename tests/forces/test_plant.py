"""What simulations ask at every step: machine code and LAPACK agree, drift by differences."""

import sys
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from conftest import assert_close
from heavy import weighed

import closedchain as cc
from closedchain.analysis.forces import plant as module
from closedchain.analysis.forces.plant import Fit, plant_under

sys.path.insert(0, str(Path(__file__).parents[1] / "analysis"))

from linkage_text import J, load
from linkages import four_bar

DRAWN = [name for name in cc.robots() if name != "wren"]
"""Those with hinges or slides, whose values are drawn at random."""
PUSH = np.array([3.0, -2.0, 5.0, 0.4, -0.3, 0.2])


def mechanisms() -> dict[str, cc.Mechanism]:
    chain = [J("A", "base", "a", axis="0 1 0"), J("B", "a", "b", "0 0 -1", axis="1 0 0")]
    return {
        **{name: cc.load(name) for name in (*DRAWN, "delia")},
        "four_bar": weighed(four_bar({"q1": "A", "q2": "D"})),
        "chain": weighed(load("chain", chain, inputs={"q": "A"}, tip="b")),
    }


MECHANISMS = mechanisms()


@pytest.mark.parametrize("name", MECHANISMS)
def test_machine_code_and_lapack_agree(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    m = MECHANISMS[name]
    rng = np.random.default_rng(3)
    r = cc.resets(m, 4, seed=5)
    plant = plant_under(m, PUSH, [1.0, -2.0, -9.0])
    states = [
        (q, v, rng.standard_normal(len(m.inputs)), 1e-3 * rng.standard_normal(m.model.nv))
        for q, v in zip(r.q, r.v, strict=True)
    ]

    def asked() -> list[tuple[np.ndarray, Fit, Fit]]:
        return [
            (
                plant.acceleration(q, v, tau),
                plant.fit(pin.integrate(m.model, q, off * m.column_scale), v),
                plant.fit(q, v + off),
            )
            for q, v, tau, off in states
        ]

    by_code = asked()
    monkeypatch.setattr(module, "PIVOT", np.inf)  # nothing is good enough for machine code
    for (a, away, near), (a_too, away_too, near_too) in zip(by_code, asked(), strict=True):
        assert_close(a, a_too, 1e-10 * max(1.0, np.abs(a_too).max()))
        assert_close(away.step, away_too.step, 1e-4)  # to first order, whichever rows are kept
        assert_close(near.v, near_too.v, 1e-12)
        z = near_too.basis
        assert_close(z @ (z.T @ near.basis), near.basis, 1e-10 * np.abs(near.basis).max())


@pytest.mark.parametrize("name", ["d1", "linear_delta", "rus6"])
def test_accelerations_keep_the_loops_closed(name: str) -> None:
    """K a + Kdot v = 0, by differences along the motion; free falls keep the energy."""
    m = MECHANISMS[name]
    r = cc.resets(m, 2, seed=2)
    plant, h = plant_under(m), 1e-5
    for q, v in zip(r.q, r.v, strict=True):
        a = plant.acceleration(q, v, np.zeros(len(m.inputs)))
        ends = [
            cc.constraint_jacobian(m, pin.integrate(m.model, q, s * h * v)) @ (v + s * h * a)
            for s in (1, -1)
        ]
        assert_close((ends[0] - ends[1]) / (2 * h), np.zeros(m.rows), 1e-6 * np.abs(a).max())
        ways = [s * h * v + 0.5 * h * h * a for s in (1, -1)]
        energies = [plant.energy(pin.integrate(m.model, q, way), v + s * h * a)
                    for way, s in zip(ways, (1, -1), strict=True)]  # fmt: skip
        power = (energies[0] - energies[1]) / (2 * h)
        assert abs(power) < 1e-6 * max(1.0, np.abs(a).max())


def test_close_to_a_singularity_lapack_takes_over() -> None:
    """Through the line of crank and coupler: a pivot vanishes there, and the energy is kept."""
    m = weighed(four_bar({"q1": "D"}), seed=4)
    d = np.pi - np.arccos((0.4**2 + 0.3**2 - 0.5**2) / (2 * 0.4 * 0.3))
    a = np.arctan2(0.3 * np.sin(d), 0.4 + 0.3 * np.cos(d))
    q = cc.close(m, [a - 0.05, 0.1, d], fixed={"A": a - 0.05}).raise_if_failed().q
    k = cc.constraint_jacobian(m, q)
    v = np.linalg.svd(k)[2][-1]
    r = cc.simulate(m, q, 5.0 * v / v[0], None, 0.1, gravity=False, limits=False)
    assert "direct" in {event.kind for event in r.events}
    assert r.drift < 1e-9
    assert r.residual < 1e-12


def test_a_plant_is_made_once_a_thread() -> None:
    m = MECHANISMS["linear_delta"]
    assert plant_under(m) is plant_under(m, gravity=True)
    assert plant_under(m) is not plant_under(m, gravity=False)
    assert plant_under(m, payload={"P": 1.0}) is not plant_under(m)
