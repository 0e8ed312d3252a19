"""Rows of every closure kind: residual, exact Jacobian, drift, freedoms, mirrors and guards."""

from __future__ import annotations

from collections.abc import Callable
from typing import get_args

import numpy as np
import pinocchio as pin
import pytest
from conftest import Tolerances, assert_close

from closedchain.closure.closures import Closure, CoupledJoint, Coupling
from closedchain.closure.joint_kinds import JOINT_KINDS
from closedchain.closure.workspace import Workspace
from closedchain.urdf.description import ClosureType
from closedchain.urdf.errors import ClosureError

KINDS: tuple[ClosureType, ...] = get_args(ClosureType)
SAMPLES = 100
HALF_TURN_MARGIN = 3.0
"""log6 is not differentiable at half a turn: fixed closures stay below this angle [rad]."""

ROD = 0.7
"""Length of the distance closures [m]."""

PAIRS = ((3, 5), (0, 5), (3, 0), (2, 4), (5, 1), (1, 3))
"""Chain end to carried body, the base on either side, along one chain."""


def random_mechanism(rng: np.random.Generator) -> pin.Model:
    """Revolute, prismatic, revolute chain (joints 1 2 3); free flyer with a revolute (4 5)."""
    model = pin.Model()

    def add(parent: int, joint: pin.JointModel, name: str) -> int:
        return int(model.addJoint(parent, joint, pin.SE3.Random(), name))

    def axis() -> np.ndarray:
        direction = rng.standard_normal(3)
        return np.asarray(direction / np.linalg.norm(direction))

    pin.seed(int(rng.integers(2**31)))
    first = add(0, pin.JointModelRevoluteUnaligned(axis()), "r1")
    second = add(first, pin.JointModelPrismaticUnaligned(axis()), "p")
    add(second, pin.JointModelRZ(), "r2")
    add(add(0, pin.JointModelFreeFlyer(), "free"), pin.JointModelRevoluteUnaligned(axis()), "r3")
    return model


def random_configuration(model: pin.Model, rng: np.random.Generator) -> np.ndarray:
    return np.asarray(pin.integrate(model, pin.neutral(model), rng.standard_normal(model.nv)))


def allowed_motion(kind: str, rng: np.random.Generator) -> pin.SE3:
    """Pose of frame 2 in frame 1 that a joint of this kind allows."""
    turn, slide, tilt = rng.uniform(-2.5, 2.5), rng.uniform(-1, 1), rng.uniform(-2.5, 2.5)
    about_z = pin.exp3(np.array([0.0, 0.0, turn]))
    still, along_z = np.zeros(3), np.array([0.0, 0.0, slide])
    # frame 2's z axis is the second axis of the cross, at right angles to frame 1's z axis
    cross = about_z @ pin.exp3(np.array([np.pi / 2, 0.0, 0.0]))
    any_turn = pin.exp3(rng.standard_normal(3))
    return {
        "fixed": pin.SE3.Identity(),
        "revolute": pin.SE3(about_z, still),
        "prismatic": pin.SE3(np.eye(3), along_z),
        "cylindrical": pin.SE3(about_z, along_z),
        "universal": pin.SE3(cross @ pin.exp3(np.array([0.0, 0.0, tilt])), still),
        "spherical": pin.SE3(any_turn, still),
        "planar": pin.SE3(about_z, np.array([slide, tilt, 0.0])),
        "point_on_line": pin.SE3(any_turn, along_z),
        "in_plane": pin.SE3(any_turn, np.array([slide, tilt, 0.0])),
        "distance": pin.SE3(any_turn, ROD * pin.exp3(rng.standard_normal(3))[:, 0]),
    }[kind]


