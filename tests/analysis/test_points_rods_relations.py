"""Balls in slots and on planes, rods, and relations of joint values: against values by hand."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pinocchio as pin
import point_linkages as linkages
import pytest
from conftest import Tolerances, assert_close

import closedchain as cc
from closedchain.analysis.screws.accelerators import from_spatial


def solved(m: cc.Mechanism, *inputs: float) -> np.ndarray:
    return cc.direct(m, inputs).raise_if_failed().q


ALL = "x y z rx ry rz"


def rates(m: cc.Mechanism, q: np.ndarray, outputs: str | None = None) -> np.ndarray:
    """Rates of the outputs per input rate."""
    found = cc.velocity(m, q, outputs).twist_map
    assert found is not None
    return found


def counts(m: cc.Mechanism) -> tuple[int, int, int, dict[str, int]]:
    """Mobility, Gruebler's count, redundant rows, pairs by symbol."""
    found = cc.mobility(m)
    return found.mobility, found.gruebler, found.redundant_rows, found.pair_counts


# -- a ball in a slot --------------------------------------------------------------------------


@pytest.fixture(scope="module")
def slider_crank() -> cc.Mechanism:
    return linkages.slider_crank()


def test_slider_crank_counts(slider_crank: cc.Mechanism) -> None:
    """Planar: one of the slot's two rows is redundant, which Gruebler does not know."""
    assert counts(slider_crank) == (1, 0, 1, {"R": 2, "PS": 1})


@pytest.mark.parametrize("angle", [0.2, 0.7, 1.5, 2.9, -2.0])
def test_slider_crank_moves_as_by_hand(
    slider_crank: cc.Mechanism, angle: float, tol: Tolerances
) -> None:
    r, rod = 0.2, 0.5
    q = solved(slider_crank, angle)
    s, c = r * math.sin(angle), r * math.cos(angle)
    along = math.sqrt(rod**2 - s**2)
    assert_close(slider_crank.point(q, "P"), [c + along, 0.0, 0.0], tol.reference)
    assert_close(rates(slider_crank, q), [[-s - s * c / along]], tol.algebra)
    assert cc.classify(slider_crank, q).kinds == frozenset()
    second = cc.acceleration(slider_crank, q, [1.0], [0.0]).tip_acceleration[0]
    expected = -c - (c**2 - s**2) / along - (s * c) ** 2 / along**3
    assert second == pytest.approx(expected, abs=1e-9)


def test_slider_crank_is_singular_where_the_links_are_in_line() -> None:
    """In line with the slot P stands still; across it a locked crank lets P go."""
    m = linkages.slider_crank()
    assert cc.classify(m, solved(m, 0.0)).kinds == {"inverse"}
    long_crank = linkages.slider_crank(crank=0.3, rod=0.25)
    across = np.array([math.asin(0.25 / 0.3), 0.0])
    across[1] = -math.pi / 2.0 - across[0]
    assert np.abs(cc.residual(long_crank, across)).max() < 1e-15
    assert cc.classify(long_crank, across).kinds == {"direct"}


# -- rods --------------------------------------------------------------------------------------


def rocker(angle: float) -> tuple[float, float, float]:
    """Angle and rate ratio of the rocker of the planar rod four-bar, and d |C - O| / d crank."""
    tip = 0.15 * np.array([math.cos(angle), math.sin(angle)])
    from_d = tip - [0.4, 0.0]
    reach = float(np.linalg.norm(from_d))
    # triangle of rocker 0.3, reach and rod 0.35 at the pivot D
    inside = math.acos((0.3**2 + reach**2 - 0.35**2) / (2.0 * 0.3 * reach))
    theta = math.atan2(from_d[1], from_d[0]) - inside
    end = np.array([0.4, 0.0]) + 0.3 * np.array([math.cos(theta), math.sin(theta)])
    rod = end - tip
    turned = np.array([-1.0, 1.0])
    crank_rate = tip[::-1] * turned
    rocker_rate = (end - [0.4, 0.0])[::-1] * turned
    return theta, float(rod @ crank_rate / (rod @ rocker_rate)), float(np.linalg.norm(end))


