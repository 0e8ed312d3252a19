import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser import Browser
from page_reading import HALVES, SLIDER, SQUARE, browse, drawn, geometry, transforms
from PIL import Image

import closedchain as cc
from closedchain.robots._body import joint_poses
from closedchain.robots._shapes import balls, cividis, mapped, spelled, thinned, tube
from closedchain.robots.viewer import (
    PALETTE,
    Box,
    Markers,
    Polyline,
    Surface,
    boxed,
    static_page,
)


@pytest.fixture(scope="module")
def slider() -> cc.Mechanism:
    return cc.load_urdf(SLIDER)


# -- shapes ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("closed", [False, True])
def test_tube_has_its_radius_everywhere(closed: bool) -> None:
    t = np.linspace(0.0, 2.0 * np.pi, 600, endpoint=not closed)
    points = np.column_stack([np.cos(t), np.sin(2.0 * t), np.sin(3.0 * t + 0.3)])
    vertices, triangles, owner = tube(points, 0.01, closed)
    gaps = np.linalg.norm(vertices - points[owner], axis=1)
    assert np.allclose(gaps, 0.01, atol=1e-12)
    edges = np.sort(np.vstack([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]))
    _, uses = np.unique(edges, axis=0, return_counts=True)
    assert set(uses) == ({2} if closed else {1, 2})  # a closed tube has no rim
    spokes = (vertices - points[owner]).reshape(-1, 6, 3)
    turns = np.roll(spokes, -1, axis=0) - spokes  # the last to the first too where it is closed
    assert np.linalg.norm(turns if closed else turns[:-1], axis=2).max() < 0.15 * 0.01


def test_tube_survives_repeated_points_and_turning_back() -> None:
    there_and_back = np.array([[0.0, 0, 0], [0, 0, 0], [1, 0, 0], [0, 0, 0]])
    vertices, triangles, _ = tube(there_and_back, 0.1, False)
    assert np.isfinite(vertices).all()
    assert len(vertices) == 18
    assert triangles.max() == 17
    ball, _, owner = tube(np.ones((5, 3)), 0.1, True)
    assert np.allclose(np.linalg.norm(ball - 1.0, axis=1), 0.2)
    assert not owner.any()


def test_balls_are_closed_and_point_outwards() -> None:
    vertices, triangles, owner = balls(SQUARE, 0.5)
    assert np.allclose(np.linalg.norm(vertices - SQUARE[owner], axis=1), 0.5)
    a, b, c = (vertices[triangles[:, i]] - SQUARE[owner[triangles[:, 0]]] for i in range(3))
    assert (np.einsum("ij,ij->i", a, np.cross(b, c)) > 0.0).all()
    assert len(triangles) == 4 * 20


def test_thinning_keeps_within_its_tolerance_and_keeps_corners() -> None:
    t = np.linspace(0.0, 2.0 * np.pi, 2000)
    circle = np.column_stack([np.cos(t), np.sin(t)])
    kept = thinned(circle, 1e-3)
    assert len(kept) < 140  # 71 would do, placed at best
    inner = np.column_stack([np.interp(t, t[kept], circle[kept, i]) for i in range(2)])
    assert np.abs(np.linalg.norm(inner, axis=1) - 1.0).max() < 1.1e-3
    corner = np.array([[0.0, 0], [1, 0], [2, 0], [2, 1], [2, 2]])
    assert thinned(corner, 1e-9).tolist() == [0, 2, 4]


# -- overlays on the page --------------------------------------------------------------------------


def test_surface_is_drawn_at_its_place_on_both_sides_and_hides_nothing(
    slider: cc.Mechanism,
) -> None:
    page = static_page(slider, overlays=[Surface(SQUARE, HALVES, "inverse", opacity=0.3)])
    material, arrays = geometry(page, 0)
    assert np.array_equal(arrays["position"], SQUARE)
    assert np.array_equal(arrays["index"], HALVES)
    assert material["color"] == 0x0072B2
    assert (material["side"], material["transparent"], material["depthWrite"]) == (2, True, False)
    assert material["opacity"] == 0.3
    solid, _ = geometry(static_page(slider, overlays=[Surface(SQUARE, HALVES, opacity=1.0)]), 0)
    assert (solid["transparent"], solid["depthWrite"]) == (False, True)


