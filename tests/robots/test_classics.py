"""The classics of the catalogue: home, mobility, and their closed forms as a second way."""

from __future__ import annotations

import json
import math

import numpy as np
import pinocchio as pin
import pytest
from conftest import Tolerances, assert_close
from typer.testing import CliRunner

import closedchain as cc
from closedchain.cli import app
from closedchain.robots import robot

EVERY = [
    (name, variant)
    for name in cc.robots("classics")
    for variant in (tuple(robot(name).variants) or (None,))
]


def jacobian(m: cc.Mechanism, q: np.ndarray, locked: bool = False) -> np.ndarray:
    """Pinocchio's K, lengths over the mechanism's; without the inputs' columns where they rest."""
    k = cc.constraint_jacobian(m, q) * np.asarray(m.column_scale)
    return np.delete(k, m.input_v, axis=1) if locked else k


def freedoms(m: cc.Mechanism, q: np.ndarray) -> tuple[int, int]:
    """Instantaneous mobility, free and with the inputs locked."""
    ranks = [np.linalg.matrix_rank(jacobian(m, q, locked), 1e-9) for locked in (False, True)]
    return m.model.nv - int(ranks[0]), m.model.nv - len(m.inputs) - int(ranks[1])


def moved(m: cc.Mechanism, by: list[float]) -> np.ndarray:
    """The closed posture nearest to home with its inputs moved."""
    q = m.home.copy()
    q[list(m.input_q)] += by
    s = cc.close(m, q)
    assert s.converged
    return s.q


def apex(a: np.ndarray, b: np.ndarray, from_a: float, from_b: float, side: int) -> np.ndarray:
    """Intersection of two circles; ``side`` 1 is left of the way a to b."""
    way = b - a
    distance = float(np.hypot(*way))
    along = (from_a**2 - from_b**2 + distance**2) / (2.0 * distance)
    across = side * math.sqrt(from_a**2 - along**2)
    return np.asarray(a + (along * way + across * np.array([-way[1], way[0]])) / distance)


# -- all of them ----------------------------------------------------------------------------------


@pytest.mark.parametrize(("name", "variant"), EVERY)
def test_home_and_named_postures_close(name: str, variant: str, tol: Tolerances) -> None:
    m = cc.load(name, variant=variant)
    assert m.task is not None
    assert len(m.inputs) == {"wren": 0}.get(name, cc.mobility(m).mobility)
    pose = m.pose(m.home)
    for posture in m.postures:
        q = m.posture(posture)
        assert np.abs(cc.residual(m, q)).max() < tol.closure
        there = m.pose(q)  # the others are working modes at home's pose
        assert np.abs(there.translation - pose.translation).max() < tol.algebra
        if "rz" in m.task.outputs:
            assert np.abs(there.rotation - pose.rotation).max() < tol.algebra
    drawn = {link.name for link in m.description.links if link.visuals}
    moving = {j.child for j in m.description.joints if j.type in ("revolute", "prismatic")}
    crosses = {link for link in moving if link.endswith("_cross") or link == "C1"}
    assert moving - crosses <= drawn


# Gruebler's count, mobility
COUNTS = {
    "five_bar": (-1, 2),
    "three_rrr": (-3, 3),
    "three_rpr": (-3, 3),
    "gough_stewart": (6, 6),
    "three_rps": (3, 3),
    "three_upu": (3, 3),
    "delta": (3, 3),
    "agile_eye": (-3, 3),
    "six_r": (1, 1),
    "bennett": (-2, 1),
    "double_butterfly": (-8, 1),
    "ankle": (2, 2),
    "excavator": (-5, 1),
}


@pytest.mark.parametrize("name", COUNTS)
def test_mobility(name: str) -> None:
    found = cc.mobility(cc.load(name))
    assert (found.gruebler, found.mobility, found.finite) == (*COUNTS[name], COUNTS[name][1])


