"""Bad requests for maps are refused before any work, with a message that says what would do."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import closedchain as cc
from closedchain.analysis.singularity.maps import storage


@pytest.mark.parametrize(
    ("robot", "request_", "message"),
    [
        ("d1", {"over": {}}, "at least one coordinate must vary; known coordinates: q1, q2"),
        ("d1", {"over": {"q9": [0, 1]}}, "unknown coordinate 'q9'.*q1"),
        ("d1", {"over": {"q1": [0.5]}}, "at least two finite, rising numbers, such as"),
        ("d1", {"over": {"q1": []}}, "at least two"),
        ("d1", {"over": {"q1": [0.5, 0.4]}}, "'q1' must be .*rising"),
        ("d1", {"over": {"q1": [0.5, float("nan")]}}, "finite"),
        ("d1", {"over": {"q1": "wide"}}, "rising numbers"),
        ("d1", {"over": {"q1": [[0.5, 0.6]]}}, "rising numbers"),
        ("d1", {"over": {"q1": [0.5, 0.52]}, "at": {"q1": 0.5}}, "both varies and is held"),
        ("d1", {"over": {"q1": [0.5, 0.52]}, "at": {"q7": 0.5}}, "unknown coordinate 'q7'"),
        ("d1", {"over": {"q1": [0.5, 0.52]}, "at": {"q3": 1.4}}, "out of reach|singularity"),
        ("d1", {"over": {"q1": [0.5, 0.52]}, "outputs": "x w"}, "unknown output 'w'"),
        (
            "d1",
            {"over": {"q1": [1.2, 1.3]}},
            "first cell cannot be reached.*straight way to q1=1.2 ends after .*%, at q1=0",
        ),
        (
            "d1",
            {"over": {n: [0.5, 0.6] for n in (*"xyz", "rx", "ry", "rz", "q1")}},
            "at most 6 coordinates, got 7.*hold some of them with at=",
        ),
        ("d1", {"over": {"q1": [9.0, 9.5]}}, "beyond its joint limits|cannot be reached"),
        (
            "linear_delta",
            {"over": {"q1": [50.0, 60.0]}},
            "all values of 'q1', 50 to 60 m, lie beyond its joint limits .* to .* m",
        ),
        (
            "linear_delta",
            {"over": {"x": [3.0, 3.5], "y": [0.0, 0.1]}},
            r"cannot be reached.*way to x=3, y=0 ends after .*singularity \(inverse\)",
        ),
        ("linear_delta", {"over": {"x": [0.0, 0.1], "q1": [0.0, 0.1]}}, "4 coordinates.*freedoms"),
        ("eclipse", {"over": {"rx": [-4.0, 0.1]}}, "'rx' must be within -pi to pi rad, got -4"),
        ("eclipse", {"over": {"tilt": [-0.1, 0.1]}}, "'tilt' must be within 0 to pi .*azimuth"),
        ("eclipse", {"over": {"tilt": [0.1, 3.2]}}, "'tilt' must be within 0 to pi"),
        ("eclipse", {"over": {"azimuth": [0.0, 7.0]}}, "'azimuth' must be within -2 pi"),
        ("eclipse", {"over": {"tilt": [0, 1]}, "at": {"torsion": 4.0}}, "'torsion' must be"),
        ("eclipse", {"over": {"tilt": [0, 1]}, "mode": "elbow"}, r"unknown mode 'elbow'.*\+\+\+"),
        ("d1", {"over": {"x": [0.0, 0.1]}}, "singular for these coordinates"),
        ("d1", {"over": ["q1", "q2"]}, "over must be a mapping, such as .*'q1': np.linspace"),
        ("d1", {"over": {"q1": [0.5, 0.52]}, "chunk": 0}, "positive number of cells"),
        ("d1", {"over": {"q1": [0.5, 0.52]}, "chunk": {"q2": 4}}, "'q2', which does not vary.*q1"),
        ("d1", {"over": {"q1": [0.5, 0.52]}, "workers": 0}, "workers must be a positive number"),
        ("d1", {"over": {"q1": [0.5, 0.52]}, "client": "tcp"}, "dask.distributed.Client"),
        ("d1", {"over": {"q1": [0.5, 0.52]}, "client": 1, "workers": 1}, "not both"),
    ],
)
def test_bad_maps_are_refused(robot: str, request_: dict[str, Any], message: str) -> None:
    calls: list[Any] = []
    with pytest.raises(cc.ClosureError, match=message):
        cc.singularity_map(cc.load(robot), **request_, progress=lambda *a: calls.append(a))
    assert not [done for _, done, total in calls if total]  # before any work


def test_posture_and_mode_exclude_each_other() -> None:
    m = cc.load("eclipse")
    with pytest.raises(cc.ClosureError, match=r"either a posture .* or a mode"):
        cc.singularity_map(m, {"tilt": [0, 0.1]}, m.home, mode="home", progress=False)


def test_maps_beyond_memory_are_refused_without_save(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Any
) -> None:
    m = cc.load("linear_delta")
    axis = np.linspace(-0.02, 0.02, 12)
    over = {"x": axis, "y": axis}
    monkeypatch.setattr(storage, "free_memory", lambda: 12_000)
    cc.singularity_map(m, over, progress=False)  # 144 cells of 58 bytes: 8.4 kB
    with pytest.raises(cc.ClosureError, match=r"144 cells take .* 1.2e-05 GB are free.*keep_q"):
        cc.singularity_map(m, over, progress=False, keep_q=True)
    monkeypatch.setattr(storage, "free_memory", lambda: 8_000)
    with pytest.raises(cc.ClosureError, match=r"144 cells take .* GB of memory.*save='map.zarr'"):
        cc.singularity_map(m, over, progress=False)
    found = cc.singularity_map(m, over, progress=False, save=tmp_path / "map.zarr")
    assert (found["status"] == 0).all()


def test_maps_beyond_any_memory_are_refused() -> None:
    m = cc.load("d1")
    axis = np.linspace(0.5, 0.55, 3000)
    over = dict.fromkeys(m.inputs, axis)
    with pytest.raises(cc.ClosureError, match=r"729,000,000,000,000,000,000 cells.*save="):
        cc.singularity_map(m, over, progress=False)


def test_free_memory_is_a_size() -> None:
    assert 1e7 < storage.free_memory() < 1e15


def test_next_cells_are_tried_where_the_nearest_is_out_of_reach() -> None:
    """The cell nearest to home, in cells, lies beyond the limits; the next one does not."""
    m = cc.load("linear_delta")
    home = m.input_values(m.home)[0]
    upper = float(m.limits[1][m.input_q[0]])
    z = m.point(m.home, "P")[2]
    rise = upper - home
    over = {"z": np.array([z - 0.1, z + rise + 0.05])}
    found = cc.singularity_map(m, over, progress=False)
    assert found["status"].to_numpy()[0] == 0


def test_progress_is_reported() -> None:
    m = cc.load("linear_delta")
    calls: list[tuple[str, int, int]] = []
    axis = np.linspace(-0.8, 0.8, 9)
    cc.singularity_map(m, {"x": axis, "y": axis}, progress=lambda *a: calls.append(a))
    assert {what for what, _, _ in calls} >= {"following the branch", "searching other branches"}
    assert all(0 <= done <= total for _, done, total in calls)
    counted = [done for what, done, _ in calls if what == "following the branch"]
    assert counted == sorted(counted)
    assert calls[-1][1:] == (81, 81)
