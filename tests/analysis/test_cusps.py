"""The planar 3-RPR platform of Innocenti and Parenti-Castelli: six modes, two aspects, cusps.

Its modes change into each other without a singularity, round cusps [Innocenti1998]_. Lengths are a
tenth of the paper's.

[Innocenti1998]_ C. Innocenti, V. Parenti-Castelli, Singularity-free evolution from one
configuration to another in serial and fully-parallel manipulators, Journal of Mechanical Design
120, 1998.
"""

from __future__ import annotations

import math

import linkages
import numpy as np
import pytest
from linkages import Cut, J

import closedchain as cc

BASE = ((0.0, 0.0), (1.591, 0.0), (0.0, 1.0))
SIDES = (1.704, 1.654, 2.084)
LEGS = (1.498, 1.538, 1.2)


@pytest.fixture(scope="module")
def platform() -> cc.Mechanism:
    one, two, three = SIDES
    x = (three**2 - two**2 + one**2) / (2.0 * one)
    corners = ((0.0, 0.0), (one, 0.0), (x, math.sqrt(three**2 - x * x)))
    place, turn = np.array([0.3, 1.2]), -0.4
    c, s = math.cos(turn), math.sin(turn)
    joints, cuts, inputs, home = [], [], {}, {}
    for i, (a, b) in enumerate(zip(BASE, corners, strict=True), 1):
        leg = place + np.array([c * b[0] - s * b[1], s * b[0] + c * b[1]]) - a
        angle = math.atan2(leg[1], leg[0])
        joints += [
            J(f"r{i}", "base", f"lower{i}", f"{a[0]} {a[1]} 0"),
            J(f"p{i}", f"lower{i}", f"upper{i}", axis="1 0 0", type="prismatic"),
        ]
        inputs[f"q{i}"] = f"p{i}"
        home |= {f"r{i}": angle, f"p{i}": math.hypot(*leg)}
        if i == 1:
            joints.append(J("turn", "upper1", "platform"))
            home["turn"] = turn - angle
        else:
            cuts.append(Cut(f"c{i}", f"upper{i}", "platform", "0 0 0", f"{b[0]!r} {b[1]!r} 0"))
    return linkages.load(
        "rpr", joints, cuts, inputs=inputs, home=home, tip="platform", outputs="x y rz"
    )


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
