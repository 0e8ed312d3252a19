"""Figures of maps made by hand: colours by kind, hatches, home, and what is refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from drawn_maps import made_map, made_set, sphere
from matplotlib.axes._secondary_axes import SecondaryAxis
from matplotlib.collections import LineCollection
from matplotlib.colors import to_hex

import closedchain as cc
from closedchain.analysis.figures.drawing import draw_map
from closedchain.analysis.figures.palette import BLANKS, COLOURS
from closedchain.analysis.figures.space import cut
from closedchain.analysis.survey.set_tables import polylines

GRID = np.linspace(-1.0, 1.0, 9)


def panels(figure: Any) -> list[Any]:
    """Axes with a map: those that are no colour bars."""
    return [ax for ax in figure.axes if ax.get_xlabel()]


def colours_of_lines(ax: Any) -> dict[str, list[np.ndarray]]:
    """Strokes of curves by colour, white halos left out."""
    found: dict[str, list[np.ndarray]] = {}
    for lines in ax.collections:
        if isinstance(lines, LineCollection) and lines.get_segments():
            found.setdefault(to_hex(lines.get_color()[0]).upper(), []).extend(lines.get_segments())
    found.pop("#FFFFFF", None)
    return found


def legend_of(figure: Any) -> list[str]:
    (legend,) = [child for row in figure.subfigs for child in row.legends]
    return [text.get_text() for text in legend.get_texts()]


def test_a_slice_shows_two_measures_curves_by_kind_and_home() -> None:
    data = made_map((0.25, -0.5), x=GRID, y=GRID)
    direct = made_set("direct", ("x", "y"), [(0.0, -1.0), (0.0, 0.0), (0.0, 1.0)])
    # coordinates in the other order: a set need not follow the order of the map
    inverse = made_set("inverse", ("y", "x"), [(0.5, -1.0), (0.5, 1.0)])
    figure = draw_map(data, [direct, inverse])
    left, right = panels(figure)
    for ax in (left, right):
        lines = colours_of_lines(ax)
        assert set(lines) == {COLOURS["direct"], COLOURS["inverse"]}
        assert np.array_equal(lines[COLOURS["direct"]][0], direct.coordinates)
        assert np.array_equal(lines[COLOURS["inverse"]][0], inverse.coordinates[:, ::-1])
        (star,) = [line for line in ax.lines if line.get_marker() == "*"]
        assert star.get_xydata().tolist() == [[0.25, -0.5]]
        assert (ax.get_xlabel(), ax.get_ylabel()) == ("x [m]", "y [m]")
        assert ax.get_xlim() == ax.get_ylim() == (-1.0, 1.0)
    assert legend_of(figure)[-1] == "home"


@pytest.mark.parametrize("name", BLANKS)
def test_cells_without_a_posture_are_hatched_and_named(name: str) -> None:
    data = made_map(x=GRID, y=GRID)
    code = data["status"].attrs["flag_meanings"].split().index(name.replace(" ", "_"))
    data["status"][:3, :3] = code
    figure = draw_map(data)
    assert legend_of(figure) == [BLANKS[name].label]
    hatched = [c for c in panels(figure)[0].collections if c.get_hatch() == BLANKS[name].hatch]
    corners = np.concatenate([path.vertices for c in hatched for path in c.get_paths()])
    edge = 0.5 * (GRID[2] + GRID[3])  # of the nine cells, whole
    assert corners.min() == -1.0
    assert corners.max() == pytest.approx(edge)
    assert legend_of(draw_map(made_map(x=GRID, y=GRID))) == []


def test_curves_of_other_branches_are_thin_and_closed_ones_closed() -> None:
    corners = [(0.0, 0.0), (0.5, 0.0), (0.5, 0.5), (0.0, 0.5)]
    ring = made_set("direct", ("x", "y"), corners, ends=(("closed", "closed"),))
    ((line, on_branch),) = polylines(ring)
    assert (line.tolist(), on_branch) == ([0, 1, 2, 3, 0], True)
    half = made_set("direct", ("x", "y"), corners, on_branch=[True, True, False, False])
    strokes = [(line.tolist(), on) for line, on in polylines(half)]
    assert strokes == [([0, 1, 2], True), ([2, 3], False)]
    figure = draw_map(made_map(x=GRID, y=GRID), [half])
    assert "thin: the same, not reached by the branch" in legend_of(figure)


def test_a_slice_that_is_singular_everywhere_says_so() -> None:
    whole = made_set("direct", ("x", "y"), [], everywhere=True)
    left, right = panels(draw_map(made_map(x=GRID, y=GRID), [whole]))
    assert left.get_title() == "every posture is directly singular"
    assert right.get_title() == "sigma inverse"


def test_angles_have_a_second_scale_in_degrees() -> None:
    figure = draw_map(made_map(x=GRID, alpha=GRID))
    ax = panels(figure)[0]
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("x [m]", "alpha [rad]")
    figure.canvas.draw()
    (degrees,) = [a for a in ax.child_axes if isinstance(a, SecondaryAxis)]
    assert degrees.get_ylim() == pytest.approx(tuple(np.degrees(ax.get_ylim())))
    assert any(text.get_text().endswith("°") for text in degrees.get_yticklabels())


def test_tilt_and_azimuth_are_drawn_round() -> None:
    tilt, turn = np.linspace(0.0, 1.2, 7), np.linspace(-np.pi, np.pi, 13)
    data = made_map((0.0, 0.0), tilt=tilt, azimuth=turn)
    circle = np.stack([np.full(13, 0.8), turn], axis=1)
    ax = panels(draw_map(data, [made_set("direct", ("tilt", "azimuth"), circle)]))[0]
    assert ax.name == "polar"
    assert ax.get_rmax() == 1.2
    ((line,),) = colours_of_lines(ax).values()
    assert np.array_equal(line, circle[:, ::-1])  # angle first
    wedge = panels(draw_map(made_map(azimuth=turn[:5], tilt=tilt)))[0]
    assert wedge.name == "polar"
    assert (wedge.get_thetamin(), wedge.get_thetamax()) == pytest.approx((-180.0, -60.0))
    twice = made_map(tilt=tilt, azimuth=np.linspace(-6.0, 6.0, 13))
    assert panels(draw_map(twice))[0].name == "rectilinear"


def test_one_coordinate_gives_lines() -> None:
    data = made_map((0.5,), alpha=GRID)
    data["status"][:2] = 1
    data["sigma_direct"][:2] = np.nan
    figure = draw_map(data, [made_set("direct", ("alpha",), [0.0])])
    ax = panels(figure)[0]
    drawn = {line.get_label(): line for line in ax.lines}
    direct = next(line for label, line in drawn.items() if label.startswith("sigma_direct"))
    assert np.array_equal(direct.get_ydata(), data["sigma_direct"].to_numpy(), equal_nan=True)
    upright = [line for line in ax.lines if list(line.get_xdata()) == [0.0, 0.0]]
    assert [to_hex(line.get_color()).upper() for line in upright] == [COLOURS["direct"]]
    assert set(legend_of(figure)) == {
        "direct singularities (type 2)",
        "home",
        BLANKS["none found"].label,
    }
    (shaded,) = ax.patches
    assert shaded.get_hatch() == BLANKS["none found"].hatch
    edges = shaded.get_x(), shaded.get_x() + shaded.get_width()
    assert edges == pytest.approx((-1.0, 0.5 * (GRID[1] + GRID[2])))


def test_three_coordinates_give_surfaces_and_planes() -> None:
    points, triangles = sphere(0.6)
    found = made_set("inverse", ("x", "y", "z"), points, (triangles,))
    figure = draw_map(made_map((0.0, 0.0, 0.25), x=GRID, y=GRID, z=GRID), [found])
    (space,) = [ax for ax in figure.axes if ax.name == "3d"]
    (mesh,) = space.collections
    assert len(mesh.get_facecolor()) == len(triangles)
    titles = [ax.get_title() for ax in panels(figure) if ax.name != "3d"]
    assert titles[:3] == ["sigma direct at z = 0.25 m", "sigma direct at y = 0 m",
                          "sigma direct at x = 0 m"]  # fmt: skip
    assert len(titles) == 6


def test_a_plane_cuts_a_sphere_in_a_circle() -> None:
    points, triangles = sphere(0.6)
    found = made_set("direct", ("x", "y", "z"), points, (triangles,))
    circle = cut(found, "z", 0.3, ("x", "y"))
    radii = np.linalg.norm(circle.coordinates, axis=1)
    assert len(circle.pieces) == 1  # in one stroke, so that dashes run on
    assert len(circle.coordinates) > 30
    assert np.allclose(radii, np.sqrt(0.6**2 - 0.3**2), atol=5e-3)
    turned = np.sort(np.arctan2(*circle.coordinates.T))
    assert np.diff(turned).max() < 0.3  # all the way round
    assert not cut(found, "x", 0.7, ("y", "z")).pieces


def test_measures_can_be_chosen() -> None:
    data = made_map(x=GRID, y=GRID)
    data["condition"][4] = np.inf  # where the twist map does not exist
    figure = draw_map(data, measures=["det_direct", "condition"])
    assert [ax.get_title() for ax in panels(figure)] == ["det direct", "condition"]
    signed, condition = (ax.collections[0] for ax in panels(figure))
    assert signed.get_clim() == (-1.0, 1.0)
    assert condition.get_clim()[0] == pytest.approx(1.0)
    assert np.isfinite(np.ma.filled(condition.get_array(), 1.0)).all()
    figure.canvas.draw()


def test_axes_of_ones_own_and_no_state_of_pyplot() -> None:
    import matplotlib.pyplot as plt
    from matplotlib.figure import Figure

    before = plt.get_fignums()
    own = Figure()
    ax = own.add_subplot()
    data = made_map(x=GRID, y=GRID)
    assert draw_map(data, axes=ax, measures="sigma_inverse") is own
    assert ax.get_title() == "sigma inverse"
    draw_map(data)
    assert plt.get_fignums() == before
    with pytest.raises(cc.ClosureError, match="path or axes"):
        draw_map(data, axes=ax, path="map.png")


@pytest.mark.parametrize(
    ("ending", "begins"), [("png", b"\x89PNG"), ("svg", b"<?xml"), ("pdf", b"%PDF")]
)
def test_images(tmp_path: Path, ending: str, begins: bytes) -> None:
    path = tmp_path / f"map.{ending}"
    draw_map(made_map(x=GRID, y=GRID), path=path, dpi=50)
    assert path.read_bytes().startswith(begins)


def nothing() -> xr.Dataset:
    return made_map(x=GRID, y=GRID).drop_vars("status")


def unlabelled() -> xr.Dataset:
    data = made_map(x=GRID, y=GRID)
    data["status"].attrs = {}
    return data


@pytest.mark.parametrize(
    ("data", "sets", "measures", "message"),
    [
        (nothing(), [], None, "'status' is missing"),
        (unlabelled(), [], None, "does not say what its numbers mean"),
        (made_map(x=GRID, y=GRID), [], "sigma", "unknown measure 'sigma'"),
        (made_map(x=GRID, y=GRID), [], "det_inverse", "not square"),
        (made_map(x=GRID, y=GRID), [], [], "at least one measure"),
        (
            made_map(x=GRID, y=GRID),
            [made_set("direct", ("x", "z"), [])],
            None,
            "the map is over x x y, the direct set over x x z",
        ),
        (made_map(a=GRID, b=GRID, c=GRID, d=GRID), [], None, "one to three coordinates"),
    ],
)
def test_what_cannot_be_drawn_is_refused(
    data: xr.Dataset, sets: list[Any], measures: Any, message: str
) -> None:
    with pytest.raises(cc.ClosureError, match=message):
        draw_map(data, sets, measures=measures)
