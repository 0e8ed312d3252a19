"""Second order by screws: against Pinocchio, D1's own equations, and differences of positions."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from itertools import pairwise

import linkage_text
import linkages
import numpy as np
import pinocchio as pin
import pytest
from conftest import Tolerances, assert_close
from linkage_text import Cut, J

import closedchain as cc
from closedchain.analysis.screws import from_motion, lie, revolute
from closedchain.analysis.screws.accelerators import (
    Accelerators,
    accelerators,
    composed,
    from_classical,
    from_spatial,
    lie_form,
    lie_screw,
    to_classical,
    to_spatial,
)
from closedchain.analysis.structure.graph import reverse
from closedchain.analysis.structure.loops import loops
from closedchain.analysis.structure.postures import wander
from closedchain.robots.d1 import Pose, geometry, limb_rates, limb_screws, motion

EQUAL = 1e-9  # two exact ways to the same number, relative to the largest acceleration
DIFFERENCES = 1e-6  # derivatives against differences of positions, relative
REGULAR = 0.002  # smallest singular value of the circuits' conditions where differences settle


@cache
def robot(name: str) -> cc.Mechanism:
    return cc.load(name)


@cache
def samples(name: str, count: int = 6) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Postures (nq,) away from home with input rates and accelerations (n_inputs,)."""
    m = robot(name)
    rng = np.random.default_rng(41)
    return [(q, *rng.standard_normal((2, len(m.inputs)))) for q in wander(m, count, seed=5)]


def hybrid(first: Cut, second: Cut, *, rocker: int = 1) -> cc.Mechanism:
    """A driven crank, a rod between two cut joints, and a rocker: one loop with one freedom."""
    joints = [
        J("R1", "base", "crank"),
        J("R2", "base", "rocker", "0.35 0 0", axis="1 0 0"),
        J("pose", "base", "rod", type="floating"),
    ]
    if rocker == 2:
        joints[1] = J("R2", "base", "arm", "0.35 0 0", axis="1 0 0")
        joints.insert(2, J("R3", "arm", "rocker", "0.02 0 0", axis="0 0 1"))
    home = {"R1": 0.7, "pose": "0.08 0.06 0 0 0 0 1"}
    return linkage_text.load(
        "hybrid", joints, [first, second], inputs={"q1": "R1"}, home=home, tip="rod"
    )


def near(kind: str, axis: str = "0 0 1", child_axis: str = "0 0 1") -> Cut:
    return Cut("one", "crank", "rod", "0.1 0 0", "0 0 0", kind, axis, child_axis)


def far(kind: str, axis: str = "0 0 1", child_axis: str = "0 0 1") -> Cut:
    return Cut("two", "rod", "rocker", "0.4 0 0", "0 0.25 0", kind, axis, child_axis)


LINKAGES: dict[str, Callable[[], cc.Mechanism]] = {
    "four-bar": linkages.four_bar,
    "parallelogram": linkages.parallelogram,
    "five-bar, coupled cranks": lambda: linkages.five_bar(coupled=True),
    "Bennett": linkages.bennett,
    "wedges": linkages.wedges,
    "RUSR": lambda: linkages.spatial_four_bar(True),
    "six-bar": lambda: linkages.six_bar("G"),
    "arm with a parallelogram": linkages.arm_with_parallelogram,
    "no loop": linkages.lone_arm,
    "cut universal": lambda: hybrid(near("universal", "0 0 1", "0 1 0"), far("spherical")),
    "cut cylindrical": lambda: hybrid(near("cylindrical"), far("spherical")),
    "cut planar": lambda: hybrid(
        near("planar", "0 1 0", "0 1 0"), far("universal", "0 0 1", "0 1 0")
    ),
    "cut prismatic": lambda: hybrid(near("prismatic"), far("spherical"), rocker=2),
}


def scale(found: np.ndarray) -> float:
    return 1.0 + float(np.abs(found).max(initial=0.0))


def of_pinocchio(m: cc.Mechanism, q: np.ndarray, found: cc.Acceleration) -> pin.Data:
    data = m.model.createData()
    pin.forwardKinematics(m.model, data, q, found.qdot, found.qddot)
    return data


# -- algebra -------------------------------------------------------------------------------------


