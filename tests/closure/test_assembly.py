"""Home: stated, nearly stated, not stated, and not there at all."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from conftest import Tolerances
from small_linkages import four_bar_angles

import closedchain as cc
from closedchain.robots.viewer import static_page

BARS = (0.10, 0.30, 0.25, 0.28)  # crank, coupler, rocker, ground


def planar(
    bars: tuple[float, ...] = BARS, home: str = "", limit: str = "", drive: str = "A"
) -> str:
    """Four-bar in the x-y plane; ``limit`` is that of the rocker's joint."""
    crank, coupler, rocker, ground = bars
    kind = "revolute" if limit else "continuous"
    return (
        '<robot name="planar"><link name="ground"/><link name="crank"/><link name="coupler"/>'
        '<link name="rocker"/>'
        '<joint name="A" type="continuous"><parent link="ground"/><child link="crank"/>'
        '<axis xyz="0 0 1"/></joint>'
        '<joint name="B" type="continuous"><parent link="crank"/><child link="coupler"/>'
        f'<origin xyz="{crank} 0 0"/><axis xyz="0 0 1"/></joint>'
        f'<joint name="D" type="{kind}"><parent link="ground"/><child link="rocker"/>'
        f'<origin xyz="{ground} 0 0"/><axis xyz="0 0 1"/>{limit}</joint>'
        '<constraint name="C" type="revolute"><parent link="coupler"/>'
        f'<parent_origin xyz="{coupler} 0 0"/><parent_axis xyz="0 0 1"/><child link="rocker"/>'
        f'<child_origin xyz="{rocker} 0 0"/></constraint>'
        f'<transmission name="q1"><joint name="{drive}"/></transmission>'
        f'<task base="ground" tip="coupler" outputs="rz"/>{home}</robot>'
    )


def state(**values: float) -> str:
    joints = "".join(f'<joint name="{name}" value="{x}"/>' for name, x in values.items())
    return f'<group_state name="home" group="all">{joints}</group_state>'


def test_a_stretched_zero_is_left(tol: Tolerances) -> None:
    """All links on one line: no direction closes the loop to first order."""
    m = cc.load_urdf(planar())
    assert not m.home_open
    assert m.home[0] == 0.0  # the input stays
    # circles about the two ends, by hand
    sides = {round(float(x), 7) for x in (abs(m.home[1]), abs(m.home[2]))}
    assert sides == {0.9828785, 1.6252677}
    assert m.home[1] * m.home[2] > 0.0
    assert np.abs(cc.residual(m, m.home)).max() < tol.closure
    (note,) = m.notes
    assert note.startswith("no home is stated and the loops are open with all joints at zero")


def test_inputs_are_moved_last() -> None:
    m = cc.load_urdf(planar(home=state(A=0.7, B=0.1, D=1.5)))
    assert m.home[0] == 0.7
    assert len(m.notes) == 2
    first, second, *_ = m.notes
    assert first.startswith("home: joint 'B' is stated at 0.1 and closes at ")
    assert second.startswith("home: joint 'D' is stated at 1.5 and closes at ")
    # driven from the other side the other joint stays
    other = cc.load_urdf(planar(home=state(A=0.7, B=0.1, D=1.5), drive="D"))
    assert other.home[2] == 1.5
    assert other.home[0] != 0.7
    # a rocker that is out of reach has to move, and that is said
    far = cc.load_urdf(planar((0.1, 0.3, 0.25, 0.28), state(A=0.7, D=3.1), drive="D"))
    assert not far.home_open
    assert far.home[2] != 3.1
    assert any("joint 'D' is stated at 3.1 and closes at" in note for note in far.notes)


def test_the_nearest_closed_posture_within_limits_is_home() -> None:
    up = four_bar_angles((0.10, 0.30, 0.25, 0.28), 0.0, 1)
    down = four_bar_angles((0.10, 0.30, 0.25, 0.28), 0.0, -1)
    assert up[2] == pytest.approx(-down[2])
    for lower, upper in ((0.2, 3.0), (-3.0, -0.2)):
        limit = f'<limit lower="{lower}" upper="{upper}" effort="1" velocity="1"/>'
        m = cc.load_urdf(planar(limit=limit))
        assert lower < m.home[2] < upper
        assert abs(m.home[2]) == pytest.approx(abs(up[2]), abs=1e-9)
        assert m.home[0] == 0.0