def test_every_classic_is_counted_somewhere() -> None:
    """Wren's platform, whose rank promises more than moves, is in test_finite_mobility."""
    assert {*COUNTS, "wren"} == set(cc.robots("classics"))
    assert {*cc.robots("papers"), *cc.robots("classics")} == set(cc.robots())
    with pytest.raises(cc.DescriptionError, match="papers"):
        cc.robots("paper")


@pytest.mark.parametrize(
    ("name", "sizes", "culprit"),
    [
        ("five_bar", {"rods": "0.3 0.01"}, "home"),
        ("three_rrr", {"arm": -0.1}, "arm"),
        ("three_rrr", {"corners": "0 0 0.1 0"}, "corners"),
        ("gough_stewart", {"tops": "0 0 1"}, "tops"),
        ("three_rpr", {"sides": "1 2 4"}, "sides"),
        ("three_upu", {"axes": "askew"}, "axes"),
        ("delta", {"home": "0 0 -2"}, "home"),
        ("bennett", {"stretch": 1.01}, "stretch"),
        ("excavator", {"home": 3.0}, "home"),
    ],
)
def test_sizes_that_cannot_be_are_refused(name: str, sizes: dict, culprit: str) -> None:
    with pytest.raises(cc.DescriptionError, match=culprit):
        cc.load(name, **sizes)


@pytest.mark.parametrize(
    ("name", "sizes"),
    [
        ("five_bar", {"base": 0.2, "cranks": "0.15 0.25", "rods": [0.35, 0.2]}),
        ("three_rrr", {"arm": 0.25, "rod": 0.18, "home": "0.31 0.16 -0.3"}),
        ("three_rpr", {"feet": "0 0 1 0 0.5 1", "sides": "0.4 0.4 0.4", "home": "0.2 0.3 0.4"}),
        ("gough_stewart", {"home": "0.05 -0.02 0.4 0.1 -0.1 0.2 1"}),
        ("three_rps", {"platform_radius": 1.1, "height": 0.7}),
        ("three_upu", {"axes": "radial", "base_side": 0.4, "height": 0.5}),
        ("delta", {"arm": 0.2, "rod": 0.5, "home": "0.05 -0.1 -0.45", "elbows": "1 -1 1"}),
        ("bennett", {"alpha": 0.7, "beta": 1.2, "a": 0.3, "angle": -2.0}),
        ("wren", {"radius": 0.3, "rod": 0.4}),
        ("ankle", {"foot": "0.05 0.04 -0.02", "crank": 0.04}),
        ("excavator", {"lever": 0.4, "home": 1.3}),
    ],
)
def test_other_sizes_close_as_stated(name: str, sizes: dict, tol: Tolerances) -> None:
    m = cc.load(name, **sizes)
    assert not any("closes at" in note for note in m.notes)
    assert np.abs(cc.residual(m, m.home)).max() < tol.closure


# -- special mobility -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("variant", "at_home"), [("snu", (5, 2)), ("tsai", (3, 0)), ("tsai_equal", (5, 2))]
)
def test_3_upu(variant: str, at_home: tuple[int, int]) -> None:
    """Mobility, and what is left of it with the slides locked."""
    m = cc.load("three_upu", variant=variant)
    assert freedoms(m, m.home) == at_home
    assert freedoms(m, moved(m, [0.05, -0.03, 0.02])) == (3, 0)


def test_equal_triangles_on_parallel_legs_are_loose_wherever_they_go(tol: Tolerances) -> None:
    """Three equal legs stay parallel: the platform moves on a sphere with its slides locked."""
    m = cc.load("three_upu", variant="tsai_equal")
    q = m.home.copy()
    q[:3] = 0.8 * np.array([0.3, 0.2, math.sqrt(0.87)])
    s = cc.close(m, q, fixed={f"leg{n}_P": 0.8 for n in (1, 2, 3)})
    assert s.converged
    assert freedoms(m, s.q) == (3, 2)
    assert_close(m.pose(s.q).rotation, np.eye(3), tol.algebra)


