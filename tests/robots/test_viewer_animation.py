import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from page_reading import HALVES, SLIDER, SQUARE, browse, geometry, motion, transforms, with_probe

import closedchain as cc
from closedchain.robots.viewer import (
    Animation,
    Markers,
    Readout,
    Surface,
    Trace,
    boxed,
    input_readouts,
    static_page,
)


@pytest.fixture(scope="module")
def slider() -> cc.Mechanism:
    return cc.load_urdf(SLIDER)


@pytest.fixture(scope="module")
def slide() -> tuple[np.ndarray, np.ndarray]:
    times = np.linspace(0.0, 2.0, 41)
    return np.column_stack([times, np.pi * times / 2.0]), times


def test_animation_moves_every_part_as_a_page_of_the_posture_shows_it(d1: cc.Mechanism) -> None:
    steps = [d1.home]
    for k in range(1, 4):
        pose = d1.pose(d1.home)
        pose.translation += np.array([0.01 * k, 0.02 * k, 0.0])
        found = cc.inverse(d1, pose, outputs="x y z rx rz", guess=steps[-1])
        steps.append(found.raise_if_failed().q)
    q = np.array(steps)
    data = motion(static_page(d1, up="y", animation=Animation(q, [0.0, 0.1, 0.2, 0.5])))
    assert data["times"] == [0.0, 0.1, 0.2, 0.5]
    for k in range(4):
        shown = transforms(static_page(d1, q[k], up="y"))
        names = {part["path"] for part in data["parts"]}
        assert {path for path in shown if "/bodies/" in path} <= names
        for part in data["parts"]:
            x, y, z, *turn = data["poses"][k, part["body"]].astype(float)
            carrier = np.eye(4)
            carrier[:3, :3] = rotation(np.array(turn))
            carrier[:3, 3] = x, y, z
            moved = carrier @ np.reshape(part["matrix"], (4, 4)).T
            assert np.allclose(moved, shown[part["path"]], atol=1e-6), part["path"]


def rotation(quaternion: np.ndarray) -> np.ndarray:
    x, y, z, w = quaternion / np.linalg.norm(quaternion)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def test_trace_is_the_path_of_its_point(
    slider: cc.Mechanism, slide: tuple[np.ndarray, np.ndarray]
) -> None:
    q, times = slide
    page = static_page(
        slider,
        animation=Animation(
            q, times, traces=[Trace("end", values=times**2, label="speed", unit="m/s")]
        ),
    )
    end = np.array([slider.point(row, "end") for row in q])
    data = motion(page)
    ball = data["parts"][-1]
    assert ball["path"] == "/meshcat/robot/tracers/0"
    assert np.allclose(data["poses"][:, ball["body"], :3], end, atol=1e-6)
    _, arrays = geometry(page, 0)
    middles = arrays["position"].reshape(-1, 6, 3).mean(axis=1)
    assert np.linalg.norm(middles[:, None] - end, axis=2).min(axis=1).max() < 1e-6
    assert "<p>speed [m/s]</p>" in page


def test_readouts_hold_the_numbers_shown(
    slider: cc.Mechanism, slide: tuple[np.ndarray, np.ndarray], d1: cc.Mechanism
) -> None:
    q, times = slide
    page = static_page(
        slider,
        animation=Animation(
            q, times, readouts=[Readout("σ & co", np.cos(times), "1"), Readout("c", 0 * times)]
        ),
    )
    assert np.allclose(motion(page)["readouts"][0], np.cos(times), atol=1e-6)
    assert "<b>σ &amp; co</b><output></output><span>1</span>" in page
    curve = re.findall(r'polyline points="([^"]*)"', page)[0]
    ends = [tuple(map(float, spot.split(","))) for spot in (curve.split()[0], curve.split()[-1])]
    assert ends == [(46.0, 2.0), (266.0, 32.0)]
    numbers = re.findall(r"<text [^>]*>([^<]*)</text>", page)
    assert numbers[:4] == ["1", "-0.416", "0", "2 s"]  # greatest, least, begin and end
    assert numbers[4:] == ["0", "0", "2 s"]
    rows = input_readouts(d1, d1.home[None])
    assert [(r.name, r.unit) for r in rows] == [(f"q{i}", "m") for i in range(1, 7)]
    assert np.allclose([r.values[0] for r in rows], d1.input_values(d1.home))


