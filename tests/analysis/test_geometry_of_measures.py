"""Measures are geometry: not of the cut, the order, the names or the robot's place in the world."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import linkage_text
import linkages
import numpy as np
import pinocchio as pin
import pytest
from conftest import assert_close
from recut import Recut, every_cut, recut

import closedchain as cc
from closedchain.analysis.singularity.maps.measures import measures_at
from closedchain.closure.generic import generic_ranks
from closedchain.closure.joint_rates import physical_rates
from closedchain.closure.loading import mechanism_from_description
from closedchain.closure.solve.samples import closed_samples
from closedchain.urdf import description as written

SAME = 1e-9
POSTURES = 3

SMALL: dict[str, Callable[[], cc.Mechanism]] = {
    "four-bar": linkages.four_bar,
    "five-bar": linkages.five_bar,
    "coupled five-bar": lambda: linkages.five_bar(coupled=True),
    "six-bar": lambda: linkages.six_bar("D"),
    "3-RRR": linkages.three_rrr,
    "RUSR": lambda: linkages.spatial_four_bar(hooke=True),
    "RSSR": lambda: linkages.spatial_four_bar(hooke=False),
    "parallelogram": linkages.parallelogram,
    "arm with parallelogram": linkages.arm_with_parallelogram,
    "wedges": linkages.wedges,
    "Bennett": linkages.bennett,
}


def assert_same(new: Recut, postures: list[np.ndarray]) -> None:
    """Mobility, kinds, types, singular values and condition are those of the original."""
    assert cc.mobility(new.new).mobility == cc.mobility(new.old).mobility
    assert new.new.length == pytest.approx(new.old.length, rel=SAME)
    for q in postures:
        there = new.posture(q)
        assert np.abs(cc.residual(new.new, there)).max() < 1e-10
        one, two = cc.classify(new.old, q), cc.classify(new.new, there)
        assert two.kinds == one.kinds, (one.text, two.text)
        assert two.types == one.types
        assert two.free_twists.shape == one.free_twists.shape
        assert_close(two.sigma_direct, one.sigma_direct, SAME, "direct")
        assert_close(two.sigma_inverse, one.sigma_inverse, SAME, "inverse")
        assert_close(_flatness(new.new, there), _flatness(new.old, q), SAME, "condition")


def posture(m: cc.Mechanism, **values: float) -> np.ndarray:
    """Posture with these joints of one freedom at these values, the others at home."""
    q = np.array(m.home)
    for name, value in values.items():
        q[m.model.joints[m.model.getJointId(name)].idx_q] = value
    return q


def _flatness(m: cc.Mechanism, q: np.ndarray) -> float:
    """1 / condition: finite at singularities too."""
    return 1.0 / float(measures_at(m, q[None], m.outputs())["condition"][0])


# -- cuts ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", SMALL)
def test_no_cut_changes_anything(name: str) -> None:
    m = SMALL[name]()
    postures = closed_samples(m)[:POSTURES]
    for seed, cut in enumerate(every_cut(m)):
        assert_same(recut(m, cut, seed), list(postures))


@pytest.mark.slow
def test_no_cut_of_a_stewart_platform_changes_anything() -> None:
    m = cc.load("gough_stewart", home="0.03 -0.02 0.5 0.05 -0.1 0.08 1")
    postures = closed_samples(m)[:2]
    for seed, cut in enumerate([*every_cut(m)][::5]):
        assert_same(recut(m, cut, seed), list(postures))


@pytest.mark.slow
@pytest.mark.parametrize("robot", cc.robots("papers"))
def test_no_cut_of_a_robot_changes_anything(robot: str) -> None:
    m = cc.load(robot)
    postures = closed_samples(m)[:POSTURES]
    cuts = [*every_cut(m)][:-1]
    for seed, cut in enumerate(cuts[:: max(1, len(cuts) // 3)]):
        assert_same(recut(m, cut, seed), list(postures))


def test_the_recut_mechanism_is_another_one() -> None:
    """Else the tests above would say nothing: K differs in size and in singular values."""
    m = linkages.five_bar()
    scales = set()
    for cut in (("B",), ("C",), ("B", "C", "D")):
        new = recut(m, cut)
        assert {c.name for c in new.new.closures} >= set(cut)
        scales.add(round(cc.classify(new.new, new.new.home).sigma_constraint, 6))
    assert len(scales) > 1


def test_at_singular_postures_too() -> None:
    """Flat parallelogram; D1's home is among the postures of the robots above."""
    m = linkages.parallelogram()
    flat = posture(m, A=np.pi / 2, B=-np.pi / 2, D=np.pi / 2)
    for seed, cut in enumerate(every_cut(m)):
        assert_same(recut(m, cut, seed), [flat])


# -- order, names, place -------------------------------------------------------------------------


@pytest.mark.parametrize("robot", ["linear_delta", "eclipse"])
def test_order_and_names_of_joints_and_closures_change_nothing(robot: str) -> None:
    m = cc.load(robot)
    postures = list(closed_samples(m)[:2])
    names = {c.name for c in m.closures}
    for seed in range(3):
        new = recut(m, (), seed, prefix=f"n{seed}_")
        assert not names & {c.name for c in new.new.closures}
        assert_same(new, postures)


