"""What figures say in words: headings, captions, alternative texts; pages, ticks, grey schemes."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from drawn_maps import made_map, made_set, sphere
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgb

from closedchain.analysis.figures.drawing import draw_map, draw_survey
from closedchain.analysis.figures.palette import COLOURED, DASHES, EDGES, MARKERS, PRINTED
from closedchain.analysis.figures.saving import alt_file, words_of
from closedchain.analysis.figures.ticks import part_ticks, touching_labels
from closedchain.analysis.singularity.sets.mesh_fit import Fit
from closedchain.analysis.survey.captions import account, caption, description, heading
from closedchain.analysis.survey.set_tables import SavedSet

GRID = np.linspace(-1.0, 1.0, 9)
HELD = {
    **{"held_q3": 0.25, "held_q3_units": "m", "held_q4": 0.25, "held_q4_units": "m"},
    **{"held_b": -0.0, "held_b_units": "rad", "mechanism": "arm", "outputs": "x y", "mode": ""},
}


@dataclass(frozen=True)
class Part:
    map: xr.Dataset
    sets: tuple[SavedSet, ...]


@dataclass(frozen=True)
class Many:
    title: str
    slices: tuple[Part, ...]


def held_map(**axes: np.ndarray) -> xr.Dataset:
    data = made_map((0.0,) * len(axes), **axes)
    data.attrs |= HELD
    return data


def curves() -> tuple[SavedSet, SavedSet]:
    line = [(0.0, -1.0), (0.0, 0.0), (0.0, 1.0)]
    return (
        made_set("direct", ("x", "y"), line, on_branch=[True, True, False]),
        made_set("inverse", ("x", "y"), [(y, x) for x, y in line]),
    )


def test_a_heading_says_what_is_held_which_outputs_and_whose_branch() -> None:
    data = held_map(x=GRID, y=GRID)
    words = "x × y, held: q3 = q4 = 0.25 m, b = 0 rad; outputs x y; branch of home"
    assert heading(data) == words
    data.attrs |= {"start": "start", "mode": "--+"}
    assert heading(data).endswith("branch of mode --+")
    figure = draw_map(data, curves())
    assert any(heading(data) == row.get_suptitle() for row in figure.subfigs)  # type: ignore[union-attr]


def test_a_caption_says_how_sets_were_found() -> None:
    direct, inverse = curves()
    data = held_map(x=GRID, y=GRID)
    assert account(direct) == "direct: 1 curve through 3 points (made by hand)"
    assert account(replace(inverse, missed=0)).startswith(
        "inverse: 1 curve through 3 points; a grid twice as fine shows nothing else"
    )
    assert "4 sign changes lie away" in account(replace(inverse, missed=4))
    whole = made_set("direct", ("x", "y"), [], everywhere=True)
    assert account(whole) == "direct: every posture over x × y is singular"
    words = caption(data, [direct])
    assert words.startswith(f"arm: {heading(data)}. Direct: 1 curve")
    assert "on a grid;" in words  # of sets made by hand none is known
    assert "on a grid of 5 × 7 cells;" in caption(data, [replace(direct, grid=(5, 7))])
    assert "no finer grid was tried" in words
    assert "no finer grid" not in caption(data, [replace(direct, missed=0)])
    assert "Map of 9 × 9 cells; no singular sets are drawn." in caption(data, [])
    points, triangles = sphere(0.6)
    mesh = replace(
        made_set("inverse", ("x", "y", "z"), points, (triangles,)),
        fit=Fit(0.05, 0.031, 7, 2, 1),
    )
    said = account(mesh)
    for part in ("within 0.05 cells", "0.031", "7 were split", "2 were left out", "in 1 cells"):
        assert part in said


def test_shares_are_told_to_what_is_there() -> None:
    cells = np.linspace(-1.0, 1.0, 60)
    data = held_map(x=cells, y=cells)
    assert "100 % on the branch." in description(data, [], [])
    data["status"][0, 0] = 1
    words = description(data, [], ["sigma_direct"])
    assert "99.97 % on the branch, 0.03 % without a closed posture that was found." in words


@pytest.mark.parametrize("ending", ["png", "svg", "pdf"])
def test_an_image_has_its_words_beside_it(ending: str, tmp_path: Path) -> None:
    data = held_map(x=GRID, y=GRID)
    data["status"][:3] = 3
    image = tmp_path / f"map.{ending}"
    draw_map(data, curves(), path=image, dpi=40)
    words = alt_file(image).read_text(encoding="utf-8")
    assert caption(data, curves()) in words
    assert "x from -1 to 1 m" in words
    assert "67 % on the branch, 33 % beyond a joint limit" in words
    assert "sigma direct runs from 0 to 1" in words
    if ending == "png":
        assert b"Description" in image.read_bytes()


def test_kinds_differ_without_their_colours() -> None:
    for table in (DASHES, MARKERS, EDGES):
        assert len({str(table[kind]) for kind in ("direct", "inverse", "constraint")}) == 3
    assert len({str(dash) for dash in DASHES.values()}) == 4
    figure = draw_map(held_map(x=GRID, y=GRID), curves(), grey=True)
    ax = next(a for a in figure.axes if a.get_xlabel())
    thick = [c for c in ax.collections if isinstance(c, LineCollection) and c.get_linewidth() == 2]
    assert len({str(c.get_linestyle()) for c in thick if c.get_segments()}) == 2
    for lines in thick:
        red, green, blue = to_rgb(lines.get_color()[0])
        assert red == green == blue
    legends = [legend for row in figure.subfigs for legend in row.legends]  # type: ignore[union-attr]
    drawn = {line.get_label(): line for legend in legends for line in legend.get_lines()}
    shown = [line for label, line in drawn.items() if "singularities" in str(label)]
    assert len({str(line.get_linestyle()) for line in shown}) == len(shown) == 2
    assert set(PRINTED.maps) == set(COLOURED.maps)


def test_large_surveys_go_on_pages_without_a_warning(tmp_path: Path) -> None:
    slices = tuple(Part(held_map(x=GRID, y=GRID), curves()) for _ in range(7))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        images = draw_survey(Many("many", slices), tmp_path / "map.png", dpi=30)
    assert [image.name for image in images] == ["map.png", "map-2.png", "map-3.png"]
    for i, image in enumerate(images):
        assert image.is_file()
        assert f"({i + 1} of 3)" in alt_file(image).read_text(encoding="utf-8")
    assert draw_survey(Many("one", slices[:1]), tmp_path / "one.png", dpi=30) == (
        tmp_path / "one.png",
    )


@pytest.mark.parametrize("k", [1, 2, 3])
def test_tick_labels_do_not_touch(k: int) -> None:
    axes = {"x": np.linspace(-0.1, 0.1, 7), "y": np.linspace(1000.0, 1000.2, 7), "rz": GRID[:7]}
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # the start, far outside, must not spread the layout
        figure = draw_map(held_map(**dict(list(axes.items())[:k])))
        assert not touching_labels(figure)  # type: ignore[arg-type]


def test_ticks_that_touch_are_taken_away() -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(1.5, 1.5), layout="constrained")
    ax = figure.subplots()
    ax.set_xlim(1000.0, 1001.0)
    ax.ticklabel_format(useOffset=False)
    ax.locator_params(nbins=9)
    assert touching_labels(figure)
    part_ticks(figure)
    assert not touching_labels(figure)


def test_a_map_is_told_in_words_too() -> None:
    data = held_map(x=GRID, y=GRID)
    data["status"][:3] = 3
    words = words_of(draw_map(data, curves()))  # type: ignore[arg-type]
    assert words.startswith(heading(data))
    assert "inverse: 1 curve through 3 points" in words
    assert "sigma direct over x [m] and y [m]: colours from 0 to 1" in words
    assert "from 1 to 1" not in words


def test_figures_of_lines_are_told_in_words() -> None:
    from matplotlib.figure import Figure

    figure = Figure()
    ax = figure.subplots()
    ax.plot([0.0, 1.0], [2.0, 5.0], label="q1")
    ax.set(title="inputs", xlabel="time [s]", ylabel="[m]")
    figure.suptitle("arm")
    assert words_of(figure) == "arm. inputs [m] over time [s]: q1 from 2 to 5."
    ax.set_ylabel("length [m]")
    ax.axhline(3.0)  # guides the eye
    assert words_of(figure) == "arm. inputs, length [m], over time [s]: q1 from 2 to 5."
