"""Statics: free bodies, virtual work, internal forces, and loads that nothing carries."""

import sys
from pathlib import Path

import numpy as np
import pytest
from conftest import assert_close
from heavy import moved, potential, unbalanced, weighed
from scipy.linalg import qr

import closedchain as cc
from closedchain.closure.closures import Closure
from closedchain.closure.joint_kinds import JOINT_KINDS
from closedchain.urdf import ClosureType

sys.path.insert(0, str(Path(__file__).parents[1] / "analysis"))

from linkage_text import Cut, J, Tie, load
from linkages import four_bar, spinning_rod

DRAWN = [name for name in cc.robots() if name != "wren"]
"""Those with hinges or slides, whose values are drawn at random."""
FALL = np.array([0.0, 0.0, -9.81])
PUSH = np.array([3.0, -2.0, 5.0, 0.4, -0.3, 0.2])


@pytest.fixture(scope="module", params=["d1", "eclipse", "rpa3t", "linear_delta", "rus6"])
def robot(request: pytest.FixtureRequest) -> cc.Mechanism:
    return weighed(cc.load(request.param))


def held_by_one(kind: ClosureType) -> cc.Mechanism:
    """A chain of nine joints whose end is held by one cut joint."""
    joints = [
        J(
            f"j{i}",
            "base" if i == 0 else f"l{i - 1}",
            f"l{i}",
            "0.1 0.2 0.1",
            axis=("1 0 0", "0 1 0", "0 0 1")[i % 3],
            type="prismatic" if i > 5 else "revolute",
        )
        for i in range(9)
    ]
    cut = Cut("cut", "base", "l8", "0.4 0.3 0.2", "0.1 0 0", kind)
    loose = load(kind, joints, [cut], home={f"j{i}": 0.2 + 0.1 * i for i in range(9)})
    # the joints that close the loop are those whose columns stand out most
    held = qr(cc.constraint_jacobian(loose, loose.home), pivoting=True)[2]
    driven = {f"q{i}": f"j{i}" for i in sorted(held[JOINT_KINDS[kind].rows :])}
    home = {f"j{i}": float(x) for i, x in enumerate(loose.home)}
    return load(kind, joints, [cut], inputs=driven, home=home, tip="l8")


def test_every_body_is_in_equilibrium(robot: cc.Mechanism) -> None:
    q = moved(robot)
    tip = robot.task.tip
    s = cc.statics(robot, q, PUSH)
    assert s.carried, s.text
    assert unbalanced(robot, q, dict(s.joints), {tip: PUSH}, FALL) < 1e-9
    assert set(s.joints) >= {c.name for c in robot.closures if isinstance(c, Closure)}


def test_virtual_work_of_every_closed_motion(robot: cc.Mechanism) -> None:
    """What the inputs do, the loads undo; the weight by differences of potential energy."""
    q = moved(robot)
    v = cc.velocity(robot, q, "x y z rx ry rz")
    s = cc.statics(robot, q, PUSH, gravity=False)
    assert_close(s.inputs, -v.twist_map.T @ PUSH, 1e-9)
    s = cc.statics(robot, q)
    for i in range(len(robot.inputs)):
        step = np.zeros(len(robot.inputs))
        step[i] = 1e-4
        energy = []
        for sign in (1, -1):
            at = cc.direct(robot, robot.input_values(q) + sign * step, q).raise_if_failed().q
            energy.append(potential(robot, at, FALL))
        slope = (energy[0] - energy[1]) / 2e-4
        assert abs(s.inputs[i] - slope) < 1e-6 * max(1.0, abs(slope))


