"""Singular or not is decided by distance, and everything that depends on it agrees."""

from __future__ import annotations

from collections.abc import Callable

import linkage_text
import linkages
import numpy as np
import pinocchio as pin
import pytest
from conftest import assert_close

import closedchain as cc
from closedchain.analysis.singularity.bulk.measuring import bulk_measures
from closedchain.closure.generic import dimensionless_task
from closedchain.closure.joint_rates import orthonormal_motions, physical_rates
from closedchain.closure.ranks import null_space
from closedchain.closure.solve.samples import closed_samples
from closedchain.robots.d1.geometry import RADIAL, TANGENT


def tilted(m: cc.Mechanism, tilt: float) -> np.ndarray:
    """D1 with its first stage tilted by an angle [rad] about an axis in between two symmetries."""
    axis = np.array([np.cos(np.radians(40.0)), 0.0, np.sin(np.radians(40.0))])
    turn = pin.exp3(tilt * axis)
    # the guides shift the stage sideways, eq. (2) of the paper, on a ring of 0.1 m
    along = (TANGENT * (RADIAL @ turn.T)).sum(axis=1)
    middle = -0.1 * 2.0 / 3.0 * along @ TANGENT + np.array([0.0, -0.5, 0.0])
    end = middle + turn @ np.array([0.0, -0.25, 0.0])
    place = {"coupler": pin.SE3(turn, middle), "platform": pin.SE3(turn, end)}
    return cc.close(m, place=place).raise_if_failed().q


def agree(m: cc.Mechanism, q: np.ndarray) -> cc.Classification:
    """``classify``, with ``redundancy`` and ``velocity`` saying the same."""
    c, r, v = cc.classify(m, q), cc.redundancy(m, q), cc.velocity(m, q)
    generic = cc.classify(m, closed_samples(m)[-1])
    assert not generic.kinds, "the comparison is with a regular posture"
    motions = m.model.nv - c.ranks["constraint"].value
    assert r.dimension == motions - c.ranks["inverse"].value
    assert m.passive_v.size - v.rank.value == motions - c.ranks["direct"].value
    if not c.types & {"RO", "IIM"} and generic_map(m):
        assert v.twist_map is not None
    if "RO" in c.types:
        assert v.twist_map is None
    for kind, near in c.nearest.items():
        assert near.here == (kind in c.kinds)
        assert near.distance >= 0.0
        assert near.accuracy > 0.0
    assert (c.distance <= c.accuracy) == bool(c.kinds)
    return c


def generic_map(m: cc.Mechanism) -> bool:
    return cc.velocity(m, closed_samples(m)[-1]).twist_map is not None


# -- zeros of third order ------------------------------------------------------------------------


@pytest.mark.parametrize("tilt", [0.02, 0.0125, 0.0085, 0.005, 1e-3, 1e-4])
def test_a_tiny_singular_value_is_regular_where_no_singular_posture_is_near(
    tilt: float, d1: cc.Mechanism
) -> None:
    """The value grows with the cube of the tilt: 5.4837177e-9 at 0.0085 rad with 50 digits."""
    q = tilted(d1, tilt)
    c = agree(d1, q)
    assert c.kinds == frozenset()
    value = np.linalg.svd(stacked(d1, q), compute_uv=False)[-1]
    assert value == pytest.approx(5.4837177e-9 * (tilt / 0.0085) ** 3, rel=0.02)
    # tilted, other motions lead to singular postures, some 0.277 tilt^2 away
    assert c.distance == pytest.approx(0.2766 * tilt**2, rel=0.02)
    assert c.distance > 2.0 * c.accuracy
    assert c.ranks["inverse"].value == 6


def test_the_distance_is_where_the_determinant_changes_its_sign(d1: cc.Mechanism) -> None:
    """Beside a regular posture with a value of 1e-7, by its slope in all closed motions."""
    q = tilted(d1, 0.02)
    distance = cc.classify(d1, q).distance
    basis, _ = null_space(cc.constraint_jacobian(d1, q) * d1.column_scale)
    unit = orthonormal_motions(basis, physical_rates(d1, q))
    at = lambda v: det_inverse(d1, q, v)  # noqa: E731
    slope = np.array([(at(1e-6 * v) - at(-1e-6 * v)) / 2e-6 for v in unit.T])
    steepest = unit @ slope / np.linalg.norm(slope)
    here, sign = at(0.0 * steepest), -np.sign(at(0.0 * steepest))
    assert abs(here) / np.linalg.norm(slope) == pytest.approx(distance, rel=0.01)
    assert here * at(sign * 0.97 * distance * steepest) > 0.0
    assert here * at(sign * 1.03 * distance * steepest) < 0.0
    rng = np.random.default_rng(3)
    for _ in range(30):
        v = unit @ rng.standard_normal(6)
        v *= 0.97 * distance / np.linalg.norm(physical_rates(d1, q) @ v)
        assert here * at(v) > 0.0, "no singular posture is nearer"


