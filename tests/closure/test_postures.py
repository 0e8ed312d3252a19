"""Named postures: closed when asked for, near what is stated, and the modes of the closed forms."""

from __future__ import annotations

import pickle
from collections.abc import Mapping
from itertools import combinations
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from conftest import Tolerances, assert_close
from small_linkages import GRASHOF, four_bar, four_bar_angles

import closedchain as cc
from closedchain.closure import named
from closedchain.robots import d1 as d1_forms
from closedchain.robots import eclipse, rpa3t, rus6
from closedchain.robots import linear_delta as delta

CRANK, JOINTS = 1.1, ("crank_joint", "rod_joint", "rocker_joint")
LEFT = dict(zip(JOINTS, four_bar_angles(GRASHOF, CRANK), strict=True))
RIGHT = dict(zip(JOINTS, four_bar_angles(GRASHOF, CRANK, side=-1), strict=True))


def with_states(**states: Mapping[str, float]) -> cc.Mechanism:
    """The four-bar at ``LEFT``, with further named postures."""
    text = four_bar(GRASHOF, CRANK).description.text
    for name, values in states.items():
        joints = "".join(f'<joint name="{n}" value="{v!r}"/>' for n, v in values.items())
        state = f'<group_state name="{name}">{joints}</group_state>'
        text = text.replace("</robot>", state + "</robot>")
    return cc.load_urdf(text, xacro=False)


def at(m: cc.Mechanism, values: Mapping[str, Any]) -> np.ndarray:
    """Configuration (nq,) with these joint values, the other joints as at home."""
    q = np.array(m.home)
    for name, value in values.items():
        joint = m.model.joints[m.model.getJointId(name)]
        q[joint.idx_q : joint.idx_q + joint.nq] = value
    return q


def off(m: cc.Mechanism, one: np.ndarray, other: np.ndarray) -> float:
    """Largest difference of two postures [m or rad], whole turns apart being the same."""
    d = np.asarray(pin.difference(m.model, one, other))
    turned = np.where(m.translational, d, (d + np.pi) % (2.0 * np.pi) - np.pi)
    return float(np.abs(turned).max())


# -- the mapping ----------------------------------------------------------------------------------


def test_home_comes_first_and_is_the_home_posture() -> None:
    m = with_states(other=RIGHT)
    assert list(m.postures) == ["home", "other"]
    assert len(m.postures) == 2
    assert m.posture("home") is m.home
    assert list(four_bar(GRASHOF, CRANK).postures) == ["home"]


def test_a_posture_is_the_stated_assembly_closed_and_kept(tol: Tolerances) -> None:
    m = with_states(other=RIGHT)
    q = m.posture("other")
    assert_close(q, at(m, RIGHT), tol.algebra)
    assert np.abs(cc.residual(m, q)).max() < tol.closure
    assert m.posture("other") is q
    assert m.postures["other"] is q
    assert off(m, q, m.home) > 0.5


def test_nothing_is_closed_before_it_is_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[object] = []
    wrapped = named.closed_beside
    monkeypatch.setattr(named, "closed_beside", lambda *a, **k: asked.append(a) or wrapped(*a, **k))
    m = with_states(one=RIGHT, two=RIGHT)
    assert [*m.postures] == ["home", "one", "two"]
    assert "two" in m.postures
    assert "none" not in m.postures
    assert repr(m.postures) == "Postures(home, one, two)"
    assert asked == []
    m.posture("one")
    m.posture("one")
    assert len(asked) == 1


def test_postures_are_write_protected() -> None:
    m = with_states(other=RIGHT)
    for name in m.postures:
        with pytest.raises(ValueError, match="read-only"):
            m.posture(name)[0] = 0.0
    postures: Any = m.postures
    with pytest.raises(TypeError):
        postures["new"] = m.home


def test_a_tree_without_loops_stands_as_stated() -> None:
    text = """<robot name="r"><link name="a"/><link name="b"/><joint name="j" type="continuous">
      <parent link="a"/><child link="b"/></joint>
      <group_state name="up"><joint name="j" value="0.5"/></group_state></robot>"""
    q = cc.load_urdf(text, xacro=False).posture("up")
    assert q.tolist() == [0.5]
    assert not q.flags.writeable


