"""Singular sets in the workspace and with further inputs, against each robot's closed forms."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from singular_points import at_value, check_points, joint, with_inputs

import closedchain as cc
from closedchain.robots import linear_delta as ld
from closedchain.robots import rpa3t
from closedchain.robots.eclipse import Geometry as EclipseGeometry
from closedchain.robots.eclipse import actuator_jacobian, direct_determinant
from closedchain.robots.rus6 import Pose, det_jx, geometry, inverse, j_q

DEGREE = np.pi / 180.0


def hinges(m: cc.Mechanism, q: np.ndarray) -> np.ndarray:
    return np.array([joint(m, q, f"{leg}_R") for leg in "abc"])


# -- Eclipse ---------------------------------------------------------------------------------------

TILT = {"tilt": np.linspace(0.3, 1.5, 17), "azimuth": np.linspace(-np.pi, np.pi, 25)}


@pytest.fixture(scope="module")
def eclipse() -> cc.Mechanism:
    return cc.load("eclipse")


@pytest.fixture(scope="module")
def tilts(eclipse: cc.Mechanism) -> cc.SingularitySet:
    return cc.singularity_set(eclipse, "direct", TILT)


@pytest.mark.parametrize(
    ("azimuth", "tilt"),
    [(0.0, 69.9786165), (30.0, 54.0070), (60.0, 48.1896851), (-90.0, 54.0070), (120.0, 69.9786165)],
)
def test_tilts_of_eclipse(
    eclipse: cc.Mechanism, tilts: cc.SingularitySet, azimuth: float, tilt: float
) -> None:
    found = at_value(eclipse, tilts, "azimuth", azimuth * DEGREE)
    assert found[1] == pytest.approx(azimuth * DEGREE, abs=1e-12)
    assert found[0] / DEGREE == pytest.approx(tilt, abs=5e-5 if azimuth % 60 else 1e-7)


def test_direct_curve_of_eclipse(eclipse: cc.Mechanism, tilts: cc.SingularitySet) -> None:
    check_points(eclipse, tilts, TILT)
    assert tilts.missed == 0
    assert len(tilts.pieces) == 1  # once round, from azimuth -pi to pi
    assert tilts.ends == (("edge of the range", "edge of the range"),)
    assert tilts.on_branch.all()
    assert (tilts.coordinates[:, 0] / DEGREE).min() > 48.18968
    assert (tilts.coordinates[:, 0] / DEGREE).max() < 69.97862
    g = EclipseGeometry()
    for q in tilts.q[::10]:
        assert abs(direct_determinant(eclipse.input_values(q), hinges(eclipse, q), g)) < 1e-9


@pytest.mark.slow
def test_inverse_curve_of_eclipse() -> None:
    """Some S_j on the axis (rho_j = 0), or some link square to its column (sin q_rj = 0)."""
    m, g = cc.load("eclipse", r=0.15), EclipseGeometry(r=0.15)
    over = {"x": np.linspace(-0.085, 0.08, 12), "y": np.linspace(-0.083, 0.082, 12)}
    found = cc.singularity_set(m, "inverse", over)
    check_points(m, found, over)
    assert len(found.q) > 20
    assert found.missed == 0
    for q in found.q:
        values = actuator_jacobian(m.input_values(q), hinges(m, q), g)
        assert np.abs(values).min() < 1e-8


@pytest.mark.slow
def test_direct_surface_of_eclipse(eclipse: cc.Mechanism) -> None:
    over = {
        "x": np.linspace(-0.03, 0.03, 4),
        "tilt": np.linspace(0.6, 1.4, 12),
        "azimuth": np.linspace(-0.8, 0.9, 9),
    }
    found = cc.singularity_set(eclipse, "direct", over)
    check_points(eclipse, found, over)
    assert found.verdict == "surface"
    assert found.dropped == 0
    (triangles,) = found.pieces
    assert len(triangles) > 100
    # at x = 0 it passes through the tilt of azimuth 0
    place = at_value(eclipse, found, "tilt", 69.9786165 * DEGREE, np.array([0.0, 1.22, 0.0]))
    assert place[1] == pytest.approx(69.9786165 * DEGREE, abs=1e-12)


@pytest.mark.parametrize(
    ("driven", "points"),
    [
        # the leg that is not driven decides: its plane and the plate's fall together at 48.19
        # degrees; with a alone driven, b and c, which are not, meet S_a at 69.98 degrees
        (("a_R",), [(69.9786165, 0.0), (48.1896851, 60.0), (48.1896851, -60.0)]),
        (("b_R", "c_R"), [(48.1896851, 180.0)]),
        (("a_R", "b_R", "c_R"), []),
    ],
    ids=["one", "two", "three"],
)
def test_eclipse_with_driven_hinges(
    eclipse: cc.Mechanism, driven: tuple[str, ...], points: list[tuple[float, float]]
) -> None:
    m = with_inputs(eclipse, *driven)
    found = cc.singularity_set(m, "direct", TILT)
    check_points(m, found, TILT)
    assert found.verdict == ("isolated" if points else "none found")
    assert f"{len(driven) + 1} conditions on 2 coordinates" in found.note
    folded = found.coordinates / DEGREE
    folded[:, 1] = np.where(folded[:, 1] < -179.999, folded[:, 1] + 360.0, folded[:, 1])
    assert {(round(t, 5), round(a, 5) + 0.0) for t, a in folded} == {
        (round(t, 5), round(a, 5)) for t, a in points
    }


# -- rpa3t -----------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def parallel() -> cc.Mechanism:
    return cc.load("rpa3t")


def factors(m: cc.Mechanism, q: np.ndarray) -> dict[str, float]:
    """Factors of det A and det B at a posture, by name."""
    g = rpa3t.Geometry()
    p = m.point(q, "P")
    theta = m.input_values(q)
    sine = p[1] / g.l7
    beta = np.arctan2(sine, -np.sqrt(max(0.0, 1.0 - sine**2)))
    best: dict[str, float] = {}
    for b in (beta, np.pi - beta):
        x = np.array([p[0] - g.l2 - g.l7 * np.cos(b), p[2] - 2.0 * g.l6, b])
        if np.abs(rpa3t.residuals(x, theta, g)).max() < 1e-6:
            f = rpa3t.factors(x, theta, g)
            best = {n: float(getattr(f, n)) for n in ("sin_beta", "kappa", "M", "cos_beta")}
            best |= {n: float(getattr(f, n)) for n in ("s1", "s2", "s3", "drop")}
    return best


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "names", "over", "expected"),
    [
        (
            "direct",
            ("sin_beta", "kappa", "M"),
            {"x": np.linspace(0.0, 0.6, 9), "y": np.linspace(-0.045, 0.02, 7)},
            {"sin_beta", "kappa"},
        ),
        (
            "inverse",
            ("cos_beta", "s1", "s2", "s3"),
            {"x": np.linspace(-0.5, 0.85, 13), "z": np.linspace(-1.05, -0.42, 11)},
            {"s1", "s2", "s3"},
        ),
        (
            "inverse",
            ("cos_beta", "s1", "s2", "s3"),
            {"x": np.linspace(0.0, 0.2, 5), "y": np.linspace(-0.07, -0.02, 9)},
            {"cos_beta"},
        ),
    ],
    ids=["direct", "inverse", "output"],
)
def test_surfaces_of_rpa3t(
    parallel: cc.Mechanism,
    kind: str,
    names: tuple[str, ...],
    over: dict[str, np.ndarray],
    expected: set[str],
) -> None:
    at = {"z": -0.45} if kind == "direct" else {}
    found = cc.singularity_set(parallel, kind, over, at)
    check_points(parallel, found, over)
    assert found.missed == 0
    seen = set()
    for q in found.q[found.on_branch]:
        f = factors(parallel, q)
        least = min(names, key=lambda n: abs(f[n]))
        assert abs(f[least]) < 1e-7
        seen.add(least)
    assert seen == expected


@pytest.mark.slow
def test_parallel_rods_of_rpa3t(parallel: cc.Mechanism) -> None:
    """M = 0 on the branch of home: a simple zero, which the determinant crosses."""
    over = {
        "x": np.linspace(0.80, 0.88, 6),
        "y": np.linspace(-0.045, -0.012, 4),
        "z": np.linspace(-0.37, -0.34, 3),
    }
    found = cc.singularity_set(parallel, "direct", over)
    check_points(parallel, found, over)
    assert found.verdict == "surface"
    assert found.missed == 0
    assert len(found.q) > 10
    for q in found.q[found.on_branch]:
        f = factors(parallel, q)
        assert abs(f["M"]) < 1e-9 < min(abs(f["kappa"]), abs(f["sin_beta"]))
    theta = np.array([parallel.input_values(q) for q in found.q])
    assert np.abs(rpa3t.parallel_rods(theta, rpa3t.Geometry())).max() < 1e-12


@pytest.mark.slow
def test_constraint_curve_of_rpa3t(parallel: cc.Mechanism) -> None:
    """Level rods: the closures themselves lose rank, and with them all that holds them."""
    over = {"x": np.linspace(0.72, 0.9, 7), "z": np.linspace(-0.36, -0.3, 6)}
    found = cc.singularity_set(parallel, "constraint", over)
    check_points(parallel, found, over)
    assert found.verdict == "curve"
    assert len(found.q) > 5
    assert set(found.kinds) == {frozenset({"constraint", "direct"})}  # no output is lost
    for q in found.q:
        assert abs(factors(parallel, q)["drop"]) < 1e-8
    inverse = cc.singularity_set(parallel, "inverse", over)
    check_points(parallel, inverse, over)
    # level rods lose no output, so they are no points of the inverse set
    assert len(inverse.q) > 0
    assert not any("constraint" in kinds for kinds in inverse.kinds)
    assert inverse.missed == 0


# -- linear Delta ----------------------------------------------------------------------------------


@pytest.mark.slow
def test_sets_of_the_linear_delta() -> None:
    """No direct set with all sliders on one side; inverse where a rod is horizontal."""
    m, g = cc.load("linear_delta"), ld.Geometry()
    over = {"x": np.linspace(-0.38, 0.37, 9), "y": np.linspace(-0.37, 0.38, 9)}
    none = cc.singularity_set(m, "direct", over)
    assert none.verdict == "none found"
    assert none.missed == 0
    found = cc.singularity_set(m, "inverse", over)
    check_points(m, found, over)
    assert found.missed == 0
    drops = []
    for q in found.q:
        bhat = ld.rods(m.point(q, "P"), m.input_values(q), g)
        drops.append(np.abs(ld.inverse_factors(bhat)))
    assert np.min(drops, axis=1).max() < 1e-9
    assert set(np.argmin(drops, axis=1)) == {0, 1, 2}


@pytest.mark.parametrize("mode", ["+-+", "-+-"])
def test_direct_curve_of_the_linear_delta_in_a_mixed_mode(mode: str) -> None:
    """Rods on both sides become coplanar; the sheet's opposed rods are one point of the curve."""
    m, g = cc.load("linear_delta"), ld.Geometry()
    over = {"x": np.linspace(-0.2, 0.21, 12), "y": np.linspace(-0.2, 0.22, 12)}
    found = cc.singularity_set(m, "direct", over, mode=mode)
    check_points(m, found, over)
    assert found.verdict == "curve"
    assert found.missed == 0
    assert found.on_branch.all()
    for q in found.q:
        bhat = ld.rods(m.point(q, "P"), m.input_values(q), g)
        assert abs(ld.direct_factor(bhat)) < 1e-10
        assert np.abs(ld.inverse_factors(bhat)).min() > 1e-3
    opposed = ld.opposed_rods(g, 0, 1)
    root = at_value(m, found, "x", float(opposed[0]), opposed[:2])
    assert root == pytest.approx(opposed[:2], abs=1e-9)


