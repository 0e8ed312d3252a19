"""Measures in bulk against ``classify``: robots, small linkages, singular postures."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import linkages
import numpy as np
import pinocchio as pin
import pytest
from conftest import Tolerances
from oracle.walks import closed

import closedchain as cc
from closedchain.analysis.first_order import first_order
from closedchain.analysis.singularity.bulk.measuring import bulk_measures
from closedchain.closure.generic import generic_ranks

KINDS = ("direct", "inverse", "constraint")
FIVE = {"d1": "x y z rx rz", "eclipse": "x y z", "rpa3t": "x z", "rus6": "x y z"}


def check(m: cc.Mechanism, postures: np.ndarray, outputs: str | None, tol: float) -> None:
    """Every measure of every posture is that of ``classify``, to ``tol`` of the matrix' size."""
    batch = bulk_measures(m, outputs)
    found = batch.measures(postures)
    plain = batch.determinants(postures)
    for i, q in enumerate(postures):
        at = first_order(m, q, outputs)
        c = cc.classify(m, q, outputs)
        size = np.linalg.norm(at.stacked, 2)
        for kind in KINDS:
            off = abs(found[f"sigma_{kind}"][i] - getattr(c, f"sigma_{kind}"))
            assert off <= tol * size, f"{m.name} {kind} {i}: {off}"
        for kind in KINDS[:2]:
            det, name = getattr(c, f"det_{kind}"), f"det_{kind}"
            assert (det is None) == (name not in found)
            if det is not None:
                # scale of the determinant: product of the row norms (Hadamard's bound)
                matrix = at.K_passive if kind == "direct" else at.stacked
                bound = np.prod(np.maximum(np.linalg.norm(matrix, axis=1), 1.0))
                assert abs(found[name][i] - det) <= tol * max(abs(det), 1e-3 * bound), f"{name} {i}"
                assert np.isclose(plain[name][i], found[name][i], rtol=tol, atol=tol * bound)
        assert found["residual"][i] <= 1e-11
        assert_condition(m, q, outputs, found["condition"][i])


def assert_condition(m: cc.Mechanism, q: np.ndarray, outputs: str | None, found: float) -> None:
    v = cc.velocity(m, q, outputs)
    if v.twist_map is None or not m.inputs:
        assert found > 1e8  # infinite, but for rounding
        return
    units = np.array([m.length if n in "xyz" else 1.0 for n in v.outputs])
    s = np.linalg.svd(v.twist_map / units[:, None] * m.column_scale[m.input_v], compute_uv=False)
    s = s[: generic_ranks(m, v.outputs).outputs.value]  # others never move by themselves
    if s[-1] > 1e-9 * s[0]:
        assert abs(found / (s[0] / s[-1]) - 1.0) < 1e-6
    else:
        assert found > 1e8


@pytest.mark.parametrize("robot", cc.robots("papers"))
def test_measures_of_the_robots(robot: str, tol: Tolerances) -> None:
    m = cc.load(robot)
    check(m, np.vstack([m.home[None], closed(m, 25)]), None, tol.closure)


@pytest.mark.parametrize("robot", FIVE)
def test_measures_of_fewer_outputs(robot: str, tol: Tolerances) -> None:
    m = cc.load(robot)
    check(m, closed(m, 8), FIVE[robot], tol.closure)


@pytest.mark.parametrize(
    "make",
    [
        "four_bar", "three_rrr", "parallelogram", "wedges", "bennett", "truss", "five_bar",
        "arm_with_parallelogram", "lone_arm", "gantry", "rods",
    ],
)  # fmt: skip
def test_measures_of_small_linkages(make: str, tol: Tolerances) -> None:
    """Redundant rows, rows that fix all, no rows, idle motions, no inputs, mimics."""
    m = getattr(linkages, make)()
    postures = m.home[None] if make == "truss" else np.vstack([m.home[None], closed(m, 6, 0, 0.1)])
    check(m, postures, None, tol.closure)


@pytest.mark.parametrize("hooke", [False, True], ids=["idle rod", "no idle rod"])
def test_measures_with_an_idle_motion(hooke: bool, tol: Tolerances) -> None:
    m = linkages.spatial_four_bar(hooke)
    check(m, closed(m, 6, 0, 0.1), "rx ry rz", tol.closure)


def test_measures_with_inputs_to_spare(tol: Tolerances) -> None:
    m = linkages.five_bar(inputs={"q1": "A", "q2": "E", "q3": "B"})
    check(m, closed(m, 6, 0, 0.1), None, tol.closure)


def test_measures_at_d1s_reference_singularities(
    d1: cc.Mechanism, reference: Callable[[str], dict[str, Any]], tol: Tolerances
) -> None:
    for name, entry in reference("d1")["singular"].items():
        place = {
            "coupler": _pose(entry["quatB"], entry["pB"]),
            "platform": _pose(entry["quatC"], entry["pC"]),
        }
        q = cc.close(d1, place=place).raise_if_failed().q
        check(d1, q[None], None, tol.closure)
        found = bulk_measures(d1).measures(q[None])
        least = min(float(found[f"sigma_{kind}"][0]) for kind in KINDS)
        assert least < 1e-9, name


def _pose(quaternion: list[float], position: list[float]) -> pin.SE3:
    w, x, y, z = quaternion
    return pin.SE3(pin.Quaternion(w, x, y, z).matrix(), np.array(position))


def small_linkages() -> ModuleType:
    """Makers of the closure tests."""
    path = Path(__file__).parents[1] / "closure" / "small_linkages.py"
    spec = importlib.util.spec_from_file_location("small_linkages", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_measures_at_a_toggle_and_a_flat_parallelogram(tol: Tolerances) -> None:
    small = small_linkages()
    rocking, toggle = small.ROCKING, small.toggle(small.ROCKING)
    m = small.four_bar(rocking, toggle - 1e-3)
    for gap in (1e-3, 1e-5, 1e-7):
        q = cc.direct(m, [toggle - gap]).raise_if_failed().q
        check(m, q[None], None, tol.closure)
    flat = small.four_bar(small.PARALLELOGRAM, 0.5)
    q = cc.close(flat, guess=np.zeros(3), fixed={"crank_joint": 0.0}).q
    assert float(bulk_measures(flat).measures(q[None])["sigma_constraint"][0]) < 1e-9
    check(flat, q[None], None, tol.closure)


def test_measures_near_zero_keep_their_digits(d1: cc.Mechanism, tol: Tolerances) -> None:
    """Small steps off home, an inverse singularity of D1: values from 1e-2 down to 1e-13."""
    home = d1.input_values(d1.home)
    postures = [
        cc.direct(d1, home + step * np.array([1.0, -0.5, 0.2, 0.3, 0.0, -0.7])).raise_if_failed().q
        for step in 10.0 ** np.arange(-2, -13, -1)
    ]
    check(d1, np.array(postures), None, tol.closure)