@pytest.mark.parametrize("closed_before", [False, True])
def test_postures_survive_pickling(closed_before: bool) -> None:
    m = with_states(other=RIGHT)
    if closed_before:
        m.posture("other")
    copy = pickle.loads(pickle.dumps(m))
    assert list(copy.postures) == ["home", "other"]
    np.testing.assert_array_equal(copy.posture("other"), m.posture("other"))
    assert not copy.posture("other").flags.writeable


def test_an_unknown_name_is_refused_with_the_known_ones() -> None:
    m = with_states(other=RIGHT)
    with pytest.raises(cc.ClosureError, match=r"unknown posture 'othr' \(did you mean 'other'\?\)"):
        m.posture("othr")
    with pytest.raises(cc.ClosureError, match="known: home, other"):
        m.posture("sleeping")
    with pytest.raises(KeyError):
        m.postures["sleeping"]


# -- what is stated -------------------------------------------------------------------------------


def test_joints_left_out_are_as_at_home() -> None:
    m = with_states(same={})
    assert_close(m.posture("same"), m.home, 1e-15)


def test_joints_left_out_follow_the_stated_ones(tol: Tolerances) -> None:
    m = with_states(turned={"crank_joint": 0.6})
    expected = dict(zip(JOINTS, four_bar_angles(GRASHOF, 0.6), strict=True))
    assert_close(m.posture("turned"), at(m, expected), tol.algebra)


def test_rounding_of_what_is_stated_is_closed(tol: Tolerances) -> None:
    m = with_states(rounded={name: round(value, 7) for name, value in RIGHT.items()})
    q = m.posture("rounded")
    assert np.abs(cc.residual(m, q)).max() < tol.closure
    assert 0.0 < off(m, q, at(m, RIGHT)) < 1e-6


def test_a_posture_that_closing_moves_is_refused() -> None:
    m = with_states(off={**RIGHT, "rod_joint": RIGHT["rod_joint"] + 1e-3})
    with pytest.raises(cc.ClosureError) as caught:
        m.posture("off")
    for phrase in ("posture 'off' of 'small'", "closure 'loop'", "moves joint 'rod_joint' by"):
        assert phrase in str(caught.value)
    with pytest.raises(cc.ClosureError):  # asked again, it says so again
        m.posture("off")
    assert m.posture("home") is m.home


@pytest.mark.parametrize(
    ("values", "phrase"),
    [
        # no rocker reaches the tip of a stretched rod
        ((CRANK, 0.0), "closure 'loop' .* stays open .* moves joint"),
        # all bars in one line: no motion brings the ends nearer
        ((0.0, 0.0, np.pi), "closure 'loop' .* stays open .* does not close"),
    ],
)
def test_a_posture_that_cannot_close_is_refused(values: tuple[float, ...], phrase: str) -> None:
    m = with_states(away=dict(zip(JOINTS, values, strict=False)))
    with pytest.raises(cc.ClosureError, match=f"posture 'away' .* {phrase}"):
        m.posture("away")


# -- the modes of the robots ----------------------------------------------------------------------


def eclipse_modes(m: cc.Mechanism, g: eclipse.Geometry) -> dict[str, np.ndarray]:
    height = float(m.parameters["height"])
    found = eclipse.inverse([0.0, 0.0, height], np.eye(3), g)
    modes = {}
    for mode, real, inputs, q_r in zip(
        found.modes, found.exists, found.inputs, found.q_r, strict=True
    ):
        if real:
            modes[mode.label] = at(m, {f"{leg}_R": q_r[i] for i, leg in enumerate("abc")})
            modes[mode.label][m.input_q] = inputs
    return modes