def free_twists(kind: str, motion: pin.SE3) -> np.ndarray:
    """Twists (6, freedoms) of frame 2, in frame 2, that leave a closed joint closed."""
    in_two = motion.rotation.T
    x, y, z = in_two.T
    zero, own = np.zeros(3), np.array([0.0, 0.0, 1.0])
    ball = [(zero, x), (zero, y), (zero, z)]
    rod = in_two @ motion.translation
    a, b = (x, y) if abs(rod @ z) > 0.5 * np.linalg.norm(rod) else (y, z)
    twists = {
        "fixed": [],
        "revolute": [(zero, z)],
        "prismatic": [(z, zero)],
        "cylindrical": [(z, zero), (zero, z)],
        "universal": [(zero, z), (zero, own)],
        "spherical": ball,
        "planar": [(x, zero), (y, zero), (zero, z)],
        "point_on_line": [(z, zero), *ball],
        "in_plane": [(x, zero), (y, zero), *ball],
        "distance": [(np.cross(rod, a), zero), (np.cross(rod, b), zero), *ball],
    }[kind]
    return np.array([np.concatenate(t) for t in twists]).reshape(-1, 6).T


def closure(kind: ClosureType, ids: tuple[int, int], one: pin.SE3, two: pin.SE3) -> Closure:
    sizes = {"length": ROD} if kind == "distance" else {}
    return Closure("loop", kind, ids[0], one, ids[1], two, f"body{ids[0]}", f"body{ids[1]}", sizes)


def frames(model: pin.Model, q: np.ndarray, loop: Closure) -> tuple[pin.SE3, pin.SE3]:
    data = model.createData()
    pin.forwardKinematics(model, data, q)
    return (
        data.oMi[loop.joint1] * loop.placement1,
        data.oMi[loop.joint2] * loop.placement2,
    )


def closed_at(
    model: pin.Model, q: np.ndarray, kind: ClosureType, ids: tuple[int, int], motion: pin.SE3
) -> Closure:
    """Closure whose frame 2 sits on frame 1 up to ``motion`` at ``q``."""
    data = model.createData()
    pin.forwardKinematics(model, data, q)
    one = pin.SE3.Random()
    return closure(kind, ids, one, data.oMi[ids[1]].actInv(data.oMi[ids[0]] * one * motion))


def difference(
    model: pin.Model, q: np.ndarray, function: Callable[[np.ndarray], np.ndarray]
) -> np.ndarray:
    """Central differences (rows, nv) of ``function`` along ``pin.integrate``."""
    step = 1e-6
    columns = []
    for direction in np.eye(model.nv):
        ahead = function(pin.integrate(model, q, step * direction))
        behind = function(pin.integrate(model, q, -step * direction))
        columns.append((ahead - behind) / (2.0 * step))
    return np.array(columns).T


def samples(
    kind: ClosureType, closed: bool, count: int, seed: int
) -> list[tuple[pin.Model, np.ndarray, Closure]]:
    """Random mechanisms with one closure each and configurations, all pairs of joints in turn."""
    rng = np.random.default_rng([seed, KINDS.index(kind), closed])
    found: list[tuple[pin.Model, np.ndarray, Closure]] = []
    while len(found) < count:
        ids = PAIRS[len(found) % len(PAIRS)]
        model = random_mechanism(rng)
        q = random_configuration(model, rng)
        if closed:
            loop = closed_at(model, q, kind, ids, allowed_motion(kind, rng))
        else:
            loop = closure(kind, ids, pin.SE3.Random(), pin.SE3.Random())
        one, two = frames(model, q, loop)
        if kind == "fixed" and np.linalg.norm(pin.log3(one.rotation.T @ two.rotation)) > (
            HALF_TURN_MARGIN
        ):
            continue
        found.append((model, q, loop))
    return found


