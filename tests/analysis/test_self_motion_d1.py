"""D1's self-motion: the coupler's slide under a vertical tool, and what differs elsewhere."""

from __future__ import annotations

from functools import cache

import numpy as np
import pinocchio as pin
import pytest
from conftest import Tolerances, assert_close

import closedchain as cc
from closedchain.analysis.motion.self_motion.motion import SelfMotion, self_motion
from closedchain.closure.charting import chart_of, straight
from closedchain.closure.solve.continuation import follow
from closedchain.closure.solve.newton import correct
from closedchain.robots.d1 import (
    Pose,
    geometry,
    inverse,
    leg_lengths,
    scaled_screws,
    tasks,
    vertical_tool,
    vertical_tool_quaternions,
)
from closedchain.robots.d1.geometry import quaternion_from_rotation

G = geometry()
AXIS_TASK = "x y z rx rz"
TIPS = ((0.0, -1.0, 0.0), (0.03, -1.0, 0.02), (-0.02, -1.05, 0.04))
TILTED = ((0.01, -0.02, 0.015, 0.03, -0.02, 0.01), (-0.02, 0.01, 0.02, 0.01, 0.03, -0.02))


@cache
def upright(d1: cc.Mechanism, tip: tuple[float, ...], *, through: bool = False) -> SelfMotion:
    lengths = vertical_tool(np.array([tip]), G).inputs[0]
    q = cc.direct(d1, lengths).raise_if_failed().q
    return self_motion(d1, q, AXIS_TASK, through=through)


@cache
def tilted(d1: cc.Mechanism, lengths: tuple[float, ...]) -> SelfMotion:
    q = cc.direct(d1, d1.input_values(d1.home) + np.array(lengths)).raise_if_failed().q
    return self_motion(d1, q, AXIS_TASK)


def posed(m: cc.Mechanism, q: np.ndarray) -> tuple[Pose, Pose]:
    coupler, platform = (m.pose(q, name) for name in ("coupler", "platform"))
    return (
        Pose(coupler.rotation, coupler.translation),
        Pose(platform.rotation, platform.translation),
    )


def least_of_stages(m: cc.Mechanism, q: np.ndarray) -> list[float]:
    """Smallest singular values of J1, J2, J3: first stage, second stage, coupler."""
    return [float(np.linalg.svd(j, compute_uv=False)[-1]) for j in scaled_screws(*posed(m, q), G)]


# -- tool vertical -------------------------------------------------------------------------------


@pytest.mark.parametrize("tip", TIPS)
def test_vertical_tool_slides_the_coupler_alone(
    d1: cc.Mechanism, tip: tuple[float, ...], tol: Tolerances
) -> None:
    s = upright(d1, tip)
    assert s.residual.max() < tol.closure
    assert s.task_error.max() < tol.closure
    outer = s.inputs[:, 3:]
    assert np.abs(outer - outer[s.start]).max() < 1e-12
    assert np.ptp(s.inputs[:, :3], axis=0).min() > 0.4
    for q in s.q:
        assert_close(d1.point(q, "T"), tip, 1e-12)
        assert_close(d1.pose(q, "platform").rotation, np.eye(3), 1e-12)  # torsion too
    assert not s.degenerate