def test_home_is_singular(d1: cc.Mechanism) -> None:
    for tilt in (0.0, 1e-6, 2e-5):
        c = agree(d1, tilted(d1, tilt))
        assert c.kinds == {"inverse"}
        assert c.distance < 1e-9


def stacked(m: cc.Mechanism, q: np.ndarray) -> np.ndarray:
    """[K; J], dimensionless."""
    k = cc.constraint_jacobian(m, q) * m.column_scale / m.row_scale[:, None]
    return np.vstack([k, dimensionless_task(m, q, m.outputs())])


def det_inverse(m: cc.Mechanism, q: np.ndarray, motion: np.ndarray) -> float:
    """Determinant of [K; J] at the closed posture beside, after a dimensionless motion."""
    beside = pin.integrate(m.model, q, motion * m.column_scale)
    return float(np.linalg.det(stacked(m, cc.close(m, beside).raise_if_failed().q)))


# -- double roots --------------------------------------------------------------------------------


def toggled(m: cc.Mechanism, off: float) -> np.ndarray:
    """The four-bar driven at its rocker, crank and coupler in line but for an angle [rad]."""
    reach = 0.15 + 0.35
    crank = float(np.arccos((reach**2 + 0.4**2 - 0.3**2) / (2.0 * reach * 0.4)))
    end = reach * np.array([np.cos(crank), np.sin(crank)]) - [0.4, 0.0]
    exact = np.array([crank, 0.0, np.arctan2(end[1], end[0])])
    if not off:
        return exact
    joint = m.model.names[2]
    return cc.close(m, exact + np.array([0.0, off, 0.0]), fixed={joint: off}).raise_if_failed().q


@pytest.mark.parametrize("off", [0.0, 1e-10, 1e-8, 3e-8])
def test_a_fold_is_known_to_the_root_of_rounding(off: float) -> None:
    """Rows change by 1e-15 on the way to the fold: with these inputs it may as well be there."""
    m = linkages.four_bar({"q1": "D"})
    q = toggled(m, off)
    c = agree(m, q)
    assert "direct" in c.kinds
    assert c.sigma_direct <= 2.0 * off + 1e-15


@pytest.mark.parametrize("off", [1e-6, 1e-5, 1e-3])
def test_beside_a_fold_postures_are_regular_at_the_right_distance(off: float) -> None:
    """The only motion leads back: the distance is its length in the rates of all four joints."""
    m = linkages.four_bar({"q1": "D"})
    q, exact = toggled(m, off), toggled(m, 0.0)
    c = agree(m, q)
    assert c.kinds == frozenset()
    if off < 1e-5:
        length = float(np.linalg.norm(physical_rates(m, q) @ (q - exact)))
        assert c.distance == pytest.approx(length, rel=1e-3)
        assert c.accuracy < 1e-7


@pytest.mark.parametrize("off", [1e-8, 1e-7, 1e-6])
def test_a_posture_that_a_solver_leaves_beside_a_fold_is_singular(off: float) -> None:
    """Rows below 1e-12 leave an error of up to 1e-6, and say so."""
    m = linkages.four_bar({"q1": "D"})
    q = toggled(m, 0.0) + np.array([0.0, off, 0.0])
    q[0] -= 0.7 * off  # along the motion with the input locked: rows of the order off^2
    assert np.abs(cc.residual(m, q)).max() < 1e-12
    assert "direct" in agree(m, q).kinds


# -- all robots: singular at the place, regular away from it ---------------------------------------


SINGULAR: dict[str, Callable[[], tuple[cc.Mechanism, np.ndarray]]] = {
    "d1 at home": lambda: at_home("d1"),
    "flat parallelogram": lambda: flat(),
    "rocker in line": lambda: (linkages.four_bar({"q1": "D"}), toggled(linkages.four_bar(), 0.0)),
}


def at_home(robot: str) -> tuple[cc.Mechanism, np.ndarray]:
    m = cc.load(robot)
    return m, m.home


def flat() -> tuple[cc.Mechanism, np.ndarray]:
    m = linkages.parallelogram()
    q = np.array(m.home)
    for name, value in {"A": np.pi / 2, "B": -np.pi / 2, "D": np.pi / 2}.items():
        q[m.model.joints[m.model.getJointId(name)].idx_q] = value
    return m, q