def test_conversions_are_pinocchios() -> None:
    """Spatial acceleration in any of its three frames; classical acceleration of a point."""
    model = pin.buildSampleModelHumanoid()
    data = model.createData()
    rng = np.random.default_rng(0)
    q = pin.integrate(model, pin.neutral(model), rng.standard_normal(model.nv))
    pin.forwardKinematics(model, data, q, *rng.standard_normal((2, model.nv)))
    pin.updateFramePlacements(model, data)
    for f in range(1, model.nframes, 3):
        placed = data.oMf[f]
        aligned = pin.SE3(np.eye(3), placed.translation)
        world = from_spatial(pin.getFrameAcceleration(model, data, f, pin.WORLD))
        size = scale(world)
        for reference, pose in ((pin.LOCAL, placed), (pin.LOCAL_WORLD_ALIGNED, aligned)):
            given = pin.getFrameAcceleration(model, data, f, reference)
            assert_close(from_spatial(given, pose), world, 1e-12 * size)
            assert_close(to_spatial(world, pose).vector, given.vector, 1e-12 * size)
        twist = from_motion(pin.getFrameVelocity(model, data, f, pin.WORLD))
        classical = pin.getFrameClassicalAcceleration(model, data, f, pin.LOCAL_WORLD_ALIGNED)
        point = placed.translation
        assert_close(to_classical(world, twist, point), classical.vector, 1e-12 * size)
        assert_close(from_classical(classical.vector, twist, point), world, 1e-12 * size)


def test_conversions_are_vectorised() -> None:
    rng = np.random.default_rng(1)
    a, v, p = rng.standard_normal((4, 5, 6)), rng.standard_normal((5, 6)), rng.standard_normal(3)
    there = to_classical(a, v, p)
    assert there.shape == (4, 5, 6)
    assert_close(from_classical(there, v, p), a, 1e-14)
    assert_close(there[2, 3], to_classical(a[2, 3], v[3], p), 1e-15)


def test_lie_screw_is_the_sum_of_all_brackets() -> None:
    """Eq (17) written out, vectorised, and as a bilinear form."""
    rng = np.random.default_rng(2)
    twists = rng.standard_normal((3, 5, 6))
    pairs = [(j, k) for j in range(5) for k in range(j + 1, 5)]
    written_out = sum(lie(twists[:, j], twists[:, k]) for j, k in pairs)
    assert_close(lie_screw(twists), written_out, 1e-14)
    unit = rng.standard_normal((5, 4, 6))  # five joints, four motions
    u = rng.standard_normal(4)
    form = lie_form(unit)
    assert_close(form, np.swapaxes(form, 1, 2), 0.0)
    moving = np.einsum("nmc,m->nc", unit, u)
    assert_close(np.einsum("cij,i,j->c", form, u, u), lie_screw(moving), 1e-13)


def test_accelerator_of_a_serial_arm() -> None:
    """Eq (16): J times the second rates plus the Lie screw, on an arm of six joints."""
    model = pin.buildSampleModelManipulator()
    data = model.createData()
    rng = np.random.default_rng(3)
    q, v, a = rng.standard_normal((3, model.nv))
    pin.forwardKinematics(model, data, q, v, a)
    pin.computeJointJacobians(model, data, q)
    screws = np.array([from_motion(pin.Motion(column)) for column in data.J.T])
    last = model.njoints - 1
    spatial = data.oMi[last].act(data.a[last])
    assert_close(a @ screws + lie_screw(v[:, None] * screws), from_motion(spatial), 1e-12)


def test_a_turning_point_accelerates_towards_the_axis() -> None:
    """By hand: w = 2 about z through (1, 0, 0), point (3, 0, 0): a = -w^2 2 x, accelerator zero."""
    twist = 2.0 * revolute([0.0, 0.0, 1.0], [1.0, 0.0, 0.0])
    assert_close(
        to_classical(np.zeros(6), twist, [3.0, 0.0, 0.0]), [-8.0, 0.0, 0.0, 0.0, 0.0, 0.0], 1e-15
    )


# -- mechanisms ----------------------------------------------------------------------------------


@pytest.mark.parametrize("name", cc.robots("papers"))
def test_robots_move_as_the_constraint_jacobians_say(name: str) -> None:
    m = robot(name)
    for q, v, a in samples(name):
        one, two = cc.acceleration(m, q, v, a), accelerators(m, q, v, a)
        size = scale(one.qddot)
        assert_close(two.qdot, one.qdot, EQUAL * scale(one.qdot))
        assert_close(two.qddot, one.qddot, EQUAL * size)
        assert_close(two.classical(m.required_task().tip), one.tip_acceleration, EQUAL * size)


@pytest.mark.parametrize("name", LINKAGES)
def test_linkages_move_as_the_constraint_jacobians_say(name: str) -> None:
    """Planar, overconstrained and coupled loops, loops that share nothing, every kind of cut."""
    m = LINKAGES[name]()
    rng = np.random.default_rng(7)
    for q in wander(m, 3, seed=1):
        v, a = rng.standard_normal((2, len(m.inputs)))
        one, two = cc.acceleration(m, q, v, a), accelerators(m, q, v, a)
        assert np.abs(one.qddot - a[0]).max() > 1e-3
        assert_close(two.qdot, one.qdot, EQUAL * scale(one.qdot))
        assert_close(two.qddot, one.qddot, EQUAL * scale(one.qddot))


