"""Modes joined without a singularity, and modes that meet: closed forms, and other ways to go."""

from __future__ import annotations

import math

import numpy as np
import pytest
from conftest import Tolerances
from small_linkages import GRASHOF, ROCKING, four_bar

import closedchain as cc
from closedchain.closure.modes.result import by_joint

FEET = np.array([[0.0, 0.0], [15.91, 0.0], [0.0, 10.0]])


def line_determinant(m: cc.Mechanism, q: np.ndarray) -> float:
    """Of the three leg lines of the planar 3-RPR: zero exactly where they meet in a point.

    Directions and moments about the first corner, by hand from leg angles and lengths.
    """
    joints = by_joint(m, q)
    turn = np.array([joints[f"leg{i}_A"][0] for i in (1, 2)])
    corner = FEET[:2] + m.input_values(q)[:2, None] * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    third = m.point(q, "C3")[:2]
    corners = np.array([*corner, third])
    along = (corners - FEET) / m.input_values(q)[:, None]
    arm = corners - corners[0]
    return float(
        np.linalg.det(np.column_stack([along, arm[:, 0] * along[:, 1] - arm[:, 1] * along[:, 0]]))
    )


def turned(change: np.ndarray) -> np.ndarray:
    """Without whole turns; slides differ by less than half of one."""
    return (change + np.pi) % (2.0 * np.pi) - np.pi


@pytest.fixture(scope="module")
def rpr() -> cc.Mechanism:
    return cc.load("three_rpr")


@pytest.fixture(scope="module")
def modes(rpr: cc.Mechanism) -> cc.Postures:
    return cc.postures(rpr, inputs=(14.98, 15.38, 12.0), count=False)


@pytest.fixture(scope="module")
def connected(modes: cc.Postures) -> cc.Connections:
    return modes.connections({"q2": (2.0, 32.0), "q3": (2.0, 32.0)}, resolution=40)


# -- the planar 3-RPR of Innocenti and Parenti-Castelli --------------------------------------------


def test_two_aspects_of_three_modes_each(
    rpr: cc.Mechanism, modes: cc.Postures, connected: cc.Connections
) -> None:
    sides = {name: np.sign(line_determinant(rpr, modes[name].q)) for name in modes.names}
    groups = [set(group) for group in connected.groups]
    assert sorted(map(len, groups)) == [3, 3]
    for group in groups:
        assert len({sides[name] for name in group}) == 1
        assert len({connected.signs[name] for name in group}) == 1
    assert not connected.left_out
    assert not connected.unconfirmed
    assert "by no way at all" in connected.text


def test_passages_hold_when_they_are_tracked(
    rpr: cc.Mechanism, modes: cc.Postures, connected: cc.Connections, tol: Tolerances
) -> None:
    assert len(connected.passages) == 4
    for passage in connected.passages:
        one, two = passage.modes
        assert np.array_equal(passage.values[0], passage.values[-1])
        path = np.column_stack([np.full(len(passage.values), 14.98), passage.values])
        track = cc.track(rpr, path, start=passage.q[0])
        assert track.complete, track.stop
        assert np.abs(track.q[-1] - passage.q[-1]).max() < tol.reference
        assert (
            np.abs(rpr.pose(track.q[-1]).homogeneous - rpr.pose(modes[two].q).homogeneous).max()
            < 1e-8
        )
        assert (
            np.abs(rpr.pose(modes[one].q).homogeneous - rpr.pose(modes[two].q).homogeneous).max()
            > 0.1
        )
        lines = np.array([line_determinant(rpr, q) for q in passage.q])
        assert (np.sign(lines) == np.sign(lines[0])).all()
        assert (np.sign(passage.determinant) == np.sign(passage.determinant[0])).all()
        assert passage.residual < tol.closure
        assert max(np.abs(cc.residual(rpr, q)).max() for q in passage.q) == passage.residual
        some = np.linspace(0, len(passage.q) - 1, 5).astype(int)
        for q, sigma in zip(passage.q[some], passage.sigma[some], strict=True):
            assert abs(cc.classify(rpr, q).sigma_direct - sigma) < tol.algebra
        assert passage.sigma.min() > 1e-4


def test_passages_are_put_together_and_go_back(
    modes: cc.Postures, connected: cc.Connections
) -> None:
    for group in connected.groups:
        for one in group:
            for two in group:
                assert connected.joined(one, two)
                if one == two:
                    continue
                way = connected.passage(one, two)
                assert way.modes == (one, two)
                ends = modes[one].q, modes[two].q
                for q, end in zip((way.q[0], way.q[-1]), ends, strict=True):
                    assert np.abs(turned(q - end)).max() < 1e-7
                assert len(way.values) == len(way.q) == len(way.sigma) == len(way.determinant)
                assert way.pieces == len(way.corners) - 1
                back = connected.passage(two, one)
                assert np.abs(back.sigma - way.sigma[::-1]).max() < 1e-12
                assert np.abs(np.diff(way.q, axis=0)).max() < 3.0  # nothing jumps by a turn
    (one, *_), (two, *_) = connected.groups
    assert not connected.joined(one, two)
    with pytest.raises(cc.ClosureError, match="no such way"):
        connected.passage(one, two)
    with pytest.raises(cc.ClosureError, match="to itself"):
        connected.passage(one, one)
    with pytest.raises(KeyError, match="unknown mode 'nowhere'"):
        connected.joined("nowhere", one)