def test_values_are_coloured_and_the_bar_says_how(slider: cc.Mechanism) -> None:
    values = [0.0, 1.0, 2.0, 5.0]
    overlay = Surface(SQUARE, HALVES, values=values, label="sigma <1>", unit="mm", limits=(0, 4))
    page = static_page(slider, overlays=[overlay])
    _, arrays = geometry(page, 0)
    table = cividis()
    assert np.allclose(arrays["color"], table[[0, 64, 128, 255]], atol=1e-6)
    assert "<p>sigma &lt;1&gt; [mm]</p>" in page
    assert "<span>0</span><span>2</span><span>≥ 4</span>" in page
    first, last = (
        f"#{r:02x}{g:02x}{b:02x}" for r, g, b in np.rint(255 * table[[0, -1]]).astype(int)
    )
    gradient = re.search(r"linear-gradient\(to right, ([^)]*)\)", page)
    assert gradient is not None
    stops = gradient[1].split(", ")
    assert (stops[0], stops[-1]) == (first, last)


def test_equal_values_are_one_colour() -> None:
    assert np.array_equal(mapped(np.full(3, 7.0), (7.0, 7.0)), cividis()[[128] * 3])


def test_numbers_of_a_bar_are_told_apart() -> None:
    def marks(low: float, high: float) -> list[str]:
        return spelled(np.linspace(low, high, 3), (low, high))

    assert marks(-1.0, 1.0 + 1e-7) == ["-1", "0", "1"]
    assert marks(0.5001, 0.5003) == ["0.5001", "0.5002", "0.5003"]
    assert marks(0.0, 2e-7) == ["0", "1e-07", "2e-07"]
    assert marks(3.0, 3.0) == ["3", "3", "3"]


def test_line_keeps_its_colours_when_it_is_thinned(slider: cc.Mechanism) -> None:
    x = np.linspace(0.0, 1.0, 500)
    points = np.column_stack([x, 0 * x, 0 * x])
    page = static_page(slider, overlays=[Polyline(points, "direct", width=0.02)])
    material, arrays = geometry(page, 0)
    assert len(arrays["position"]) == 2 * 6
    assert material["color"] == 0xD55E00
    assert np.allclose(np.hypot(*arrays["position"][:, 1:].T), 0.01, atol=1e-8)
    values = np.abs(x - 0.5)
    _, arrays = geometry(
        static_page(slider, overlays=[Polyline(points, values=values, width=0.02)]), 0
    )
    # thinned to the kink, and each vertex has the colour of its own value
    assert len(arrays["position"]) <= 4 * 6
    assert np.abs(arrays["position"][:, 0] - 0.5).min() < 0.02
    own = mapped(np.abs(arrays["position"][:, 0] - 0.5), (values.min(), values.max()))
    assert np.abs(arrays["color"] - own).max() < 0.02


def test_legend_names_each_label_once_in_its_colour(slider: cc.Mechanism) -> None:
    line = Polyline(SQUARE, "direct", label="direct & more", closed=True)
    page = static_page(
        slider,
        overlays=[line, line, Markers(SQUARE, "#123456", label="spots"), Surface(SQUARE, HALVES)],
        title="Sets <of> it",
    )
    assert page.count("direct &amp; more</p>") == 1
    assert re.search(r'<line [^>]*stroke="#d55e00"[^>]*/></svg>direct &amp; more</p>', page)
    assert '<i class="ball" style="background: #123456"></i>spots</p>' in page
    assert "<h1>Sets &lt;of&gt; it</h1>" in page
    assert "<title>Sets &lt;of&gt; it</title>" in page


def test_palette_is_okabe_and_itos() -> None:
    assert dict(PALETTE) == {
        "direct": "#D55E00",
        "inverse": "#0072B2",
        "combined": "#000000",
        "constraint": "#009E73",
    }