@pytest.mark.parametrize("name", cc.robots("papers"))
def test_every_body_moves_as_in_pinocchio(name: str) -> None:
    m = robot(name)
    q, v, a = samples(name)[0]
    found, data = accelerators(m, q, v, a), of_pinocchio(m, q, cc.acceleration(m, q, v, a))
    size = scale(found.second_rates)
    for body in loops(m).bodies:
        for link in body.links:
            where = (m.model, data, m.frame_id(link), pin.WORLD)
            twist = from_motion(pin.getFrameVelocity(*where))
            spatial = from_spatial(pin.getFrameAcceleration(*where))
            assert_close(found.twist(link), twist, EQUAL * size, link)
            assert_close(found.accelerator(link), spatial, EQUAL * size, link)


@pytest.mark.parametrize("name", cc.robots("papers"))
def test_circuits_close_to_second_order(name: str) -> None:
    """Eqs (34), (35) before anything is eliminated: twists and accelerators sum to zero."""
    m = robot(name)
    for q, v, a in samples(name)[:2]:
        found = accelerators(m, q, v, a)
        size = scale(found.second_rates)
        assert len(found.circuits.walks) == len(loops(m).loops)
        # those of a parallelogram alone vanish
        lies = [found.chain_lie_screw(walk) for walk in found.circuits.walks]
        assert np.abs(lies).max() > 1e-3
        for walk in found.circuits.walks:
            assert_close(found.chain_twist(walk), np.zeros(6), EQUAL * size)
            assert_close(found.chain_accelerator(walk), np.zeros(6), EQUAL * size)
            # from another pair on, in the other direction: no other condition
            turned = reverse(walk[2:] + walk[:2])
            assert_close(found.chain_accelerator(turned), np.zeros(6), EQUAL * size)


def moving_d1(d1: cc.Mechanism) -> list[tuple[np.ndarray, np.ndarray, np.ndarray, Accelerators]]:
    return [(q, v, a, accelerators(d1, q, v, a)) for q, v, a in samples("d1")]


def test_d1s_own_equations(d1: cc.Mechanism, tol: Tolerances) -> None:
    """Generic accelerators are those of eqs (34), (35), in bodies and in relative motion."""
    g = geometry()
    for q, v, a, found in moving_d1(d1):
        placed = [d1.pose(q, name) for name in ("coupler", "platform")]
        coupler, platform = (Pose(p.rotation, p.translation) for p in placed)
        own = motion(coupler, platform, g, v, a)
        assert own.regular
        size = scale(own.A_AC)
        assert_close(found.twist("coupler"), own.V_AB, EQUAL * size)
        assert_close(found.twist("platform"), own.V_AC, EQUAL * size)
        assert_close(found.accelerator("coupler"), own.A_AB, EQUAL * size)
        assert_close(found.accelerator("platform"), own.A_AC, EQUAL * size)
        v_bc, a_bc = (f("platform", "coupler") for f in (found.twist, found.accelerator))
        limbs = limb_screws(coupler, platform, g)
        ends = ((own.V_AB, own.A_AB), (v_bc, a_bc), (own.V_AC, own.A_AC))
        active = (a[:3], None, a[3:])
        for screws, (twist, accelerator), given in zip(limbs, ends, active, strict=True):
            # eq (32) with the Lie screws (33) of limbs whose spherical joints are three revolutes
            moving = limb_rates(screws, twist)[..., None] * screws
            right = accelerator - lie_screw(moving)
            second = np.linalg.solve(np.swapaxes(screws, -1, -2), right[..., None])[..., 0]
            if given is not None:
                assert_close(second[:, 2], given, EQUAL * size)


@pytest.mark.parametrize("name", ["d1", "rus6"])
def test_composition(name: str) -> None:
    """Eq (31) for any three bodies; the reverse of a motion has the opposite accelerator."""
    m = robot(name)
    q, v, a = samples(name)[1]
    found = accelerators(m, q, v, a)
    links = [body.name for body in loops(m).bodies][::3]
    size = scale(found.second_rates) ** 2
    for one in links:
        for two in links:
            v_12, a_12 = found.twist(two, one), found.accelerator(two, one)
            assert_close(found.accelerator(one, two), -a_12, EQUAL * size)
            for three in links:
                v_23, a_23 = found.twist(three, two), found.accelerator(three, two)
                whole = composed(v_12, a_12, v_23, a_23)
                assert_close(whole, found.accelerator(three, one), EQUAL * size)