@pytest.mark.parametrize("closed", [False, True], ids=["open", "closed"])
@pytest.mark.parametrize("kind", KINDS)
def test_jacobian_is_the_derivative_of_the_residual(
    kind: ClosureType, closed: bool, tol: Tolerances
) -> None:
    for model, q, loop in samples(kind, closed, SAMPLES, 1):
        space = Workspace(model, [loop])
        values, jacobian = space.evaluate(q)
        assert values.shape == (6 - JOINT_KINDS[kind].freedoms,)
        assert jacobian.shape == (values.size, model.nv)
        assert_close(space.residual(q), values, 1e-15, "residual alone and with the Jacobian")
        if closed:
            assert np.abs(values).max() < tol.closure
        expected = difference(model, q, space.residual)
        size = max(1.0, float(np.abs(jacobian).max()))
        assert_close(jacobian, expected, tol.finite_difference * size, loop.describe())


@pytest.mark.parametrize("closed", [False, True], ids=["open", "closed"])
@pytest.mark.parametrize("kind", KINDS)
def test_drift_is_the_rate_of_the_jacobian(
    kind: ClosureType, closed: bool, tol: Tolerances
) -> None:
    rng = np.random.default_rng(2)
    step = 1e-6
    for model, q, loop in samples(kind, closed, SAMPLES, 3):
        space = Workspace(model, [loop])
        v = rng.standard_normal(model.nv)
        ahead = space.evaluate(pin.integrate(model, q, step * v))[1].copy()
        behind = space.evaluate(pin.integrate(model, q, -step * v))[1].copy()
        expected = (ahead - behind) @ v / (2.0 * step)
        size = max(1.0, float(np.abs(ahead).max()) * float(v @ v))
        assert_close(space.drift(q, v), expected, tol.finite_difference * size, loop.describe())


def test_drift_does_not_depend_on_what_was_computed_before(tol: Tolerances) -> None:
    """Pinocchio keeps velocities of the last call in its data."""
    rng = np.random.default_rng(4)
    for kind in KINDS:
        ((model, q, loop),) = samples(kind, False, 1, 5)
        v = rng.standard_normal(model.nv)
        fresh = Workspace(model, [loop]).drift(q, v)
        used = Workspace(model, [loop])
        used.drift(random_configuration(model, rng), 10.0 * v)
        used.evaluate(q)
        assert_close(used.drift(q, v), fresh, 1e-12, kind)
        assert_close(used.drift(q, np.zeros(model.nv)), np.zeros(loop.rows), 1e-12, kind)


def test_several_closures_stack_in_order() -> None:
    """Kinds that take different ways through Pinocchio do not mix up their rows."""
    rng = np.random.default_rng(6)
    model = random_mechanism(rng)
    q = random_configuration(model, rng)
    v = rng.standard_normal(model.nv)
    order: tuple[ClosureType, ...] = (
        "revolute", "spherical", "fixed", "spherical", "planar", "distance", "universal",
        "spherical", "in_plane",
    )  # fmt: skip
    loops: list[Closure | Coupling] = [
        closure(kind, PAIRS[i % len(PAIRS)], pin.SE3.Random(), pin.SE3.Random())
        for i, kind in enumerate(order)
    ]
    loops.insert(3, coupling(model))
    together = Workspace(model, loops)
    alone = [Workspace(model, [loop]) for loop in loops]
    assert_close(together.residual(q), np.concatenate([w.residual(q) for w in alone]), 1e-15)
    assert_close(together.evaluate(q)[1], np.vstack([w.evaluate(q)[1] for w in alone]), 1e-15)
    assert_close(together.drift(q, v), np.concatenate([w.drift(q, v) for w in alone]), 1e-12)


def coupling(model: pin.Model) -> Coupling:
    """Last revolute follows the prismatic joint."""
    follower = CoupledJoint("r3", model.idx_qs[5], model.idx_vs[5], (0.0, 1.0))
    leader = CoupledJoint("p", model.idx_qs[2], model.idx_vs[2], (-0.3, 1.7))
    return Coupling("tie", "coupling", (follower, leader), length_row=False)