def test_home_may_be_given() -> None:
    down = cc.load_urdf(planar(), home={"B": -1.0, "D": -1.6})
    up = cc.load_urdf(planar(), home={"B": 1.0, "D": 1.6})
    assert down.home[1] == pytest.approx(-0.9828785, abs=1e-7)
    assert up.home[1] == pytest.approx(0.9828785, abs=1e-7)
    # an input is a joint too, and what is given replaces what is stated
    turned = cc.load_urdf(planar(home=state(A=0.7)), home={"q1": 1.1})
    assert turned.home[0] == 1.1
    with pytest.raises(cc.DescriptionError, match=r"home: unknown joint 'E'.*known: A, B, D"):
        cc.load_urdf(planar(), home={"E": 1.0})
    with pytest.raises(cc.DescriptionError, match="must be 1 finite number"):
        cc.load_urdf(planar(), home={"A": [1.0, 2.0]})


def test_what_closes_nowhere_can_be_looked_at() -> None:
    m = cc.load_urdf(planar((0.1, 0.2, 0.2, 0.9)))
    assert m.home_open
    assert m.open_by == pytest.approx(0.4, abs=1e-6)  # stretched towards each other
    assert m.notes[-1].startswith("no closed posture was found and home is open: closure 'C'")
    page = static_page(m)
    assert "open: closure" in page
    assert "drawn in red" in page
    for question in (
        lambda: cc.mobility(m),
        lambda: cc.direct(m, [0.1]),
        lambda: cc.classify(m, m.home),
        lambda: cc.singularity_map(m, {"q1": np.linspace(-0.1, 0.1, 3)}),
    ):
        with pytest.raises(cc.ClosureError, match="open"):
            question()
    guess = m.home.copy()
    guess[0] = 0.3
    assert not cc.close(m, guess).converged
    with pytest.raises(cc.ClosureError, match="the loops are open there by"):
        m.with_closed_home(guess)


def test_a_closed_posture_may_become_home(tol: Tolerances) -> None:
    m = cc.load_urdf(planar())
    s = cc.direct(m, [0.4]).raise_if_failed()
    moved = m.with_closed_home(s.q)
    assert moved.home.tolist() == s.q.tolist()
    assert moved.length == m.length
    assert cc.direct(moved, [0.5]).raise_if_failed().residual < tol.closure


def test_as_many_inputs_as_may_be_stay() -> None:
    """A five-bar with three inputs: two stay, the third follows."""
    z = '<axis xyz="0 0 1"/>'
    text = (
        '<robot name="five"><link name="base"/><link name="l"/><link name="r"/><link name="lr"/>'
        '<link name="rr"/>'
        f'<joint name="A" type="continuous"><parent link="base"/><child link="l"/>{z}</joint>'
        f'<joint name="E" type="continuous"><parent link="base"/><child link="r"/>'
        f'<origin xyz="0.3 0 0"/>{z}</joint>'
        f'<joint name="B" type="continuous"><parent link="l"/><child link="lr"/>'
        f'<origin xyz="0.2 0 0"/>{z}</joint>'
        f'<joint name="D" type="continuous"><parent link="r"/><child link="rr"/>'
        f'<origin xyz="0.2 0 0"/>{z}</joint>'
        '<constraint name="C" type="revolute"><parent link="lr"/><parent_origin xyz="0.3 0 0"/>'
        '<parent_axis xyz="0 0 1"/><child link="rr"/><child_origin xyz="0.3 0 0"/></constraint>'
        '<transmission name="q1"><joint name="A"/></transmission>'
        '<transmission name="q2"><joint name="E"/></transmission>'
        '<transmission name="q3"><joint name="B"/></transmission>'
        + state(A=2.2, E=0.9, B=-1.3, D=1.3)
        + "</robot>"
    )
    m = cc.load_urdf(text)
    assert m.input_values(m.home)[:2].tolist() == [2.2, 0.9]
    assert m.input_values(m.home)[2] != -1.3


def test_a_file_s_home_argument_is_still_one(tmp_path: Path) -> None:
    """A xacro argument called home goes to xacro; joint values come as a mapping."""
    text = planar(home=state(A="$(arg home)")).replace(  # type: ignore[arg-type]
        '<robot name="planar">',
        '<robot name="planar" xmlns:xacro="http://www.ros.org/wiki/xacro">'
        '<xacro:arg name="home" default="0.2"/>',
    )
    file = tmp_path / "planar.urdf.xacro"
    file.write_text(text)
    assert cc.load_urdf(file).home[0] == 0.2
    assert cc.load_urdf(file, home=0.5).home[0] == 0.5
    assert cc.load_urdf(file, home={"A": 0.6}).home[0] == 0.6
    assert math.isclose(cc.load_file(file, home={"A": 0.6}).home[0], 0.6)