@pytest.mark.parametrize("name", SINGULAR)
def test_the_decision_changes_once_on_the_way_from_a_singular_posture(name: str) -> None:
    """Singular up to some distance of rounding, regular from there on, and never back."""
    m, q = SINGULAR[name]()
    rng = np.random.default_rng(7)
    basis, _ = null_space(cc.constraint_jacobian(m, q) * m.column_scale / m.row_scale[:, None])
    for _ in range(3):
        v = basis @ rng.standard_normal(basis.shape[1])
        v /= np.linalg.norm(v)
        found = []
        for size in 10.0 ** np.arange(-12.0, -1.9, 0.5):
            near = cc.close(m, pin.integrate(m.model, q, size * v * m.column_scale))
            found.append(bool(agree(m, near.raise_if_failed().q).kinds))
        assert found[0]
        assert not found[-1]
        assert np.diff(np.array(found, dtype=int)).tolist().count(-1) == 1
        assert 1 not in np.diff(np.array(found, dtype=int))


@pytest.mark.parametrize("name", SINGULAR)
def test_measures_of_maps_are_those_of_classify(name: str) -> None:
    """Also where closures lose a rank, and all the way to where they do not."""
    m, q = SINGULAR[name]()
    basis, _ = null_space(cc.constraint_jacobian(m, q) * m.column_scale / m.row_scale[:, None])
    v = basis @ np.random.default_rng(8).standard_normal(basis.shape[1])
    near = [pin.integrate(m.model, q, x * v * m.column_scale) for x in 10.0 ** np.arange(-11, -2)]
    postures = np.array([q, *(cc.close(m, one).raise_if_failed().q for one in near)])
    found = bulk_measures(m).measures(postures)
    for i, posture in enumerate(postures):
        c = cc.classify(m, posture)
        for kind in ("direct", "inverse", "constraint"):
            value = getattr(c, f"sigma_{kind}")
            assert found[f"sigma_{kind}"][i] == pytest.approx(value, rel=1e-7, abs=1e-12), (i, kind)


def ladder(stages: int) -> cc.Mechanism:
    """Parallelograms on top of each other, each driven at a crank."""
    joints, cuts, below = [], [], "base"
    for i in range(stages):
        at = "0.3 0 0" if i else "0 0 0"
        joints += [
            linkage_text.J(f"A{i}", below, f"crank{i}", at),
            linkage_text.J(f"B{i}", f"crank{i}", f"bar{i}", "0.1 0 0"),
            linkage_text.J(f"D{i}", below, f"rocker{i}", "0.3 0.4 0" if i else "0 0.4 0"),
        ]
        cuts.append(linkage_text.Cut(f"C{i}", f"bar{i}", f"rocker{i}", "0 0.4 0", "0.1 0 0"))
        below = f"bar{i}"
    home = {j.name: -0.3 if j.name[0] == "B" else 0.3 for j in joints}
    inputs = {f"q{i}": f"A{i}" for i in range(stages)}
    return linkage_text.load(
        "ladder", joints, cuts, inputs=inputs, home=home, tip=below, outputs="x y rz"
    )


def test_many_ranks_lost_at_once() -> None:
    """All stages flat: each may branch. Off by an angle, the nearest one decides: four joints."""
    stages = 5
    m = ladder(stages)

    def turned(off: float) -> np.ndarray:
        q = np.array(m.home)
        for i in range(stages):
            turn = np.pi / 2 + off * (1 + i)
            for name, value in ((f"A{i}", turn), (f"B{i}", -turn), (f"D{i}", turn)):
                q[m.model.joints[m.model.getJointId(name)].idx_q] = value
        return q

    r = cc.classify(m, m.home).ranks["constraint"].value
    for off in (0.0, 1e-12, 1e-10):
        c = cc.classify(m, turned(off))
        assert c.kinds == {"constraint", "direct"}
        assert c.ranks["constraint"].value == r - stages
    for off in (1e-6, 1e-5):
        c = cc.classify(m, turned(off))
        assert c.kinds == frozenset()
        assert c.distance == pytest.approx(2.0 * off, rel=1e-3)


def test_a_tolerance_asks_for_the_share_instead(d1: cc.Mechanism) -> None:
    q = tilted(d1, 0.0085)
    c = cc.classify(d1, q, tolerance=1e-8)
    assert c.kinds == {"inverse"}
    assert c.accuracy == 1e-8
    assert_close(c.distance * 1.04055, c.sigma_inverse, 1e-11)


def test_what_stands_in_the_text(d1: cc.Mechanism) -> None:
    """The rank with its gap and the distance, where a singular value is small."""
    text = cc.classify(d1, tilted(d1, 0.0085)).text
    assert "inverse: rank 6 (singular values 9.17e-09 | 0)" in text
    assert "singular at a distance of 2e-05" in text
