"""Section 6 of the D1 paper: periodic inputs, three holes, a hexagon, against stored numbers."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from conftest import Tolerances, assert_close

import closedchain as cc
from closedchain.robots.d1 import (
    Pose,
    drill_waypoints,
    follow_inputs,
    geometry,
    hexagon_waypoints,
    inverse,
    periodic,
    rest_to_rest,
    scaled_screws,
    tasks,
    vertical_tool,
)
from closedchain.robots.d1.geometry import quaternion_from_rotation

G = geometry()
TIMES = np.linspace(0.0, 2.0 * np.pi, 201)
AXIS_TASK = "x y z rx rz"


def continued(m: cc.Mechanism, inputs: np.ndarray) -> list[np.ndarray]:
    """Postures of inputs (n, 6), each on the branch of the one before; home first."""
    found, q = [], m.home
    for row in inputs:
        q = cc.direct(m, row, guess=q).raise_if_failed().q
        found.append(q)
    return found


def one(batch: Pose, k: int) -> Pose:
    return Pose(batch.rotation[k], batch.position[k])


@pytest.fixture(scope="module")
def motion() -> tasks.Assemblies:
    return follow_inputs(periodic(TIMES, G).inputs, G)


# -- the periodic motion -------------------------------------------------------------------------


def test_rates_are_the_derivatives_of_the_inputs() -> None:
    step = 1e-5
    ahead, here, behind = (periodic(TIMES + s * step, G) for s in (1, 0, -1))
    assert_close((ahead.inputs - behind.inputs) / (2 * step), here.rates, 1e-10)
    assert_close((ahead.rates - behind.rates) / (2 * step), here.accelerations, 1e-10)


def test_periodic_motion_by_closed_form_is_the_reference(
    motion: tasks.Assemblies, reference: Callable[[str], Any], tol: Tolerances
) -> None:
    assert motion.converged.all()
    j1, j2, j3 = scaled_screws(motion.coupler, motion.platform, G)
    stored = reference("d1")["periodic"]
    for sample in stored["samples"]:
        k = round(sample["t"] * 100 / np.pi)
        assert_close(TIMES[k], sample["t"], 1e-12)
        assert_close(motion.inputs[k], [sample[f"q{i}"] for i in range(1, 7)], tol.reference)
        for name, pose in (("B", one(motion.coupler, k)), ("C", one(motion.platform, k))):
            quaternion = [sample[f"quat{name}_{c}"] for c in "wxyz"]
            position = [sample[f"p{name}_{c}"] for c in "xyz"]
            assert_close(pose.position, position, tol.reference)
            assert_close(quaternion_from_rotation(pose.rotation), quaternion, tol.reference)
        tip = [sample[f"tip_{c}"] for c in "xyz"]
        assert_close(tasks.tip(one(motion.platform, k), G), tip, tol.reference)
        assert_close(tasks.torsion(one(motion.platform, k)), sample["torsionC"], tol.reference)
        dets = [float(np.linalg.det(j[k])) for j in (j1, j2, j3)]
        assert_close(dets, [sample[f"detJ{i}"] for i in (1, 2, 3)], tol.reference)
    for name, values in (
        ("detJ1", np.linalg.det(j1)),
        ("detJ2", np.linalg.det(j2)),
        ("detJ3", np.linalg.det(j3)),
        ("sminJ2", np.linalg.svd(j2, compute_uv=False)[:, -1]),
        ("tiltB_deg", np.degrees(tasks.tilt(motion.coupler))),
        ("tiltC_deg", np.degrees(tasks.tilt(motion.platform))),
        ("torsion_deg", np.degrees(tasks.torsion(motion.platform))),
    ):
        # the reference tells the extremes with 10 to 13 digits
        assert_close([values.min(), values.max()], stored[name], 2e-6, name)


def test_periodic_motion_by_continuation_is_the_closed_form(
    d1: cc.Mechanism, motion: tasks.Assemblies
) -> None:
    for k, q in enumerate(continued(d1, periodic(TIMES, G).inputs)):
        for name, batch in (("coupler", motion.coupler), ("platform", motion.platform)):
            placed = d1.pose(q, name)
            assert_close(placed.translation, batch.position[k], 1e-10)
            assert_close(placed.rotation, batch.rotation[k], 1e-10)


def test_velocities_and_accelerations_of_the_periodic_motion(
    d1: cc.Mechanism, reference: Callable[[str], Any], tol: Tolerances
) -> None:
    for sample in reference("d1")["periodic"]["samples"]:
        at = periodic(sample["t"], G)
        q = continued(d1, periodic(np.linspace(0.0, sample["t"], 12), G).inputs)[-1]
        found = cc.acceleration(d1, q, at.rates[0], at.accelerations[0])
        twist = [sample[f"{n}_{c}"] for n in ("vtip", "omega") for c in "xyz"]
        second = [sample[f"{n}_{c}"] for n in ("atip", "alpha") for c in "xyz"]
        assert_close(found.tip_twist, twist, tol.reference)
        assert_close(found.tip_acceleration, second, tol.reference)


def test_torsion_refutes_five_degrees_of_freedom(motion: tasks.Assemblies) -> None:
    """A robot of five freedoms that keeps omega.n = 0 would show no torsion at all."""
    degrees = np.degrees(tasks.torsion(motion.platform))
    assert degrees.min() == pytest.approx(-2.561, abs=1e-3)
    assert degrees.max() == pytest.approx(1.843, abs=1e-3)
    # each stage for itself keeps its torsion angle at zero
    assert np.abs(tasks.torsion(motion.coupler)).max() < 1e-12
    relative = np.swapaxes(motion.coupler.rotation, 1, 2) @ motion.platform.rotation
    assert np.abs(tasks.torsion(Pose(relative, motion.platform.position))).max() < 1e-12
    assert cc.mobility(cc.load("d1")).mobility == 6


@pytest.mark.parametrize("variant", ["printed_u", "circle_u"])
def test_periodic_motion_of_the_variants(
    variant: str, reference: Callable[[str], Any], tol: Tolerances
) -> None:
    g, stored = geometry(variant), reference("d1")["periodic"][variant]
    m = cc.load("d1", variant=variant)
    found = continued(m, periodic(TIMES, g).inputs)
    assert_close(m.point(found[50], "T"), stored["tip_at_pi_2"], tol.reference)
    coupler, platform = (
        Pose(np.array([p.rotation for p in placed]), np.array([p.translation for p in placed]))
        for placed in ([m.pose(q, name) for q in found] for name in ("coupler", "platform"))
    )
    _, j2, _ = scaled_screws(coupler, platform, g)
    smallest = np.linalg.svd(j2, compute_uv=False)[:, -1].min()
    assert_close(smallest, stored["sminJ2"], 2e-6)


def test_rows_without_a_clear_next_assembly_are_refused() -> None:
    home = periodic(0.0, G).inputs[0]
    short, mirrored = home.copy(), home.copy()
    short[0] = 0.01  # S1 stays 0.05 m or more away from R1
    with pytest.raises(ValueError, match="row 1 of the inputs has no real assembly"):
        follow_inputs(np.array([home, short]), G)
    mirrored[:3] = 0.16  # the coupler close to the base, above or below it
    with pytest.raises(ValueError, match="row 1 of the inputs is too far from the row before"):
        follow_inputs(np.array([home, mirrored]), G)


# -- vertical tool -------------------------------------------------------------------------------


def test_drilling_is_the_reference(reference: Callable[[str], Any], tol: Tolerances) -> None:
    stored = reference("d1")["task_drill"]
    assert_close(drill_waypoints(), stored["waypoints"], 1e-12)
    times, tips = rest_to_rest(drill_waypoints())
    assert times.shape == (201,)
    assert_close([times[0], times[-1]], [0.0, 10.0], 1e-12)
    found = vertical_tool(tips, G)
    assert found.converged.all()
    assert_close(found.inputs[::20], stored["q_at_waypoints"], tol.reference)
    assert_close(found.inputs.min(axis=0), stored["q_min"], tol.reference)
    assert_close(found.inputs.max(axis=0), stored["q_max"], tol.reference)
    tilt = np.degrees(tasks.tilt(found.coupler)).max()
    assert_close(tilt, stored["tiltB_max_deg"], tol.reference)
    j1, j2, _ = scaled_screws(found.coupler, found.platform, G)
    for matrices, name in ((j1, "sminJ1_min"), (j2, "sminJ2_min")):
        assert_close(np.linalg.svd(matrices, compute_uv=False).min(), stored[name], tol.reference)


def locked_singular_value(m: cc.Mechanism, q: np.ndarray) -> float:
    """Smallest one of (q1, q2, q4, q5, q6) -> tip and tool axis, rotations times 0.18 m."""
    twist_map = cc.velocity(m, q, AXIS_TASK).twist_map
    assert twist_map is not None
    scaled = np.diag([1.0, 1.0, 1.0, 0.18, 0.18]) @ np.delete(twist_map, 2, axis=1)
    return float(np.linalg.svd(scaled, compute_uv=False)[-1])


@pytest.mark.parametrize("corners", [drill_waypoints, hexagon_waypoints])
def test_a_task_by_continuation_is_the_closed_form(
    d1: cc.Mechanism,
    corners: Callable[[], np.ndarray],
    reference: Callable[[str], Any],
    tol: Tolerances,
) -> None:
    _, tips = rest_to_rest(corners())
    found = vertical_tool(tips, G)
    assert found.converged.all()
    assert_close(found.inputs[:, 2], np.full(201, found.inputs[0, 2]), 1e-14)  # locked
    worst = np.inf
    for k, q in enumerate(continued(d1, found.inputs)):
        assert_close(d1.point(q, "T"), tips[k], 1e-10)
        assert_close(d1.pose(q).rotation, np.eye(3), 1e-10)  # the tool stays vertical
        assert_close(d1.point(q, "coupler"), found.coupler.position[k], 1e-10)
        worst = min(worst, locked_singular_value(d1, q))
    stored = reference("d1")["task_drill"]
    if corners is drill_waypoints:
        assert_close(worst, stored["smin_task_locked_min"], tol.reference)
    else:
        cut = corners()[2:9]
        assert_close(cut[:, 1], np.full(7, cut[0, 1]), 1e-14)
        radii = np.linalg.norm(cut[:, [0, 2]], axis=1)  # as long as the sides of a hexagon
        assert_close(np.linalg.norm(np.diff(cut, axis=0), axis=1), radii[:6], 1e-14)
        assert_close(radii, np.full(7, tasks.HEXAGON_RADIUS), 1e-14)
    assert worst > 0.597
    assert np.degrees(tasks.tilt(found.coupler)).max() < 9.7


def test_a_task_point_lies_in_the_self_motion_of_its_tool_pose() -> None:
    """The elimination finds the same coupler among all those that hold the vertical tool."""
    _, tips = rest_to_rest(hexagon_waypoints(), samples=4)
    found = vertical_tool(tips, G)
    for k in range(1, len(tips) - 1, 5):
        (family,) = inverse(one(found.platform, k), G).self_motions
        assert family.kind == "tool_vertical"
        members = family.members(float(found.coupler.position[k, 1]))
        assert min(np.abs(a.q - found.inputs[k]).max() for a in members) < 1e-9


def test_hexagon() -> None:
    corners = hexagon_waypoints()
    cut = corners[2:9]
    assert_close(cut[0], cut[-1], 1e-15)
    assert_close(np.linalg.norm(np.diff(cut, axis=0), axis=1), np.full(6, 0.04), 1e-15)
    assert_close(cut[:, 1], np.full(7, -1.02), 0.0)
    assert_close(corners[[0, -1]], np.array([[0.0, -1.0, 0.0]] * 2), 0.0)


@pytest.mark.parametrize(("locked", "free"), [(0, True), (1, True), (3, False), (5, False)])
def test_only_legs_of_the_coupler_can_be_locked(d1: cc.Mechanism, locked: int, free: bool) -> None:
    """The paper lets any of the six inputs be the redundant one; q4, q5, q6 cannot be."""
    _, tips = rest_to_rest(drill_waypoints(), samples=2)
    for q in continued(d1, vertical_tool(tips, G).inputs)[::4]:
        twist_map = cc.velocity(d1, q, AXIS_TASK).twist_map
        assert twist_map is not None
        values = np.linalg.svd(np.delete(twist_map, locked, axis=1), compute_uv=False)
        assert values[-1] > 1e-3 if free else values[-1] < 1e-10
        found = cc.redundancy(d1, q, AXIS_TASK)
        assert found.dimension == 1
        lock = found.locks[(d1.inputs[locked],)]
        assert lock > 1e-3 if free else lock < 1e-10
        # what is left over needs the inputs that can be locked, and no others
        assert bool(abs(found.inputs[locked, 0]) > 1e-3) is free


def test_tasks_out_of_reach_do_not_converge() -> None:
    tips = np.array([[0.0, -1.0, 0.0], [0.01, -1.0, 0.0]])
    assert vertical_tool(tips, G).converged.all()
    found = vertical_tool(tips, G, q3=0.01)  # S3 stays 0.05 m or more away from R3
    assert not found.converged.any()
    assert np.isfinite(found.inputs).all()
