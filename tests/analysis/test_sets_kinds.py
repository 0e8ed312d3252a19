"""Sets hold what ``classify`` calls by their kind: closures that lose rank lose no output."""

from __future__ import annotations

import linkages
import numpy as np
import pinocchio as pin
import pytest

import closedchain as cc
from closedchain.analysis.survey.surveying import Slice, survey


def along_input(m: cc.Mechanism, outputs: str) -> Slice:
    """Sets over the one input, almost a whole turn each way."""
    (part,) = survey(m, [m.inputs[:1]], resolution=41, span=3.3, outputs=outputs).slices
    return part


@pytest.fixture(scope="module")
def parallelogram() -> Slice:
    return along_input(linkages.parallelogram(), "x")


@pytest.mark.parametrize("kind", ["direct", "constraint"])
def test_flat_parallelogram(parallelogram: Slice, kind: str) -> None:
    """Two points, not small curves of postures that rounding closes around them."""
    found = parallelogram.set_of(kind)
    assert found.verdict == "isolated"
    assert np.sort(found.coordinates[:, 0]) == pytest.approx([-np.pi / 2, np.pi / 2], abs=1e-9)
    assert set(found.kinds) == {frozenset({"direct", "constraint"})}
    assert found.dropped == 0


def test_a_flat_parallelogram_loses_no_output(parallelogram: Slice) -> None:
    """x is 0.4 (R00 cos q + R01 sin q) and a constant: one stationary value within the branch."""
    found = parallelogram.inverse
    turn = pin.rpy.rpyToMatrix(0.3, -0.5, 0.8)
    expected = np.arctan2(turn[0, 1], turn[0, 0])
    assert found.coordinates[:, 0] == pytest.approx([expected], abs=1e-9)
    assert found.kinds == (frozenset({"inverse"}),)
    assert found.dropped == 0
    assert parallelogram.combined.verdict == "none found"
    assert len(parallelogram.combined.q) == 0


def test_four_bar() -> None:
    """The crank's tip moves across x where the crank lies along it; nothing else is singular."""
    part = along_input(linkages.four_bar(), "x")
    assert np.sort(part.inverse.coordinates[:, 0]) == pytest.approx([0.0, np.pi], abs=1e-9)
    assert set(part.inverse.kinds) == {frozenset({"inverse"})}
    for kind in ("direct", "combined", "constraint"):
        assert part.set_of(kind).verdict == "none found"


def test_a_serial_arm_has_no_direct_singularities() -> None:
    """Its joints are all inputs: with them held nothing moves. It is inverse where stretched."""
    limit = '<axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="1" velocity="1"/>'
    arm = cc.load_urdf(f"""<robot name="arm"><link name="base"/><link name="upper"/>
      <link name="lower"/><link name="hand"/>
      <joint name="A" type="revolute"><parent link="base"/><child link="upper"/>{limit}</joint>
      <joint name="B" type="revolute"><parent link="upper"/><child link="lower"/>
        <origin xyz="0.4 0 0"/>{limit}</joint>
      <joint name="F" type="fixed"><parent link="lower"/><child link="hand"/>
        <origin xyz="0.3 0 0"/></joint>
      <transmission name="a"><joint name="A"/></transmission>
      <transmission name="b"><joint name="B"/></transmission>
      <task base="base" tip="hand" outputs="x y"/>
      <group_state name="home"><joint name="A" value="0.2"/><joint name="B" value="0.6"/>
      </group_state></robot>""")
    over = {"a": np.linspace(-0.5, 0.9, 8), "b": np.linspace(-0.6, 1.1, 9)}
    for kind in ("direct", "combined", "constraint"):
        assert cc.singularity_set(arm, kind, over).verdict == "none found"
    assert "nothing can move" in cc.singularity_set(arm, "direct", over).note
    stretched = cc.singularity_set(arm, "inverse", over)
    assert stretched.verdict == "curve"
    assert np.abs(stretched.coordinates[:, 1]).max() < 1e-9
