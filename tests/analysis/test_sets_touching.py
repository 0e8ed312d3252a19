"""Sets at which a determinant touches zero; many points at once against one at a time."""

from __future__ import annotations

import numpy as np
import pytest
from linkage_text import J, load
from singular_points import check_points

import closedchain as cc
from closedchain.analysis.singularity.maps.grid import grid_of
from closedchain.analysis.singularity.sets.bordered import Measure
from closedchain.analysis.singularity.sets.classifying import classified
from closedchain.analysis.singularity.sets.edges import on_edges
from closedchain.analysis.singularity.sets.lattice import lattice_on
from closedchain.analysis.singularity.sets.seeds import brackets
from closedchain.analysis.singularity.sets.slices import Frame, Slice
from closedchain.closure.charting import chart_of

LEAN = np.linspace(0.4, 1.3, 9)
LEGS = np.linspace(0.4, 0.64, 9)
REACH = np.linspace(-0.4, 0.4, 9)


@pytest.fixture(scope="module")
def polar() -> cc.Mechanism:
    """Turntable, leaning axis, slide through both: det = r^2 sin(lean) keeps its sign at r = 0."""
    return load(
        "polar",
        [
            J("A", "base", "table"),
            J("B", "table", "fork", axis="0 1 0"),
            J("C", "fork", "hand", type="prismatic"),
        ],
        inputs={"turn": "A", "lean": "B", "r": "C"},
        home={"A": 0.3, "B": 0.9, "C": 0.2},
        tip="hand",
        outputs="x y z",
    )


@pytest.mark.parametrize(
    "radii",
    [np.linspace(-0.31, 0.4, 12), np.linspace(-0.3, 0.3, 13)],
    ids=["between cells", "on cells"],
)
def test_squared_factor_gives_a_curve(polar: cc.Mechanism, radii: np.ndarray) -> None:
    over = {"r": radii, "lean": LEAN}
    found = cc.singularity_set(polar, "inverse", over)
    check_points(polar, found, over)
    assert found.verdict == "curve"
    assert found.missed == 0
    assert found.ends == (("edge of the range", "edge of the range"),)
    (piece,) = found.pieces
    r, lean = found.coordinates[piece].T
    assert np.abs(r).max() < 1e-9
    steps = np.diff(lean)
    assert abs(np.sign(steps).sum()) == steps.size >= LEAN.size - 1  # in order
    assert (lean.min(), lean.max()) == pytest.approx((LEAN[0], LEAN[-1]))


def test_squared_factor_that_a_simple_one_crosses(polar: cc.Mechanism) -> None:
    over = {"r": np.linspace(-0.31, 0.3, 13), "lean": np.linspace(-0.45, 1.3, 14)}
    found = cc.singularity_set(polar, "inverse", over)
    check_points(polar, found, over)
    assert found.missed == 0
    r, lean = np.abs(found.coordinates.T)
    assert np.minimum(r, lean).max() < 1e-9
    assert r.max() > 0.29
    assert lean.max() > 1.29


def test_squared_factor_gives_a_surface(polar: cc.Mechanism) -> None:
    over = {"r": np.linspace(-0.31, 0.3, 7), "lean": LEAN[::2], "turn": np.linspace(0.0, 1.0, 5)}
    found = cc.singularity_set(polar, "inverse", over)
    check_points(polar, found, over)
    assert found.verdict == "surface"
    assert np.abs(found.coordinates[:, 0]).max() < 1e-9
    (triangles,) = found.pieces
    assert len(triangles) == 2 * 4 * 4
    corners = found.coordinates[triangles][:, :, 1:]
    sides = corners[:, 1:] - corners[:, :1]
    area = 0.5 * np.abs(np.linalg.det(sides)).sum()
    assert area == pytest.approx(0.9)


