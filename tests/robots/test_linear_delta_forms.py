"""Closed forms of the linear Delta: against stored numbers, differences and the source's claims."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from conftest import assert_close
from hypothesis import given, settings
from hypothesis import strategies as st
from linear_delta_postures import SEED, G, random_positions, rods, translation

from closedchain.robots import linear_delta as ld
from closedchain.urdf.errors import ClosureError, DescriptionError

DIGITS = 2e-11  # the reference states 12 digits


@pytest.fixture(scope="module")
def ref(reference: Callable[[str], dict[str, Any]]) -> dict[str, Any]:
    return reference("linear_delta")


@pytest.fixture(scope="module")
def generic(ref: dict[str, Any]) -> dict[str, Any]:
    return ref["generic"]


# --- geometry and position ---------------------------------------------------------------------


def test_geometry_matches_the_reference(ref: dict[str, Any]) -> None:
    stored = ref["geometry"]
    assert (G.a, G.b, G.c, G.t) == tuple(stored[name] for name in "abct")
    assert_close(ld.PHI, stored["phi"], DIGITS)
    with pytest.raises(DescriptionError, match=r"'b' must be positive, not -0\.5"):
        ld.Geometry(b=-0.5)
    with pytest.raises(DescriptionError, match="'t' must be a finite number, not nan"):
        ld.Geometry(t=float("nan"))


def test_inverse_position_has_eight_modes(ref: dict[str, Any]) -> None:
    (stored,) = ref["ik_all"]
    every = ld.inverse(stored["p"], G)
    assert every.shape == (8, 3)
    assert len(np.unique(ld.MODES, axis=0)) == 8
    for entry in stored["solutions"]:
        assert_close(ld.sliders(stored["p"], G, entry["sgn"]), entry["q"], DIGITS)
        mode = int(np.flatnonzero((entry["sgn"] == ld.MODES).all(axis=1))[0])
        assert_close(every[mode], entry["q"], DIGITS)


def test_direct_position_has_two_assemblies(ref: dict[str, Any]) -> None:
    (stored,) = ref["fk"]
    found = ld.direct(stored["q"], G)
    assert_close(found.p, stored["p"], DIGITS)
    assert found.sides.tolist() == stored["sgn"]
    double = ref["singularities"]["type1_limb1_rod_horizontal"]
    assert_close(ld.direct(double["q"], G).p, double["fk"], 1e-9)


def test_loop_equations_hold_and_direct_inverts_inverse_in_all_modes() -> None:
    p = random_positions(1000)
    q = ld.inverse(p, G)
    c = p[:, None, None, :] + G.C  # eq (1): O o' + o' C_i = O A_i + A_i B_i + B_i C_i
    b = G.A + q[..., None] * ld.AXIS
    assert_close(np.linalg.norm(c - b, axis=-1), np.full((1000, 8, 3), G.b), 1e-14)
    assert_close(c - b, G.b * ld.rods(np.broadcast_to(p[:, None], q.shape), q, G), 1e-14)
    found = ld.direct(q, G)
    miss = np.linalg.norm(found.p - p[:, None, None, :], axis=-1)
    assert miss.min(axis=-1).max() < 1e-10
    which = miss.argmin(axis=-1)[..., None, None]
    labels = np.take_along_axis(found.sides, which, axis=-2)[..., 0, :]
    assert (labels == ld.MODES).all()


def test_assemblies_mirror_each_other_in_the_plane_of_the_sphere_centres() -> None:
    q = ld.inverse(random_positions(200), G)[:, 0]
    found = ld.direct(q, G)
    s = G.d * ld.RADIAL + q[..., None] * ld.AXIS
    normal = np.cross(s[:, 1] - s[:, 0], s[:, 2] - s[:, 0])
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    across = found.p[:, 1] - found.p[:, 0]
    assert_close(across, 2.0 * found.height[:, None] * normal, 1e-13)
    assert_close(((found.p.mean(axis=1) - s[:, 0]) * normal).sum(axis=-1), np.zeros(200), 1e-14)


def test_only_a_minus_c_enters_the_position_problem() -> None:
    p = random_positions(50)
    other = ld.Geometry(a=0.55, c=0.35, t=0.02)
    assert_close(ld.inverse(p, other), ld.inverse(p, G), 1e-14)
    raised = ld.inverse(p + 0.37 * ld.AXIS, G)  # z is cyclic
    assert_close(raised - 0.37, ld.inverse(p, G), 1e-14)


def test_reach_is_three_discs() -> None:
    assert abs(G.inscribed_radius - 0.3) < 1e-15
    reach = []
    for angle in np.linspace(0.0, 2.0 * np.pi, 73):
        ray = np.linspace(0.25, 0.4, 30001)[:, None] * [np.cos(angle), np.sin(angle)]
        inside = (ld.margins(np.pad(ray, ((0, 0), (0, 1))), G) >= 0.0).all(axis=-1)
        reach.append(0.25 + 0.15 / 30000 * (np.count_nonzero(inside) - 1))
    assert abs(min(reach) - 0.3) < 1e-5
    assert abs(max(reach) - 0.369042) < 1e-5
    assert abs(reach[36] - 0.3) < 1e-5  # -r_1
    assert abs(reach[0] - 0.369042) < 1e-5  # +r_1


def test_questions_out_of_reach_are_refused() -> None:
    with pytest.raises(ClosureError, match=r"out of reach of leg 1: it needs a rod of 0\.6 m"):
        ld.inverse([-0.4, 0.0, 0.0], G)
    with pytest.raises(ClosureError, match="no platform position has the sliders"):
        ld.direct([0.0, 0.0, 1.5], G)
    with pytest.raises(ClosureError, match="a = c"):
        ld.direct([0.0, 0.0, 0.0], ld.Geometry(a=0.2))
    with pytest.raises(ClosureError, match=r"must be \+1 or -1"):
        ld.sliders([0.0, 0.0, 0.0], G, [1, 0, 1])
    with pytest.raises(ClosureError, match="do not close"):
        ld.rods([0.0, 0.0, 0.0], [1.0, 1.0, 1.0], G)
    with pytest.raises(DescriptionError, match="not finite"):
        ld.inverse([np.nan, 0.0, 0.0], G)
    with pytest.raises(DescriptionError, match="shape"):
        ld.direct([0.0, 0.0], G)


# --- screws and Jacobian -----------------------------------------------------------------------


def test_screws_match_the_reference(generic: dict[str, Any]) -> None:
    bhat = rods(generic["p"], generic["sgn"])
    assert_close(bhat, generic["bhat"], DIGITS)
    limb, stored = ld.limbs(bhat, G), generic["limb1"]
    for name in ("s", "e"):
        assert_close(getattr(limb, name)[0], stored[name], DIGITS, name)
    assert_close(limb.twists[0], [*stored["ta"], *stored["tc"]], DIGITS)
    assert_close(limb.wrenches[0], [*stored["wa"], *stored["wc"]], DIGITS)
    assert_close(ld.pins(bhat, G)[0], [stored[n] for n in "DEFG"], DIGITS)


def test_jacobian_matches_the_reference(generic: dict[str, Any]) -> None:
    bhat = rods(generic["p"], generic["sgn"])
    found = ld.generalized_jacobian(bhat, G)
    for value, name in (
        (found.Jx, "Jx"),
        (found.Ja, "Ja_diag"),
        (found.Jc, "Jc_diag"),
        (found.J, "J"),
    ):
        assert_close(value, generic[name], DIGITS, name)
    assert_close(np.linalg.svd(found.Jx)[1], generic["sv_Jx"], DIGITS)
    assert np.linalg.matrix_rank(found.Jx) == generic["rank_Jx"] == 6
    assert np.linalg.matrix_rank(found.Jx[3:]) == generic["rank_Jxc"] == 3
    assert abs(ld.direct_factor(bhat) - generic["det_Jxa_trans"]) < DIGITS
    assert abs(np.linalg.cond(found.J[:3, :3]) - generic["cond_J_trans"]) < 1e-10
    v = np.array(generic["v"])
    assert_close(ld.slider_rates(bhat, v), generic["qdot"], DIGITS)
    assert_close(ld.limb_rates(bhat, G, translation(v)), generic["rho"], DIGITS)


def test_wrenches_are_dual_to_twists_in_all_modes() -> None:
    bhat = rods(random_positions(100)[:, None, :], ld.MODES)
    limb = ld.limbs(bhat, G)
    products = limb.wrenches @ np.swapaxes(limb.twists, -1, -2)
    assert_close(products * (1.0 - np.eye(6)), np.zeros(products.shape), 1e-14)
    # (24) for wc2 is not 1, as one might read: it is the sine between rod and bars
    s2b = (bhat * ld.TANGENT).sum(axis=-1)
    assert_close(limb.pairings[..., 4], np.ones(s2b.shape), 1e-14)
    assert_close(limb.pairings[..., 5], np.sqrt(1.0 - s2b**2), 1e-14)
    assert_close(limb.pairings[..., 0], bhat[..., 2], 1e-14)
    # observation 2: couples are reciprocal; ranks of the four subspaces
    assert np.linalg.matrix_rank(limb.twists[..., :4, :]).min() == 4
    assert np.linalg.matrix_rank(limb.twists).min() == 6


def test_constraint_couples_always_have_rank_three() -> None:
    bhat = rods(random_positions(100)[:, None, :], ld.MODES)
    couples = ld.generalized_jacobian(bhat, G).Jx[..., 3:, :]
    assert_close(couples[..., :3], np.zeros(couples[..., :3].shape), 0.0)
    values = np.linalg.svd(couples[..., 3:], compute_uv=False)
    assert values[..., 2].min() > 0.5  # s2_i are fixed and distinct: no constraint singularity


def test_parallelogram_is_a_slider_to_first_order() -> None:
    """Eqs (13), (14): $D - $G = $E - $F = b (e; 0)."""
    bhat = rods(random_positions(100)[:, None, :], ld.MODES)
    d, e, f, g = np.moveaxis(ld.pins(bhat, G), -2, 0)
    unit = ld.limbs(bhat, G).twists[..., 2, :]
    assert_close(d - g, G.b * unit, 1e-15)
    assert_close(e - f, G.b * unit, 1e-15)
    assert_close(unit[..., :3], np.cross(ld.parallelogram(bhat)[0], bhat), 1e-15)


def test_limb_rates_make_up_the_twist() -> None:
    """Eq (22) holds for any twist; translation needs no restricted motion, and theta4 = -theta2."""
    rng = np.random.default_rng(SEED)
    bhat = rods(random_positions(100))
    twist = rng.normal(size=(100, 6))
    rates = ld.limb_rates(bhat, G, twist)
    made = (rates[..., None, :] @ ld.limbs(bhat, G).twists)[..., 0, :]
    assert_close(made, np.broadcast_to(twist[:, None, :], made.shape), 1e-12)
    slide = ld.limb_rates(bhat, G, translation(twist[:, :3]))
    assert_close(slide[..., 4:], np.zeros((100, 3, 2)), 1e-12)
    assert_close(slide[..., 3], -slide[..., 1], 1e-12)
    jacobian = ld.generalized_jacobian(bhat, G).J
    assert_close((jacobian @ translation(twist[:, :3])[..., None])[:, :3, 0], slide[..., 0], 1e-12)


def test_pseudo_inverse_is_one_sided() -> None:
    bhat = rods([0.08, -0.05, -0.6])
    jacobian = ld.generalized_jacobian(bhat, G).J
    for v in np.eye(3):  # J $t = (qdot; 0)
        made = jacobian @ translation(v)
        assert_close(made, np.concatenate([ld.slider_rates(bhat, v), np.zeros(6)]), 1e-12)
    left = np.linalg.pinv(jacobian)
    assert_close(left @ jacobian, np.eye(6), 1e-12)
    assert np.abs(jacobian @ left - np.eye(9)).max() > 0.3


# --- singular sets -----------------------------------------------------------------------------


def test_determinant_never_vanishes_with_all_sliders_on_one_side() -> None:
    p = random_positions(20000, radius=0.37)
    p = p[(ld.margins(p, G) >= 0.0).all(axis=-1)]
    values = np.abs(ld.direct_factor(rods(p)))
    centre = 1.5 * np.sqrt(3.0) * G.d**2 * np.sqrt(G.b**2 - G.d**2) / G.b**3
    assert abs(np.abs(ld.direct_factor(rods([0.0, 0.0, 0.0]))) - centre) < 1e-14
    assert abs(centre - 0.38099) < 1e-5
    assert values.min() >= centre - 1e-12
    assert values.max() < 0.601


@settings(max_examples=150, deadline=None)
@given(
    a=st.floats(0.1, 1.0),
    c=st.floats(0.1, 1.0),
    slack=st.floats(1.001, 5.0),
    x=st.floats(-1.0, 1.0),
    y=st.floats(-1.0, 1.0),
    side=st.sampled_from([1.0, -1.0]),
)
def test_no_direct_singularity_on_one_side_for_any_size(
    a: float, c: float, slack: float, x: float, y: float, side: float
) -> None:
    d = abs(a - c)
    if d < 1e-3:
        return
    g = ld.Geometry(a=a, b=slack * d, c=c)
    p = np.array([x, y, 0.0]) * g.b
    if (ld.margins(p, g) < 0.0).any():
        return
    bhat = rods(p, np.full(3, side), g)
    # 3 sqrt(3)/2 (d/b)^2 is twice the area of the shadows' triangle
    assert abs(ld.direct_factor(bhat)) > 0.3 * (d / g.b) ** 2 * np.abs(bhat[:, 2]).max()


def test_equal_radii_are_singular_everywhere() -> None:
    g = ld.Geometry(a=0.2)
    p = random_positions(50)
    assert np.abs(ld.direct_factor(rods(p, (1, 1, 1), g))).max() < 1e-15
    assert np.abs(ld.direct_factor(rods(p, (1, -1, 1), g))).max() < 1e-15


@pytest.mark.parametrize("pair", list(itertools.combinations(range(3), 2)))
def test_opposed_rods_are_a_double_root(pair: tuple[int, int]) -> None:
    i, j = pair
    sides = np.ones(3)
    sides[j] = -1.0
    p = ld.opposed_rods(G, i, j, z=-0.6)
    bhat = rods(p, sides)
    assert_close(bhat[i], -bhat[j], 1e-15)
    assert abs(ld.direct_factor(bhat)) < 1e-15
    assert np.linalg.matrix_rank(ld.generalized_jacobian(bhat, G).Jx, tol=1e-10) == 5
    assert ld.direct(ld.sliders(p, G, sides), G).height < 1e-7
    assert np.abs(bhat @ ld.free_direction(bhat)).max() < 1e-12
    with pytest.raises(ClosureError, match="not coplanar"):
        ld.free_direction(rods(p))


def test_horizontal_rod_of_the_reference(ref: dict[str, Any]) -> None:
    stored = ref["singularities"]["type1_limb1_rod_horizontal"]
    assert_close(ld.horizontal_rod(G, 0, np.pi, z=-0.6), stored["p"], 1e-15)
    bhat = rods(stored["p"])
    assert_close(ld.sliders(stored["p"], G, np.ones(3)), stored["q"], 1e-8)
    assert_close(bhat, stored["bhat"], 1e-8)
    assert_close(ld.inverse_factors(bhat), stored["Ja_diag"], 1e-8)
    assert abs(ld.direct_factor(bhat) - stored["det_Jxa"]) < 1e-8
    jx = ld.generalized_jacobian(bhat, G).Jx
    assert np.linalg.matrix_rank(jx) == stored["rank_Jx"]


def test_collapse_of_a_parallelogram_is_out_of_reach() -> None:
    """It needs bhat = +-s2, hence a horizontal rod, and puts the other legs out of reach."""
    assert_close(ld.collapse_factors(rods([0.0, 0.0, 0.0])), np.ones(3), 1e-15)
    for i in range(3):
        for sense in (1.0, -1.0):
            p = G.d * ld.RADIAL[i] + sense * G.b * ld.TANGENT[i]
            assert ld.margins(p, G).min() < -0.1
