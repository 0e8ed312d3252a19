"""Singularities of the linear Delta: closed-form factors against the generic definitions."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from conftest import assert_close
from linear_delta_postures import SEED, G, configuration, random_positions, rods_at
from scipy.optimize import brentq

import closedchain as cc
from closedchain.robots import linear_delta as ld

MIXED = ld.MODES[1:7]  # sliders on both sides


def test_reference_singularities(
    delta: cc.Mechanism, reference: Callable[[str], dict[str, Any]]
) -> None:
    stored = reference("linear_delta")["singularities"]["type1_limb1_rod_horizontal"]
    cases = [
        (stored["p"], (1, 1, 1), {"inverse"}),
        (ld.opposed_rods(G, 0, 1, z=-0.6), (1, -1, 1), {"direct"}),
        (stored["p"], (1, 1, -1), {"direct", "inverse"}),
        (stored["p"], (-1, 1, -1), {"direct", "inverse"}),
        (stored["p"], (1, -1, 1), {"direct", "inverse"}),
        (delta.point(delta.home, "P"), (1, 1, 1), set()),
    ]
    for p, sides, kinds in cases:
        q = configuration(delta, p, sides)
        found = cc.classify(delta, q)
        assert found.kinds == kinds, found.text
        bhat = ld.rods(p, delta.input_values(q), G)
        if "direct" in kinds:
            assert cc.velocity(delta, q).twist_map is None
            (twist,) = found.free_twists.T
            direction = twist[:3] / np.linalg.norm(twist[:3])
            assert abs(abs(direction @ ld.free_direction(bhat)) - 1.0) < 1e-9
            assert np.abs(twist[3:]).max() < 1e-12
        if "inverse" in kinds:
            # the output along a horizontal rod is lost
            assert_close(np.abs(found.lost_twists), np.abs(bhat[:1].T), 1e-8)


def test_rank_of_the_full_rows_does_not_reveal_them(
    delta: cc.Mechanism, reference: Callable[[str], dict[str, Any]]
) -> None:
    p = reference("linear_delta")["singularities"]["type1_limb1_rod_horizontal"]["p"]
    for sides in ((1, 1, 1), (1, 1, -1)):
        found = cc.classify(delta, configuration(delta, p, sides))
        assert found.sigma_constraint > 0.1


def test_inverse_set_is_that_of_horizontal_rods(delta: cc.Mechanism) -> None:
    rng = np.random.default_rng(SEED)
    count = 0
    while count < 60:
        i, azimuth = int(rng.integers(3)), rng.uniform(0.0, 2.0 * np.pi)
        p = ld.horizontal_rod(G, i, azimuth, z=-0.6)
        others = np.delete(ld.margins(p, G), i)
        if others.min() < 1e-3:
            continue
        count += 1
        q = configuration(delta, p, ld.MODES[count % 8])
        found = cc.classify(delta, q)
        bhat = ld.rods(p, delta.input_values(q), G)
        assert "inverse" in found.kinds
        assert ("direct" in found.kinds) == (abs(ld.direct_factor(bhat)) < 1e-9)
        assert_close(np.abs(found.lost_twists[:, 0]), np.abs(bhat[i]), 1e-6)


def coplanar_positions(count: int) -> list[tuple[np.ndarray, np.ndarray]]:
    """Random platform centres and modes with coplanar rods: roots of the determinant on chords."""
    rng = np.random.default_rng(SEED)
    found: list[tuple[np.ndarray, np.ndarray]] = []
    while len(found) < count:
        sides = MIXED[rng.integers(6)]
        one, two = random_positions(2, seed=int(rng.integers(1 << 30)))

        def volume(
            t: float, one: np.ndarray = one, two: np.ndarray = two, sides: np.ndarray = sides
        ) -> float:
            p = (1.0 - t) * one + t * two
            return float(ld.direct_factor(ld.rods(p, ld.sliders(p, G, sides), G)))

        if volume(0.0) * volume(1.0) < 0.0:
            t = brentq(volume, 0.0, 1.0, xtol=1e-15, rtol=1e-15)
            found.append(((1.0 - t) * one + t * two, sides))
    return found


def test_direct_set_is_that_of_coplanar_rods(delta: cc.Mechanism) -> None:
    for p, sides in coplanar_positions(60):
        q = configuration(delta, p, sides)
        found = cc.classify(delta, q)
        assert found.kinds == {"direct"}, found.text
        assert ld.direct(delta.input_values(q), G).height < 1e-6  # a double root


def test_factors_vanish_with_the_generic_determinants_only(delta: cc.Mechanism) -> None:
    """Their ratio to det[bhat] and to the product of bhat.z keeps its size and sign."""
    ratios = []
    for p, sides in zip(random_positions(240, seed=7), itertools.cycle(ld.MODES), strict=False):
        q = configuration(delta, p, sides)
        found = cc.classify(delta, q)
        assert found.kinds == frozenset()
        bhat = ld.rods(p, delta.input_values(q), G)
        volume, drops = ld.direct_factor(bhat), ld.inverse_factors(bhat).prod()
        assert found.det_direct is not None
        assert found.det_inverse is not None
        ratios.append([found.det_direct / abs(volume), found.det_inverse * np.sign(volume) / drops])
    direct, inverse = np.abs(ratios).T
    assert direct.max() / direct.min() < 20.0
    assert inverse.max() / inverse.min() < 20.0
    assert len(set(np.sign(ratios)[:, 1])) == 1


def test_equal_radii_are_directly_singular_everywhere() -> None:
    m = cc.load("linear_delta", a=0.2)
    g = ld.Geometry(a=0.2)
    for p in random_positions(4, seed=8, radius=0.1):
        assert "direct" in cc.classify(m, configuration(m, p, (1, 1, 1), g)).kinds


@pytest.mark.slow
def test_map_and_curves_with_redundant_rows(delta: cc.Mechanism) -> None:
    """Status, measures and curves of a slice agree with the closed forms."""
    values = np.linspace(-0.9, 0.3, 11)
    over, at = {"q1": values, "q2": values}, {"q3": -0.6}
    found = cc.singularity_map(delta, over, at=at, progress=False, keep_q=True)
    signs = set()
    for (i, one), (j, two) in itertools.product(enumerate(values), repeat=2):
        cell = found.isel(q1=i, q2=j)
        heights = np.array([one, two, -0.6])
        try:
            centre = ld.direct(heights, G).p[0]
        except cc.ClosureError:
            assert cell["status"] == 1  # none found
            continue
        assert cell["status"] == 0
        assert_close(delta.point(cell["q"].to_numpy(), "P"), centre, 1e-9)
        drops = ld.inverse_factors(ld.rods(centre, heights, G))
        assert cell["det_direct"] > 0.0
        signs.add(float(np.sign(cell["det_inverse"])) * np.sign(drops.prod()))
    assert len(signs) == 1
    direct = cc.singularity_set(delta, "direct", over, at=at)
    inverse = cc.singularity_set(delta, "inverse", over, at=at)
    assert len(direct.q) > 10
    assert len(inverse.q) > 20
    assert direct.dropped < 0.2 * len(direct.q)
    assert inverse.dropped < 0.2 * len(inverse.q)
    for q in direct.q:
        bhat = rods_at(delta, q)
        assert abs(ld.direct_factor(bhat)) < 1e-9
        assert len(set(np.sign(bhat[:, 2]))) == 2  # never with all sliders on one side
    for q in inverse.q:
        assert np.abs(ld.inverse_factors(rods_at(delta, q))).min() < 1e-9