def test_camera_steps_back_for_overlays(slider: cc.Mechanism) -> None:
    def camera(*overlays: Any) -> tuple[float, np.ndarray, np.ndarray]:
        page = static_page(slider, overlays=overlays)
        (position,) = (c["value"] for c in drawn(page) if c.get("property") == "position")
        return float(np.linalg.norm(position)), position, transforms(page)["/meshcat/robot"]

    near, *_ = camera()
    far_away = np.array([[0.0, 0, 0], [9.0, -4.0, 5.0]])
    far, position, turned = camera(Markers(far_away))
    assert far > 3.0 * near
    back = np.array([position[0], -position[2], position[1]])
    right = np.cross([0.0, 0.0, 1.0], back)
    for spot in far_away:
        seen = turned[:3, :3] @ spot + turned[:3, 3] - back
        depth = -seen @ back / np.linalg.norm(back)
        aside = seen @ right / np.linalg.norm(right)
        upright = np.sqrt(seen @ seen - depth**2 - aside**2)
        reach = np.tan(np.radians(37.5)) * depth
        assert abs(aside) < 1.2 * reach
        assert upright < reach


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Polyline(np.zeros((4, 2))), r"polyline: points must have shape \(n, 3\)"),
        (lambda: Polyline(np.zeros((1, 3))), "at least 2 are needed, got 1"),
        (lambda: Polyline(SQUARE * np.nan, label="rim"), "polyline 'rim': points must be finite"),
        (lambda: Polyline(SQUARE * 1e9), "within 1e\\+06 m"),
        (lambda: Polyline([["a", "b", "c"]]), "array of numbers"),
        (lambda: Polyline(SQUARE, values=[1.0]), r"values must have shape \(4,\), got \(1,\)"),
        (lambda: Polyline(SQUARE, values=[1, 2, 3, np.inf]), r"entry \[3\] is inf"),
        (lambda: Polyline(SQUARE, limits=(2, 1)), "limits must rise"),
        (lambda: Polyline(SQUARE, width=0.0), "width must be positive"),
        (lambda: Polyline(SQUARE, "directt"), "did you mean 'direct'"),
        (lambda: Markers(np.zeros((0, 3))), "at least 1"),
        (lambda: Markers(SQUARE, size=-1.0), "size must be positive"),
        (lambda: Surface(SQUARE, [[0, 1, 4]]), "triangle 0 names vertex 4; there are .* 0 to 3"),
        (lambda: Surface(SQUARE, [[0, 1, -1]]), "names vertex -1"),
        (lambda: Surface(SQUARE, [[0.0, 1.0, 2.0]]), "integers"),
        (lambda: Surface(SQUARE, [0, 1, 2]), r"shape \(t, 3\)"),
        (lambda: Surface(SQUARE, HALVES, opacity=0.0), "opacity"),
        (lambda: Box(("a", "b"), ("", "", ""), SQUARE, SQUARE, SQUARE), "three texts"),
    ],
)
def test_malformed_overlays_are_named(make: Any, message: str) -> None:
    with pytest.raises(cc.ClosureError, match=message):
        make()


# -- boxes -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("up", ["x", "y", "z"])
def test_box_maps_linearly_and_stands_clear_of_the_robot(d1: cc.Mechanism, up: Any) -> None:
    values = np.array([[0.4, 0.5, -2.0], [0.6, 0.5, -2.0], [0.4, 0.7, 3.0], [0.6, 0.7, 3.0]])
    box, line, surface = boxed(
        [Polyline(values, label="set"), Surface(values, HALVES)],
        ("q1", "q2", "angle"),
        ("m", "m", "rad"),
        beside=d1,
        up=up,
    )
    assert isinstance(box, Box)
    assert isinstance(line, Polyline)
    assert line.label == "set"
    lengths = np.linalg.norm(box.edges, axis=1)
    assert np.allclose(lengths, lengths[0])
    assert np.allclose(box.edges[2], lengths[2] * np.eye(3)["xyz".index(up)])
    assert np.linalg.det(box.edges) > 0.0
    assert np.allclose(line.points[0], box.corner)
    assert np.allclose(line.points[3], box.corner + box.edges.sum(axis=0))
    assert np.allclose(surface.vertices, line.points)  # type: ignore[union-attr]
    middle = box.place([[0.5, 0.6, 0.5]])[0]
    assert np.allclose(middle, box.corners.mean(axis=0))
    joints = joint_poses(d1, d1.home[None])[0, :, :3, 3]
    apart = np.linalg.norm(middle - joints, axis=1).min()
    assert apart > 0.5 * lengths[0]
    assert (np.abs((joints - middle) @ box.edges.T) > 0.5 * lengths**2).any(axis=1).all()


def test_box_is_labelled_with_round_numbers_at_their_places() -> None:
    box = Box(
        ("q1", "q2", "tilt"),
        ("m", "", "rad"),
        np.array([[0.0, 1.0], [-0.013, 0.031], [10.0, 400.0]]),
        np.array([5.0, 0.0, 0.0]),
        np.diag([2.0, 3.0, 4.0]),
    )
    texts = [text for text, _ in box.labels()]
    assert texts[:7] == ["0", "0.2", "0.4", "0.6", "0.8", "1", "q1 [m]"]
    assert texts[7:13] == ["-0.01", "0", "0.01", "0.02", "0.03", "q2"]
    assert texts[13:] == ["100", "200", "300", "400", "tilt [rad]"]
    spots = dict(box.labels()[:6])
    assert np.allclose([spots[x][0] for x in ("0", "0.4", "1")], [5.0, 5.8, 7.0])
    heights = [spot[2] for text, spot in box.labels()[13:17]]
    assert np.allclose(heights, 4.0 * (np.array([100.0, 200, 300, 400]) - 10.0) / 390.0)
    assert len(box.lines()) == 12 + 6 + 5 + 4