@pytest.mark.parametrize("name", [*DRAWN, "delia"])
def test_both_ways_agree_wherever_the_branch_leads(name: str) -> None:
    """Free bodies and virtual work at random postures, as a share of the largest wrench."""
    m = cc.load(name)
    for q in cc.resets(m, 4, seed=4, speed=0.0).q:
        s = cc.statics(m, q, PUSH)
        assert s.carried, s.text
        largest = max(np.abs(wrench).max() for wrench in s.joints.values())
        assert unbalanced(m, q, dict(s.joints), {m.task.tip: PUSH}, FALL) < 1e-12 * largest
        efforts = cc.statics(m, q, PUSH, gravity=False).inputs
        expected = -cc.velocity(m, q, "x y z rx ry rz").twist_map.T @ PUSH
        assert_close(efforts, expected, 1e-12 * np.abs(expected).max())


def test_near_a_singularity_wrenches_grow_and_balance() -> None:
    """Crank and coupler almost in line, the motor at the rocker: efforts go with 1 / angle."""
    m = weighed(four_bar({"q1": "D"}), seed=4)
    d = np.pi - np.arccos((0.4**2 + 0.3**2 - 0.5**2) / (2 * 0.4 * 0.3))
    a = np.arctan2(0.3 * np.sin(d), 0.4 + 0.3 * np.cos(d))
    push, fall = np.array([3.0, -2.0, 0.0, 0.0, 0.0, 0.2]), np.array([0.0, -9.81, 0.0])
    efforts = []
    for gap in (1e-3, 1e-5, 1e-7, 1e-9):
        q = cc.close(m, [a + gap, -2 * gap, d], fixed={"A": a + gap}).raise_if_failed().q
        s = cc.statics(m, q, {"coupler": push}, gravity=fall)
        assert s.carried == (gap > 1e-8)  # closer by, the posture counts as singular
        largest = max(np.abs(wrench).max() for wrench in s.joints.values())
        if s.carried:
            assert unbalanced(m, q, dict(s.joints), {"coupler": push}, fall) < 1e-12 * largest
            efforts.append(s.inputs[0] * gap)
    assert abs(efforts[1] / efforts[2] - 1.0) < 1e-3


def test_passive_joints_do_no_work(robot: cc.Mechanism) -> None:
    q = moved(robot)
    s = cc.statics(robot, q, PUSH)
    driven = {spec.joint: spec.name for spec in robot.description.inputs}
    coupled = {j for efforts in s.couplings.values() for j in efforts}
    for joint in robot.description.joints:
        if joint.name not in s.joints or joint.name in coupled:
            continue
        part = slice(0, 3) if joint.type == "prismatic" else slice(3, 6)
        along = s.joints[joint.name][part] @ joint.axis
        wanted = s.inputs[robot.inputs.index(driven[joint.name])] if joint.name in driven else 0.0
        assert abs(along - wanted) < 1e-9, joint.name


@pytest.mark.parametrize("kind", [kind for kind in JOINT_KINDS if kind != "distance"])
def test_cut_joints_of_every_kind(kind: ClosureType) -> None:
    m = weighed(held_by_one(kind))
    q = moved(m)
    s = cc.statics(m, q, PUSH)
    assert s.carried, s.text
    assert unbalanced(m, q, dict(s.joints), {"l8": PUSH}, FALL) < 1e-9
    (cut,) = (c for c in m.closures if isinstance(c, Closure))
    one = m.pose(q, "base") * cut.placement1
    two = m.pose(q, "l8") * cut.placement2
    between = one.actInv(two)
    for velocity, spin in cut.joint_kind.twists(
        between.translation.tolist(), between.rotation.tolist()
    ):
        assert abs(s.closures["cut"] @ [*velocity, *spin]) < 1e-9


