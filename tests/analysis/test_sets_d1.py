"""Singular curves, points and surfaces of D1 in joint space, against the stages' determinants."""

from __future__ import annotations

import numpy as np
import pytest
from singular_points import check_points

import closedchain as cc
from closedchain.analysis.singularity.maps.grid import OK
from closedchain.analysis.singularity.sets.bordered import Measure
from closedchain.analysis.singularity.sets.slices import Slice
from closedchain.closure.charting import chart_of
from closedchain.closure.solve.solution_set import settle
from closedchain.robots.d1 import Pose, geometry, planes1, planes2, scaled_screws

G = geometry()
AXIS = np.linspace(0.35, 0.70, 25)
FIRST = {"q1": AXIS, "q2": AXIS}
SECOND = {"q4": AXIS, "q5": AXIS}
SPACE = {name: np.linspace(0.42, 0.62, 8) for name in ("q1", "q2", "q3")}


def poses(m: cc.Mechanism, q: np.ndarray) -> tuple[Pose, Pose]:
    """Coupler and platform."""
    found = [m.pose(q, name) for name in ("coupler", "platform")]
    return tuple(Pose(p.rotation, p.translation) for p in found)  # type: ignore[return-value]


def determinants(m: cc.Mechanism, q: np.ndarray) -> np.ndarray:
    """det J1, J2, J3, scaled."""
    return np.array([np.linalg.det(j) for j in scaled_screws(*poses(m, q), G)])