def test_rounding_is_drawn_as_rest(
    slider: cc.Mechanism, slide: tuple[np.ndarray, np.ndarray]
) -> None:
    """An energy that is kept to ten digits is a straight line, and its numbers fit."""
    q, times = slide
    kept, moved = -46.0957229 + 1e-9 * np.sin(9.0 * times), -46.0957229 + 1e-3 * times
    told = [Readout("kept", kept, "J"), Readout("moved", moved, "J")]
    page = static_page(slider, animation=Animation(q, times, readouts=told))
    curves = [
        {spot.split(",")[1] for spot in points.split()}
        for points in re.findall(r'polyline points="([^"]*)"', page)
    ]
    assert curves[0] == {"17.0"}
    assert len(curves[1]) > 5
    numbers = re.findall(r"<text [^>]*>([^<]*)</text>", page)
    assert numbers[:3] == ["-46.1", "0", "2 s"]
    assert all(len(number) < 10 for number in numbers)
    assert np.allclose(motion(page)["readouts"][0], kept)


def test_page_keeps_its_size_and_says_what_it_left_out(d1: cc.Mechanism) -> None:
    n = 6000
    q = np.tile(d1.home, (n, 1))
    motion_ = Animation(q, np.linspace(0.0, 600.0, n), readouts=[Readout("t", np.arange(n))])
    page = static_page(d1, animation=motion_)
    data = motion(page)
    assert 1000 < len(data["times"]) < n
    assert (data["times"][0], data["times"][-1]) == (0.0, 600.0)
    assert len(page.encode()) < 6_000_000
    assert f"{len(data['times'])} of {n} postures shown" in page


def test_frames_are_given_postures_no_denser_than_the_rate() -> None:
    times = np.sort(np.random.default_rng(5).uniform(0.0, 3.0, 2000))
    motion_ = Animation(np.zeros((2000, 2)), times)
    kept = motion_.frames(3)
    gaps = np.diff(times[kept])
    assert gaps[:-1].min() > 0.999 / 30.0
    assert gaps.max() < 2.5 / 30.0
    assert (kept[0], kept[-1]) == (0, 1999)
    even = Animation(np.zeros((61, 2)), np.arange(61) / 30.0)
    assert np.array_equal(even.frames(3), np.arange(61))
    slow = Animation(np.zeros((61, 2)), np.arange(61) / 30.0, frame_rate=10.0)
    assert np.array_equal(slow.frames(3), np.arange(0, 61, 3))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"times": [0.0, 1.0, 1.0]}, r"times must rise; times\[1\] = 1 s is followed by 1 s"),
        ({"times": [0.0, 1.0]}, r"times must have shape \(3,\), got \(2,\)"),
        ({"times": [0.0, np.nan, 1.0]}, "times must be finite"),
        ({"q": np.zeros((1, 2))}, "n >= 2"),
        ({"q": np.full((3, 2), np.inf)}, "q must be finite"),
        ({"frame_rate": 0.0}, "frame_rate must be positive"),
        ({"traces": [Trace("end", values=[1.0])]}, r"values must have shape \(3,\)"),
        ({"traces": [Trace(SQUARE, label="s")]}, r"trace 's': along must have one position"),
        ({"readouts": [Readout("a", np.zeros(4))]}, "readout 'a' must have shape"),
    ],
)
def test_malformed_animations_are_named(change: dict[str, Any], message: str) -> None:
    good = Animation(np.zeros((3, 2)), np.arange(3.0))
    with pytest.raises(cc.ClosureError, match=message):
        replace(good, **change)


def test_page_with_everything_loads_nothing(
    slider: cc.Mechanism, slide: tuple[np.ndarray, np.ndarray]
) -> None:
    box = boxed([Markers(SQUARE)], tuple("abc"), ("", "", ""), beside=slider)
    page = static_page(slider, overlays=box, animation=Animation(*slide, traces=[Trace("end")]))
    for text in (page[:100_000], page[-100_000:]):
        assert not re.search(r"""(?:src|href)\s*=\s*["']?\s*(?:https?:)?//""", text)
    outside = re.sub(r"<script.*?</script>", "", page, flags=re.S)
    assert not re.search(r"http(?!-equiv)|url\(|ws://", outside)