def test_modes_meet_those_of_the_other_sign_at_singularities(
    rpr: cc.Mechanism, modes: cc.Postures, connected: cc.Connections
) -> None:
    pairs = [meeting for meeting in connected.meetings if len(meeting.modes) == 2]
    assert len(pairs) >= 6
    one, two = map(set, connected.groups)
    here = np.array([15.38, 12.0])
    for meeting in pairs:
        assert len(set(meeting.modes) & one) == len(set(meeting.modes) & two) == 1
        assert connected.meeting(*meeting.modes) is meeting
        assert abs(line_determinant(rpr, meeting.q)) < 1e-8
        assert meeting.sigma < 1e-10
        assert "direct" in cc.classify(rpr, meeting.q).kinds
        assert np.abs(rpr.input_values(meeting.q)[1:] - meeting.values).max() < 1e-10
        assert abs(np.linalg.norm(meeting.values - here) / rpr.length - meeting.distance) < 1e-9
        apart = []
        for share in (1.0 - 1e-4, 1.0 - 1e-6):
            inputs = [14.98, *(here + share * (meeting.values - here))]
            near = [cc.direct(rpr, inputs, guess=modes[name].q) for name in meeting.modes]
            assert all(s.converged for s in near)
            apart.append(np.linalg.norm(turned(near[0].q - near[1].q)))
        # as the root of the way that is left
        assert apart[1] == pytest.approx(0.1 * apart[0], rel=0.05)
        beyond = [14.98, *(here + 1.001 * (meeting.values - here))]
        assert not any(cc.direct(rpr, beyond, guess=modes[n].q).converged for n in meeting.modes)
    assert [m.distance for m in connected.meetings] == sorted(
        m.distance for m in connected.meetings
    )


def test_without_ranges_the_window_holds_all_that_is_reached(modes: cc.Postures) -> None:
    found = modes.connections("q2 q3", resolution=30)
    assert sorted(map(len, found.groups)) == [3, 3]
    assert found.bounded == (True, True)
    assert found.counts.shape == (2, 31, 31)
    assert found.counts.sum() == found.searched.postures
    assert found.counts.max() == 3
    at = tuple(
        int(np.flatnonzero(axis == x)[0])
        for axis, x in zip(found.axes.values(), (15.38, 12.0), strict=True)
    )
    assert (found.counts[(slice(None), *at)] == 3).all()


def test_limits_are_kept_to() -> None:
    m = cc.load("three_rpr", length_max=16)
    p = cc.postures(m, inputs=(14.98, 15.38, 12.0), count=False)
    assert len(p) == 6
    assert not any(p.beyond_limits)
    over = {"q2": (2.0, 32.0), "q3": (2.0, 32.0)}
    within, aside = (p.connections(over, resolution=30, limits=x) for x in (True, False))
    assert len(within.groups) > len(aside.groups) == 2
    assert not any(within.bounded)
    for passage in within.passages:
        assert passage.values.max() <= 16.0
    assert max(passage.values.max() for passage in aside.passages) > 16.0
    assert all(meeting.values.max() <= 16.0 for meeting in within.meetings)
    beyond = cc.postures(m, inputs=(14.98, 16.5, 12.0), count=False)
    assert all(beyond.beyond_limits)
    with pytest.raises(cc.ClosureError, match="joints beyond their limits"):
        beyond.connections(over)


@pytest.mark.slow
def test_every_loop_goes_round_a_cusp(
    rpr: cc.Mechanism, modes: cc.Postures, connected: cc.Connections
) -> None:
    axis = np.linspace(2.0, 32.0, 61)
    cusps: list[np.ndarray] = []
    for group in connected.groups:
        start = modes[group[0]].q
        found = cc.singularity_set(
            rpr, "direct", {"q2": axis, "q3": axis}, start, cusps=True, check=False
        )
        cusps += list(found.cusps)
    assert len(cusps) >= 3
    for passage in connected.passages:
        turns = []
        for cusp in cusps:
            way = passage.values - cusp
            angles = np.unwrap(np.arctan2(way[:, 1], way[:, 0]))
            turns.append(round((angles[-1] - angles[0]) / (2.0 * math.pi)))
        assert any(turns), passage.modes


# -- one coordinate --------------------------------------------------------------------------------