@pytest.mark.slow
def test_info_tells_motion_from_the_promise_of_the_rank() -> None:
    def info(*words: str) -> str:
        done = CliRunner().invoke(app, ["info", *words], catch_exceptions=False)
        assert done.exit_code == 0
        return " ".join(done.stdout.split())

    assert "form sets of dimension 2 and of dimension 1." in info("wren")
    assert json.loads(info("bennett", "--json"))["mobility"]["finite"] == [1]
    assert "Not all of that is motion" not in info("bennett")


def test_bennett_moves_only_with_his_sizes() -> None:
    m = cc.load("bennett")
    assert freedoms(m, m.home) == (1, 0)
    off = cc.load("bennett", stretch=1.01, angle=0)
    found = cc.mobility(off)
    assert (found.gruebler, found.mobility, found.finite) == (-2, 0, 0)
    assert len(cc.postures(off, inputs=[0.3], count=False)) == 0
    assert len(cc.postures(off, inputs=[0.0], count=False)) == 1


def test_similar_hexagons_are_singular_everywhere() -> None:
    """O. Ma and J. Angeles 1991: six legs that are never independent; three are not where level."""
    m = cc.load("gough_stewart", variant="hexagons")
    assert freedoms(m, m.home) == (6, 3)
    assert freedoms(m, moved(m, [0.03, -0.02, 0.01, 0.02, -0.04, 0.03])) == (6, 1)
    well = cc.load("gough_stewart")
    assert freedoms(well, well.home) == (6, 0)


# -- closed forms ---------------------------------------------------------------------------------


def test_five_bar_is_two_circles(tol: Tolerances) -> None:
    m = cc.load("five_bar")
    for inputs in ([2.3, 0.9], [1.8, 1.2], [2.0, 0.4]):
        elbows = [
            np.array([x + 0.2 * math.cos(t), 0.2 * math.sin(t)])
            for x, t in zip((0.0, 0.3), inputs, strict=True)
        ]
        s = cc.direct(m, inputs)
        assert s.converged
        tip = apex(elbows[0], elbows[1], 0.3, 0.3, 1)
        assert_close(m.pose(s.q).translation[:2], tip, tol.algebra)


def test_planar_legs_are_as_long_as_they_are() -> None:
    """3-RRR and 3-RPR: corners of the platform from the tip's pose alone."""
    corners = np.array([(-0.12, -0.04 * 3**0.5), (0.12, -0.04 * 3**0.5), (0.0, 0.08 * 3**0.5)])
    feet = np.array([(0.0, 0.0), (0.6, 0.0), (0.3, 0.3 * 3**0.5)])
    m = cc.load("three_rrr")
    for mode in m.postures:
        near = m.posture(mode)
        s = cc.direct(m, m.input_values(near) + np.array([0.05, -0.04, 0.06]), guess=near)
        pose = m.pose(s.q)
        ends = pose.translation[:2] + corners @ pose.rotation[:2, :2].T
        angles = m.input_values(s.q)
        elbows = feet + 0.2 * np.stack([np.cos(angles), np.sin(angles)], axis=1)
        assert_close(np.linalg.norm(ends - elbows, axis=1), np.full(3, 0.2), 1e-12)
    m = cc.load("three_rpr")
    s = cc.direct(m, [15.3, 15.0, 12.2])
    pose = m.pose(s.q)
    feet = np.array([(0.0, 0.0), (15.91, 0.0), (0.0, 10.0)])
    corners = np.array(
        [(0.0, 0.0), (17.04, 0.0), apex(np.zeros(2), np.array([17.04, 0.0]), 20.84, 16.54, 1)]
    )
    ends = pose.translation[:2] + corners @ pose.rotation[:2, :2].T
    assert_close(np.linalg.norm(ends - feet, axis=1), [15.3, 15.0, 12.2], 1e-12)


def pairs(half: float) -> list[float]:
    return [k * 2.0 * math.pi / 3.0 + side * half for k in range(3) for side in (-1, 1)]