# -- rus6 ------------------------------------------------------------------------------------------


def legs_of(m: cc.Mechanism, q: np.ndarray) -> object:
    pose = m.pose(q)
    return inverse(Pose(pose.rotation, pose.translation), float(joint(m, q, "leg1_F")), geometry())


@pytest.mark.slow
@pytest.mark.parametrize(
    ("turn", "angle"),
    [("ry", 87.5923188294), ("ry", -84.853552183), ("rz", 40.5006836262), ("rx", 42.695811785)],
)
def test_direct_roots_of_rus6(turn: str, angle: float) -> None:
    """Yaw, pitch (rz) and roll (rx) with the platform at home's place and beta held at zero."""
    m = cc.load("rus6")
    turns = np.linspace(angle - 9.0, angle + 8.0, 7) * DEGREE
    over = {turn: turns, "y": np.linspace(-0.57, -0.53, 5)}
    found = cc.singularity_set(m, "direct", over, {"beta": 0.0})
    check_points(m, found, over)
    assert found.missed == 0
    assert found.verdict == "curve"
    root = at_value(m, found, "y", -0.55, np.array([angle * DEGREE, -0.55]))
    assert root[0] / DEGREE == pytest.approx(angle, abs=1e-8)
    for q in found.q[::4]:
        assert abs(det_jx(legs_of(m, q))) < 1e-9  # type: ignore[arg-type]


