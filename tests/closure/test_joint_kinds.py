"""The table of joint kinds: every entry by itself, over floats, arrays, jets and expressions."""

from __future__ import annotations

from typing import Any, get_args

import numpy as np
import pinocchio as pin
import pytest
from conftest import Tolerances, assert_close
from hypothesis import given
from hypothesis import strategies as st

from closedchain.closure.joint_kinds import JOINT_KINDS, TREE_KINDS, JointKind
from closedchain.closure.tape.expression import Graph, Tape
from closedchain.closure.tape.jets import Jet, jets, parts
from closedchain.urdf.description import CLOSURE_TYPES, JOINT_TYPES, ClosureType

KINDS = tuple(JOINT_KINDS.values())
SIZES = {"length": 0.7}
ids = [kind.name for kind in KINDS]


def gap(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Origin (3,) and rotation (3, 3), by less than half a turn."""
    return rng.standard_normal(3), pin.exp3(rng.uniform(-1.5, 1.5, 3))


def forces(kind: JointKind, p: Any, r: Any, sizes: Any = SIZES) -> np.ndarray:
    """Wrenches (rows, 6) as numbers."""
    return np.array([[*f, *m] for f, m in kind.wrenches(p, r, sizes)], dtype=float)


def run(tape: Tape, inputs: np.ndarray) -> np.ndarray:
    """Evaluate a tape of sums and products on numbers."""
    known: list[Any] = []
    plain = {
        "add": lambda a, b: a + b, "sub": lambda a, b: a - b, "mul": lambda a, b: a * b,
        "neg": lambda a: -a, "recip": lambda a: 1.0 / a,
    }  # fmt: skip
    for op, *args in tape.nodes:
        if op == "const":
            known.append(args[0])
        elif op == "input":
            known.append(inputs[args[0]])
        else:
            known.append(plain[op](*(known[i] for i in args)))
    return np.array([known[i] for i in tape.outputs])


def test_the_table_has_every_type_that_the_reader_knows() -> None:
    assert tuple(JOINT_KINDS) == CLOSURE_TYPES == get_args(ClosureType)
    assert set(TREE_KINDS) == set(JOINT_TYPES)
    assert len({kind.symbol for kind in KINDS}) == len(KINDS)


@pytest.mark.parametrize("kind", KINDS, ids=ids)
def test_counts_of_an_entry_agree(kind: JointKind) -> None:
    p, r = gap(np.random.default_rng(1))
    assert len(kind.values(p, r, SIZES)) == len(kind.wrenches(p, r, SIZES)) == kind.rows
    assert len(kind.translational) == kind.rows
    assert sorted(kind.translational, reverse=True) == list(kind.translational), "lengths first"
    assert len(kind.screws) == sum(kind.parts) == kind.freedoms == 6 - kind.rows


@pytest.mark.parametrize("kind", KINDS, ids=ids)
def test_wrenches_are_the_derivatives_of_the_values(kind: JointKind, tol: Tolerances) -> None:
    rng = np.random.default_rng(2)
    step = 1e-6
    for _ in range(50):
        p, r = gap(rng)

        def moved(twist: np.ndarray, p: np.ndarray = p, r: np.ndarray = r) -> np.ndarray:
            here = p + twist[:3], pin.exp3(twist[3:]) @ r
            return np.array(kind.values(*here, SIZES))

        expected = [(moved(step * e) - moved(-step * e)) / (2.0 * step) for e in np.eye(6)]
        found = forces(kind, p, r)
        size = max(1.0, float(np.abs(found).max()))
        assert_close(found, np.array(expected).T, tol.finite_difference * size, kind.name)


@pytest.mark.parametrize("kind", KINDS, ids=ids)
def test_lengths_scale_with_the_unit(kind: JointKind) -> None:
    """p, sizes and the rows that are lengths in another unit; wrenches keep their dimensions."""
    p, r = gap(np.random.default_rng(3))
    unit, lengths = 0.31, np.array(kind.translational)
    small = {name: size / unit for name, size in SIZES.items()}
    values = np.array(kind.values(p, r, SIZES))
    assert_close(kind.values(p / unit, r, small), np.where(lengths, values / unit, values), 1e-14)
    force, moment = np.split(forces(kind, p, r), 2, axis=1)
    scaled = forces(kind, p / unit, r, small)
    assert_close(scaled[lengths, :3], force[lengths], 1e-14)
    assert_close(scaled[~lengths, 3:], moment[~lengths], 1e-14)
    assert not force[~lengths].any()
    assert not moment[lengths].any()


@pytest.mark.parametrize("kind", KINDS, ids=ids)
def test_any_number_type_gives_the_same(kind: JointKind, tol: Tolerances) -> None:
    rng = np.random.default_rng(4)
    many = [gap(rng) for _ in range(5)]
    stacked_p = np.array([p for p, _ in many]).T
    stacked_r = np.array([r for _, r in many]).transpose(1, 2, 0)
    values = kind.values(list(stacked_p), [list(row) for row in stacked_r], SIZES)
    graph = Graph()
    inputs = graph.inputs(0, 12)
    rows = [inputs[3:6], inputs[6:9], inputs[9:12]]
    written = kind.values(inputs[:3], rows, SIZES)
    wrenches = kind.wrenches(inputs[:3], rows, SIZES)
    tape = graph.tape([*written, *(x for f, m in wrenches for x in (*f, *m))], 12)
    for i, (p, r) in enumerate(many):
        plain = kind.values(p.tolist(), r.tolist(), SIZES)
        assert_close([value[i] for value in values], plain, 1e-15)
        found = run(tape, np.concatenate([p, r.ravel()]))
        assert_close(found[: kind.rows], plain, tol.algebra)
        assert_close(found[kind.rows :].reshape(-1, 6), forces(kind, p, r), tol.algebra)


@pytest.mark.parametrize("kind", KINDS, ids=ids)
def test_jets_carry_the_rates_of_the_wrenches(kind: JointKind, tol: Tolerances) -> None:
    rng = np.random.default_rng(5)
    step = 1e-6
    p, r = gap(rng)
    v, w = rng.standard_normal((2, 3))
    moving = [jets(row, rate) for row, rate in zip(r, pin.skew(w) @ r, strict=True)]
    wrenches = kind.wrenches(jets(p, v), moving, SIZES)
    found = np.array([[rate for _, rate in parts([*f, *m])] for f, m in wrenches])
    ahead = forces(kind, p + step * v, pin.exp3(step * w) @ r)
    behind = forces(kind, p - step * v, pin.exp3(-step * w) @ r)
    size = max(1.0, float(np.abs(found).max()))
    assert_close(found, (ahead - behind) / (2.0 * step), tol.finite_difference * size)
    values = kind.values(jets(p, v), moving, SIZES)
    expected = forces(kind, p, r) @ np.concatenate([v, w])
    assert_close([rate for _, rate in parts(values)], expected, tol.algebra)


@given(st.floats(0.2, 5), st.floats(-5, 5), st.floats(0.2, 5), st.floats(-5, 5))
def test_jets_follow_the_rules_of_derivatives(a: float, da: float, b: float, db: float) -> None:
    x, y = Jet(a, da), Jet(b, db)
    for found, value, rate in (
        (x + y, a + b, da + db),
        (3.0 - x, 3.0 - a, -da),
        (x - 2.0, a - 2.0, da),
        (x * y, a * b, da * b + a * db),
        (2.0 * x, 2.0 * a, 2.0 * da),
        (x / y, a / b, (da * b - a * db) / b**2),
        (2.0 / x, 2.0 / a, -2.0 * da / a**2),
    ):
        assert found.value == pytest.approx(value, abs=1e-12)
        assert found.rate == pytest.approx(rate, rel=1e-9, abs=1e-9)


def test_rotation_rows_of_a_fixed_joint_are_log6_to_first_order() -> None:
    """The error of the Rodrigues vector is of third order, and it only vanishes at rest."""
    kind = JOINT_KINDS["fixed"]
    rng = np.random.default_rng(6)
    axis = rng.standard_normal(3)
    axis /= np.linalg.norm(axis)
    misses = []
    for angle in (1e-2, 2e-2):
        rotation = pin.exp3(angle * axis)
        found = kind.values([0.0, 0.0, 0.0], rotation, {})[3:]
        assert_close(found, 2.0 * np.tan(angle / 2.0) * axis, 1e-14)
        misses.append(np.linalg.norm(np.array(found) - pin.log3(rotation)))
    assert misses[1] / misses[0] == pytest.approx(8.0, rel=1e-2)
    for angle in (0.1, 1.0, 2.0, 3.0, 3.14):
        found = kind.values([0.0, 0.0, 0.0], pin.exp3(angle * axis), {})[3:]
        assert np.linalg.norm(found) > angle
    at_rest = forces(kind, [0.0, 0.0, 0.0], np.eye(3))
    assert_close(at_rest, pin.Jlog6(pin.SE3.Identity()), 1e-15)


@pytest.mark.parametrize("kind", KINDS, ids=ids)
def test_free_screws_are_what_the_rows_leave(kind: JointKind, tol: Tolerances) -> None:
    """At closed gaps the twists of the screws are independent and no row sees them."""
    rng = np.random.default_rng(7)
    for _ in range(20):
        p, r = closed_gap(kind.name, rng)
        assert_close(kind.values(p, r, SIZES), np.zeros(kind.rows), 1e-14)
        twists = np.array([[*v, *w] for v, w in kind.twists(p, r)]).reshape(-1, 6)
        if kind.name == "distance":
            assert np.linalg.svd(twists, compute_uv=False)[-1] > 0.2
        else:
            assert_close(twists @ twists.T, np.eye(kind.freedoms), tol.algebra, "orthonormal")
        wrenches = forces(kind, p, r).reshape(-1, 6)
        assert_close(wrenches @ twists.T, np.zeros((kind.rows, kind.freedoms)), tol.algebra)
        slides = [not np.any(w) for _, w in kind.twists(p, r)]
        assert slides == [screw.is_length for screw in kind.screws]


def closed_gap(kind: str, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    a, b, angle, tilt = rng.uniform(-1.5, 1.5, 4)
    about_z, any_turn = pin.exp3(np.array([0, 0, angle])), pin.exp3(rng.uniform(-1.5, 1.5, 3))
    cross = about_z @ pin.exp3(np.array([np.pi / 2, 0, 0])) @ pin.exp3(np.array([0, 0, tilt]))
    still, along, within = np.zeros(3), np.array([0, 0, a]), np.array([a, b, 0])
    return {
        "fixed": (still, np.eye(3)),
        "revolute": (still, about_z),
        "prismatic": (along, np.eye(3)),
        "cylindrical": (along, about_z),
        "universal": (still, cross),
        "spherical": (still, any_turn),
        "planar": (within, about_z),
        "point_on_line": (along, any_turn),
        "in_plane": (within, any_turn),
        "distance": (SIZES["length"] * any_turn[0], any_turn),
    }[kind]
