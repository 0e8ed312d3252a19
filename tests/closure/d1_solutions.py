"""What every solution of D1's position problems must show. No tests here."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from conftest import Tolerances, assert_close

import closedchain as cc
from closedchain.closure.equations import Equations
from closedchain.urdf.errors import ClosureError

FOLD = np.array([0.02858, -0.06320, 0.02858, 0.0, 0.0, 0.0])
"""Step of the inputs from home to the nearest known direct singularity of stage 1 [m]."""


def se3(quaternion_wxyz: Any, position: Any) -> pin.SE3:
    w, x, y, z = quaternion_wxyz
    rotation = pin.Quaternion(w, x, y, z).normalized().matrix()
    return pin.SE3(rotation, np.array(position, dtype=float))


def tool(entry: dict[str, Any]) -> pin.SE3:
    """Pose of the tip of a reference entry: rotation of the platform, position of T."""
    return se3(entry["quatC"], entry["tip"])


def placed(entry: dict[str, Any]) -> dict[str, pin.SE3]:
    """Poses of both bodies in a reference entry."""
    letters = {"coupler": "B", "platform": "C"}
    return {body: se3(entry[f"quat{x}"], entry[f"p{x}"]) for body, x in letters.items()}


def check_entry(m: cc.Mechanism, q: np.ndarray, entry: dict[str, Any], atol: float) -> None:
    assert_close(m.input_values(q), entry["q"], atol, "inputs")
    for body, expected in placed(entry).items():
        assert_close(m.pose(q, body).homogeneous, expected.homogeneous, atol, body)
    for i, point in enumerate(entry["S"]):
        assert_close(m.point(q, f"S{i + 1}"), point, atol, f"S{i + 1}")
    for i, point in enumerate(entry["R4_6"]):
        assert_close(m.point(q, f"R{i + 4}"), point, atol, f"R{i + 4}")
    assert_close(m.point(q, "T"), entry["tip"], atol, "T")


def check_solution(m: cc.Mechanism, s: cc.Solution, tol: Tolerances) -> None:
    """A converged solution is what it says."""
    assert s.converged, s.message
    assert s.residual < tol.closure
    assert np.abs(cc.residual(m, s.q)).max() < tol.closure
    assert s.iterations > 0
    assert s.raise_if_failed() is s


def check_failure(m: cc.Mechanism, s: cc.Solution, *words: str) -> None:
    """A failure is finite, says so, and its posture and residual belong together."""
    assert not s.converged
    assert np.isfinite(s.q).all()
    assert np.isfinite(s.residual)
    m.configuration(s.q)
    for word in words:
        assert word in s.message
    with pytest.raises(ClosureError):
        s.raise_if_failed()


def branch_of(m: cc.Mechanism, q: np.ndarray) -> float:
    sign, _ = np.linalg.slogdet(Equations(m, m.passive_v).evaluate(q)[1])
    return float(sign)


def near_postures(m: cc.Mechanism, count: int, seed: int) -> list[np.ndarray]:
    rng = np.random.default_rng(seed)
    home = m.input_values(m.home)
    return [cc.direct(m, home + rng.uniform(-0.015, 0.015, 6)).q for _ in range(count)]
