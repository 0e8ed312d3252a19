"""The mechanism as an object, on D1: sizes, names, home, copies, threads, other parsers."""

from __future__ import annotations

import copy
import io
import pickle
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
import yourdfpy
from conftest import Reference, Tolerances, assert_close

import closedchain as cc
from closedchain.urdf.errors import ClosureError

VARIANTS = ("corrected", "printed_u", "circle_u")


def random_posture(m: cc.Mechanism, seed: int, size: float = 0.5) -> np.ndarray:
    """A configuration near home, not closed."""
    rng = np.random.default_rng(seed)
    v = size * rng.standard_normal(m.model.nv)
    return np.asarray(pin.integrate(m.model, m.home, v))


# -- sizes, names, home ---------------------------------------------------------------------------


def test_sizes(d1: cc.Mechanism) -> None:
    assert (d1.model.nq, d1.model.nv, d1.rows) == (35, 33, 27)
    assert len(d1.closures) == 9
    assert d1.inputs == ("q1", "q2", "q3", "q4", "q5", "q6")
    assert d1.passive_v.size == 27
    assert d1.task is not None
    assert d1.task.tip == "T"
    assert d1.task.outputs == ("x", "y", "z", "rx", "ry", "rz")
    assert d1.length == 0.18
    assert all(closure.kind == "spherical" for closure in d1.closures)
    ends = [(s.start, s.stop) for s in d1.row_slices]
    assert ends == [(3 * i, 3 * i + 3) for i in range(9)]
    jacobian = cc.constraint_jacobian(d1, d1.home)
    assert jacobian.shape == (27, 33)
    assert cc.residual(d1, d1.home).shape == (27,)


@pytest.mark.parametrize("variant", VARIANTS)
def test_home_is_closed_with_the_stored_leg_lengths(
    variant: str, reference: Reference, tol: Tolerances
) -> None:
    m = cc.load("d1", variant=variant)
    ref = reference("d1")
    expected = ref["home"]["q"] if variant == "corrected" else (
        ref["geometry"]["variants_home_q"][variant]
    )  # fmt: skip
    assert np.abs(cc.residual(m, m.home)).max() < tol.closure
    assert_close(m.input_values(m.home), expected, tol.reference, variant)
    legs = [np.linalg.norm(m.point(m.home, f"S{i}") - m.point(m.home, f"R{i}")) for i in (1, 2, 3)]
    legs += [
        np.linalg.norm(m.point(m.home, f"S{i}") - m.point(m.home, f"U{i - 3}")) for i in (4, 5, 6)
    ]
    assert_close(m.input_values(m.home), legs, tol.closure, "inputs read leg lengths")


def test_named_points_at_home(d1: cc.Mechanism, reference: Reference, tol: Tolerances) -> None:
    ref = reference("d1")
    home, geometry = ref["home"], ref["geometry"]
    for i in range(6):
        assert_close(d1.point(d1.home, f"S{i + 1}"), home["S"][i], tol.reference, f"S{i + 1}")
    for i in range(3):
        assert_close(d1.point(d1.home, f"R{i + 1}"), geometry["R1_3"][i], tol.reference)
        assert_close(d1.point(d1.home, f"R{i + 4}"), home["R4_6"][i], tol.reference)
        assert_close(d1.point(d1.home, f"U{i + 1}"), geometry["U1_3"][i], tol.reference)
    assert_close(d1.point(d1.home, "T"), home["tip"], tol.reference)
    assert_close(d1.point(d1.home, "coupler"), home["pB"], tol.reference)
    assert_close(d1.point(d1.home, "platform"), home["pC"], tol.reference)
    assert_close(d1.pose(d1.home).translation, home["tip"], tol.reference, "default frame: the tip")
    assert_close(d1.pose(d1.home, "base").homogeneous, np.eye(4), 0.0, "the base is the world")


@pytest.mark.parametrize("variant", VARIANTS[1:])
def test_points_of_the_variants(variant: str, reference: Reference, tol: Tolerances) -> None:
    m = cc.load("d1", variant=variant)
    points = reference("d1")["geometry"]["variants_U"][variant]
    if variant == "circle_u":
        assert_close(m.point(m.home, "U1"), points[0], tol.reference)
    for i in range(3):
        assert_close(m.point(m.home, f"U{i + 1}"), points[i], tol.reference, f"U{i + 1}")