def test_a_rod_only_pulls_and_pushes() -> None:
    """A pendulum held by a rod from the ceiling: moments about its hinge, by hand."""
    m = load(
        "hung",
        [J("A", "base", "arm", axis="0 1 0"), J("e", "arm", "end", "0.5 0 0", type="fixed")],
        [Cut("rod", "base", "end", "0.5 0 0.4", type="distance", length=0.4)],
        home={"A": 0.0},
        tip="end",
    )
    s = cc.statics(m, m.home, payload={"end": 2.0})
    assert s.carried
    assert_close(s.closures["rod"], [0.0, 0.0, 2.0 * 9.81, 0.0, 0.0, 0.0], 1e-12)
    assert_close(s.joints["A"], np.zeros(6), 1e-12)
    pushed = cc.statics(m, m.home, {"end": [0, 0, 3.0, 0, 0, 0]}, gravity=False)
    assert_close(pushed.closures["rod"][2], -3.0, 1e-12)


def test_four_bar_by_hand() -> None:
    """Crank torque by the angular velocity ratio; the coupler of the rocker's load is a rod."""
    m = four_bar()
    moment = np.array([0, 0, 0, 0, 0, 2.0])
    s = cc.statics(m, m.home, {"rocker": moment}, gravity=False)
    a, b, d = m.home
    # both rates by the loop: 0.15 e(a) + 0.35 e(a + b) = (0.4, 0) + 0.3 e(d)
    turn = a + b
    ratio = 0.15 * np.sin(a - turn) / (0.3 * np.sin(d - turn))
    assert abs(s.inputs[0] + 2.0 * ratio) < 1e-12
    force = s.joints["B"][:2]  # along the coupler's axes: a two-force member
    assert abs(force[1]) < 1e-12
    assert abs(abs(force[0]) - 2.0 / (0.3 * abs(np.sin(d - turn)))) < 1e-12


def test_planar_loops_leave_what_acts_across_the_plane_open() -> None:
    m = four_bar()
    s = cc.statics(m, m.home, PUSH)
    assert s.internal.shape == (1 + m.rows, 3)
    assert set(s.undetermined) == {"A", "B", "C", "D"}
    assert all(set(parts) <= {"fz", "mx", "my"} for parts in s.undetermined.values())
    k = cc.constraint_jacobian(m, m.home)
    rows = np.zeros((3, 1))
    rows[m.input_v, 0] = 1.0
    assert_close(np.hstack([rows, k.T]) @ s.internal, np.zeros((3, 3)), 1e-12)
    flat = cc.statics(m, m.home, [1.0, 2.0, 0, 0, 0, 0.5], gravity=False)
    for wrench in flat.joints.values():
        assert_close(wrench[2:5], np.zeros(3), 1e-12)


def test_least_choice_does_not_depend_on_the_cut() -> None:
    """Cut at C, or at D with the base first: the same wrench in every joint."""
    m = four_bar()
    at = m.home
    a, b, d = at
    turn = a + b - d  # of the coupler against the rocker
    other = load(
        "four_bar",
        [
            J("A", "base", "crank"),
            J("B", "crank", "coupler", "0.15 0 0"),
            J("C", "coupler", "rocker", "0.35 0 0"),
        ],
        [Cut("D", "base", "rocker", "0.4 0 0", "-0.3 0 0")],
        inputs={"q1": "A"},
        home={"A": a, "B": b, "C": -turn},
        tip="coupler",
    )
    one, two = cc.statics(m, at, PUSH), cc.statics(other, other.home, PUSH)
    for name in "AB":
        assert_close(one.joints[name], two.joints[name], 1e-9, name)
    assert one.internal.shape[1] == two.internal.shape[1] == 3


def test_spare_drives_share_by_the_least_squares() -> None:
    m = four_bar({"q1": "A", "q2": "D"})
    one = four_bar()
    s, alone = cc.statics(m, m.home, PUSH), cc.statics(one, one.home, PUSH)
    assert "q1" in s.undetermined
    assert "q2" in s.undetermined
    k = cc.constraint_jacobian(one, one.home)
    motion = np.linalg.svd(k)[2][-1]
    rates = motion[[0, 2]]
    # what the drives must do together is alone.inputs on A; the least way is along the rates
    assert_close(s.inputs, alone.inputs[0] * motion[0] * rates / (rates @ rates), 1e-12)