def test_platforms_on_legs(tol: Tolerances) -> None:
    """6-UPS and 3-RPS: legs as long as the inputs; the 3-RPS keeps its legs in their planes."""
    m = cc.load("gough_stewart")
    feet, tops = (
        np.array([[r * math.cos(t), r * math.sin(t), 0.0] for t in pairs(half)])
        for r, half in ((0.3, 0.2), (0.2, 0.9))
    )
    inputs = m.input_values(m.home) + np.array([0.02, -0.03, 0.01, 0.03, -0.01, 0.02])
    pose = m.pose(cc.direct(m, inputs).q)
    assert_close(
        np.linalg.norm(pose.translation + tops @ pose.rotation.T - feet, axis=1), inputs, 1e-12
    )

    m = cc.load("three_rps")
    round_ = np.array([[math.cos(t), math.sin(t), 0.0] for t in 2.0 * np.pi * np.arange(3) / 3.0])
    across = np.cross([0.0, 0.0, 1.0], round_)
    pose = m.pose(cc.direct(m, [1.2, 1.35, 1.1]).q)
    legs = pose.translation + 0.6 * round_ @ pose.rotation.T - round_
    assert_close(np.linalg.norm(legs, axis=1), [1.2, 1.35, 1.1], 1e-12)
    assert np.abs((legs * across).sum(axis=1)).max() < tol.closure


def test_delta_is_three_spheres(tol: Tolerances) -> None:
    """The level platform's middle is a rod from the elbows, moved inwards by its radius."""
    m = cc.load("delta")
    azimuths = 2.0 * np.pi * np.arange(3) / 3.0
    for inputs in ([0.5, 0.5, 0.5], [0.2, 0.9, 0.6], [-0.4, 0.3, 0.1]):
        reach = 0.2 - 0.05 + 0.25 * np.cos(inputs)
        centres = np.stack(
            [reach * np.cos(azimuths), reach * np.sin(azimuths), -0.25 * np.sin(inputs)], axis=1
        )
        s = cc.direct(m, inputs)
        assert s.converged
        pose = m.pose(s.q)
        assert_close(pose.rotation, np.eye(3), tol.algebra)
        assert_close(np.linalg.norm(pose.translation - centres, axis=1), np.full(3, 0.6), 1e-12)
    modes = [np.array([m.posture(name)[i] for i in m.input_q]) for name in m.postures]
    assert len({tuple(np.round(mode, 9)) for mode in modes}) == 8


def test_delta_with_upright_rods_is_loose() -> None:
    """The couples of three pairs of upright rods are level, so that none of them is about z."""
    m = cc.load("delta", home="0 0 -0.8", elbows="-1 -1 -1")
    assert_close(np.cos(m.input_values(m.home)), np.full(3, -0.6), 1e-12)
    assert freedoms(m, m.home) == (4, 3)  # it turns, and slides any way
    assert cc.classify(m, m.home).kinds >= {"direct", "constraint"}
    near = cc.load("delta", home="0 0 -0.75", elbows="-1 -1 -1")
    assert freedoms(near, near.home) == (3, 0)


@pytest.mark.slow
def test_delta_falls_until_its_rods_are_upright() -> None:
    m = cc.load("delta")
    fall = cc.simulate(m, m.home, np.zeros(m.model.nv), None, 0.4)
    assert fall.ending.word == "singularity"
    assert abs(fall.t[-1] - 0.282) < 0.001
    assert_close(np.cos(m.input_values(fall.q[-1])), np.full(3, -0.6), 1e-6)


def test_agile_eye_keeps_its_axes_at_right_angles(tol: Tolerances) -> None:
    """The middle axis of each leg, which its input turns, is square to the platform's."""
    m, e = cc.load("agile_eye"), np.eye(3)
    for inputs in ([0.3, -0.4, 0.5], [-0.2, 0.1, 0.6]):
        s = cc.direct(m, inputs)
        assert s.converged
        turn = m.pose(s.q).rotation
        for i, t in enumerate(inputs):
            middle = math.cos(t) * e[i - 1] - math.sin(t) * e[i - 2]
            assert abs(middle @ turn[:, i - 2]) < tol.algebra


