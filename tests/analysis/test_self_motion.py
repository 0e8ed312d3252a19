"""Self-motions of planar linkages: loops, ends, branch points, and starts without a curve."""

from __future__ import annotations

import dataclasses

import linkage_text
import linkages
import numpy as np
import pytest
from conftest import Tolerances, assert_close

import closedchain as cc
from closedchain.analysis.motion.self_motion.motion import SelfMotion, self_motion


def five_bar_at(a: float, e: float) -> tuple[cc.Mechanism, np.ndarray]:
    """Five-bar with cranks of 0.2 m and rods of 0.3 m on feet 0.3 m apart, at crank angles."""
    m = linkages.five_bar()
    found = cc.close(m, fixed={"A": a, "E": e})
    assert found.converged, found.message
    return m, found.q


def stretched() -> tuple[cc.Mechanism, np.ndarray]:
    """Five-bar whose tip is the far end of the left rod, with the left leg stretched."""
    m = linkage_text.load(
        "stretched",
        [
            linkage_text.J("A", "base", "left"),
            linkage_text.J("B", "left", "left_rod", "0.2 0 0"),
            linkage_text.J("E", "base", "right", "0.3 0 0"),
            linkage_text.J("D", "right", "right_rod", "0.2 0 0"),
            linkage_text.J("end", "left_rod", "tip", "0.3 0 0", type="fixed"),
        ],
        [linkage_text.Cut("C", "left_rod", "right_rod", "0.3 0 0", "0.3 0 0")],
        inputs={"q1": "A", "q2": "E"},
        home={"A": 2.2, "B": -1.3, "E": 0.9, "D": 1.3},
        tip="tip",
        outputs="x y",
    )
    found = cc.close(m, fixed={"B": 0.0})
    assert found.converged, found.message
    return m, found.q