@pytest.mark.slow
def test_inverse_set_of_rus6_is_a_curve_in_spite_of_its_codimension() -> None:
    """[K; J] is 26 x 27, two conditions; but a stretched leg of M2 is one, whatever beta does."""
    m = cc.load("rus6")
    over = {"x": np.linspace(-0.1, 0.11, 9), "y": np.linspace(-0.81, -0.7, 9)}
    found = cc.singularity_set(m, "inverse", over, {"beta": 0.0})
    check_points(m, found, over)
    assert found.verdict == "curve"
    assert "2 conditions on 2 coordinates" in found.note
    for q in found.q[found.on_branch]:
        lines = j_q(legs_of(m, q))  # type: ignore[arg-type]
        assert np.abs(lines[3:]).min() < 1e-7


def test_twists_of_the_set(eclipse: cc.Mechanism, tilts: cc.SingularitySet) -> None:
    """At 48.19 degrees the plate turns about the line of the two other joints."""
    i = int(np.abs(tilts.coordinates[:, 0] - tilts.coordinates[:, 0].min()).argmin())
    (twist,) = tilts.free_twists[i].T
    pin.forwardKinematics(eclipse.model, eclipse.model.createData(), tilts.q[i])
    assert np.linalg.norm(twist[3:]) > 0.1 * np.linalg.norm(twist[:3])
    assert tilts.lost_twists[i].shape == (6, 0)