def delta_modes(m: cc.Mechanism) -> dict[str, np.ndarray]:
    p, g = m.point(m.home, "P"), delta.Geometry()
    modes = {}
    for sides, heights in zip(delta.MODES, delta.inverse(p, g), strict=True):
        swing, tilt = delta.leg_angles(delta.rods(p, heights, g))
        values = {"leg1_C": -swing[0]}
        for i in range(3):
            leg = {"P": heights[i], "B": swing[i], "D": tilt[i], "E": tilt[i], "G": -tilt[i]}
            values |= {f"leg{i + 1}_{letter}": value for letter, value in leg.items()}
        modes[label(sides)] = at(m, values)
    return modes


def rpa3t_modes(m: cc.Mechanism) -> dict[str, np.ndarray]:
    g = rpa3t.geometry()
    found = rpa3t.inverse(m.point(m.home, "P"), g)
    return {
        label(mode): at(m, rpa3t.joint_values(q, theta, g))
        for mode, real, q, theta in zip(found.modes, found.real, found.q, found.theta, strict=True)
        if real
    }


def rus6_modes(m: cc.Mechanism, **sizes: float) -> dict[str, np.ndarray]:
    g = rus6.geometry(**sizes)
    modes = {}
    for kappa in rus6.MODES:
        if len(set(kappa[:3])) == len(set(kappa[3:])) == 1:
            legs = rus6.inverse(g.home, float(m.parameters["beta"]), g, kappa)
            assert legs.closed
            values: dict[str, float] = {}
            for i in range(6):
                leg = {"A": legs.alpha[i], "U1": legs.bend[i], "U2": legs.swing[i]}
                values |= {f"leg{i + 1}_{letter}": value for letter, value in leg.items()}
            modes[label(kappa)] = at(m, values)
    return modes


def label(signs: np.ndarray) -> str:
    return "".join("+" if sign > 0 else "-" for sign in signs)


def assert_modes(m: cc.Mechanism, modes: Mapping[str, np.ndarray], home: str) -> None:
    """The named postures are these modes, all different, and ``home`` is that of home."""
    assert set(m.postures) == {"home", *modes}
    for name, q in modes.items():
        assert off(m, m.posture(name), q) < 1e-10, name
        assert np.abs(cc.residual(m, m.posture(name))).max() < 1e-12, name
    assert off(m, m.posture(home), m.home) < 1e-14
    for one, other in combinations(modes, 2):
        assert off(m, m.posture(one), m.posture(other)) > 1e-3, (one, other)


@pytest.mark.parametrize("sizes", [{}, {"r": 0.17, "height": 0.13}])
def test_eclipse_has_its_eight_working_modes(sizes: dict[str, float]) -> None:
    m = cc.load("eclipse", **sizes)
    lengths = {k: v for k, v in sizes.items() if k != "height"}
    modes = eclipse_modes(m, eclipse.Geometry(**lengths))
    assert len(modes) == 8
    assert_modes(m, modes, "+++")


def test_eclipse_with_long_links_has_columns_beyond_the_axis_too() -> None:
    m = cc.load("eclipse", r=0.35, d_min=-0.5, d_max=1.0)
    modes = eclipse_modes(m, eclipse.Geometry(r=0.35))
    assert len(modes) == 64
    assert_modes(m, modes, "+++")


def test_eclipse2_has_sixteen_working_modes() -> None:
    m = cc.load("eclipse2", z_c=0.02)
    modes = eclipse_modes(m, eclipse.Geometry(z_c=0.02))
    assert len(modes) == 16
    assert_modes(m, modes, "+++")


def test_eclipse_leaves_out_what_is_beyond_its_columns_or_coincides() -> None:
    assert list(cc.load("eclipse", d_min=0.0).postures) == ["home", "+++"]
    assert list(cc.load("eclipse", r=0.1).postures) == ["home", "+++"]  # straight links


@pytest.mark.parametrize("sides", ["1 1 1", "-1 1 -1"])
def test_linear_delta_has_its_eight_working_modes(sides: str) -> None:
    m = cc.load("linear_delta", home="0.08 -0.05 -0.6", sides=sides)
    assert_modes(m, delta_modes(m), label(np.array(sides.split(), dtype=float)))


def test_linear_delta_leaves_out_what_is_beyond_its_rails() -> None:
    assert list(cc.load("linear_delta", variant="V1").postures) == ["home", "+++"]


