"""Hessians: against differences of the twist map, ``cc.acceleration``, and the linear Delta."""

from __future__ import annotations

from functools import cache

import linkages
import numpy as np
import pytest
from conftest import assert_close

import closedchain as cc
from closedchain.analysis.screws import lie, shifted
from closedchain.analysis.screws.accelerators import accelerators
from closedchain.analysis.screws.chains import Circuits, circuits
from closedchain.analysis.screws.hessian import hessian, limb_hessian
from closedchain.analysis.structure.postures import wander
from closedchain.robots import linear_delta as ld

EQUAL = 1e-9  # two exact ways to the same number, relative
DIFFERENCES = 1e-7  # derivatives against fourth-order differences, relative
ALL = ("x", "y", "z", "rx", "ry", "rz")
G = ld.Geometry()


@cache
def robot(name: str) -> cc.Mechanism:
    return cc.load(name)


@cache
def postures(name: str, count: int = 6) -> list[np.ndarray]:
    return wander(robot(name), count, seed=11)


def scale(found: np.ndarray) -> float:
    return 1.0 + float(np.abs(found).max(initial=0.0))


# -- any mechanism -------------------------------------------------------------------------------


@pytest.mark.parametrize("name", cc.robots("papers"))
def test_accelerations(name: str) -> None:
    """T a + v^T H v is what the constraint Jacobians say; T is the twist map."""
    m = robot(name)
    rng = np.random.default_rng(1)
    for q in postures(name):
        found = hessian(m, q)
        n = len(m.inputs)
        assert (found.T.shape, found.H.shape) == ((6, n), (6, n, n))
        assert_close(found.H, np.swapaxes(found.H, 1, 2), 0.0)
        assert_close(found.T, cc.velocity(m, q, ALL).twist_map, EQUAL * scale(found.T))
        for v, a in rng.standard_normal((3, 2, n)):
            expected = cc.acceleration(m, q, v, a).tip_acceleration
            size = scale(found.H) * scale(v) ** 2
            assert_close(found.acceleration(v, a), expected, EQUAL * size)


@pytest.mark.parametrize("name", cc.robots("papers"))
def test_entries_by_polarisation(name: str) -> None:
    """Every entry, from Kdot v: 2 H_ij = f(e_i + e_j) - f(e_i) - f(e_j), f(v) at rest inputs."""
    m = robot(name)
    q = postures(name)[0]
    unit = np.eye(len(m.inputs))

    def f(v: np.ndarray) -> np.ndarray:
        return cc.acceleration(m, q, v, 0.0 * v).tip_acceleration

    found = hessian(m, q).H
    single = [f(e) for e in unit]
    for i, one in enumerate(unit):
        assert_close(found[:, i, i], single[i], EQUAL * scale(found))
        for j, two in enumerate(unit[:i]):
            mixed = 0.5 * (f(one + two) - single[i] - single[j])
            assert_close(found[:, i, j], mixed, EQUAL * scale(found))


@pytest.mark.parametrize("name", cc.robots("papers"))
def test_against_differences_of_the_twist_map(name: str) -> None:
    """H is the symmetric part of dT/dq; the rest is [w_i w_j] / 2, for turning does not commute."""
    m = robot(name)
    q = postures(name)[1]
    found = hessian(m, q)
    start = m.input_values(q)
    h = 1e-3 / np.sqrt(scale(found.H))

    def twist_map(inputs: np.ndarray) -> np.ndarray:
        here = cc.velocity(m, cc.direct(m, inputs, q).raise_if_failed().q, ALL).twist_map
        assert here is not None
        return here

    derivative = np.empty_like(found.H)
    for j, step in enumerate(h * np.eye(start.size)):
        near, far = (twist_map(start + k * step) - twist_map(start - k * step) for k in (1, 2))
        derivative[:, :, j] = (8.0 * near - far) / (12.0 * h)
    turned = np.swapaxes(derivative, 1, 2)
    size = DIFFERENCES * scale(found.H)
    assert_close((derivative + turned) / 2.0, found.H, size)
    w = found.T[3:].T
    brackets = np.moveaxis(np.cross(w[None, :, :], w[:, None, :]), -1, 0)
    assert_close((derivative - turned)[:3], np.zeros_like(brackets), size)
    assert_close((derivative - turned)[3:], brackets, size)


@pytest.mark.parametrize("name", ["d1", "rus6"])
def test_other_frames(name: str) -> None:
    m = robot(name)
    rng = np.random.default_rng(2)
    frames = {"d1": ("coupler", "S1", "S5"), "rus6": ("platform",)}[name]
    for q in postures(name)[:2]:
        v, a = rng.standard_normal((2, len(m.inputs)))
        motion = accelerators(m, q, v, a)
        for frame in frames:
            found = hessian(m, q, frame)
            assert found.frame == frame
            expected = motion.classical(frame)
            size = EQUAL * scale(found.H) * scale(v) ** 2
            assert_close(found.acceleration(v, a), expected, size, frame)


def test_the_base_rests() -> None:
    m = robot("d1")
    found = hessian(m, m.home, "base")
    assert_close(found.T, np.zeros((6, 6)), 0.0)
    assert_close(found.H, np.zeros((6, 6, 6)), 0.0)


def test_a_crank_by_hand() -> None:
    """A parallelogram's bar moves on a circle of radius 0.4: |H| = 0.4, towards the pivot."""
    m = linkages.parallelogram()
    for q in wander(m, 2):
        found = hessian(m, q, "bar")
        crank = m.point(q, "bar") - m.point(q, "left")
        assert_close(np.linalg.norm(crank), 0.4, 1e-12)
        assert_close(found.H[:, 0, 0], [*-crank, 0.0, 0.0, 0.0], 1e-12)
        assert_close(found.T[3:, 0], np.zeros(3), 1e-12)