def four_planes(m: cc.Mechanism, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Planes (4, 4) of the two stages."""
    coupler, platform = poses(m, q)
    return planes1(coupler, G), planes2(coupler, platform, G)


def shared_point(planes: np.ndarray) -> float:
    """Least singular value (share of the largest) of planes: zero where they share a point."""
    s = np.linalg.svd(planes * [1.0, 1.0, 1.0, 10.0], compute_uv=False)
    return float(s[-1] / s[0])


@pytest.fixture(scope="module")
def direct(d1: cc.Mechanism) -> cc.SingularitySet:
    return cc.singularity_set(d1, "direct", FIRST)


@pytest.fixture(scope="module")
def inverse(d1: cc.Mechanism) -> cc.SingularitySet:
    return cc.singularity_set(d1, "inverse", FIRST)


@pytest.mark.slow
def test_direct_curves_are_those_of_a_stage(d1: cc.Mechanism, direct: cc.SingularitySet) -> None:
    """Planes of three limbs and of the body that they carry share a point: det J1 det J2 = 0."""
    check_points(d1, direct, FIRST)
    for q in direct.q[::3]:
        assert min(shared_point(m) for m in four_planes(d1, q)) < 1e-9
        assert np.abs(determinants(d1, q)[:2]).min() < 1e-8
    assert direct.missed == 0
    assert direct.verdict == "curve"
    assert {end for ends in direct.ends for end in ends} <= {"closed", "edge of the range"}


@pytest.mark.slow
def test_direct_curve_bounds_the_branch_where_it_says_so(
    d1: cc.Mechanism, direct: cc.SingularitySet
) -> None:
    """From home straight on, the branch is lost at the first point that is on it."""
    home = d1.input_values(d1.home)
    on = direct.coordinates[direct.on_branch]
    assert 0 < len(on) < len(direct.q)
    for point in on[:: len(on) // 6]:
        towards = point - home[:2]
        inside, outside = (home[:2] + s * towards for s in (0.99, 1.01))
        assert cc.direct(d1, [*inside, *home[2:]]).converged
        assert not cc.direct(d1, [*outside, *home[2:]]).converged


@pytest.mark.slow
def test_inverse_curves_are_three_lines_that_cross_at_home(
    d1: cc.Mechanism, inverse: cc.SingularitySet
) -> None:
    check_points(d1, inverse, FIRST)
    h = d1.input_values(d1.home)[0]
    x, y = inverse.coordinates.T
    assert np.min(np.abs([x - h, y - h, x - y]), axis=0).max() < 1e-8
    assert len(inverse.pieces) == 3
    assert inverse.ends == (("closed", "closed"),) * 3  # back on another sheet
    assert inverse.missed == 0
    crossings = inverse.coordinates[inverse.branch_points]
    at_home = np.linalg.norm(crossings - h, axis=1) < 1e-4
    for piece in inverse.pieces:
        assert np.isin(inverse.branch_points[at_home], piece).any()
    for q in inverse.q[::5]:
        assert abs(determinants(d1, q)[2]) < 1e-8
    # what the branch reaches lies inside its boundary: the lines' ends are the combined points
    cut = inverse.of_branch()
    assert len(cut.pieces) == 3
    assert {end for ends in cut.ends for end in ends} == {"leaves the branch"}


@pytest.mark.slow
def test_combined_points(d1: cc.Mechanism) -> None:
    found = cc.singularity_set(d1, "combined", FIRST, check=False)
    check_points(d1, found, FIRST)
    assert len(found.q) == 6
    assert found.verdict == "isolated"
    assert found.dimension == 0
    for q in found.q:
        dets = determinants(d1, q)
        assert np.abs(dets[:2]).min() < 1e-8
        assert abs(dets[2]) < 1e-8


@pytest.mark.slow
def test_slice_that_is_inversely_singular_everywhere(d1: cc.Mechanism) -> None:
    whole = cc.singularity_set(d1, "inverse", SECOND)
    assert whole.everywhere
    assert whole.verdict == "everywhere"
    assert len(whole.q) == 0
    found = cc.singularity_set(d1, "combined", SECOND)
    check_points(d1, found, SECOND)
    assert "everywhere" in found.note
    assert len(found.q) > 50
    for q in found.q[::7]:
        dets = determinants(d1, q)
        assert shared_point(four_planes(d1, q)[1]) < 1e-9
        assert abs(dets[1]) < 1e-8
        assert abs(dets[2]) < 1e-8


@pytest.mark.slow
def test_every_sign_change_of_a_finer_map_lies_beside_the_set(
    d1: cc.Mechanism, inverse: cc.SingularitySet
) -> None:
    """An independent map, not the one that the check itself walks."""
    fine = np.linspace(AXIS[0], AXIS[-1], 2 * AXIS.size - 1)
    cells = cc.singularity_map(d1, {"q1": fine, "q2": fine}, progress=False)
    det = np.where(cells["status"] == OK, cells["det_inverse"], np.nan)
    cell = AXIS[1] - AXIS[0]
    seen = 0
    for one, two, axis in ((det[:-1], det[1:], 0), (det[:, :-1], det[:, 1:], 1)):
        for i, j in np.argwhere(one * two < 0.0):
            middle = np.array([fine[i], fine[j]])
            middle[axis] += 0.25 * cell
            gaps = np.linalg.norm(inverse.coordinates - middle, axis=1)
            assert gaps.min() < cell
            seen += 1
    assert seen > 50


def test_coarse_grid_misses_and_the_check_finds(d1: cc.Mechanism) -> None:
    """Three cells see no sign change across a pair of lines; a grid twice as fine does."""
    h = d1.input_values(d1.home)[0]
    over = {"q1": np.array([h - 0.02, h + 0.0201, h + 0.06]), "q3": np.array([h - 0.02, h + 0.019])}
    at = {"q2": h + 0.01}
    found = cc.singularity_set(d1, "inverse", over, at)
    check_points(d1, found, over)
    assert found.missed == 0
    q1, q3 = found.coordinates.T
    q2 = h + 0.01
    assert np.min(np.abs([q1 - q2, q3 - q2, q1 - q3]), axis=0).max() < 1e-7
    lines = set(np.argmin(np.abs([q1 - q2, q3 - q2, q1 - q3]), axis=0))
    assert lines == {0, 1, 2}


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "which"), [("direct", [0, 1]), ("inverse", [2])])
def test_surfaces(d1: cc.Mechanism, kind: str, which: list[int]) -> None:
    found = cc.singularity_set(d1, kind, SPACE)
    check_points(d1, found, SPACE)
    assert found.dimension == 2
    assert found.verdict == "surface"
    assert found.dropped <= 0.02 * len(found.q)
    assert found.missed == 0
    triangles = np.concatenate(found.pieces)
    assert len(triangles) > 80
    edges = np.sort(np.concatenate([triangles[:, i] for i in ([0, 1], [1, 2], [2, 0])]))
    _, shared = np.unique(edges, axis=0, return_counts=True)
    assert shared.max() <= 2
    for q in found.q[::5]:
        assert np.abs(determinants(d1, q)[which]).min() < 1e-8


@pytest.mark.slow
def test_combined_curves_in_space(d1: cc.Mechanism) -> None:
    found = cc.singularity_set(d1, "combined", SPACE)
    check_points(d1, found, SPACE)
    assert found.dimension == 1
    assert found.verdict == "curve"
    assert len(found.q) > 30
    for q in found.q[::5]:
        dets = determinants(d1, q)
        assert np.abs(dets[:2]).min() < 1e-8
        assert abs(dets[2]) < 1e-8


# -- higher codimension ----------------------------------------------------------------------------

AXIS_TASK = "x y z rx rz"


@pytest.fixture(scope="module")
def rank_four(d1: cc.Mechanism) -> np.ndarray:
    """Posture in which the five-output task has rank 4, far from home."""
    draws = np.random.default_rng(0).uniform(-0.12, 0.12, (8, 6))
    start = cc.direct(d1, d1.input_values(d1.home) + draws[7]).raise_if_failed().q
    measure = Measure(d1, "inverse", d1.outputs(AXIS_TASK))
    system = Slice(chart_of(d1, ("q1", "q2", "q4", "q5"), start), (measure,))
    z = settle(system, system.point(start))
    assert z.good
    return system.posture(z.posture)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("names", "verdict"), [(("q1", "q2"), "isolated"), (("q1", "q2", "q6"), "curve")]
)
def test_axis_task_loses_rank_on_a_set_of_codimension_two(
    d1: cc.Mechanism, rank_four: np.ndarray, names: tuple[str, ...], verdict: str
) -> None:
    here = dict(zip(d1.inputs, d1.input_values(rank_four), strict=True))
    over = {name: np.linspace(here[name] - 0.0013, here[name] + 0.0011, 7) for name in names}
    found = cc.singularity_set(d1, "inverse", over, rank_four, outputs=AXIS_TASK)
    check_points(d1, found, over, AXIS_TASK)
    assert found.verdict == verdict
    assert found.dimension == len(names) - 2
    apart = np.abs(found.coordinates - [here[name] for name in names]).max(axis=1)
    assert apart.min() < (1e-7 if verdict == "isolated" else 1e-3)
    if verdict == "isolated":
        assert len(found.q) == 1
        assert cc.redundancy(d1, found.q[0], AXIS_TASK).dimension == 2  # 1 where it is regular


def test_axis_task_is_regular_around_home(d1: cc.Mechanism) -> None:
    over = {name: np.linspace(0.48, 0.56, 7) for name in ("q1", "q2")}
    found = cc.singularity_set(d1, "inverse", over, outputs=AXIS_TASK)
    assert found.verdict == "none found"
    assert len(found.q) == 0
    assert "2 conditions on 2 coordinates" in found.note


# -- requests --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("kind", "over", "message"),
    [
        ("serial", FIRST, "unknown kind of singularity 'serial'"),
        ("direct", {"q1": AXIS}, "two coordinates to vary"),
        ("direct", {}, "two coordinates to vary"),
        ("direct", {f"q{i}": AXIS for i in range(1, 5)}, "two coordinates to vary"),
        ("direct", {"q1": AXIS, "q9": AXIS}, "unknown coordinate 'q9'"),
        ("direct", {"q1": AXIS, "q2": AXIS[::-1]}, "rising"),
        ("direct", {"q1": AXIS, "q2": np.array([1.3, 1.4])}, "cannot be reached"),
    ],
)
def test_bad_requests_are_refused(
    d1: cc.Mechanism, kind: str, over: dict[str, np.ndarray], message: str
) -> None:
    with pytest.raises(cc.ClosureError, match=message):
        cc.singularity_set(d1, kind, over)


def test_progress_is_reported(d1: cc.Mechanism) -> None:
    seen: list[tuple[str, int, int]] = []
    axis = np.linspace(0.51, 0.535, 4)
    cc.singularity_set(
        d1, "inverse", {"q1": axis, "q2": axis}, progress=lambda *what: seen.append(what)
    )
    assert {what for what, _, _ in seen} >= {"following the branch", "tracing inverse curves"}
    assert all(0 <= done <= total for _, done, total in seen)