def test_home_and_parameters_are_read_only(d1: cc.Mechanism) -> None:
    with pytest.raises(ValueError, match="read-only"):
        d1.home[0] = 1.0
    with pytest.raises(TypeError):
        d1.parameters["tip"] = 1.0  # type: ignore[index]
    with pytest.raises(AttributeError):
        d1.name = "other"  # type: ignore[misc]


def test_a_result_is_not_overwritten_by_the_next_call(d1: cc.Mechanism) -> None:
    """Pinocchio's data are reused; what is handed out must not change under the caller."""
    q = random_posture(d1, 1)
    results = [
        cc.residual(d1, q), cc.constraint_jacobian(d1, q), d1.pose(q).homogeneous,
        d1.pose(q, "base").homogeneous, d1.point(q, "S1"), d1.input_values(q),
    ]  # fmt: skip
    kept = [r.copy() for r in results]
    other = random_posture(d1, 2)
    cc.residual(d1, other)
    cc.constraint_jacobian(d1, other)
    d1.pose(other)
    d1.point(other, "S1")
    for result, copied in zip(results, kept, strict=True):
        assert_close(result, copied, 0.0)


# -- copies and threads ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    "duplicate",
    [lambda m: pickle.loads(pickle.dumps(m)), copy.copy, copy.deepcopy],
    ids=["pickle", "copy", "deepcopy"],
)
def test_copies_compute_the_same(
    d1: cc.Mechanism, duplicate: Callable[[cc.Mechanism], cc.Mechanism]
) -> None:
    cc.residual(d1, d1.home)  # scratch data exist: they must not travel
    m = duplicate(d1)
    assert (m.name, m.inputs, dict(m.parameters)) == (d1.name, d1.inputs, dict(d1.parameters))
    q = random_posture(d1, 3)
    v = np.random.default_rng(3).standard_normal(d1.model.nv)
    assert_close(cc.residual(m, q), cc.residual(d1, q), 0.0)
    assert_close(cc.constraint_jacobian(m, q), cc.constraint_jacobian(d1, q), 0.0)
    assert_close(cc.constraint_drift(m, q, v), cc.constraint_drift(d1, q, v), 0.0)
    target = d1.input_values(d1.home) + 0.01
    assert_close(cc.direct(m, target).q, cc.direct(d1, target).q, 0.0)
    assert not m.home.flags.writeable
    with pytest.raises(TypeError):
        m.parameters["tip"] = 1.0  # type: ignore[index]


def test_solution_travels_between_processes(d1: cc.Mechanism) -> None:
    s = cc.direct(d1, d1.input_values(d1.home) + 0.01)
    again = pickle.loads(pickle.dumps(s))
    assert (again.converged, again.message, again.rank) == (s.converged, s.message, s.rank)
    assert_close(again.q, s.q, 0.0)