@pytest.mark.parametrize(
    ("mode", "home"), [("1 1 -1 1", "0.1 -0.03 -0.6"), ("-1 1 1 -1", "0.05 0.02 -0.65")]
)
def test_rpa3t_has_its_sixteen_working_modes(mode: str, home: str) -> None:
    m = cc.load("rpa3t", mode=mode, home=home)
    modes = rpa3t_modes(m)
    assert len(modes) == 16
    assert_modes(m, modes, label(np.array(mode.split(), dtype=float)))


def test_rpa3t_keeps_modes_whose_arms_are_within_their_limits() -> None:
    m = cc.load("rpa3t", variant="working")
    assert list(m.postures) == ["home", "++-+", "-+-+"]
    # an arm past half a turn is given as its limits count it
    assert m.input_values(m.posture("-+-+"))[1] == pytest.approx(np.radians(181.949), abs=1e-4)
    lower, upper = m.limits
    assert ((lower <= m.posture("-+-+")) & (m.posture("-+-+") <= upper)).all()


def test_rpa3t_at_the_end_of_its_stroke_has_one_sign_of_cos_beta() -> None:
    names = list(cc.load("rpa3t", home="0.1 0.05 -0.6").postures)
    assert names[1:] == ["++++", "+++-", "++-+", "++--", "+-++", "+-+-", "+--+", "+---"]


@pytest.mark.parametrize("variant", ["coupled", "free", "locked"])
def test_rus6_has_the_modes_whose_stages_are_symmetric(variant: str) -> None:
    m = cc.load("rus6", variant=variant, beta=0.2)
    modes = rus6_modes(m)
    assert set(modes) == {"++++++", "+++---", "---+++", "------"}
    assert_modes(m, modes, "++++++")


def test_d1_has_the_level_assemblies_of_its_home_lengths() -> None:
    m = cc.load("d1")
    g = d1_forms.geometry()
    found = d1_forms.forward(m.input_values(m.home), g).assemblies
    level = [
        a
        for a in found
        if all(abs(pose.rotation[1, 1] - 1.0) < 1e-6 for pose in (a.coupler, a.platform))
    ]
    modes = {}
    for a in level:
        side = label(np.array([a.coupler.position[1], a.platform.position[1] - g.U[0, 1]]))
        modes[f"{'-'.join(a.modes)}/{side}"] = a
    assert set(m.postures) == {"home", *modes}
    assert len(modes) == 8
    for name, a in modes.items():
        q = m.posture(name)
        assert np.abs(cc.residual(m, q)).max() < 1e-12
        assert_close(m.input_values(q), m.input_values(m.home), 1e-12, name)
        for frame, pose in (("coupler", a.coupler), ("platform", a.platform)):
            assert_close(m.pose(q, frame).translation, pose.position, 1e-10, name)
            assert_close(m.pose(q, frame).rotation, pose.rotation, 1e-10, name)
    assert_close(m.posture("ZT-ZT/--"), m.home, 1e-14)
    for one, other in combinations(modes, 2):
        assert off(m, m.posture(one), m.posture(other)) > 1e-3, (one, other)


@pytest.mark.parametrize("variant", ["printed_u", "circle_u"])
def test_d1_has_them_wherever_its_outer_feet_are_level(variant: str) -> None:
    m = cc.load("d1", variant=variant)
    assert len(m.postures) == 9
    for name in m.postures:
        assert_close(m.input_values(m.posture(name)), m.input_values(m.home), 1e-12, name)


def test_d1_leaves_out_what_its_sizes_do_not_allow() -> None:
    uneven = cc.load("d1", U1="0.4 -0.2 0")
    assert list(uneven.postures) == ["home"]
    short = cc.load("d1", leg_max=0.8)
    assert "ZT-ZT/+-" not in short.postures  # a passive leg of 1.25 m
    low = cc.load("d1", height_coupler=-0.25, height_platform=-0.6)
    assert not any(name.startswith("HT") for name in low.postures)


def test_the_family_names_home_only() -> None:
    assert list(cc.load("delia").postures) == ["home"]
