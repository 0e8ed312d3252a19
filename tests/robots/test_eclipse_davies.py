"""The paper's integration with closure error fed back, along the trajectory of eq. (20)."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from conftest import Reference
from numpy.testing import assert_allclose

from closedchain.robots.eclipse import ECLIPSE, ECLIPSE2, Geometry
from closedchain.robots.eclipse.davies import Run, exact_joints, integrate

APART = np.radians(60)  # start of the three hinges that keeps them off gimbal lock


def worst(run: Run) -> tuple[float, float, float]:
    """Largest errors: driven joints in cm, closure in cm and rad."""
    g = ECLIPSE2 if np.ptp(run.exact[:, 0, 1]) > 0.2 else ECLIPSE
    scale = np.full((3, 2), 100.0)
    scale[:, 0] = 20.0
    scale[0, 1] = 20.0 if g.z_c is not None else 100.0
    driven = np.abs(run.joints - run.exact)[:, :, :2] * scale
    position = np.linalg.norm(run.errors[:, :, 3:], axis=-1)
    rotation = np.linalg.norm(run.errors[:, :, :3], axis=-1)
    return float(driven.max()), 100 * float(position.max()), float(rotation.max())


def test_runs_of_the_reference(reference: Reference, tol: Any) -> None:
    """Equation (11) with dt = 0.01: drift without feedback, and what the gain makes of it."""
    for entry in reference("eclipse")["davies"]:
        run = integrate(ECLIPSE, gain=entry["Ke"] if entry["feedback"] else None)
        driven, position, rotation = worst(run)
        assert_allclose(driven, entry["max_act_err_cm"], atol=tol.reference)
        assert_allclose(position, entry["max_closure_pos_cm"], atol=tol.reference)
        assert_allclose(rotation, entry["max_closure_rot"], atol=tol.reference)
        final = np.array(entry["q_final"])
        final[:, 1] /= 100
        assert_allclose(run.joints[-1], final, atol=tol.reference)


@pytest.mark.parametrize("g", [ECLIPSE, ECLIPSE2])
def test_hinges_kept_off_gimbal_lock(g: Geometry) -> None:
    """Errors of all driven joints in cm and of the closure; the same for both robots."""
    expected = {
        None: (0.973, 0.500, 0.0156),
        10.0: (0.311, 0.157, 0.0050),
        50.0: (0.0805, 0.0463, 0.0016),
        100.0: (0.0403, 0.0237, 0.00081),
    }
    for gain, numbers in expected.items():
        found = worst(integrate(g, gain=gain, offset=APART))
        assert_allclose(found, numbers, rtol=2e-2)
    run = integrate(g, gain=100.0, inner=3, offset=APART)
    assert np.abs(run.joints - run.exact).max() < 1e-12


def test_gain_must_stay_below_two_steps() -> None:
    """Euler with feedback is stable for 0 < K dt < 2."""
    bounded = worst(integrate(ECLIPSE, gain=198.0, offset=APART))[1]
    grows = worst(integrate(ECLIPSE, gain=202.0, offset=APART))[1]
    lost = worst(integrate(ECLIPSE, gain=210.0, offset=APART))[1]
    assert bounded < 0.03 < 0.1 < grows < 1.0 < lost


def test_hinges_come_near_gimbal_lock() -> None:
    """Started in the link's frame, leg c's hinges pass 88 degrees: of the representation only."""
    assert np.degrees(exact_joints(ECLIPSE)[:, 2, 4].max()) == pytest.approx(88.28, abs=0.01)
    assert np.degrees(np.abs(exact_joints(ECLIPSE, APART)[:, :, 4]).max()) < 43.0