def test_a_crank_that_goes_round_joins_nothing_and_meets_nothing() -> None:
    m = four_bar(GRASHOF, 0.3)
    found = cc.postures(m, inputs=[0.3], count=False).connections(m.inputs, limits=False)
    assert found.groups == (("home",), ("+1",))
    assert found.meetings == ()
    assert found.bounded == (True, True)
    assert (found.counts == 1).all()
    assert found.searched.shape == (400,)
    (window,) = found.searched.over.values()
    assert window == pytest.approx((0.3 - math.pi, 0.3 + math.pi))


def test_a_rocking_crank_ends_where_rod_and_rocker_are_in_line(tol: Tolerances) -> None:
    m = four_bar(ROCKING, 0.9)
    found = cc.postures(m, inputs=[0.9], count=False).connections({"crank_joint": (-2.0, 3.0)})
    assert len(found.groups) == 2
    a, b, c, d = ROCKING
    stretched = math.acos((a * a + d * d - (b + c) ** 2) / (2.0 * a * d))
    (meeting,) = found.meetings
    assert set(meeting.modes) == set(found.modes)
    assert meeting.fold
    assert abs(meeting.values[0] - stretched) < tol.algebra
    assert meeting.distance == pytest.approx(stretched - 0.9)
    assert f"{stretched - 0.9:.3g} rad straight from here" in found.text
    assert found.kind == "direct"


def test_joints_that_are_no_inputs_may_vary() -> None:
    m = four_bar(ROCKING, 0.9)
    held = float(m.home[2])
    found = cc.postures(m, fixed={"rocker_joint": held}, count=False).connections("rocker_joint")
    assert found.kind == "fixed joints"
    (meeting,) = found.meetings
    a, b, c, d = ROCKING  # the crank and the rod are in line
    tip = np.array([d + c * math.cos(meeting.values[0]), c * math.sin(meeting.values[0])])
    assert min(abs(np.hypot(*tip) - (a + b)), abs(np.hypot(*tip) - abs(a - b))) < 1e-9


def test_a_five_bar_meets_itself_where_its_rods_are_in_line() -> None:
    m = cc.load("five_bar")
    p = cc.postures(m, inputs=m.input_values(m.home), count=False)
    found = p.connections(m.inputs, resolution=24)
    assert sorted(map(len, found.groups)) == [1, 1]
    (meeting,) = (x for x in found.meetings if len(x.modes) == 2)
    ends = [0.2 * np.array([math.cos(x), math.sin(x)]) for x in meeting.values]
    gap = float(np.hypot(*(ends[0] - ends[1] - [0.3, 0.0])))
    assert min(abs(gap - 0.6), gap) < 1e-9


# -- robots of the catalogue -----------------------------------------------------------------------


def test_working_modes_that_meet_differ_in_one_leg() -> None:
    m = cc.load("linear_delta")
    p = cc.postures(m, pose=m.pose(m.home), count=False)
    found = p.connections({"x": (-0.4, 0.4)})
    assert found.kind == "inverse"
    assert len(found.groups) == 8
    signs = {name: "+++" if name == "home" else name for name in p.names}
    pairs = [meeting.modes for meeting in found.meetings if len(meeting.modes) == 2]
    assert len(pairs) == 4
    for one, two in pairs:
        assert sum(a != b for a, b in zip(signs[one], signs[two], strict=True)) == 1
    for meeting in found.meetings:
        assert "inverse" in cc.classify(m, meeting.q).kinds


def test_near_home_nothing_is_joined() -> None:
    m = cc.load("eclipse")
    p = cc.postures(m, inputs=m.input_values(m.home), count=False)
    found = p.connections({"d_a": (0.24, 0.31), "d_b": (0.24, 0.31)}, resolution=8)
    assert all(len(group) == 1 for group in found.groups)
    assert len(found.groups) == 8
    assert found.passages == ()
    assert "That other groups are apart is what the grid saw" in found.text


# -- what is refused -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("over", "options", "message"),
    [
        ("q2 x", {}, "unknown coordinate 'x'; known: q1, q2, q3; only what the modes have held"),
        ((), {}, "one to three"),
        ("q1 q2 q3 q1", {}, "varies twice"),
        ({"q2": (1.0, 2.0)}, {}, "must hold the value that the modes have, 15.38"),
        ({"q2": (20.0, 2.0)}, {}, "must rise"),
        ({"q2": 3.0}, {}, r"must be \(lowest, highest\), got 3.0"),
        ({"q2": (2.0, math.inf)}, {}, "finite"),
        ("q2", {"resolution": 1}, "q2 must have between 2 and 2000 cells, got 1"),
        ("q2", {"resolution": {"q2": 5000}}, "between 2 and 2000"),
    ],
)
def test_refused(
    modes: cc.Postures, over: object, options: dict[str, object], message: str
) -> None:
    with pytest.raises(cc.ClosureError, match=message):
        modes.connections(over, **options)  # type: ignore[arg-type]


def test_families_have_no_connections() -> None:
    with pytest.raises(cc.ClosureError, match="leaves freedoms"):
        cc.postures(four_bar(GRASHOF, 0.3)).connections("crank_joint")
