"""Masses from shapes: closed forms, composites, and mechanisms of the catalogue with them."""

import numpy as np
import pytest
from conftest import assert_close

import closedchain as cc
from closedchain.urdf.description import Origin
from closedchain.urdf.shapes import Shape, ShapeKind
from closedchain.urdf.solid_shapes import inertial_of, moments, volume

INSIDE = {
    "box": lambda p, s: (np.abs(p) < np.array(s) / 2).all(axis=1),
    "sphere": lambda p, s: (p**2).sum(axis=1) < s[0] ** 2,
    "cylinder": lambda p, s: (np.hypot(p[:, 0], p[:, 1]) < s[0]) & (np.abs(p[:, 2]) < s[1] / 2),
    "capsule": lambda p, s: (
        np.hypot(np.hypot(p[:, 0], p[:, 1]), np.maximum(np.abs(p[:, 2]) - s[1] / 2, 0)) < s[0]
    ),
}


@pytest.mark.parametrize(
    ("kind", "sizes"),
    [
        ("box", (0.3, 0.5, 0.8)),
        ("sphere", (0.5,)),
        ("cylinder", (0.3, 0.9)),
        ("capsule", (0.25, 0.6)),
    ],
)
def test_shapes_by_counting_points(kind: ShapeKind, sizes: tuple[float, ...]) -> None:
    """Points of a fine grid that lie inside."""
    axis = (np.arange(120) + 0.5) / 120 * 1.2 - 0.6
    grid = np.stack(np.meshgrid(axis, axis, axis), axis=-1).reshape(-1, 3)
    inside = grid[INSIDE[kind](grid, sizes)]
    cell = (1.2 / 120) ** 3
    shape = Shape(kind, sizes)
    assert abs(len(inside) * cell / volume(shape) - 1) < 0.01
    squares = (inside**2).sum(axis=0) * cell
    expected = squares.sum() - squares
    assert_close(np.array(moments(shape)) / expected, np.ones(3), 0.015)


def test_a_turned_box_and_a_ball_beside_it() -> None:
    box = Shape("box", (0.2, 0.1, 0.4), Origin((0.1, 0.2, 0.3), (0.3, -0.5, 0.7)))
    ball = Shape("sphere", (0.05,), Origin((-0.2, 0.0, 0.1)))
    both = inertial_of([box, ball], 1000.0)
    assert abs(both.mass - 1000 * (0.008 + 4 / 3 * np.pi * 0.05**3)) < 1e-12
    one, two = inertial_of([box], 1000.0), inertial_of([ball], 1000.0)
    centre = (one.mass * np.array(one.origin.xyz) + two.mass * np.array(two.origin.xyz)) / both.mass
    assert_close(both.origin.xyz, centre, 1e-15)
    # turning changes no trace, and leaning axes make products
    assert abs((one.ixx + one.iyy + one.izz) - 8 * (0.2**2 + 0.1**2 + 0.4**2) / 6) < 1e-12
    assert abs(one.ixy) > 1e-3
    assert inertial_of([Shape("mesh", (1.0, 1.0, 1.0))], 1000.0) is None


@pytest.mark.parametrize("name", cc.robots("papers"))
def test_robots_get_masses_and_nothing_else(name: str) -> None:
    m = cc.load(name)
    heavy = cc.with_inertias(m)
    assert_close(heavy.home, m.home, 0.0)
    assert heavy.inputs == m.inputs
    assert sum(i.mass for i in heavy.model.inertias) > 0.1
    assert "2700" in heavy.notes[-1]
    again = cc.load_urdf(heavy.description.text, xacro=False)
    for one, two in zip(heavy.model.inertias, again.model.inertias, strict=True):
        assert one.isApprox(two, 1e-12)
    twice = cc.with_inertias(m, 5400.0)
    assert_close(twice.model.inertias[1].mass, 2 * heavy.model.inertias[1].mass, 1e-12)
    if name != "d1":  # home of D1 is regular for its inputs as well
        return
    assert_close(cc.statics(twice, m.home).inputs, 2 * cc.statics(heavy, m.home).inputs, 1e-9)


def test_what_is_given_is_kept() -> None:
    m = cc.with_inertias(cc.load("linear_delta"))
    again = cc.with_inertias(m, 1.0)
    for one, two in zip(m.model.inertias, again.model.inertias, strict=True):
        assert one.isApprox(two, 0.0)
    with pytest.raises(cc.ClosureError, match="density"):
        cc.with_inertias(m, -1.0)