def test_no_curve_where_the_least_value_is_not_zero(polar: cc.Mechanism) -> None:
    """sin(lean) is least at the ends of the range, r at the slide's shortest."""
    over = {"r": np.linspace(0.1, 0.4, 8), "lean": np.linspace(0.4, 2.6, 9)}
    found = cc.singularity_set(polar, "inverse", over)
    assert found.verdict == "none found"
    assert found.missed == 0


# -- many at once ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("robot", "names", "outputs"),
    [
        ("d1", ("q1", "q2"), None),
        ("eclipse", ("tilt", "azimuth", "x"), None),
        ("rpa3t", ("x", "y"), None),
        ("rus6", ("x", "ry"), None),
        ("linear_delta", ("x", "q2"), "x y"),
    ],
)
@pytest.mark.parametrize("kind", ["direct", "inverse", "constraint"])
def test_equations_of_many_points(
    robot: str, names: tuple[str, ...], outputs: str | None, kind: str
) -> None:
    m = cc.load(robot)
    chart = chart_of(m, names, outputs=outputs)
    system = Slice(chart, (Measure(m, kind, m.outputs(outputs)),))
    rng = np.random.default_rng(5)
    home = system.point(m.home)
    z = np.array([system.move(home, 0.02 * rng.standard_normal(system.size)) for _ in range(4)])
    one = system.frame(home)
    frames = Frame(one.combine, tuple((b[None], c[None]) for b, c in one.borders))
    values, jacobian = system.evaluate(z, frames)
    for i, point in enumerate(z):
        value, matrix = system.evaluate(point, one)
        assert np.abs(values[i] - value).max() < 1e-12
        assert np.abs(jacobian[i] - matrix).max() < 1e-9  # a difference quotient
    assert np.abs(system.residual(z) - [system.residual(p) for p in z]).max() < 1e-12
    steps = 0.1 * rng.standard_normal((4, system.size))
    assert np.abs(system.difference(z, system.move(z, steps)) - steps).max() < 1e-10


@pytest.mark.parametrize(
    ("robot", "kind", "over"),
    [
        ("d1", "direct", {"q1": LEGS, "q2": LEGS}),
        ("d1", "inverse", {"q1": LEGS, "q2": LEGS}),
        (
            "linear_delta",
            "inverse",
            {"x": np.linspace(-0.4, 0.4, 9), "y": np.linspace(-0.4, 0.4, 9)},
        ),
    ],
)
def test_points_on_edges_and_their_classification(
    robot: str, kind: str, over: dict[str, np.ndarray]
) -> None:
    m = cc.load(robot)
    outputs = m.outputs()
    lattice = lattice_on(grid_of(m, over), outputs)
    edges = brackets(lattice, kind)
    system = Slice(lattice.chart, (Measure(m, kind, outputs),))
    z = on_edges(system, lattice, kind, edges)
    assert len(z) > 10
    assert np.isfinite(z).all()
    low, high = lattice.place(edges.lower), lattice.place(edges.upper)
    c, cell = system.coordinates(z), lattice.cell
    assert ((c >= low - 0.1 * cell) & (c <= high + 0.1 * cell)).all()
    across = np.abs(c - low)
    across[np.arange(len(c)), edges.axis] = 0.0
    assert across.max() < 1e-12  # on its edge
    q = np.concatenate([system.posture(z)[::3], lattice.q[lattice.ok][::9]])
    for posture, many in zip(q, classified(m, q, outputs), strict=True):
        one = cc.classify(m, posture)
        assert many.kinds == one.kinds
        sigmas = [one.sigma_direct, one.sigma_inverse, one.sigma_constraint]
        assert np.abs(many.sigmas - sigmas).max() < 1e-11
        for a, b in ((many.free_twists, one.free_twists), (many.lost_twists, one.lost_twists)):
            assert a.shape == b.shape
            assert (
                np.abs(a @ a.T - b @ b.T).max(initial=0.0)
                < 1e-8 * (1.0 + np.abs(b).max(initial=0.0)) ** 2
            )
