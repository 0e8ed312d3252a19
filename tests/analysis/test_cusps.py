"""The planar 3-RPR platform of Innocenti and Parenti-Castelli: six modes, two aspects, cusps.

Its modes change into each other without a singularity, round cusps [Innocenti1998]_. Lengths are a
tenth of the paper's.

[Innocenti1998]_ C. Innocenti, V. Parenti-Castelli, Singularity-free evolution from one
configuration to another in serial and fully-parallel manipulators, Journal of Mechanical Design
120, 1998.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

import closedchain as cc

LEGS = (1.498, 1.538, 1.2)


@pytest.fixture(scope="module")
def platform() -> cc.Mechanism:
    sizes = {"feet": "0 0 1.591 0 0 1", "sides": "1.704 1.654 2.084", "length_max": 9}
    return cc.load("three_rpr", home="0.3 1.2 -0.4", **sizes)


@pytest.mark.slow
def test_six_modes_three_of_each_sign(platform: cc.Mechanism) -> None:
    found = cc.postures(platform, inputs=LEGS)
    assert (found.complete, found.complex_count, len(found)) == ("counted", 6, 6)
    assert sorted(found.branch.tolist()) == [-1, -1, -1, 1, 1, 1]
    assert found.certified.all()


@pytest.mark.slow
def test_cusps_are_where_three_postures_meet(platform: cc.Mechanism) -> None:
    start = cc.direct(platform, LEGS, guess=cc.postures(platform, inputs=LEGS, count=False)[2].q)
    axis = np.linspace(0.2, 3.2, 61)
    over = {"q2": axis, "q3": axis}
    found = cc.singularity_set(platform, "direct", over, start.q, cusps=True)
    assert len(found.cusps) == 5
    radius = 1e-3
    for place, q in zip(found.cusps, found.cusps_q, strict=True):
        assert np.abs(platform.input_values(q)[1:] - place).max() < 1e-10
        assert cc.classify(platform, q).kinds == {"direct"}
        counts = []
        for angle in np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False):
            legs = [LEGS[0], *(place + radius * np.array([math.cos(angle), math.sin(angle)]))]
            near = cc.postures(platform, inputs=legs, count=False)
            apart = np.abs(near.q - q)
            apart = np.minimum(apart, np.abs(2.0 * np.pi - apart)).max(axis=1)
            counts.append(int((apart < 4.0 * radius ** (1.0 / 3.0)).sum()))
        # one posture outside, three in the narrow wedge, which the circle need not show
        assert set(counts) <= {1, 3}
        assert 1 in counts


def test_other_kinds_have_none() -> None:
    m = cc.load("linear_delta")
    axis = np.linspace(-0.5, 0.5, 21)
    found = cc.singularity_set(m, "direct", {"x": axis, "y": axis}, {"z": -0.6}, cusps=True)
    assert found.cusps.shape == (0, 2)