def holds(s: SelfMotion, q: np.ndarray, tol: Tolerances) -> None:
    """What is true of every self-motion."""
    m, n = s.mechanism, len(s.q)
    start = m.pose(q)
    assert s.residual.max() < tol.closure
    assert s.task_error.max() < tol.closure
    assert_close(cc.residual(m, s.q[n // 2]), np.zeros(m.rows), tol.closure)
    assert_close(s.q[s.start], q, 1e-9)
    assert s.arclength[s.start] == 0.0
    assert (np.diff(s.arclength) > 0.0).all()
    assert_close(s.inputs, s.q[:, m.input_q], 0.0)
    for k in range(0, n, max(n // 8, 1)):
        here = cc.classify(m, s.q[k], s.outputs)
        assert_close(here.sigma_direct, s.sigma_direct[k], tol.algebra)
        assert_close(here.sigma_inverse, s.sigma_inverse[k], tol.algebra)
        assert_close(here.sigma_constraint, s.sigma_constraint[k], tol.algebra)
        there = m.pose(s.q[k])
        for name in s.outputs:
            if name in "xyz":
                i = "xyz".index(name)
                assert abs(there.translation[i] - start.translation[i]) < tol.closure


# -- loops ---------------------------------------------------------------------------------------


def test_double_crank_turns_once_round(tol: Tolerances) -> None:
    """With crank A held, the other loop is a drag link: 0.12 + 0.3 < 0.2 + 0.3 m (Grashof)."""
    m, q = five_bar_at(0.3, 1.0)
    s = self_motion(m, q, "x")
    holds(s, q, tol)
    assert s.closed
    assert [end.how for end in s.ends] == ["closed loop"] * 2
    assert s.turns == {"q2": 1, "B": 1}  # the right rod and the coupler go round with it
    assert not s.singular
    e = s.inputs[:, 1]
    assert (np.diff(e) > 0.0).all()
    assert e[-1] - e[0] < 2.0 * np.pi  # not twice
    assert 2.0 * np.pi - (e[-1] - e[0]) < 0.15
    assert_close(s.inputs[:, 0], np.full(len(e), 0.3), tol.closure)
    # the way back to the first posture counts: twice as fine, the same length
    assert self_motion(m, q, "x", step=0.05).length == pytest.approx(s.length, rel=2e-3)


def test_loop_of_a_double_rocker_is_cut_where_the_rods_align(tol: Tolerances) -> None:
    m = linkages.five_bar()
    whole = self_motion(m, m.home, "x", through=True)
    holds(whole, m.home, tol)
    assert whole.closed
    assert not whole.turns
    assert len(whole.singular) == 2
    middle = self_motion(m, m.home, "x")
    holds(middle, m.home, tol)
    assert not middle.closed
    assert middle.singular == (0, len(middle.q) - 1)
    for end, q in zip(middle.ends, middle.q[[0, -1]], strict=True):
        assert end.how == "singularity"
        assert end.kinds == {"direct"} == cc.classify(m, q, "x").kinds
        left, right = m.pose(q, "left_rod").rotation, m.pose(q, "right_rod").rotation
        assert abs(np.cross(left[:, 0], right[:, 0])[2]) < 1e-9  # the rods are one line
    # the other half of the loop is the other assembly mode: together they are the whole
    other = self_motion(m, whole.q[(whole.start + len(whole.q) // 2) % len(whole.q)], "x")
    assert whole.length == pytest.approx(middle.length + other.length, rel=2e-3)


def test_loop_with_one_mark_opens_at_it(tol: Tolerances) -> None:
    """Cut by hand: the part between neighbouring marks, from one mark back to it if alone."""
    from closedchain.analysis.motion.self_motion.curve import Curve, driven

    points = tuple(np.array([float(i)]) for i in range(10))
    alone = driven(Curve(points, 2, ("closed", "closed"), (5,), (7,)))
    assert [float(p[0]) for p in alone.points] == [7, 8, 9, 0, 1, 2, 3, 4, 5, 6, 7]
    assert (alone.start, alone.crossings, alone.singular) == (5, (8,), (0, 10))
    two = driven(Curve(points, 2, ("closed", "closed"), (5,), (4, 7)))
    assert [float(p[0]) for p in two.points] == [7, 8, 9, 0, 1, 2, 3, 4]
    assert (two.start, two.crossings, two.singular) == (5, (), (0, 7))


def rod_lines(m: cc.Mechanism, q: np.ndarray) -> float:
    """Determinant of the line coordinates of the rods of a 3-RRR."""
    rows = []
    for i in (1, 2, 3):
        at = m.pose(q, f"rod{i}")
        d, p = at.rotation[:2, 0], at.translation
        rows.append([*d, p[0] * d[1] - p[1] * d[0]])
    return float(np.linalg.det(np.array(rows)))


def test_platform_of_a_3rrr_turns_about_its_held_point(tol: Tolerances) -> None:
    """Through singularities the loop is closed; it is passed along once."""
    m = linkages.nearest_home(linkages.three_rrr())
    s = self_motion(m, m.home, "x y", through=True)
    holds(s, m.home, tol)
    assert s.closed
    # the lines of the rods meet in a point at the marked postures and nowhere else
    dets = np.array([rod_lines(m, q) for q in s.q])
    marks = list(s.singular)
    changes = [
        i
        for i in range(len(s.q))
        if i not in marks and (i + 1) % len(s.q) not in marks
        if dets[i] * dets[(i + 1) % len(s.q)] < 0.0
    ]
    assert not changes
    assert len(marks) == 4
    for i in marks:
        assert dets[i - 1] * dets[(i + 1) % len(s.q)] < 0.0
        assert s.sigma_direct[i] < 1e-12
        assert abs(dets[i]) < 1e-12
    short = self_motion(m, m.home, "x y")
    assert short.length < s.length
    assert [end.how for end in short.ends] == ["singularity"] * 2


def test_spin_of_a_rod_is_a_loop(tol: Tolerances) -> None:
    """The rod of an RSSR spins about the line through its ball joints; no input moves.

    Its joint is a floating one, whose quaternion comes back with the other sign.
    """
    m = linkages.nearest_home(linkages.spatial_four_bar(hooke=False))
    with pytest.raises(cc.ClosureError, match=r"direct singularity.*through=True"):
        self_motion(m, m.home, "rx")  # home is where the crank reaches furthest
    s = self_motion(m, m.home, "rx", through=True)
    holds(s, m.home, tol)
    assert s.closed
    assert s.length == pytest.approx(2.0 * np.pi, rel=1e-3)
    assert "inputs that move: none" in s.text
    assert len(s.singular) == len(s.q)
    assert "every posture is a direct singularity" in s.text


def test_eclipse_goes_round_under_its_tool(tol: Tolerances) -> None:
    """By symmetry about the guide's axis: the carriages turn fully, nothing else moves."""
    m = cc.load("eclipse")
    s = self_motion(m, m.home, "x y z rx ry")
    holds(s, m.home, tol)
    assert s.closed
    assert s.turns == {"th_a": 1, "th_b": 1, "th_c": 1}
    assert np.abs(s.inputs[:, 3:] - s.inputs[0, 3:]).max() < 1e-12
    spans = s.inputs[:, :3] - s.inputs[0, :3]
    assert np.abs(spans - spans[:, :1]).max() < 1e-9


def test_mechanism_with_redundant_rows(tol: Tolerances) -> None:
    m = cc.load("rpa3t")  # 16 rows of rank 12
    s = self_motion(m, m.home, "x y")
    holds(s, m.home, tol)
    heights = [m.pose(q).translation[2] for q in s.q]
    assert np.ptp(heights) > 0.1
    for end, q in zip(s.ends, s.q[[0, -1]], strict=True):
        assert end.kinds == cc.classify(m, q, "x y").kinds == {"direct"}


# -- singular throughout, infinitesimal, or nothing -----------------------------------------------


def test_outputs_that_never_move_leave_the_whole_motion(tol: Tolerances) -> None:
    m = linkages.four_bar()
    s = self_motion(m, m.home, "z")
    assert s.closed
    assert s.degenerate
    assert s.turns == {"q1": 1, "B": -1}
    assert s.residual.max() < tol.closure
    # z never changes: nothing is lost on this motion that other postures had
    assert s.sigma_inverse.min() == 1.0
    assert "What it is asked for, z, changes in no posture." in s.text


def test_infinitesimal_motion_is_no_self_motion() -> None:
    m, q = stretched()
    assert cc.redundancy(m, q).dimension == 1
    with pytest.raises(cc.ClosureError, match="null motion is infinitesimal"):
        self_motion(m, q)


def test_task_that_fixes_the_posture() -> None:
    m, _ = stretched()
    with pytest.raises(cc.ClosureError, match=r"x y held nothing can move.*Hold fewer outputs$"):
        self_motion(m, m.home)
    with pytest.raises(cc.ClosureError, match=r"x held and q1 q2 locked.*or lock less"):
        self_motion(m, m.home, "x", lock="q1 q2")
    every = [n for n in m.model.names if n not in ("universe", "end")]
    with pytest.raises(cc.ClosureError, match="nothing can move"):
        self_motion(m, m.home, "x", lock=every)


def test_more_than_one_freedom_asks_for_locks_or_outputs(tol: Tolerances) -> None:
    m = linkages.three_rrr()
    message = r"x held, 2 freedoms remain.*lock 1 of .*q1, q2, q3\) or hold more outputs \(y, z, rx"
    with pytest.raises(cc.ClosureError, match=message):
        self_motion(m, m.home, "x")
    s = self_motion(m, m.home, "x", lock="q2")
    holds(s, m.home, tol)
    assert_close(s.inputs[:, 1], np.full(len(s.q), m.home[m.input_q[1]]), tol.closure)
    assert np.ptp(s.inputs[:, 0]) > 0.1
    value = {"q2": float(m.home[m.input_q[1]])}
    assert_close(self_motion(m, m.home, "x", lock=value).q, s.q, 0.0)


def test_what_is_refused() -> None:
    m = linkages.three_rrr()
    with pytest.raises(cc.ClosureError, match=r"unknown input or joint to lock 'q9'.*q1, q2, q3"):
        self_motion(m, m.home, "x", lock="q9")
    with pytest.raises(cc.ClosureError, match=r"q2 is .* at the start, not 0.1"):
        self_motion(m, m.home, "x", lock={"q2": 0.1})
    with pytest.raises(cc.ClosureError, match="not closed"):
        self_motion(m, m.home + 0.01 * (np.arange(m.model.nq) == m.input_q[0]), "x y")
    with pytest.raises(cc.ClosureError, match="step must be positive"):
        self_motion(m, m.home, "x y", step=0.0)
    with pytest.raises(cc.ClosureError, match="at least 2"):
        self_motion(m, m.home, "x y", most=1)


# -- ends ----------------------------------------------------------------------------------------


def limited(lower: float, upper: float) -> cc.Mechanism:
    """The five-bar with limits of crank E."""
    text = linkage_text.urdf(
        "five_bar",
        [
            linkage_text.J("A", "base", "left"),
            linkage_text.J("B", "left", "left_rod", "0.2 0 0"),
            linkage_text.J("E", "base", "right", "0.3 0 0"),
            linkage_text.J("D", "right", "right_rod", "0.2 0 0"),
        ],
        [linkage_text.Cut("C", "left_rod", "right_rod", "0.3 0 0", "0.3 0 0")],
        inputs={"q1": "A", "q2": "E"},
        home={"A": 0.3, "B": 1.32, "E": 1.0, "D": 1.45},
        tip="left_rod",
        outputs="x y",
    )
    name = '<joint name="E" type="revolute">'
    head, tail = text.split(name)
    tail = tail.replace('lower="-9" upper="9"', f'lower="{lower}" upper="{upper}"', 1)
    return cc.load_urdf(head + name + tail, xacro=False)


def test_ends_at_joint_limits_exactly(tol: Tolerances) -> None:
    m = limited(-0.5, 2.25)
    s = self_motion(m, m.home, "x")
    holds(s, m.home, tol)
    assert not s.closed
    assert [end.how for end in s.ends] == ["joint limit"] * 2
    assert [end.joint for end in s.ends] == ["q2"] * 2
    assert_close(s.inputs[[0, -1], 1], [-0.5, 2.25], tol.closure)
    assert s.ends[0].text == "lower limit -0.5 of q2"
    assert s.ends[1].text == "upper limit 2.25 of q2"


@pytest.mark.parametrize(("lower", "upper"), [(-4.0, 4.0), (-9.0, 2.0), (-2.0, 9.0)])
def test_limits_more_than_a_turn_apart_do_not_hide_a_loop(
    lower: float, upper: float, tol: Tolerances
) -> None:
    """The limits are met one way or both, yet every posture of the loop can be had, once."""
    m = limited(lower, upper)
    s = self_motion(m, m.home, "x")
    holds(s, m.home, tol)
    assert s.closed
    assert abs(s.turns["q2"]) == 1
    e = s.inputs[:, 1]
    assert lower <= e.min() < e.max() <= upper
    assert 2.0 * np.pi - 0.15 < np.ptp(e) < 2.0 * np.pi
    free = self_motion(limited(-9.0, 9.0), m.home, "x")
    assert s.length == pytest.approx(free.length, rel=2e-3)


def test_limits_less_than_a_turn_apart_are_ends() -> None:
    s = self_motion(limited(-3.0, 3.0), limited(-3.0, 3.0).home, "x")
    assert not s.closed
    assert_close(np.sort(s.inputs[[0, -1], 1]), [-3.0, 3.0], 1e-12)


def test_start_beyond_a_limit_is_refused() -> None:
    m = limited(-0.5, 2.25)
    q = cc.close(limited(-9.0, 9.0), m.home, fixed={"A": 0.3, "E": 2.5}).q
    with pytest.raises(cc.ClosureError, match="beyond the limits of E"):
        self_motion(m, q, "x")


def test_ends_after_as_many_postures_as_allowed() -> None:
    m, q = five_bar_at(0.3, 1.0)
    s = self_motion(m, q, "x", most=5)
    assert len(s.q) == 9
    assert s.start == 4
    assert [end.how for end in s.ends] == ["longest"] * 2


def test_branch_point_is_noted_and_passed(tol: Tolerances) -> None:
    """A parallelogram, once flat, may go on as an antiparallelogram."""
    m = linkage_text.load(
        "parallelogram",
        [
            linkage_text.J("A", "base", "left"),
            linkage_text.J("B", "left", "bar", "0.4 0 0"),
            linkage_text.J("D", "base", "right", "0.1 0 0"),
        ],
        [linkage_text.Cut("C", "bar", "right", "0.1 0 0", "0.4 0 0")],
        inputs={"q1": "A"},
        home={"A": 1.0, "B": -1.0, "D": 1.0},
        tip="bar",
        outputs="z",
    )
    s = self_motion(m, m.home, through=True)
    assert s.closed
    assert len(s.branch_points) == 2
    flat = np.sort(np.mod(s.q[list(s.branch_points), 0], np.pi))
    assert_close(np.sin(flat), [0.0, 0.0], 1e-5)
    assert_close(np.sin(s.q[:, 0] - s.q[:, 2]), np.zeros(len(s.q)), 1e-9)  # stays a parallelogram
    assert s.sigma_constraint[list(s.branch_points)].max() < 1e-5
    assert s.residual.max() < tol.closure
    with pytest.raises(cc.ClosureError, match="branch point: 2 null motions"):
        self_motion(m, cc.close(m, fixed={"A": 0.0, "D": 0.0}).q)


# -- the result ----------------------------------------------------------------------------------


def test_result_is_frozen_and_exports() -> None:
    m, q = five_bar_at(0.3, 1.0)
    s = self_motion(m, q, "x")
    with pytest.raises(dataclasses.FrozenInstanceError):
        s.closed = False  # type: ignore[misc]
    with pytest.raises(ValueError, match="read-only"):
        s.q[0] = 0.0
    found = s.to_dataset()
    assert dict(found.sizes) == {"posture": len(s.q), "configuration": 4, "input": 2}
    assert_close(found["inputs"].sel(input="q2"), s.inputs[:, 1], 0.0)
    for name in ("q", "sigma_direct", "sigma_inverse", "sigma_constraint", "condition"):
        assert_close(found[name], getattr(s, name), 0.0)
    for name in ("residual", "task_error", "arclength"):
        assert_close(found[name], getattr(s, name), 0.0)
    assert found.attrs["closed"] == 1
    assert found.attrs["outputs"] == "x"
    assert "a loop of" in s.text
    assert "whole turns: B +1, q2 +1" in s.text


def test_curve_does_not_depend_on_the_start() -> None:
    m = linkages.five_bar()
    one = self_motion(m, m.home, "x")
    two = self_motion(m, one.q[-10], "x")
    assert one.length == pytest.approx(two.length, rel=2e-3)
    assert_close(one.q[[0, -1]], two.q[[0, -1]], 1e-9)