def test_bennett_turns_as_bennett_says(tol: Tolerances) -> None:
    """tan(one/2) tan(two/2) stays as it is, and opposite angles are opposite."""
    m = cc.load("bennett")
    ratio = math.sin(math.radians(115 / 2)) / math.sin(math.radians(35 / 2))
    for one in (0.3, 0.9, 1.7, 2.4):
        q = cc.direct(m, [one]).raise_if_failed().q
        assert abs(math.tan(q[0] / 2) * math.tan(q[1] / 2) / ratio - 1.0) < tol.algebra
        assert abs(math.remainder(q[2] + one, 2.0 * math.pi)) < tol.algebra


def test_six_r_closes_by_denavit_and_hartenberg(tol: Tolerances) -> None:
    a, d = (0.3, 1, 0, 1.5, 0, 1.1353), (0.0106, 0, 0.2, 0, 0, 0.1049)
    twist = (math.pi / 2, 0.0175, math.pi / 2, 0.0175, math.pi / 2, 1.4716)
    m = cc.load("six_r")
    hand = np.eye(4)
    for n in range(6):
        t, joint = twist[n], m.model.joints[m.model.getJointId(f"R{n + 1}")].idx_q
        c, s = math.cos(m.home[joint]), math.sin(m.home[joint])
        hand = hand @ np.array(
            [
                [c, -s * math.cos(t), s * math.sin(t), a[n] * c],
                [s, c * math.cos(t), -c * math.sin(t), a[n] * s],
                [0, math.sin(t), math.cos(t), d[n]],
                [0, 0, 0, 1],
            ]
        )
    assert_close(hand, np.eye(4), tol.algebra)
    assert abs(m.input_values(m.home)[0]) < tol.closure


def test_wren_keeps_to_a_sphere(tol: Tolerances) -> None:
    """Its rows depend on each other to the first order only; what is solved is closed."""
    m = cc.load("wren")
    place = 2.0 * np.array([0.15, 0.1, math.sqrt(1.0 - 0.15**2 - 0.1**2)])
    s = cc.inverse(m, pin.SE3(np.eye(3), place))
    assert s.converged
    assert s.residual < tol.closure
    assert not cc.inverse(m, pin.SE3(np.eye(3), 1.02 * place)).converged


def test_double_butterfly_by_its_bars(tol: Tolerances) -> None:
    """Four lengths between points of base, crank and wings."""
    m = cc.load("double_butterfly")
    s = cc.direct(m, [math.radians(60.0)])
    assert s.converged
    (crank, left, right) = (m.pose(s.q, name) for name in ("crank", "left", "right"))
    assert abs(math.atan2(crank.rotation[1, 0], crank.rotation[0, 0]) - math.pi / 3) < tol.algebra
    ends = {
        11.0: (np.array([-5.6, 4.2, 0.0]), left.act(np.zeros(3))),
        9.0: (crank.act(np.array([-2.4, 1.8, 0.0])), left.act(np.array([0.0, 4.0, 0.0]))),
        7.0: (crank.act(np.array([-2.0, 0.0, 0.0])), right.act(np.array([-6.0, 0.0, 0.0]))),
        12.0: (np.array([-13.0, 0.0, 0.0]), right.act(np.array([-6.46, 2.69, 0.0]))),
    }
    for length, (one, two) in ends.items():
        assert abs(np.linalg.norm(one - two) - length) < tol.algebra
    assert_close(left.act(np.array([3.0, 0.0, 0.0])), right.translation, tol.algebra)


def test_excavator_by_two_triangles(tol: Tolerances) -> None:
    m = cc.load("excavator")
    cylinder, lever, bucket = np.array([0.3, 0.35]), np.array([1.5, 0.0]), np.array([1.9, 0.0])
    for length in (0.9, 1.1, 1.4):
        middle = apex(cylinder, lever, length, 0.45, 1)
        end = apex(middle, bucket, 0.5, 0.35, 1) - bucket
        turn = m.pose(cc.direct(m, [length]).raise_if_failed().q, "bucket").rotation
        assert abs(math.atan2(turn[2, 0], turn[0, 0]) - math.atan2(end[1], end[0])) < tol.algebra