def test_turning_the_robot_in_the_world_changes_nothing() -> None:
    turn = pin.SE3(pin.rpy.rpyToMatrix(0.7, -1.1, 2.0), np.array([0.3, -0.2, 0.5]))
    for m in (cc.load("eclipse"), cc.load("linear_delta"), linkages.spatial_four_bar(True)):
        assert_same(recut(m, (), 0, turn=turn), list(closed_samples(m)[:2]))


def test_repeated_closures_change_nothing() -> None:
    m = linkages.five_bar()
    once = m.description
    (cut,) = once.closures
    twice = mechanism_from_description(replace(once, closures=(cut, replace(cut, name="again"))))
    # the joint is there twice, so it counts twice in the norm: only its rows are redundant
    welded = mechanism_from_description(replace(once, closures=(cut, _weld(m))))
    assert twice.rows == 2 * m.rows
    assert welded.rows == m.rows + 6
    for q in closed_samples(m)[:POSTURES]:
        one, two = cc.classify(m, q), cc.classify(welded, q)
        assert_close(two.sigma_direct, one.sigma_direct, SAME)
        assert_close(two.sigma_inverse, one.sigma_inverse, SAME)
        assert two.kinds == one.kinds == cc.classify(twice, q).kinds


def _weld(m: cc.Mechanism) -> written.LoopClosure:
    """A joint that welds a link to itself: six rows that always hold, and no rate."""
    link = m.description.joints[0].child
    return written.LoopClosure("weld", "fixed", link, link)


def test_symmetric_poses_of_a_linear_delta_agree() -> None:
    m = cc.load("linear_delta")
    step = np.array([0.05, -0.02, 0.01])
    found = [
        cc.classify(m, cc.direct(m, m.home[m.input_q] + np.roll(turned, k)).raise_if_failed().q)
        for k in range(3)
        for turned in (step, step[[1, 0, 2]])
    ]
    for one in found[1:]:
        assert_close(one.sigma_direct, found[0].sigma_direct, SAME)
        assert_close(one.sigma_inverse, found[0].sigma_inverse, SAME)
    scales = [one.sigma_constraint for one in found]
    assert max(scales) > 1.2 * min(scales)  # it knows which rod of each pair was cut


# -- the norm ------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", SMALL)
def test_no_closed_motion_is_invisible(name: str) -> None:
    m = SMALL[name]()
    at = physical_rates(m, m.home)
    motions = np.linalg.svd(cc.constraint_jacobian(m, m.home) * m.column_scale)[2][
        generic_ranks(m, m.outputs()).motions * -1 :
    ].T
    assert np.linalg.svd(at @ motions, compute_uv=False)[-1] > 0.1


def test_a_rod_is_what_remains_of_a_body_between_two_balls() -> None:
    """A cut of kind ``distance`` and a rod of its own between two ball joints: the same numbers."""
    body = linkages.spatial_four_bar(hooke=False)
    d = replace(body.description, task=replace(body.description.task, length=0.3))
    body = mechanism_from_description(d)
    one, two = d.closures
    rod = written.LoopClosure(
        "rod", "distance", one.parent, two.child, one.parent_origin, two.child_origin,
        sizes=(("length", 0.4),),
    )  # fmt: skip
    bare = mechanism_from_description(
        replace(
            d,
            links=tuple(link for link in d.links if link.name != "rod"),
            joints=tuple(j for j in d.joints if j.name != "rod_pose"),
            closures=(rod,),
            home={name: values for name, values in d.home.items() if name != "rod_pose"},
        )
    )
    assert cc.mobility(body).idle == 1
    assert cc.mobility(bare).idle == 0
    for q in closed_samples(body)[:POSTURES]:
        values = [
            q[body.model.joints[body.model.getJointId(n)].idx_q] for n in list(bare.model.names)[1:]
        ]
        have, same = cc.classify(body, q), cc.classify(bare, values)
        assert_close(same.sigma_direct, have.sigma_direct, SAME)
        assert_close(same.sigma_inverse, have.sigma_inverse, SAME)
        assert same.kinds == have.kinds


def test_a_floating_body_counts_only_where_nothing_else_sees_it() -> None:
    platform = linkages.three_rrr()
    assert physical_rates(platform, platform.home).shape == (6 + 3 * 3, platform.model.nv)
    free = linkage_text.load(
        "free", [linkage_text.J("pose", "base", "body", type="floating")], tip="body"
    )
    assert_close(physical_rates(free, free.home), np.eye(6), 0.0)


def test_values_by_hand() -> None:
    """A parallelogram turns in all four joints alike, a slider along with its one motion."""
    m = linkages.parallelogram()
    assert cc.classify(m, m.home).sigma_direct == pytest.approx(0.5, abs=SAME)
    slides = linkages.gantry()
    found = cc.classify(slides, slides.home)
    assert (found.sigma_direct, found.sigma_inverse) == pytest.approx((1.0, 1.0), abs=SAME)