def test_coupling_row_is_linear_and_exact(tol: Tolerances) -> None:
    rng = np.random.default_rng(7)
    for _ in range(SAMPLES):
        model = random_mechanism(rng)
        q = random_configuration(model, rng)
        follower, leader = coupling(model).joints
        space = Workspace(model, [coupling(model)])
        values, jacobian = space.evaluate(q)
        assert_close(values, [q[follower.q] + 1.7 * q[leader.q] - 0.3], 1e-15)
        expected = difference(model, q, space.residual)
        assert_close(jacobian, expected, tol.finite_difference)
        assert_close(space.drift(q, rng.standard_normal(model.nv)), [0.0], 0.0)


@pytest.mark.parametrize("degrees", [(1, 1, 1, 1), (1, 5), (1, 3, 2)])
def test_couplings_of_any_joints_are_exact(degrees: tuple[int, ...], tol: Tolerances) -> None:
    """Linear in four joints, a polynomial of degree 5, and a sum of polynomials."""
    rng = np.random.default_rng([16, *degrees])
    step = 1e-5
    for _ in range(20):
        model = random_mechanism(rng)
        q, v = random_configuration(model, rng), rng.standard_normal(model.nv)
        joints = tuple(
            CoupledJoint(
                f"j{j}", model.idx_qs[j], model.idx_vs[j], tuple(rng.standard_normal(degree + 1))
            )
            for j, degree in zip((3, 2, 5, 1), degrees, strict=False)
        )
        space = Workspace(model, [Coupling("tie", "polynomial", joints, length_row=False)])
        expected = sum(np.polyval(part.coefficients[::-1], q[part.q]) for part in joints)
        values, jacobian = space.evaluate(q)
        assert_close(values, [expected], 1e-12)
        assert_close(space.residual(q), values, 0.0)
        size = max(1.0, float(np.abs(jacobian).max()))
        rates = difference(model, q, space.residual)
        assert_close(jacobian, rates, tol.finite_difference * size)
        ahead = space.evaluate(pin.integrate(model, q, step * v))[1] @ v
        behind = space.evaluate(pin.integrate(model, q, -step * v))[1] @ v
        drift = (ahead - behind) / (2.0 * step)
        size = max(1.0, float(np.abs(ahead).max()), abs(float(drift[0])))
        assert_close(space.drift(q, v), drift, tol.finite_difference * size)


def test_coupling_of_a_joint_to_itself_is_summed() -> None:
    """Both entries land in one column: neither overwrites the other."""
    model = random_mechanism(np.random.default_rng(8))
    joints = (CoupledJoint("r2", 2, 2, (0.0, 1.0)), CoupledJoint("r2", 2, 2, (0.0, -0.25)))
    tie = Coupling("tie", "linear", joints, length_row=False)
    jacobian = Workspace(model, [tie]).evaluate(pin.neutral(model))[1]
    assert jacobian[0, 2] == pytest.approx(0.75)


def test_point_closure_is_the_three_slides(tol: Tolerances) -> None:
    """The revolute closure's first rows are written out; the spherical one is Pinocchio's."""
    rng = np.random.default_rng(9)
    for model, q, loop in samples("spherical", False, SAMPLES, 10):
        slides = closure("revolute", (loop.joint1, loop.joint2), loop.placement1, loop.placement2)
        one, two = Workspace(model, [loop]), Workspace(model, [slides])
        v = rng.standard_normal(model.nv)
        assert_close(one.evaluate(q)[0], two.evaluate(q)[0][:3], tol.algebra)
        assert_close(one.evaluate(q)[1], two.evaluate(q)[1][:3], tol.algebra)
        assert_close(one.drift(q, v), two.drift(q, v)[:3], 1e3 * tol.algebra)
        frame1, frame2 = frames(model, q, loop)
        gap = frame1.rotation.T @ (frame2.translation - frame1.translation)
        assert_close(one.residual(q), gap, tol.algebra)