@pytest.mark.parametrize("angle", [1.1, 0.3, 2.5, -0.8])
def test_planar_rod_four_bar_is_the_triangle_by_hand(angle: float, tol: Tolerances) -> None:
    m = linkages.rod_four_bar()
    assert counts(m) == (1, 1, 0, {"R": 2, "SS": 1})
    theta, ratio, _ = rocker(angle)
    q = solved(m, angle)
    assert math.remainder(q[1] - theta, 2.0 * math.pi) == pytest.approx(0.0, abs=tol.reference)
    assert_close(rates(m, q), [[ratio]], tol.algebra)
    assert cc.classify(m, q).kinds == frozenset()


def test_planar_rod_four_bar_is_singular_at_its_dead_points(tol: Tolerances) -> None:
    """Crank and rod in line: 0.15 + 0.35 from O to C. The crank then moves nothing."""
    inside = math.acos((0.4**2 + 0.3**2 - 0.5**2) / (2.0 * 0.4 * 0.3))
    theta = math.pi - inside
    end = np.array([0.4 + 0.3 * math.cos(theta), 0.3 * math.sin(theta)])
    dead = np.array([math.atan2(end[1], end[0]), theta])
    driven, driving = linkages.rod_four_bar("A"), linkages.rod_four_bar("D")
    assert np.abs(cc.residual(driven, dead)).max() < 1e-15
    assert_close(rates(driven, dead, ALL), np.zeros((6, 1)), tol.algebra)
    assert cc.classify(driven, dead).kinds == {"inverse"}
    assert cc.classify(driving, dead).kinds == {"direct"}


def test_spatial_rod_four_bar(tol: Tolerances) -> None:
    """|C - B| = 0.6 between circles about z and about x, solved by hand for the rocker."""
    m = linkages.spatial_rod_four_bar()
    assert counts(m) == (1, 1, 0, {"R": 2, "SS": 1})
    for angle in (1.3, 1.5, 1.9):
        theta = solved(m, angle)[1]
        x, y = 0.15 * math.cos(angle), 0.15 * math.sin(angle)
        # (0.5 - x)^2 + (0.3 cos t - y)^2 + (0.3 sin t)^2 = 0.36
        cosine = ((0.5 - x) ** 2 + 0.09 + y**2 - 0.36) / (0.6 * y)
        assert abs(theta) == pytest.approx(math.acos(cosine), abs=tol.reference)
    q = m.home
    angle, theta = q
    x, y = 0.15 * math.cos(angle), 0.15 * math.sin(angle)
    # d/dt of the equation: crank's share over the rocker's
    crank = (0.5 - x) * y - (0.3 * math.cos(theta) - y) * x
    assert_close(rates(m, q), [[-crank / (0.3 * math.sin(theta) * y)]], tol.algebra)


@pytest.fixture(scope="module")
def delta() -> cc.Mechanism:
    return linkages.rod_delta(real=False)


def test_rod_delta_counts(delta: cc.Mechanism) -> None:
    assert counts(delta) == (3, 3, 0, {"P": 3, "SS": 6})


@pytest.mark.parametrize("heights", [(0.0, 0.0, 0.0), (0.1, 0.1, 0.1), (0.15, -0.05, 0.02)])
def test_rod_delta_is_three_spheres(
    delta: cc.Mechanism, heights: tuple[float, float, float], tol: Tolerances
) -> None:
    q = solved(delta, *heights)
    pose = delta.pose(q)
    assert_close(pose.rotation, np.eye(3), tol.reference)
    turns = 2.0 * np.pi * np.arange(3) / 3.0
    radius = linkages.WIDE - linkages.NARROW
    centres = np.array([radius * np.cos(turns), radius * np.sin(turns), heights]).T
    arms = pose.translation - centres
    assert_close(np.linalg.norm(arms, axis=1), np.full(3, linkages.ROD), tol.reference)
    assert_close(rates(delta, q), np.linalg.solve(arms, np.diag(arms[:, 2])), tol.algebra)
    assert cc.classify(delta, q).kinds == frozenset()


