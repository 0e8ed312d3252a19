"""What the literature says of how many postures the classics have, counted from their files.

Dietmaier's forty are in test_postures_of_platforms, the six of Innocenti and Parenti-Castelli in
test_cusps.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from conftest import Tolerances

import closedchain as cc


def counted(m: cc.Mechanism, real: int, of: int, **held: object) -> cc.Postures:
    found = cc.postures(m, **held)  # type: ignore[arg-type]
    assert (found.complete, found.complex_count, len(found)) == ("counted", of, real)
    assert found.certified.all()
    return found


@pytest.mark.slow
def test_planar_stewart_platform_of_the_textbook() -> None:
    """T. Sauer: two, four and six poses as the second strut is lengthened."""
    m = cc.load("three_rpr", variant="textbook")
    for strut, real in ((4.0, 2), (5.0, 4), (7.0, 6)):
        counted(m, real, 6, inputs=[5.0, strut, 3.0])


@pytest.mark.slow
def test_3_rps_has_two_operation_modes(tol: Tolerances) -> None:
    """Sixteen, of which these legs make eight real, all in the mode without spin (x3 = 0)."""
    m = cc.load("three_rps")
    found = counted(m, 8, 16, inputs=[1.2, 1.35, 1.1])
    pose = m.model.joints[m.model.getJointId("platform_pose")].idx_q
    assert np.abs(found.q[:, pose + 5]).max() < tol.algebra


@pytest.mark.slow
def test_agile_eye(tol: Tolerances) -> None:
    """Eight working modes; eight assembly modes, of which four stand still whatever the inputs."""
    m = cc.load("agile_eye")
    working = counted(m, 8, 8, pose=m.pose(m.home))
    assert {*working.names} | {"+++"} == {"home", *m.postures}
    trivial = [np.roll(np.diag(signs), 1, axis=1) for signs in SIGNS]
    for inputs in ([0.3, -0.4, 0.5], [0.1, 0.7, -0.2]):
        found = counted(m, 8, 8, inputs=inputs)
        turns = np.array([m.pose(q).rotation for q in found.q])
        for still in trivial:
            assert min(np.abs(turns - still).max(axis=(1, 2))) < 1e-9
        for i, t in enumerate(inputs):
            middle = math.cos(t) * np.eye(3)[i - 1] - math.sin(t) * np.eye(3)[i - 2]
            assert np.abs(turns[:, :, i - 2].dot(middle)).max() < tol.algebra


SIGNS = ((1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1))
"""Each axis of the platform along one of the base: half turns from one to the next."""


@pytest.mark.slow
def test_manocha_and_canny_have_sixteen() -> None:
    counted(cc.load("six_r"), 16, 16, inputs=[0.0])


@pytest.mark.slow
def test_double_butterfly_has_six_of_eighteen() -> None:
    counted(cc.load("double_butterfly"), 6, 18, inputs=[math.radians(67.38)])


@pytest.mark.slow
def test_double_butterfly_moves_in_four_circuits() -> None:
    """All six postures at each of several crank angles lie on four closed curves, and no fewer."""
    m = cc.load("double_butterfly")
    circuits: list[np.ndarray] = []

    def beside(q: np.ndarray) -> bool:
        there = [np.abs(np.exp(1j * c) - np.exp(1j * q)).max(axis=1).min() for c in circuits]
        return min(there, default=1.0) < 0.08

    for degrees in (67.38, 0.0, 120.0, -120.0, 180.0, -60.0):
        for q in cc.postures(m, inputs=[math.radians(degrees)], count=False).q:
            if not beside(q):
                # z of a planar linkage holds nothing: all of the curve is traced
                found = cc.self_motion(m, q, "z", through=True, step=0.05)
                assert found.closed
                circuits.append(found.q)
    assert len(circuits) == 4