def test_equal_drawings_are_equal_bytes(
    slider: cc.Mechanism, slide: tuple[np.ndarray, np.ndarray]
) -> None:
    def one() -> str:
        motion = Animation(*slide, traces=[Trace("end", values=slide[1])])
        return static_page(slider, overlays=[Surface(SQUARE, HALVES)], animation=motion)

    assert one() == one()


def test_page_refuses_what_it_cannot_draw(
    slider: cc.Mechanism, d1: cc.Mechanism, slide: tuple[np.ndarray, np.ndarray]
) -> None:
    with pytest.raises(cc.ClosureError, match="Polyline, Surface, Markers or Box, got ndarray"):
        static_page(slider, overlays=[SQUARE])  # type: ignore[list-item]
    with pytest.raises(cc.ClosureError, match="not both"):
        static_page(slider, slider.home, animation=Animation(*slide))
    with pytest.raises(cc.ClosureError, match=r"\(n, 35\) for 'd1'"):
        static_page(d1, animation=Animation(*slide))
    with pytest.raises(cc.ClosureError, match="up must be"):
        static_page(slider, up="w")  # type: ignore[arg-type]
    with pytest.raises(cc.ClosureError, match="unknown frame 'tipp'"):
        static_page(slider, animation=Animation(*slide, traces=[Trace("tipp")]))


REPORT = """<script>
const report = document.body.appendChild(document.createElement("pre"));
report.id = "report";
window.addEventListener("shown", () => setTimeout(() => {
  const place = path => {
    const node = viewer.scene_tree.find(path.split("/").filter(x => x)).object;
    node.updateMatrix();
    return [path, node.matrix.toArray()];
  };
  report.textContent = JSON.stringify(PATHS.map(place));
}, 500));
</script>"""


@pytest.mark.slow
def test_player_shows_the_asked_time_with_stretched_sticks(
    slider: cc.Mechanism, slide: tuple[np.ndarray, np.ndarray], tmp_path: Path
) -> None:
    q, times = slide
    page = static_page(
        slider,
        animation=Animation(
            q, times, traces=[Trace("end")], readouts=[Readout("square", times**2, "s²")]
        ),
    )
    data = motion(page)
    paths = [part["path"] for part in (*data["parts"], *data["sticks"])]
    probe = REPORT.replace("PATHS", json.dumps(paths))
    text = browse(with_probe(page, probe), tmp_path, "--dump-dom", mark="#t=1.275")
    assert ">1.275 s</output>" in text
    assert ">play</button>" in text  # it stands
    assert "<output>1.626</output>" in text  # halfway between 1.25² and 1.3²
    found = re.search(r'<pre id="report">(.*?)</pre>', text)
    assert found is not None
    placed = {path: np.reshape(matrix, (4, 4)).T for path, matrix in json.loads(found[1])}
    between = np.array([1.275, np.pi * 1.275 / 2.0])  # steady joint speeds: the page is exact
    still = static_page(slider, between)
    for path, matrix in transforms(still).items():
        if "/joints/" in path:
            assert np.allclose(placed[path][:3, 3], matrix[:3, 3], atol=1e-5), path
    around = [slider.point(row, "end") for row, t in zip(q, times, strict=True) if 1.24 < t < 1.31]
    assert len(around) == 2
    assert np.allclose(placed["/meshcat/robot/tracers/0"][:3, 3], np.mean(around, axis=0))
    # the stick of the sliding joint reaches from the base to the carriage, 2 m long at first drawn
    (stick,) = (s for s in data["sticks"] if np.isclose(s["length"], 2.0))
    tips = placed[stick["path"]] @ np.array([[0, -1.0, 0, 1], [0, 1.0, 0, 1]]).T
    assert np.allclose(tips[:3].T, [[0, 0, 0], [1.275, 0, 0]], atol=1e-5)