def test_box_refuses_what_lies_outside(slider: cc.Mechanism) -> None:
    line = [Polyline(SQUARE)]
    ranges = [[0.0, 1.0], [0.0, 0.5], [-1.0, 1.0]]
    with pytest.raises(cc.ClosureError, match=r"row 2 has b = 1, outside the range 0 to 0\.5"):
        boxed(line, "abc", ["m"] * 3, ranges, beside=slider)
    with pytest.raises(cc.ClosureError, match="range of b must rise"):
        boxed(line, tuple("abc"), ["m"] * 3, [[0, 1], [1, 1], [0, 1]], beside=slider)
    with pytest.raises(cc.ClosureError, match="give overlays or ranges"):
        boxed([], tuple("abc"), ["m"] * 3, beside=slider)


def test_flat_coordinates_get_a_range_of_their_own(slider: cc.Mechanism) -> None:
    box, placed = boxed([Polyline(SQUARE)], tuple("abc"), ("", "", ""), beside=slider)
    assert np.allclose(box.ranges, [[0, 1], [0, 1], [-0.05, 0.05]])  # type: ignore[union-attr]
    assert np.isfinite(placed.points).all()  # type: ignore[union-attr]


@pytest.mark.slow
def test_browser_shows_overlays_labels_and_robot_through_them(
    d1: cc.Mechanism, tmp_path: Path
) -> None:
    # a pane in front of the robot, as the page is seen, and one lone solid far below
    pane = np.array([[-0.6, -1.1, 0.9], [0.6, -1.1, 0.9], [0.6, 0.1, 0.9], [-0.6, 0.1, 0.9]])
    box = boxed([Polyline(SQUARE, "direct")], ("u", "v", "w"), ("m",) * 3, beside=d1, up="y")
    clear = static_page(d1, up="y", overlays=[*box, Markers(pane, size=0.001)], title="")
    panes = [
        Surface(pane[order], HALVES, "inverse", opacity=0.3)
        for order in ([0, 1, 2, 3], [3, 2, 1, 0])
    ]
    seen = []
    for i, extra in enumerate(([], panes[:1], panes[1:])):
        folder = tmp_path / str(i)
        folder.mkdir()
        page = clear
        if extra:
            page = static_page(
                d1, up="y", overlays=[*box, Markers(pane, size=0.001), *extra], title=""
            )
        browse(page, folder, f"--screenshot={folder / 'page.png'}")
        with Image.open(folder / "page.png") as image:
            seen.append(np.asarray(image.convert("RGB")).astype(int))
    bare, front, back = (picture[:, 250:] for picture in seen)  # without the legend
    changed = np.abs(front - bare).max(axis=2) > 12
    assert changed.sum() > 5000  # the pane is there
    assert np.abs(front - back).max(axis=2)[changed].mean() < 40.0  # from behind as well
    tinted = front[changed]
    assert (tinted[:, 2] > tinted[:, 0]).mean() > 0.6  # and blue
    gold = (bare[..., 0] - bare[..., 2] > 60) & changed
    assert gold.sum() > 50  # actuators behind the pane still differ from what is around them
    around = changed & (np.abs(bare - [238, 241, 247]).max(axis=2) < 15)
    assert around.sum() > 500
    assert np.abs(front[gold].mean(axis=0) - front[around].mean(axis=0)).max() > 60
    file = tmp_path / "clear.html"
    file.write_text(clear, encoding="utf-8")
    with Browser(tmp_path / "driven") as browser:
        browser.size(800, 600)
        browser.open(file.as_uri(), "document.querySelectorAll('.name[style*=left]').length >= 3")
        text = str(browser.run("document.documentElement.outerHTML"))
    for name in ("u [m]", "v [m]", "w [m]"):
        found = re.search(
            rf'<span class="name" style="left: ([\d.]+)px; top: ([\d.]+)px;">{re.escape(name)}<',
            text,
        )
        assert found is not None, name
        assert 0.0 < float(found[1]) < 800.0
        assert 0.0 < float(found[2]) < 600.0