def test_any_chain_leads_to_the_same_accelerator(d1: cc.Mechanism) -> None:
    """Through the first limb, the last limb, and through the coupler."""
    q, v, a = samples("d1")[2]
    found = accelerators(d1, q, v, a)
    names = [pair.name for pair in found.circuits.graph.pairs]
    whole = found.accelerator("platform")
    shortest = found.chain("base", "platform")
    others = [n for k, n in enumerate(names) if k not in {p for p, _ in shortest}]
    detour = found.chain("base", "platform", others)
    lies = [found.chain_lie_screw(walk) for walk in (shortest, detour)]
    assert np.abs(lies[0] - lies[1]).max() > 1e-3
    assert_close(found.chain_accelerator(detour), whole, EQUAL * scale(whole))


def differences(path: Callable[[float], np.ndarray], h: float) -> tuple[np.ndarray, np.ndarray]:
    """First and second derivative at 0, errors of the order h^4."""
    ahead, behind = ([path(s * k * h) for k in (1, 2)] for s in (1, -1))
    first = (8 * (ahead[0] - behind[0]) - (ahead[1] - behind[1])) / (12 * h)
    second = 16 * (ahead[0] + behind[0]) - (ahead[1] + behind[1]) - 30 * path(0.0)
    return first, second / (12 * h**2)


def settled(path: Callable[[float], np.ndarray], h: float) -> list[np.ndarray]:
    """Both derivatives, Richardson-extrapolated, where they change least from step to half step."""
    steps = [differences(path, h / 2**k) for k in range(6)]
    out = []
    for order in (0, 1):
        found = [step[order] for step in steps]
        candidates = list(pairwise(found))
        for power in (4, 6, 8):
            found = [b + (b - a) / (2**power - 1) for a, b in pairwise(found)]
            candidates += pairwise(found)
        out.append(min(candidates, key=lambda two: np.abs(two[1] - two[0]).max())[1])
    return out


@pytest.mark.parametrize("name", cc.robots("papers"))
def test_against_differences_of_positions(name: str) -> None:
    """Joints and tip along inputs q0 + v t + a t^2 / 2, from the position solution alone."""
    m = robot(name)
    tip = m.required_task().tip

    def check(q: np.ndarray, v: np.ndarray, a: np.ndarray) -> None:
        found = accelerators(m, q, v, a)
        start = m.input_values(q)

        @cache
        def posture(t: float) -> np.ndarray:
            return cc.direct(m, start + t * v + 0.5 * t**2 * a, q).raise_if_failed().q

        h = 1e-2 / np.sqrt(scale(found.second_rates))
        first, second = settled(lambda t: pin.difference(m.model, q, posture(t)), h)
        assert_close(first, found.qdot, DIFFERENCES * scale(found.qdot))
        assert_close(second, found.qddot, DIFFERENCES * scale(found.qddot))
        _, second = settled(lambda t: m.point(posture(t), tip), h)
        assert_close(second, found.classical(tip)[:3], DIFFERENCES * scale(second))

    regular = 0
    for q, v, a in samples(name):
        fastest = accelerators(m, q, v, 0.0 * a)
        if fastest.circuits.rank.above > REGULAR:
            unit = np.abs(fastest.rates).max()
            check(q, v / unit, a / unit)
            regular += 1
    assert regular >= 3


# -- wrong questions -----------------------------------------------------------------------------


def test_singular_posture_is_refused() -> None:
    m = linkages.spatial_four_bar(False)
    with pytest.raises(cc.ClosureError, match="do not determine the motion"):
        accelerators(m, m.home, [1.0], [0.0])


def test_contradicting_inputs_are_refused() -> None:
    """Both cranks of a four-bar driven: one pair of rates is possible and the others are not."""
    one = linkages.four_bar()
    both = linkages.four_bar({"q1": "A", "q2": "D"})
    q = wander(one, 1, seed=2)[0]
    true = accelerators(one, q, [0.7], [-0.4])
    rates, second = true.qdot[both.input_v], true.qddot[both.input_v]
    again = accelerators(both, q, rates, second)
    assert_close(again.qddot, true.qddot, EQUAL)
    with pytest.raises(cc.ClosureError, match="velocities contradict"):
        accelerators(both, q, rates * [1.0, 1.1], second)
    with pytest.raises(cc.ClosureError, match="accelerations contradict"):
        accelerators(both, q, rates, second * [1.0, 1.1])


def test_unknown_names_are_refused(d1: cc.Mechanism) -> None:
    found = accelerators(d1, samples("d1")[0][0], np.zeros(6), np.zeros(6))
    with pytest.raises(cc.ClosureError, match="platfrom"):
        found.accelerator("platfrom")
    with pytest.raises(cc.ClosureError, match="pair"):
        found.chain("base", "platform", ["leg9"])
    with pytest.raises(cc.ClosureError, match="no chain"):
        found.chain("base", "platform", [])
