"""Screw matrices of D1 and the claims of eqs (10) and (29)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from d1_cases import HOME_Q, SEED, G, pose, state

from closedchain.robots import elimination
from closedchain.robots.d1.geometry import (
    NORMAL,
    RADIAL,
    TANGENT,
    Geometry,
    Pose,
)
from closedchain.robots.d1.position import (
    Assembly,
    forward,
    inverse,
    leg_lengths,
)
from closedchain.robots.d1.screws import j1, j2, planes1, planes2, scaled_screws


@pytest.fixture(scope="module")
def ref(reference: Callable[[str], dict[str, Any]]) -> dict[str, Any]:
    return reference("d1")


# --- screws ------------------------------------------------------------------------------------


def test_screw_matrices_match_the_reference(ref: dict[str, Any]) -> None:
    for entry in (ref["home"], ref["kinematics"][0]):
        b, c = state(entry)
        np.testing.assert_allclose(j1(b, G), entry["J1"], atol=1e-12)
        np.testing.assert_allclose(j2(b, c, G), entry["J2"], atol=1e-12)
    for entry in (ref["home"], *ref["kinematics"], *ref["singular"].values()):
        matrices = scaled_screws(*state(entry), G)
        for k, matrix in enumerate(matrices):
            assert abs(np.linalg.det(matrix) - entry["det_J1_J2_J3"][k]) < 1e-11
            values = np.linalg.svd(matrix, compute_uv=False)
            np.testing.assert_allclose(values, entry[f"sv_J{k + 1}"], atol=1e-12)


def test_screws_along_the_periodic_motion(ref: dict[str, Any]) -> None:
    for sample in ref["periodic"]["samples"]:
        b, c = (
            pose([sample[f"quat{x}_{k}"] for k in "wxyz"], [sample[f"p{x}_{k}"] for k in "xyz"])
            for x in "BC"
        )
        q = [sample[f"q{i}"] for i in range(1, 7)]
        np.testing.assert_allclose(leg_lengths(b, c, G), q, atol=1e-12)
        for k, matrix in enumerate(scaled_screws(b, c, G)):
            assert abs(np.linalg.det(matrix) - sample[f"detJ{k + 1}"]) < 1e-11
            smallest = np.linalg.svd(matrix, compute_uv=False)[-1]
            assert abs(smallest - sample[f"sminJ{k + 1}"]) < 1e-11


def test_four_planes_identity() -> None:
    """Holds with the normals t x leg; these have length 1 in stage 1 only."""
    rng = np.random.default_rng(SEED)
    for _ in range(20):
        chosen = forward(HOME_Q + rng.uniform(-0.02, 0.02, 6), G).assemblies
        for a in chosen[::7]:
            m1, m2, _ = scaled_screws(a.coupler, a.platform, G)
            first, second = planes1(a.coupler, G), planes2(a.coupler, a.platform, G)
            assert abs(np.linalg.det(m1) - 15 * np.sqrt(3) * np.linalg.det(first)) < 1e-12
            assert abs(np.linalg.det(m2) - np.linalg.det(second) / (0.04 * np.sqrt(3))) < 1e-12
            np.testing.assert_allclose(np.linalg.norm(first[:, :3], axis=1), 1.0, atol=1e-12)


def equation_10(x: np.ndarray, s4: np.ndarray, g: Geometry = G) -> np.ndarray:
    """Eq. (10) for x = (S1..S3, R4..R6) (18,) and given S4..S6, real or complex."""
    s, r = x[:9].reshape(3, 3), x[9:].reshape(3, 3)
    rows = []
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        rows.append((s4[i] - r[i]) @ (r[j] - r[k]))
        rows.append((s[i] - g.R[i]) @ (g.R[j] - g.R[k]))
        rows.append((s[i] - s[j]) @ (s[i] - s[j]) - g.sides_S[i] ** 2)
        rows.append((r[i] - r[j]) @ (r[i] - r[j]) - 3.0 * g.radius_R4**2)
        rows.append((s[i] - r[i]) @ (s[i] - r[i]) - (g.radius_R4 - g.radius_S) ** 2)
    return np.concatenate([rows, s.sum(axis=0) - r.sum(axis=0)])


def test_equation_10_is_degenerate(ref: dict[str, Any]) -> None:
    """Rank 15 of 18 at every solution."""
    entry = ref["ik"][0]
    target = Pose(np.array(entry["RC"]), np.array(entry["pC"]))
    s4 = target.points(G.c_C)
    for a in inverse(target, G).assemblies:
        x = np.r_[a.coupler.points(G.s_B).ravel(), a.coupler.points(G.r_B).ravel()]
        assert np.abs(equation_10(x, s4)).max() < 1e-12
        jacobian = np.empty((18, 18))
        for k in range(18):
            step = x.astype(complex)
            step[k] += 1e-30j
            jacobian[:, k] = equation_10(step, s4).imag / 1e-30
        values = np.linalg.svd(jacobian, compute_uv=False)
        assert values[15] < 1e-12 * values[0]
        assert values[14] > 1e-4 * values[0]


def followed(q: np.ndarray, near: Assembly) -> Assembly:
    """The assembly for q nearest to a given one."""
    return min(
        forward(q, G).assemblies,
        key=lambda a: (
            np.abs(a.coupler.rotation - near.coupler.rotation).max()
            + np.abs(a.platform.rotation - near.platform.rotation).max()
        ),
    )


def test_equation_29_rests_on_two_false_premises(ref: dict[str, Any]) -> None:
    """omega . n is not 0; omega . (y + n) is (finite differences of the closed forms)."""
    entry = ref["kinematics"][0]
    b, c = state(entry)
    q, qd = np.array(entry["q"]), np.array(entry["qd"])
    here = Assembly(b, c, ("ZT", "ZT"), q)
    h = 1e-4
    steps = {k: followed(q + k * h * qd, here) for k in (-2, -1, 1, 2)}

    def omega(name: str, rotation: np.ndarray) -> np.ndarray:
        r = {k: getattr(a, name).rotation for k, a in steps.items()}
        rate = (r[-2] - 8.0 * r[-1] + 8.0 * r[1] - r[2]) / (12.0 * h) @ rotation.T
        return np.array([rate[2, 1], rate[0, 2], rate[1, 0]])

    w_b, w_c = omega("coupler", b.rotation), omega("platform", c.rotation)
    np.testing.assert_allclose(w_b, entry["V_AB"][:3], atol=1e-9)
    np.testing.assert_allclose(w_c, entry["V_AC"][:3], atol=1e-9)
    n_b, n_c = b.rotation @ NORMAL, c.rotation @ NORMAL
    stored = entry["eq29"]
    assert abs(w_b @ n_b - stored["wAB_dot_nB"]) < 1e-9
    assert abs((w_c - w_b) @ n_c - stored["wBC_dot_nC"]) < 1e-9
    assert abs(w_b @ n_b) > 0.03
    assert abs((w_c - w_b) @ n_c) > 0.04
    assert abs(w_b @ (NORMAL + n_b)) < 1e-9
    assert abs((w_c - w_b) @ (n_b + n_c)) < 1e-9


def test_constants_are_read_only_and_consistent() -> None:
    assert elimination.BEZOUT == 16
    np.testing.assert_allclose(np.cross(NORMAL, RADIAL), TANGENT)
    np.testing.assert_allclose(TANGENT[0], [0.0, 0.0, -1.0])
    with pytest.raises(ValueError, match="read-only"):
        RADIAL[0, 0] = 2.0
