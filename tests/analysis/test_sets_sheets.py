"""Singular surfaces are meshed sheet by sheet, every triangle's middle on the set: closed forms."""

from __future__ import annotations

import numpy as np
import pytest

import closedchain as cc
from closedchain.analysis.singularity.sets.cubes import Cubes
from closedchain.analysis.singularity.sets.triangles import TOLERANCE
from closedchain.robots import eclipse
from closedchain.robots import linear_delta as ld


def corners(found: cc.SingularitySet) -> np.ndarray:
    """Corners (t, 3, 3) of all triangles."""
    triangles = np.concatenate([piece for piece in found.pieces if piece.ndim == 2])
    return found.coordinates[triangles]


def check_fit(found: cc.SingularitySet, cell: float, off: np.ndarray) -> None:
    """Distances (t,) of middles from the true set, in metres, keep what the result states."""
    assert found.fit is not None
    assert found.fit.tolerance == TOLERANCE
    assert found.fit.largest <= TOLERANCE
    # nearest distance is at most that along an axis
    assert off.max() <= found.fit.largest * cell + 1e-9
    assert found.fit.text in found.note


def test_the_three_planes_of_d1_are_three_planes(d1: cc.Mechanism) -> None:
    """Two of the first three slides alike: no triangle cuts across from one plane to another."""
    home = d1.input_values(d1.home)[:3]
    axis = np.linspace(-0.03, 0.03, 6)
    over = {f"q{i + 1}": home[i] + axis for i in range(3)}
    found = cc.singularity_set(d1, "inverse", over, check=False)
    at = corners(found)
    apart = np.abs(at - np.roll(at, 1, axis=2))  # |q1 - q3|, |q2 - q1|, |q3 - q2|
    which = apart.max(axis=1).argmin(axis=1)
    assert apart.max(axis=1).min(axis=1).max() < 1e-7
    assert set(which) == {0, 1, 2}
    # each plane is whole: its square times the root of two, but for the margin at the ends
    sides = at[:, 1:] - at[:, :1]
    area = 0.5 * np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
    for plane in range(3):
        assert area[which == plane].sum() == pytest.approx(np.sqrt(2.0) * 0.06**2, rel=5e-3)
    # all three meet in the line of three slides alike, whose points all of them have
    middle = home.mean()
    for plane in range(3):
        mine = at[which == plane].reshape(-1, 3)
        assert np.abs(mine - middle).max(axis=1).min() < 0.012
    check_fit(found, 0.012, apart.mean(axis=1).min(axis=1))
    assert found.fit is not None
    assert (found.fit.split, found.fit.left_out, found.fit.holes) == (0, 0, 0)


def test_the_cylinder_of_the_eclipse_with_its_plate_level() -> None:
    m, a = cc.load("eclipse"), eclipse.ECLIPSE.a
    axis = np.linspace(-0.13, 0.135, 8)
    over = {"x": axis, "y": axis, "z": np.array([0.08, 0.1, 0.12])}
    found = cc.singularity_set(m, "direct", over, check=False)
    at = corners(found)
    assert np.abs(np.hypot(at[..., 0], at[..., 1]) - a).max() < 1e-9
    middles = at.mean(axis=1)
    off = np.abs(np.hypot(middles[:, 0], middles[:, 1]) - a)
    check_fit(found, float(np.diff(axis)[0]), off)
    turned = np.sort(np.arctan2(middles[:, 1], middles[:, 0]))
    assert np.diff(turned).max() < 0.5  # all the way round


def test_the_walls_of_the_linear_delta() -> None:
    """The workspace ends where a rod is level: at cylinders round the rails, which cross."""
    m, g = cc.load("linear_delta"), ld.Geometry()
    over = {
        "x": np.linspace(-0.42, 0.43, 8),
        "y": np.linspace(-0.43, 0.42, 8),
        "z": np.array([-0.65, -0.6, -0.55]),
    }
    found = cc.singularity_set(m, "inverse", over, check=False)
    at = corners(found)
    feet = g.d * ld.RADIAL[:, :2]

    def off_walls(places: np.ndarray) -> np.ndarray:
        away = np.linalg.norm(places[..., None, :2] - feet, axis=-1)
        return np.abs(away - g.b).min(axis=-1)

    assert off_walls(at).max() < 1e-9
    off = off_walls(at.mean(axis=1))
    cell = max(float(np.diff(v)[0]) for v in (over["x"], over["y"]))
    check_fit(found, cell, off)


def test_planes_between_cubes_lie_askew() -> None:
    class Grid:
        values = (np.linspace(0.0, 1.0, 5),) * 3
        cell = np.full(3, 0.25)

    cubes = Cubes.of(Grid())  # type: ignore[arg-type]
    for planes in cubes.planes:
        assert len(planes) == 6
        assert planes[0] > 0.0
        assert planes[-1] < 1.0
    every = np.concatenate(cubes.planes)
    assert np.abs(np.subtract.outer(every, every) + np.eye(18)).min() > 1e-6
    edge = (2, 0, 1, 2)
    for face, into, sense in cubes.faces_at(edge):
        assert into != edge[3]
        assert sense in (1, -1)
        for cube in cubes.cubes_at(face):
            assert edge in cubes.edges_of(cube)
    assert cubes.holding(np.array([0.5, 0.5, 0.5])) == (2, 2, 2)