@pytest.mark.parametrize("kind", KINDS)
def test_freedoms_of_two_bodies(kind: ClosureType, tol: Tolerances) -> None:
    """What the rows leave free is what the cut joint leaves free, no more and no less."""
    rng = np.random.default_rng(11)
    model = pin.Model()
    for name in ("one", "two"):
        model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), name)
    for _ in range(20):
        q = random_configuration(model, rng)
        motion = allowed_motion(kind, rng)
        loop = closed_at(model, q, kind, (1, 2), motion)
        jacobian = Workspace(model, [loop]).evaluate(q)[1]
        s = np.linalg.svd(jacobian, compute_uv=False)
        assert s.size == 6 - JOINT_KINDS[kind].freedoms
        assert s[-1] > 1e-2 * s[0], "the rows are independent"
        twists = free_twists(kind, motion)
        assert twists.shape[1] == JOINT_KINDS[kind].freedoms
        in_joint = loop.placement2.action @ twists
        assert_close(
            jacobian[:, 6:] @ in_joint, np.zeros((s.size, JOINT_KINDS[kind].freedoms)), tol.algebra
        )
        # moving both bodies as one changes nothing
        data = model.createData()
        pin.forwardKinematics(model, data, q)
        common = rng.standard_normal(6)
        both = np.concatenate([data.oMi[i].inverse().action @ common for i in (1, 2)])
        assert_close(jacobian @ both, np.zeros(s.size), tol.algebra)


@pytest.mark.parametrize("kind", KINDS)
def test_mirrored_joints_are_detected(kind: ClosureType, tol: Tolerances) -> None:
    """Half a turn about an axis across: rows that are cosines vanish there as well."""
    rng = np.random.default_rng(12)
    model = random_mechanism(rng)
    q = random_configuration(model, rng)
    about = {"x": pin.exp3(np.array([np.pi, 0, 0])), "z": pin.exp3(np.array([0, 0, np.pi]))}
    for name, turn in about.items():
        motion = allowed_motion(kind, rng) * pin.SE3(turn, np.zeros(3))
        loop = closed_at(model, q, kind, (3, 5), motion)
        space = Workspace(model, [loop])
        mirrored = bool(JOINT_KINDS[kind].senses) and (name == "x" or kind == "prismatic")
        if kind != "fixed":
            assert np.abs(space.residual(q)).max() < tol.closure
        assert space.flipped(q) == ([loop.describe()] if mirrored else [])
    proper = closed_at(model, q, kind, (3, 5), allowed_motion(kind, rng))
    assert Workspace(model, [proper]).flipped(q) == []


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("ids", [(6, 1), (1, 6), (-1, 2), (2, -1), (1, 99), (10**6, 10**6)])
def test_joint_ids_out_of_range_are_refused(kind: ClosureType, ids: tuple[int, int]) -> None:
    """Pinocchio itself would crash the process."""
    model = random_mechanism(np.random.default_rng(13))
    with pytest.raises(ClosureError, match=r"'loop'.*names joint id .*joints 0 to 5"):
        Workspace(model, [closure(kind, ids, pin.SE3.Identity(), pin.SE3.Identity())])


@pytest.mark.parametrize("kind", KINDS)
def test_closure_within_one_body_has_no_jacobian(kind: ClosureType) -> None:
    """Base to base, or a body to itself: rows that nothing moves, not an error."""
    rng = np.random.default_rng(14)
    model = random_mechanism(rng)
    q = random_configuration(model, rng)
    for ids in ((0, 0), (3, 3)):
        loop = closure(
            kind, ids, pin.SE3(pin.exp3(0.3 * rng.standard_normal(3)), rng.standard_normal(3)),
            pin.SE3.Identity(),
        )  # fmt: skip
        values, jacobian = Workspace(model, [loop]).evaluate(q)
        assert np.isfinite(values).all()
        assert_close(jacobian, np.zeros((loop.rows, model.nv)), 1e-12, kind)