def test_threads_get_the_numbers_of_a_serial_run(d1: cc.Mechanism) -> None:
    """Two threads share the mechanism; each has its own scratch data."""
    home = d1.input_values(d1.home)
    rng = np.random.default_rng(4)
    targets = [home + rng.uniform(-0.015, 0.015, 6) for _ in range(150)]

    def work(target: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        q = cc.direct(d1, target).q
        return q, cc.constraint_jacobian(d1, q)

    serial = [work(t) for t in targets]
    interval = sys.getswitchinterval()
    sys.setswitchinterval(1e-5)  # switch often: a shared buffer would show
    try:
        with ThreadPoolExecutor(2) as pool:
            parallel = list(pool.map(work, targets))
    finally:
        sys.setswitchinterval(interval)
    for (q, jacobian), (q_serial, jacobian_serial) in zip(parallel, serial, strict=True):
        assert_close(q, q_serial, 0.0)
        assert_close(jacobian, jacobian_serial, 0.0)


# -- Pinocchio and other parsers ------------------------------------------------------------------

REDUCE = """
import numpy as np, pinocchio as pin, closedchain as cc
m = cc.load("d1")
keep = {"leg1_R", "leg1_P", "leg4_P", "coupler_pose"}
lock = [i for i in range(1, m.model.njoints) if m.model.names[i] not in keep]
reduced = pin.buildReducedModel(m.model, lock, np.array(m.home))
data, q = reduced.createData(), pin.neutral(reduced)
for name in keep:
    here, there = (x.joints[x.getJointId(name)] for x in (reduced, m.model))
    q[here.idx_q:here.idx_q + here.nq] = m.home[there.idx_q:there.idx_q + there.nq]
pin.framesForwardKinematics(reduced, data, q)
off = max(
    np.abs(data.oMf[reduced.getFrameId(n)].homogeneous - m.pose(m.home, n).homogeneous).max()
    for n in m.frame_ids
)
print(reduced.nq, reduced.nv, off < 1e-12)
"""


def test_reduced_model() -> None:
    """Pinocchio's own reduction works on the tree (it crashes where joint frames are missing)."""
    done = subprocess.run(
        [sys.executable, "-c", REDUCE], capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == ["10", "9", "True"]


def joint_values(m: cc.Mechanism, q: np.ndarray) -> dict[str, np.ndarray]:
    return {
        name: q[joint.idx_q : joint.idx_q + joint.nq]
        for name, joint in zip(list(m.model.names)[1:], list(m.model.joints)[1:], strict=True)
    }


def test_pinocchio_reads_the_text_and_places_every_link(d1: cc.Mechanism, tol: Tolerances) -> None:
    """The expanded text is URDF to a parser that knows nothing of closures."""
    model = pin.buildModelFromXML(d1.description.text)
    assert (model.nq, model.nv) == (d1.model.nq, d1.model.nv)
    q = random_posture(d1, 5)
    other = pin.neutral(model)
    for name, value in joint_values(d1, q).items():
        joint = model.joints[model.getJointId(name)]
        other[joint.idx_q : joint.idx_q + joint.nq] = value
    data = model.createData()
    pin.framesForwardKinematics(model, data, other)
    for link in d1.description.links:
        placed = data.oMf[model.getFrameId(link.name)].homogeneous
        assert_close(placed, d1.pose(q, link.name).homogeneous, tol.closure, link.name)


def test_yourdfpy_reads_the_text_and_places_every_link(d1: cc.Mechanism, tol: Tolerances) -> None:
    """yourdfpy keeps floating joints at identity: compared is each link against its floating body.

    Links that no floating joint carries are compared against the base, so all are covered.
    """
    urdf = yourdfpy.URDF.load(
        io.BytesIO(d1.description.text.encode()), load_meshes=False, build_scene_graph=True
    )
    q = random_posture(d1, 6)
    values = joint_values(d1, q)
    urdf.update_cfg({n: float(values[n][0]) for n in urdf.actuated_joint_names if n in values})
    one_dof = {name for name, value in values.items() if value.size == 1}
    assert one_dof <= set(urdf.actuated_joint_names)
    carrier = {joint.child: joint for joint in d1.description.joints}
    compared = 0
    for link in d1.description.links:
        body = link.name
        while body in carrier and carrier[body].type != "floating":
            body = carrier[body].parent
        expected = d1.pose(q, body).actInv(d1.pose(q, link.name)).homogeneous
        placed = urdf.get_transform(frame_to=link.name, frame_from=body)
        assert_close(placed, expected, 1e-11, f"{link.name} from {body}")
        compared += link.name != body
    assert compared == len(d1.description.links) - 3  # base, coupler, platform


# -- malformed arguments --------------------------------------------------------------------------


def broken_configurations(m: cc.Mechanism) -> list[tuple[Any, str]]:
    quaternion = np.array(m.home)
    quaternion[3:7] *= 1.01
    flat = np.array(m.home)
    flat[3:7] = 0.0
    nan, infinite = np.array(m.home), np.array(m.home)
    nan[7], infinite[8] = np.nan, np.inf
    return [
        (m.home[:-1], r"configuration q must have shape \(35,\) \(nq\), got \(34,\)"),
        (np.zeros(33), r"must have shape \(35,\).*got \(33,\)"),
        (np.zeros((1, 35)), r"must have shape \(35,\).*got \(1, 35\)"),
        (0.0, r"must have shape \(35,\)"),
        (None, "configuration q must"),
        (nan, r"not finite, at index \[7\]"),
        (infinite, r"not finite, at index \[8\]"),
        (["a"] * 35, "configuration q must be 35 numbers"),
        ([[0.0], [0.0, 1.0]], "configuration q must be 35 numbers"),
        ({"q": 1.0}, "configuration q must be 35 numbers"),
        (m.home + 1j, "configuration q must be 35 numbers"),
        (["0.5"] * 35, "configuration q must be 35 numbers"),
        (quaternion, r"q\[3:7\] is a quaternion .* of norm 1\.01"),
        (flat, r"q\[3:7\] is a quaternion .* of norm 0"),
    ]


@pytest.mark.parametrize("case", range(14))
def test_malformed_configurations_are_refused(d1: cc.Mechanism, case: int) -> None:
    q, message = broken_configurations(d1)[case]
    calls: list[Callable[[], Any]] = [
        lambda: cc.residual(d1, q),
        lambda: cc.constraint_jacobian(d1, q),
        lambda: cc.constraint_drift(d1, q, np.zeros(33)),
        lambda: d1.input_values(q),
        lambda: d1.pose(q),
        lambda: d1.point(q, "S1"),
    ]
    if q is not None:  # no guess is home
        calls += [
            lambda: cc.direct(d1, [0.5] * 6, guess=q),
            lambda: cc.inverse(d1, pin.SE3.Identity(), guess=q),
            lambda: cc.close(d1, guess=q),
        ]
    for call in calls:
        with pytest.raises(ClosureError, match=message):
            call()


@pytest.mark.parametrize("v", [np.zeros(35), np.full(33, np.nan), ["a"] * 33, np.zeros((33, 1))])
def test_malformed_velocities_are_refused(d1: cc.Mechanism, v: Any) -> None:
    with pytest.raises(ClosureError, match="velocity v"):
        cc.constraint_drift(d1, d1.home, v)


def test_integers_and_other_layouts_are_read(d1: cc.Mechanism) -> None:
    expected = cc.residual(d1, d1.home)
    strided = np.repeat(d1.home, 2)[::2]
    for q in (list(d1.home), tuple(d1.home), strided):
        assert_close(cc.residual(d1, q), expected, 0.0)
    assert_close(cc.residual(d1, d1.home.astype(np.float32)), expected, 1e-6)


def test_unknown_frames_list_the_known_ones(d1: cc.Mechanism) -> None:
    with pytest.raises(ClosureError, match=r"S7.*S1") as caught:
        d1.point(d1.home, "S7")
    assert "coupler" in str(caught.value)
    for name in ("", "leg1_R", "universe", "s1"):
        with pytest.raises(ClosureError, match="frame"):
            d1.pose(d1.home, name)


def test_outputs(d1: cc.Mechanism) -> None:
    every = ("x", "y", "z", "rx", "ry", "rz")
    assert d1.outputs() == every
    assert d1.outputs("rz x") == ("x", "rz"), "in the order of the six"
    assert d1.outputs("x,y, z") == ("x", "y", "z")
    assert d1.outputs(["rx", "rz", "x"]) == ("x", "rx", "rz")
    assert d1.outputs(every) == every
    for bad, message in (
        ("x y w", "w"),
        ("x x", "distinct"),
        ("", "at least one"),
        ((), "at least one"),
        ("X", "X"),
    ):
        with pytest.raises(ClosureError, match=message):
            d1.outputs(bad)


def test_repr_is_one_line(d1: cc.Mechanism) -> None:
    assert repr(d1) == (
        "Mechanism('d1': nq 35, nv 33, 9 closures with 27 rows, inputs q1 q2 q3 q4 q5 q6)"
    )


def test_inertia_that_no_body_has_is_refused_by_name() -> None:
    # positive entries, yet no body: the principal moments are -1 and 3
    text = """<robot name="r"><link name="base"/><link name="arm"><inertial><mass value="1"/>
      <inertia ixx="1" ixy="2" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
      <joint name="j" type="revolute"><parent link="base"/><child link="arm"/>
      <limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>"""
    with pytest.raises(cc.DescriptionError, match=r"name='arm'.*principal moments -1 to 3"):
        cc.load_urdf(text)