def test_mimics_put_opposite_work_on_their_joints() -> None:
    m = load(
        "gears",
        [J("A", "base", "one"), J("B", "base", "two", "0.3 0 0")],
        [Tie("mesh", "linear", ("A", "B"), (2.0, 1.0))],
        inputs={"q": "A"},
        tip="two",
    )
    s = cc.statics(m, m.home, [0, 0, 0, 0, 0, 1.5], gravity=False)
    assert_close(s.couplings["mesh"]["B"], -1.5, 1e-12)
    assert_close(s.couplings["mesh"]["A"], -3.0, 1e-12)
    assert_close(s.inputs, [3.0], 1e-12)


def test_crank_in_line_with_coupler() -> None:
    """Driven at the rocker, the four-bar is stuck where crank and coupler are in line."""
    m = four_bar({"q1": "D"})
    reach = 0.15 + 0.35
    d = np.pi - np.arccos((0.4**2 + 0.3**2 - reach**2) / (2 * 0.4 * 0.3))
    a = np.arctan2(0.3 * np.sin(d), 0.4 + 0.3 * np.cos(d))
    q = np.array([a, 0.0, d])
    assert np.abs(cc.residual(m, q)).max() < 1e-12
    torque = cc.statics(m, q, {"crank": [0, 0, 0, 0, 0, 1.0]}, gravity=False)
    assert not torque.carried
    assert torque.residual > 1e-3
    assert set(torque.uncarried) == {"wrench at crank"}
    assert "A" in torque.text
    assert "not carried" in torque.text
    with pytest.raises(cc.ClosureError, match="not carried"):
        torque.raise_if_failed()
    # a pull along the line of both does no work there and is carried
    line = np.array([np.cos(a), np.sin(a), 0, 0, 0, 0])
    pull = cc.statics(m, q, {"coupler": line}, gravity=False)
    assert pull.carried
    assert pull.free_motions.shape == (3, 1)
    assert "free" in pull.text


def test_free_spins_do_no_harm() -> None:
    """A rod between two balls may spin: it carries what acts on its line, no torque about it."""
    m = spinning_rod()
    s = cc.statics(m, m.home, {"arm": PUSH}, gravity=False)
    assert s.carried
    assert s.free_motions.shape[1] == 1
    assert_close(s.inputs, [-PUSH[4]], 1e-12)
    turned = cc.statics(m, m.home, {"rod": [0, 0, 0, 0.5, -0.4, 0]}, gravity=False)
    assert not turned.carried
    assert "spin" in turned.text


def test_payload_is_a_mass_at_a_frame() -> None:
    m = weighed(cc.load("linear_delta"))
    q = moved(m)
    tip = m.task.tip
    loaded = cc.statics(m, q, payload={tip: 1.5})
    pushed = cc.statics(m, q, {tip: [0, 0, -1.5 * 9.81, 0, 0, 0]})
    assert_close(loaded.inputs, pushed.inputs, 1e-11)
    sideways = cc.statics(m, q, gravity=[9.81, 0, 0])
    assert np.abs(sideways.inputs - loaded.inputs).max() > 0.1


@pytest.mark.parametrize(
    ("words", "match"),
    [
        ({"wrench": [1, 2, 3]}, r"wrench at .* must have shape \(6,\)"),
        ({"wrench": {"nobody": np.zeros(6)}}, "nobody"),
        ({"wrench": [np.nan] * 6}, "finite"),
        ({"payload": {"coupler": -1.0}}, "below zero"),
        ({"payload": {"nobody": 1.0}}, "nobody"),
        ({"gravity": [1.0, 2.0]}, "gravity"),
    ],
)
def test_wrong_loads_are_refused(words: dict[str, object], match: str) -> None:
    m = four_bar()
    with pytest.raises(cc.ClosureError, match=match):
        cc.statics(m, m.home, **words)
    with pytest.raises(cc.ClosureError, match="not closed"):
        cc.statics(m, m.home + 0.3)