def test_rods_with_balls_close_where_distances_do(delta: cc.Mechanism, tol: Tolerances) -> None:
    """The same postures; the mobility is less by the spin of each of six rods."""
    real = linkages.rod_delta(real=True)
    assert cc.mobility(real).mobility == cc.mobility(delta).mobility + 6
    for heights in ((0.1, 0.1, 0.1), (0.15, -0.05, 0.02)):
        platform = delta.pose(solved(delta, *heights))
        guess = np.array(real.home)
        guess[real.input_q] = heights
        for k in range(3):
            for n, (top, bottom) in enumerate(linkages.rod_ends(k)):
                a = np.array([float(x) for x in top.split()])
                a[2] += heights[k]
                b = platform.act(np.array([float(x) for x in bottom.split()]))
                turn = pin.Quaternion.FromTwoVectors(np.array([1.0, 0, 0]), b - a)
                start = real.model.idx_qs[real.model.getJointId(f"rod{k}{n}_pose")]
                guess[start : start + 7] = [*a, *turn.coeffs()]
        start = real.model.idx_qs[real.model.getJointId("pose")]
        guess[start : start + 7] = pin.SE3ToXYZQUAT(platform)
        assert np.abs(cc.residual(real, guess)).max() < tol.closure
        assert_close(real.pose(guess).homogeneous, platform.homogeneous, 1e-15)


@pytest.mark.slow
def test_rod_delta_with_level_rods_is_singular() -> None:
    """Rods all in the platform's plane hold three motions of it only, and slides move nothing."""
    m = linkages.rod_delta(real=False, rod=linkages.WIDE - linkages.NARROW)
    k = cc.constraint_jacobian(m, m.home)
    assert np.linalg.matrix_rank(k, tol=1e-9) == 3
    assert {"direct", "constraint"} <= cc.classify(m, m.home).kinds


# -- a ball on a plane ---------------------------------------------------------------------------


def test_ball_on_a_table(tol: Tolerances) -> None:
    """0.3 - 0.3 sin b - 0.3 sin (b + c) = 0.1, whatever the turret does."""
    m = linkages.ball_on_a_table()
    assert counts(m) == (2, 2, 0, {"R": 3, "PPS": 1})
    for a, b in ((0.4, 0.2), (-1.0, 0.5), (2.0, -0.1)):
        q = solved(m, a, b)
        elbow = math.asin((0.2 - 0.3 * math.sin(b)) / 0.3)
        assert_close(q, [a, b, elbow - b], tol.reference)
        assert m.point(q, "P")[2] == pytest.approx(0.1, abs=tol.reference)
        reach = 0.3 * (math.cos(b) + math.cos(elbow))
        gain = -0.3 * math.sin(b) + 0.3 * math.tan(elbow) * math.cos(b)
        c, s = math.cos(a), math.sin(a)
        assert_close(rates(m, q), [[-reach * s, gain * c], [reach * c, gain * s]], tol.algebra)
        assert cc.classify(m, q).kinds == frozenset()
    down = np.array([0.3, math.asin(0.2 / 0.3 - 1.0), 0.0])
    down[2] = math.pi / 2.0 - down[1]  # the fore arm points straight down: locked inputs let it go
    assert np.abs(cc.residual(m, down)).max() < 1e-15
    assert cc.classify(m, down).kinds == {"direct"}


def test_where_a_table_begins_means_nothing() -> None:
    """The characteristic length is that of the ball and the joints."""
    m = linkages.ball_on_a_table()
    text = m.description.text.replace('xyz="0.5 -2 0.1"', 'xyz="3 4 0.1"')
    moved = cc.load_urdf(text, xacro=False)
    assert text != m.description.text
    assert moved.length == pytest.approx(m.length, rel=1e-12)
    assert 0.1 < m.length < 0.5


# -- relations of joint values -------------------------------------------------------------------


def test_pantograph_keeps_the_direction_of_its_hand(tol: Tolerances) -> None:
    m = linkages.pantograph()
    assert counts(m) == (2, 2, 0, {"R": 3})
    for a, b in ((0.5, 0.8), (-1.2, 2.0), (2.0, -0.7)):
        q = solved(m, a, b)
        assert_close(q, [a, b, 0.2 - a - b], tol.reference)
        hand = pin.rpy.matrixToRpy(m.pose(q).rotation)
        assert_close(hand, [0.0, 0.0, 0.2], tol.reference)
        ab = a + b
        x = [-0.4 * math.sin(a) - 0.3 * math.sin(ab), -0.3 * math.sin(ab)]
        y = [0.4 * math.cos(a) + 0.3 * math.cos(ab), 0.3 * math.cos(ab)]
        assert_close(rates(m, q), [x, y], tol.algebra)
        assert_close(rates(m, q, "rz"), [[0.0, 0.0]], tol.algebra)
        assert cc.classify(m, q).kinds == frozenset()
    assert cc.classify(m, np.array([0.6, 0.0, -0.4])).kinds == {"inverse"}