def test_more_inputs_than_freedoms() -> None:
    """The map of a four-bar with two driven cranks holds for the motions that it allows."""
    one, both = linkages.four_bar(), linkages.four_bar({"q1": "A", "q2": "D"})
    q = wander(one, 1, seed=2)[0]
    true = cc.acceleration(one, q, [0.7], [-0.4])
    rates, second = true.qdot[both.input_v], true.qddot[both.input_v]
    found = hessian(both, q).acceleration(rates, second)
    assert_close(found, true.tip_acceleration, EQUAL)


def test_wrong_questions() -> None:
    m = robot("d1")
    with pytest.raises(cc.ClosureError, match="S99"):
        hessian(m, m.home, "S99")
    with pytest.raises(cc.ClosureError, match="shape"):
        hessian(m, m.home).acceleration([0.0] * 5, [0.0] * 6)
    spinning = linkages.spatial_four_bar(False)
    with pytest.raises(cc.ClosureError, match="do not determine the motion"):
        hessian(spinning, spinning.home)
    with pytest.raises(cc.ClosureError, match="shape"):
        limb_hessian(np.zeros((4, 5)))


# -- the linear Delta, eqs (27)-(32) -------------------------------------------------------------


def rods(m: cc.Mechanism, q: np.ndarray) -> np.ndarray:
    """Unit rod vectors (3, 3) read off named points."""
    ends = np.array([m.point(q, f"C{i}") - m.point(q, f"B{i}") for i in (1, 2, 3)])
    return np.asarray(ends / np.linalg.norm(ends, axis=1, keepdims=True))


def test_limb_hessian_is_brackets() -> None:
    rng = np.random.default_rng(3)
    screws = rng.standard_normal((2, 5, 6))
    found = limb_hessian(screws)
    assert found.shape == (2, 6, 5, 5)
    for j in range(5):
        assert_close(found[:, :, j, j], np.zeros((2, 6)), 0.0)
        for k in range(j + 1, 5):
            half = lie(screws[:, j], screws[:, k]) / 2.0
            assert_close(found[:, :, j, k], half, 1e-15)
            assert_close(found[:, :, k, j], half, 1e-15)


def limb(at: Circuits, i: int) -> np.ndarray:
    """Screws (5, 6) of limb i along one side of its parallelogram: P, B, D, G, C."""
    pairs = at.chain("base", "platform", [f"leg{i}_{x}" for x in "PBDGC"])
    assert len(pairs) == 5
    return np.concatenate([sign * at.screws[p] for p, sign in pairs])


def test_limb_hessians_are_those_of_the_linear_delta() -> None:
    """Eq (29), whose parallelogram ta3 is here the two joints D and G turning in opposition.

    Their bracket is the diagonal term (-bhat/b; 0) that the source leaves out.
    """
    m = robot("linear_delta")
    for q in postures("linear_delta"):
        at, bhat = circuits(m, q), rods(m, q)
        p = m.point(q, "P")
        own = ld.limb_hessians(bhat, G)
        printed = ld.limb_hessians(bhat, G, printed=True)
        twists = ld.limbs(bhat, G).twists[:, :4][..., [3, 4, 5, 0, 1, 2]]  # ta1..ta4
        for i in range(3):
            screws = shifted(limb(at, i + 1), p)  # about o', as the source's
            rates, _, rank, _ = np.linalg.lstsq(screws.T, twists[i].T, rcond=None)
            assert rank == 5
            assert_close(screws.T @ rates, twists[i].T, 1e-12)
            assert_close(rates[2, 2] + rates[3, 2], 0.0, 1e-12)
            form = np.einsum("cjk,ja,kb->cab", limb_hessian(screws), rates, rates)
            form = form[[3, 4, 5, 0, 1, 2]]
            expected, zero = (x[i][:, :4, :4] for x in (own, printed))
            assert_close(form, (expected + np.swapaxes(expected, 1, 2)) / 2.0, 1e-11)
            missing = form - (zero + np.swapaxes(zero, 1, 2)) / 2.0
            centripetal = np.zeros((6, 4, 4))
            centripetal[:3, 2, 2] = -bhat[i] / G.b
            assert_close(missing, centripetal, 1e-11)


def test_manipulator_hessian_is_that_of_the_linear_delta() -> None:
    """Eq (32) solved for the sliders, corrected and with the zero diagonal of the source."""
    m = robot("linear_delta")
    rng = np.random.default_rng(4)
    for q in postures("linear_delta"):
        bhat, found = rods(m, q), hessian(m, q)
        v, a = rng.standard_normal((2, 3))
        still = np.zeros(3)
        rates = np.linalg.solve(found.T[:3], v)
        quadratic = np.einsum("cij,i,j->c", found.H, rates, rates)
        sliders = np.linalg.solve(found.T[:3], a - quadratic[:3])
        assert_close(quadratic[3:], still, 1e-10 * scale(quadratic))
        assert_close(sliders, ld.slider_accelerations(bhat, v, a, G), EQUAL * scale(sliders))
        given = (np.concatenate([v, still]), np.concatenate([a, still]))
        true = ld.inverse_acceleration(bhat, G, *given)
        assert_close(sliders, true[:3], EQUAL * scale(sliders))
        printed = ld.inverse_acceleration(bhat, G, *given, printed=True)
        rho3 = ld.limb_rates(bhat, G, given[0])[:, 2]
        missing = rho3**2 / (G.b * bhat[:, 2])
        assert np.abs(missing).max() > 1e-2
        assert_close(sliders, printed[:3] + missing, EQUAL * scale(sliders))