@pytest.mark.parametrize("tip", TIPS)
def test_slide_is_the_closed_form(d1: cc.Mechanism, tip: tuple[float, ...]) -> None:
    """Every posture is among the members that the elimination finds at the coupler's height."""
    s = upright(d1, tip)
    centre = np.array(tip) - G.tip_C
    for q in s.q[:: len(s.q) // 20]:
        coupler, platform = posed(d1, q)
        family = vertical_tool_quaternions(
            centre, float(coupler.position[1]), G.radius_S, G.radius_S4
        )
        mine = quaternion_from_rotation(coupler.rotation)
        gaps = [min(np.abs(mine - w).max(), np.abs(mine + w).max()) for w in family]
        assert min(gaps) < 1e-9
        assert_close(leg_lengths(coupler, platform, G), d1.input_values(q), 1e-10)


def test_slide_from_home_by_hand(d1: cc.Mechanism, tol: Tolerances) -> None:
    """The coupler stays level: q1 = q2 = q3 = hypot(0.15, y)."""
    s = upright(d1, TIPS[0])
    heights = np.array([d1.point(q, "coupler")[1] for q in s.q])
    expected = np.hypot(0.15, heights)[:, None] * np.ones(3)
    assert_close(s.inputs[:, :3], expected, 1e-11)
    regular = np.delete(np.arange(len(s.q)), s.branch_points)  # those are known less exactly
    assert_close(s.inputs[regular, :3], expected[regular], tol.closure)
    assert_close(s.inputs[s.start], d1.input_values(d1.home), 1e-9)
    assert s.inputs[-1, 0] > s.inputs[0, 0]  # ahead is where the leading input grows


def test_slide_from_home_ends_flat_and_at_a_limit(d1: cc.Mechanism, tol: Tolerances) -> None:
    s = upright(d1, TIPS[0])
    assert not s.closed
    flat, longest = s.ends
    assert (flat.how, flat.kinds) == ("singularity", {"direct"})
    assert cc.classify(d1, s.q[0], AXIS_TASK).kinds == {"direct"}
    assert abs(d1.point(s.q[0], "coupler")[1]) < tol.reference  # S1..S3 in the plane of R1..R3
    assert_close(s.inputs[0, :3], [0.15] * 3, tol.closure)
    j1, j2, _ = scaled_screws(*posed(d1, s.q[0]), G)
    values = np.linalg.svd(j1, compute_uv=False)
    assert values[2] > 0.1  # rank 3: three twists at once
    assert values[3:].max() < tol.singular
    assert np.linalg.svd(j2, compute_uv=False)[-1] > 0.1
    assert (longest.how, longest.joint) == ("joint limit", "q1")  # q2 and q3 with it
    assert_close(s.inputs[-1, :3], [1.5] * 3, tol.closure)
    assert not cc.classify(d1, s.q[-1], AXIS_TASK).kinds


def test_slide_passes_a_branch_point_where_the_passive_legs_lie_flat(d1: cc.Mechanism) -> None:
    s = upright(d1, TIPS[0])
    (i,) = s.branch_points
    q = s.q[i]
    assert_close(d1.point(q, "coupler"), [0.0, -0.75, 0.0], 1e-6)
    # exactly there; the point above is as near as the tracer finds it
    lengths = np.append([np.hypot(0.15, 0.75)] * 3, s.inputs[0, 3:])
    exact = cc.direct(d1, lengths, guess=q).raise_if_failed().q
    assert cc.redundancy(d1, exact, AXIS_TASK).dimension == 3
    assert s.sigma_inverse[i] < 1e-6
    assert s.arclength[i] > 0.0
    with pytest.raises(cc.ClosureError, match="branch point: 3 null motions"):
        self_motion(d1, exact, AXIS_TASK)


@pytest.mark.parametrize("tip", TIPS[1:])
def test_slides_off_the_axis_end_where_the_first_stage_is_singular(
    d1: cc.Mechanism, tip: tuple[float, ...], tol: Tolerances
) -> None:
    s = upright(d1, tip)
    for end, q in zip(s.ends, s.q[[0, -1]], strict=True):
        assert end.how == "singularity"
        assert end.kinds == cc.classify(d1, q, AXIS_TASK).kinds == {"direct"}
        first, second, coupler = least_of_stages(d1, q)
        assert first < tol.singular < 0.4 < second
        assert coupler < tol.singular  # as under every vertical tool
    assert not s.branch_points
    tilts = [np.degrees(tasks.tilt(posed(d1, q)[0])) for q in s.q]
    assert tilts[-1] > 60.0  # the coupler leans as it comes down on the platform


def test_through_singularities_the_slide_goes_above_the_base(d1: cc.Mechanism) -> None:
    s, part = upright(d1, TIPS[0], through=True), upright(d1, TIPS[0])
    assert s.length > part.length
    assert [end.joint for end in s.ends] == ["passive1_P", "q1"]
    (flat,) = s.singular
    heights = np.array([d1.point(q, "coupler")[1] for q in s.q])
    assert abs(heights[flat]) < 1e-9
    assert (np.diff(heights) < 0.0).all()
    assert heights[0] > 0.5
    assert np.abs(s.inputs[:, 3:] - s.inputs[0, 3:]).max() < 1e-12


def test_with_all_six_outputs_the_slide_is_singular_throughout(
    d1: cc.Mechanism, tol: Tolerances
) -> None:
    """Home is an inverse singularity whose null motion is finite: the same curve."""
    s, other = self_motion(d1, d1.home), upright(d1, TIPS[0])
    assert s.degenerate
    assert s.sigma_inverse.max() < tol.singular
    assert s.residual.max() < tol.closure
    assert s.task_error.max() < tol.closure
    assert s.ends[0].kinds == {"direct", "inverse"} == cc.classify(d1, s.q[0]).kinds
    assert_close(s.inputs[[0, -1]], other.inputs[[0, -1]], tol.reference)
    assert s.length == pytest.approx(other.length, rel=2e-3)


def test_a_regular_pose_of_six_outputs_has_no_self_motion(d1: cc.Mechanism) -> None:
    with pytest.raises(cc.ClosureError, match="nothing can move, the task fixes the posture"):
        self_motion(d1, tilted(d1, TILTED[0]).q[3])


def test_locks(d1: cc.Mechanism) -> None:
    """A lock of q1 ends the slide; one of q4 does nothing to it: it must not be locked."""
    with pytest.raises(cc.ClosureError, match="x y z rx rz held and q3 locked nothing can move"):
        self_motion(d1, d1.home, AXIS_TASK, lock="q3")
    s = self_motion(d1, d1.home, AXIS_TASK, lock={"q4": float(d1.home[d1.input_q[3]])})
    assert s.degenerate
    assert s.length == pytest.approx(upright(d1, TIPS[0]).length, rel=2e-3)
    with pytest.raises(cc.ClosureError, match=r"3 freedoms remain: no curve. lock 2 of the inputs"):
        self_motion(d1, tilted(d1, TILTED[0]).q[3], "x y z")


def test_tip_held_and_two_inputs_locked_is_a_loop(d1: cc.Mechanism, tol: Tolerances) -> None:
    q = tilted(d1, TILTED[0]).q[tilted(d1, TILTED[0]).start]
    s = self_motion(d1, q, "x y z", lock="q1 q4")
    assert s.closed
    assert not s.singular
    assert not s.turns
    assert s.residual.max() < tol.closure
    for k in range(0, len(s.q), 8):
        assert_close(d1.point(s.q[k], "T"), d1.point(q, "T"), tol.closure)
        assert_close(s.inputs[k, [0, 3]], d1.input_values(q)[[0, 3]], tol.closure)
        found = cc.direct(d1, s.inputs[k], guess=s.q[k - 1]).raise_if_failed().q
        assert_close(pin.difference(d1.model, found, s.q[k]), np.zeros(33), tol.reference)
    gaps = [np.linalg.norm(s.inputs[k] - s.inputs[0]) for k in range(3, len(s.q) - 3)]
    assert min(gaps) > 1e-3  # once round


# -- tool not vertical ---------------------------------------------------------------------------


@pytest.mark.parametrize("lengths", TILTED)
def test_tilted_tool_needs_all_six_legs(
    d1: cc.Mechanism, lengths: tuple[float, ...], tol: Tolerances
) -> None:
    s = tilted(d1, lengths)
    assert s.residual.max() < tol.closure
    assert s.task_error.max() < tol.closure
    assert np.ptp(s.inputs[:, 3:], axis=0).max() > 1e-3
    tip, axis = d1.point(s.q[0], "T"), d1.pose(s.q[0]).rotation[:, 1]
    for q in s.q:
        assert_close(d1.point(q, "T"), tip, tol.closure)
        assert_close(d1.pose(q).rotation[:, 1], axis, tol.closure)
    turned = pin.log3(d1.pose(s.q[0]).rotation.T @ d1.pose(s.q[-1]).rotation)
    assert abs(turned[1]) > 1e-3  # the tool spins about its own axis meanwhile
    for end, q in zip(s.ends, s.q[[0, -1]], strict=True):
        assert end.kinds == cc.classify(d1, q, AXIS_TASK).kinds == {"direct"}
        first, second, coupler = least_of_stages(d1, q)
        assert first < tol.singular < 0.3 < second
        assert coupler > 1e-4


@pytest.mark.parametrize("lengths", TILTED)
def test_tilted_tool_by_the_closed_form(d1: cc.Mechanism, lengths: tuple[float, ...]) -> None:
    """The platform's pose of every posture, put into the inverse problem by elimination."""
    s = tilted(d1, lengths)
    for q in s.q[:: len(s.q) // 12]:
        _, platform = posed(d1, q)
        found = inverse(platform, G).assemblies
        assert min(np.abs(a.q - d1.input_values(q)).max() for a in found) < 1e-9


@pytest.mark.parametrize("lengths", TILTED)
def test_tilted_tool_by_inverse_solutions_with_a_leg_prescribed(
    d1: cc.Mechanism, lengths: tuple[float, ...], tol: Tolerances
) -> None:
    """Newton's method in the other unknowns for every q1 on the curve while q1 grows."""
    s = tilted(d1, lengths)
    at = d1.point(s.q[s.start], "T")[0]
    chart = chart_of(d1, ["q1"], at={"x": at}, outputs=AXIS_TASK, start=s.q[s.start])
    begin = chart.values(s.q[s.start])
    checked = 0
    here = correct(chart.equations(begin), s.q[s.start])
    assert here.refusal is None
    for k in range(s.start + 1, len(s.q)):
        if s.inputs[k, 0] <= s.inputs[k - 1, 0]:
            break
        goal = np.array([s.inputs[k, 0]])
        found = follow(straight(chart, begin, goal), here)
        if found.refusal is not None:
            break
        here, begin = found.last, goal
        gap = pin.difference(d1.model, here.q, s.q[k])
        assert np.abs(gap).max() < tol.reference
        checked += 1
    assert checked > 5


def test_inputs_along_the_curve_drive_there(d1: cc.Mechanism, tol: Tolerances) -> None:
    """The direct problem from posture to posture: no singularity in between."""
    s = tilted(d1, TILTED[0])
    for one, two in zip(s.q[1:-2], s.q[2:-1], strict=True):
        found = cc.direct(d1, d1.input_values(two), guess=one).raise_if_failed().q
        assert_close(pin.difference(d1.model, found, two), np.zeros(33), tol.reference)


def test_determinants_change_sign_at_the_marks_only(d1: cc.Mechanism) -> None:
    q = tilted(d1, TILTED[0]).q[5]
    s = self_motion(d1, q, AXIS_TASK, through=True)
    dets = np.array([cc.classify(d1, q, AXIS_TASK).det_direct for q in s.q])
    marks = set(s.singular)
    assert len(marks) >= 3
    for i in range(1, len(s.q)):
        if not {i - 1, i} & marks:
            assert dets[i - 1] * dets[i] > 0.0
    for i in marks:
        assert s.sigma_direct[i] < 1e-10
        assert "direct" in cc.classify(d1, s.q[i], AXIS_TASK).kinds
    inner = [i for i in marks if not {i - 1, i + 1} & marks]
    assert inner
    assert all(dets[i - 1] * dets[i + 1] < 0.0 for i in inner)


def test_text_of_the_slide(d1: cc.Mechanism) -> None:
    text = upright(d1, TIPS[0]).text
    assert "d1: self-motion with outputs x y z rx rz held: a curve of" in text
    assert "inputs that move: q1 0.15 to 1.5 m, q2 0.15 to 1.5 m, q3 0.15 to 1.5 m\n" in text
    assert "behind the start it ends after 7.25" in text
    assert ": direct singularity" in text
    assert "upper limit 1.5 of q1" in text
