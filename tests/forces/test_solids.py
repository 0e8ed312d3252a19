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
    """By the parameter ``density``, and the same by ``with_inertias`` of a robot without masses."""
    m = cc.load(name)
    bare = cc.load(name, density=0)
    assert not sum(i.mass for i in bare.model.inertias)
    assert bare.notes == ()
    assert "2700" in m.notes[0]
    assert_close(bare.home, m.home, 0.0)
    assert bare.length == m.length
    assert sum(i.mass for i in list(m.model.inertias)[1:]) > 0.1
    heavy = cc.with_inertias(bare)
    assert heavy.inputs == m.inputs
    assert heavy.notes == m.notes
    again = cc.load_urdf(heavy.description.text, xacro=False)
    written = cc.load_urdf(cc.export(m, "urdf")[0], xacro=False)
    twice = cc.with_inertias(m, 5400.0)
    assert twice.notes == (m.notes[0].replace("2700", "5400"),)
    for i, own in enumerate(m.model.inertias):
        for other in (heavy, again, written):
            assert own.isApprox(other.model.inertias[i], 1e-12)
        assert_close(twice.model.inertias[i].mass, 2 * own.mass, 1e-12)
    if name != "d1":  # home of D1 is regular for its inputs as well
        return
    assert_close(cc.statics(twice, m.home).inputs, 2 * cc.statics(m, m.home).inputs, 1e-9)


def test_a_rod_of_the_linear_delta_by_hand() -> None:
    """A block of 1.4 w x 1.4 w x 0.5 m below its hinge, w = 0.0075 m, of steel."""
    m = cc.load("linear_delta", density=7850)
    side, rod = 1.4 * 0.015 * 0.5, 0.5
    mass = 7850 * side**2 * rod
    found = m.model.inertias[m.model.getJointId("leg1_D")]
    assert abs(found.mass - mass) < 1e-12
    assert_close(found.lever, [0.0, 0.0, -rod / 2], 1e-15)
    across, along = mass * (side**2 + rod**2) / 12, mass * side**2 / 6
    assert_close(found.inertia, np.diag([across, across, along]), 1e-15)


def shape(geometry: str, material: str) -> str:
    return f"<visual><geometry><{geometry}/></geometry><material {material}/></visual>"


DENSE = f"""<robot name="dense">
  <material name="steel" density="7850"><color rgba="1 1 1 1"/></material>
  <link name="base">{shape('sphere radius="1"', 'name="steel"')}</link>
  <link name="a">{shape('box size="0.1 0.2 0.3"', 'name="steel"')}
    {shape('sphere radius="0.1"', 'name="own" density="1000"')}
    {shape('sphere radius="5"', 'name="air"')}</link>
  <link name="b"><inertial><mass value="3"/>
    <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
    {shape('sphere radius="0.1"', 'name="steel"')}</link>
  <joint name="A" type="continuous"><parent link="base"/><child link="a"/></joint>
  <joint name="B" type="continuous"><parent link="a"/><child link="b"/></joint></robot>"""


def test_materials_of_a_file() -> None:
    m = cc.load_urdf(DENSE, xacro=False)
    ball = 4 / 3 * np.pi * 1e-3 * 1000
    assert_close([i.mass for i in m.model.inertias], [0.0, 7850 * 0.006 + ball, 3.0], 1e-12)
    assert m.notes == ("1 link has the mass of its shapes, solid at 1000, 7850 kg/m^3",)
    one = cc.with_inertias(m, 1.0)  # what is stated stays, by whatever density
    assert_close(one.model.inertias[1].mass, 0.006 + ball / 1000 + 4 / 3 * np.pi * 125, 1e-9)
    assert one.model.inertias[2].mass == 3.0


@pytest.mark.parametrize("format", ["mjcf", "sdf", "urdf+"])
def test_other_formats_keep_the_masses(format: str) -> None:
    m = cc.load("d1")
    text, _ = cc.export(m, format)
    back = cc.load_urdf(text, xacro=False) if format == "urdf+" else cc.load_file(text)
    total = [sum(i.mass for i in list(x.model.inertias)[1:]) for x in (m, back)]
    # MuJoCo's smallest masses stand for links without one
    assert abs(total[0] - total[1]) < (0.05 if format == "mjcf" else 1e-9)


def test_wrong_densities_are_refused() -> None:
    for wrong, match in (("-1", "negative"), ("heavy", "number"), ("nan", "finite")):
        with pytest.raises(cc.DescriptionError, match=match):
            cc.load_urdf(DENSE.replace("7850", wrong), xacro=False)
    with pytest.raises(cc.DescriptionError, match="negative"):
        cc.load("d1", density=-1)


def test_what_is_given_is_kept() -> None:
    m = cc.with_inertias(cc.load("linear_delta"))
    again = cc.with_inertias(m, 1.0)
    for one, two in zip(m.model.inertias, again.model.inertias, strict=True):
        assert one.isApprox(two, 0.0)
    with pytest.raises(cc.ClosureError, match="density"):
        cc.with_inertias(m, -1.0)
