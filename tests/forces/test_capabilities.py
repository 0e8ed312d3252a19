"""Ellipsoids, compliance and efforts for unit loads: against statics, springs, and maps."""

import pickle
import sys
from pathlib import Path

import numpy as np
import pytest
from conftest import assert_close
from heavy import moved

import closedchain as cc

sys.path.insert(0, str(Path(__file__).parents[1] / "analysis"))

from linkages import four_bar


def test_twist_maps_are_those_of_velocity() -> None:
    for name in ("d1", "linear_delta", "eclipse"):
        m = cc.load(name)
        q = cc.resets(m, 15, seed=3).q
        found = cc.twist_maps(m, q)
        for one, at in zip(found, q, strict=True):
            expected = cc.velocity(m, at, "x y z rx ry rz").twist_map
            assert_close(one, expected, 1e-8 * max(1.0, np.abs(expected).max()))


def test_twist_maps_without_machine_code() -> None:
    spare = four_bar({"q1": "A", "q2": "D"})
    found = cc.twist_maps(spare, spare.home)
    assert_close(found[0], cc.velocity(spare, spare.home, "x y z rx ry rz").twist_map, 0.0)
    m = four_bar({"q1": "D"})
    d = np.pi - np.arccos((0.4**2 + 0.3**2 - 0.5**2) / (2 * 0.4 * 0.3))
    a = np.arctan2(0.3 * np.sin(d), 0.4 + 0.3 * np.cos(d))
    assert np.isinf(cc.twist_maps(m, [a, 0.0, d])).all()
    with pytest.raises(cc.ClosureError, match="direct singularity"):
        cc.capabilities(m, [a, 0.0, d])


def test_ellipsoids(delta: cc.Mechanism) -> None:
    q = moved(delta)
    found = cc.capabilities(delta, q)
    rng = np.random.default_rng(0)
    for rates in rng.standard_normal((20, 3)):
        rates /= np.linalg.norm(rates)
        v = found.twist_map[:3] @ rates
        assert abs(np.linalg.norm(found.velocity.axes.T @ v / found.velocity.radii) - 1.0) < 1e-9
        # unit efforts hold a force on the surface of its ellipsoid
        force = -np.linalg.solve(found.twist_map[:3].T, rates)
        assert_close(cc.statics(delta, q, [*force, 0, 0, 0], gravity=False).inputs, rates, 1e-9)
        assert abs(np.linalg.norm(found.force.axes.T @ force / found.force.radii) - 1.0) < 1e-9
    assert (np.diff(found.velocity.radii) <= 0).all()
    assert (np.diff(found.force.radii) <= 0).all()
    assert np.isinf(found.moment.radii).all()  # the parallelograms carry all moments
    assert_close(found.angular_velocity.radii, np.zeros(3), 1e-9)


def test_compliance_is_how_drives_give_way(delta: cc.Mechanism) -> None:
    """Push with a small wrench, let each drive give way by Hooke's law, and look at the tip."""
    q, k = moved(delta), np.array([1e5, 2e5, 3e5])
    wrench = np.array([3.0, -2.0, 5.0, 0.1, 0.2, -0.3])
    given = cc.statics(delta, q, wrench, gravity=False).inputs
    there = cc.direct(delta, delta.input_values(q) - given / k, q).q
    moved_by = delta.pose(there).translation - delta.pose(q).translation
    c = cc.compliance(delta, q, k)
    assert_close(c, c.T, 1e-18)
    assert_close((c @ wrench)[:3], moved_by, 1e-3 * np.abs(moved_by).max())
    assert_close(cc.stiffness(delta, q, k) @ c[:3, :3], np.eye(3), 1e-9)
    stiff = cc.compliance(delta, q, [np.inf, np.inf, np.inf])
    assert_close(stiff, np.zeros((6, 6)), 0.0)


def test_measures_in_a_map(delta: cc.Mechanism) -> None:
    axis = np.linspace(-0.05, 0.05, 3)
    k = [1e5, 1e5, 1e5]
    measures = {
        "effort": cc.effort_per_force,
        "moment": cc.effort_per_moment,
        "gives": cc.largest_compliance(k),
    }
    found = cc.singularity_map(
        delta, {"x": axis, "y": axis}, measures=measures, keep_q=True, progress=False
    )
    q = found["q"].values[0, 2]
    t = cc.velocity(delta, q, "x y z rx ry rz").twist_map
    assert_close(found["effort"].values[0, 2], np.linalg.norm(t[:3], axis=0).max(), 1e-9)
    assert_close(found["moment"].values[0, 2], 0.0, 1e-9)
    worst = np.linalg.eigvalsh(cc.compliance(delta, q, k)[:3, :3])[-1]
    assert_close(found["gives"].values[0, 2], worst, 1e-9 * worst)
    again = pickle.loads(pickle.dumps(measures["gives"]))  # for stores and Dask
    assert_close(again(delta, q[None]), [worst], 1e-9 * worst)
    # no unit force asks more of any input than this
    rng = np.random.default_rng(1)
    for force in rng.standard_normal((30, 3)):
        force /= np.linalg.norm(force)
        needed = cc.input_efforts(delta, q, [*force, 0, 0, 0], gravity=False)
        assert np.abs(needed).max() <= found["effort"].values[0, 2] + 1e-12


def test_wrong_questions_are_refused(delta: cc.Mechanism) -> None:
    for wrong in ([1.0, 2.0], [1.0, 1.0, -1.0], [1.0, np.nan, 1.0]):
        with pytest.raises(cc.ClosureError, match="stiffness"):
            cc.compliance(delta, delta.home, wrong)
    d1 = cc.load("d1")
    with pytest.raises(cc.ClosureError, match=r"ask for cc\.compliance"):
        cc.stiffness(d1, d1.home, np.ones(6))