@pytest.mark.parametrize("angle", [0.4, -0.6, 1.3])
def test_cam_lifts_its_valve(angle: float, tol: Tolerances) -> None:
    m = linkages.cam()
    assert counts(m) == (1, 1, 0, {"R": 1, "P": 1})
    q = solved(m, angle)
    lift = 0.02 + 0.3 * angle**2 - 0.05 * angle**3
    assert m.point(q, "valve")[2] == pytest.approx(lift, abs=tol.reference)
    assert_close(rates(m, q), [[0.6 * angle - 0.15 * angle**2]], tol.algebra)
    found = cc.acceleration(m, q, [2.0], [0.5]).tip_acceleration[2]
    expected = 4.0 * (0.6 - 0.3 * angle) + 0.5 * (0.6 * angle - 0.15 * angle**2)
    assert found == pytest.approx(expected, abs=tol.algebra)
    assert cc.classify(m, q).kinds == frozenset()


def test_cam_is_singular_where_its_lobe_is_level() -> None:
    m = linkages.cam()
    assert cc.classify(m, solved(m, 0.0)).kinds == {"inverse"}
    assert m.row_scale.tolist() == [m.length], "the valve slides: its row is a length"


# -- every analysis answers ------------------------------------------------------------------------

MECHANISMS: dict[str, Callable[[], cc.Mechanism]] = {
    "slider-crank": linkages.slider_crank,
    "rod four-bar": linkages.rod_four_bar,
    "spatial rod four-bar": linkages.spatial_rod_four_bar,
    "rod delta": lambda: linkages.rod_delta(real=False),
    "ball on a table": linkages.ball_on_a_table,
    "pantograph": linkages.pantograph,
    "cam": linkages.cam,
    "bent finger": linkages.bent_finger,
}


@pytest.mark.parametrize("name", MECHANISMS)
def test_accelerators_and_hessian_are_pinocchios(name: str, tol: Tolerances) -> None:
    """By screws alone: parts of the new pairs, and what bent relations add to the second order."""
    m = MECHANISMS[name]()
    rng = np.random.default_rng(3)
    n = len(m.inputs)
    q = solved(m, *(m.input_values(m.home) + 0.05 * rng.standard_normal(n)))
    v, a = rng.standard_normal((2, n))
    wanted = cc.acceleration(m, q, v, a)
    found = cc.accelerators(m, q, v, a)
    size = 1.0 + float(np.abs(wanted.qddot).max())
    assert_close(found.qdot, wanted.qdot, 1e-9 * size)
    assert_close(found.qddot, wanted.qddot, 1e-9 * size)
    data = m.model.createData()
    pin.forwardKinematics(m.model, data, q, wanted.qdot, wanted.qddot)
    pin.updateFramePlacements(m.model, data)
    tip = m.required_task().tip
    spatial = pin.getFrameAcceleration(m.model, data, m.frame_id(tip), pin.WORLD)
    assert_close(found.accelerator(tip), from_spatial(spatial), 1e-9 * size)
    assert_close(cc.hessian(m, q).acceleration(v, a), wanted.tip_acceleration, 1e-9 * size)


@pytest.mark.parametrize("name", MECHANISMS)
def test_network_and_legs_are_the_velocity_equation(name: str, tol: Tolerances) -> None:
    m = MECHANISMS[name]()
    net = cc.network(m, m.home)
    assert net.matrix.shape[1] - net.rank.value == cc.mobility(m).mobility
    if name == "cam":
        with pytest.raises(cc.ClosureError, match="not made of legs: body 'disc' hangs on"):
            cc.leg_velocity(m, m.home)
        return
    legs = cc.leg_velocity(m, m.home)
    assert legs.Jq.any()
    assert_close(legs.Jx @ rates(m, m.home, ALL), legs.Jq, tol.algebra * np.abs(legs.Jq).max())


@pytest.mark.parametrize("name", MECHANISMS)
def test_structure_answers(name: str) -> None:
    m = MECHANISMS[name]()
    mobility = cc.mobility(m).mobility
    graph = cc.loops(m)
    cuts = {pair.closure: pair.freedoms for pair in graph.pairs if pair.closure}
    assert cuts == {c.name: 6 - c.rows for c in m.closures if isinstance(c, cc.Closure)}
    assert cc.structure(m).text
    assert cc.dependence(m).text
    moves = cc.poc(m, m.required_task().tip)
    assert moves.translations + moves.rotations >= min(1, mobility)


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("slider-crank", "closure 'slot' is of kind point_on_line, which is not written out"),
        ("rod delta", "closure 'rod00' is of kind distance, which is not written out"),
        ("ball on a table", "closure 'table' is of kind in_plane, which is not written out"),
        ("pantograph", "joint 'c' is moved by the inputs q1 and q2 together"),
        ("bent finger", "'tendon' .polynomial coupling .* changes with the posture"),
    ],
)
def test_closed_forms_say_why_there_are_none(name: str, why: str) -> None:
    with pytest.raises(cc.ClosureError, match=why):
        cc.symbolic_singularities(MECHANISMS[name]())


def test_passive_joints_tied_together_make_no_legs() -> None:
    m = linkages.pantograph()
    text = m.description.text.replace(
        '<transmission name="q2"><joint name="b"/></transmission>', ""
    )
    one_input = cc.load_urdf(text, xacro=False)
    with pytest.raises(cc.ClosureError, match=r"'parallel' .* ties the passive joints c, b"):
        cc.leg_velocity(one_input, one_input.home)


@pytest.mark.parametrize("name", MECHANISMS)
def test_map_cells_are_what_classify_says(name: str, tol: Tolerances) -> None:
    m = MECHANISMS[name]()
    start = dict(zip(m.inputs, m.input_values(m.home), strict=True))
    over = {n: np.linspace(start[n] - 0.04, start[n] + 0.04, 3) for n in m.inputs[:2]}
    cells = cc.singularity_map(m, over, keep_q=True, progress=False)
    assert (cells["status"] == 0).all()
    postures = cells["q"].values.reshape(-1, m.model.nq)
    for kind in ("direct", "inverse", "constraint"):
        sigmas = cells[f"sigma_{kind}"].values.ravel()
        for q, sigma in zip(postures, sigmas, strict=True):
            assert np.abs(cc.residual(m, q)).max() < tol.closure
            expected = getattr(cc.classify(m, q), f"sigma_{kind}")
            assert sigma == pytest.approx(expected, rel=1e-6, abs=tol.singular)


def test_singular_curve_of_the_ball_on_a_table(tol: Tolerances) -> None:
    """The fore arm points straight down: sin b = -1/3, for every turn of the turret."""
    m = linkages.ball_on_a_table()
    over = {"q1": (-0.5, 0.5), "q2": (-0.8, 0.4)}
    found = cc.singularity_set(m, "direct", over=over, progress=False)
    assert found.dropped == 0
    assert_close(found.coordinates[:, 1], np.full(len(found.q), math.asin(-1 / 3)), tol.reference)
    assert found.coordinates[:, 0].min() == pytest.approx(-0.5)
    assert found.coordinates[:, 0].max() == pytest.approx(0.5)


@pytest.mark.parametrize("name", ["slider-crank", "spatial rod four-bar", "cam", "bent finger"])
def test_a_path_of_inputs_is_tracked(name: str, tol: Tolerances) -> None:
    m = MECHANISMS[name]()
    start = m.input_values(m.home)
    tracked = cc.track(m, np.linspace(start, start + 0.2, 9))
    assert tracked.complete
    assert max(np.abs(cc.residual(m, q)).max() for q in tracked.q) < tol.closure
    assert_close(tracked.q[-1], solved(m, *(start + 0.2)), tol.reference)


def test_a_rod_lets_a_locked_delta_move_in_its_spare_freedom(tol: Tolerances) -> None:
    """Two slides locked: the platform swings on two pairs of rods while the third slide gives."""
    m = linkages.rod_delta(real=False)
    moved = cc.self_motion(m, m.home, "z", lock=("q0",))
    assert len(moved.q) > 10
    assert max(np.abs(cc.residual(m, q)).max() for q in moved.q) < tol.closure
    heights = np.array([m.pose(q).translation[2] for q in moved.q])
    assert_close(heights, np.full(len(heights), heights[0]), tol.reference)
