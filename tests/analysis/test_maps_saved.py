"""Maps are the same whoever works on them, in memory or in a store, stopped or not."""

from __future__ import annotations

import pickle
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from delta_maps import AT, OVER, Stopped, ask, delta, program, stop_after, whole

import closedchain as cc
from closedchain.analysis.singularity.maps.anchor import anchor_of
from closedchain.analysis.singularity.maps.choice import chosen
from closedchain.analysis.singularity.maps.grid import OK, UNSEEN, grid_of
from closedchain.analysis.singularity.maps.spreading import Job, Task, work
from closedchain.analysis.singularity.maps.tiles import tiles_of


def test_threads_make_no_difference() -> None:
    for workers in (2, 5):
        xr.testing.assert_identical(ask(workers=workers), whole())


@pytest.mark.slow
def test_a_dask_client_makes_no_difference(tmp_path: Path) -> None:
    distributed = pytest.importorskip("distributed")
    quiet = {"processes": False, "n_workers": 2, "threads_per_worker": 1}
    with distributed.Client(**quiet, dashboard_address=None) as client:
        xr.testing.assert_identical(ask(client=client), whole())
        xr.testing.assert_identical(ask(workers=client), whole())
        stored = ask(client=client, save=tmp_path / "map.zarr")
        xr.testing.assert_identical(stored.load(), whole())


def test_work_pickles() -> None:
    """What goes to workers in other processes arrives as it was sent."""
    grid = grid_of(delta(), OVER, AT)
    tiles = tiles_of(grid.shape, 4, grid.names)
    job = Job(grid, tiles, chosen(delta(), ("x", "y", "z"), grid.names, None), keep_q=True)
    anchor = anchor_of(grid)
    tile = tiles.holding(anchor.cell)
    task = Task(
        tile,
        np.full(tiles.extent(tile), UNSEEN, dtype=np.int8),
        OK,
        np.array([anchor.cell]),
        anchor.q[None],
        np.zeros((0, 2), dtype=int),
    )
    here = work(job, task)
    there = work(*pickle.loads(pickle.dumps((job, task))))
    assert len(here.cells) > 1
    assert np.array_equal(here.cells, there.cells)
    assert here.q is not None
    assert there.q is not None
    assert here.q.tobytes() == there.q.tobytes()
    for name, values in here.measures.items():
        assert values.tobytes() == there.measures[name].tobytes()


def test_tiles_change_a_map_by_rounding_only() -> None:
    one = ask(chunk=None)
    assert np.array_equal(one["status"] == 0, whole()["status"] == 0)
    for name in ("sigma_direct", "sigma_inverse", "det_inverse", "q"):
        assert np.abs(one[name] - whole()[name]).max() < 1e-10


def test_stopped_runs_go_on_where_they_stopped(tmp_path: Path) -> None:
    """However often it is stopped, every run gets further, and the outcome is the same."""
    folder = tmp_path / "deep" / "map.zarr"
    stops, seen = 0, [0]
    while True:
        stop, reached = stop_after(7), [0]

        def told(
            what: str,
            done: int,
            total: int,
            stop: Callable[[], None] = stop,
            to: list[int] = reached,
        ) -> None:
            to[0] = max(to[0], done)
            stop()

        try:
            found = ask(save=folder, progress=told, workers=1)
            break
        except Stopped:
            stops += 1
            seen.append(reached[0])
    assert stops >= 3
    assert seen == sorted(seen)
    xr.testing.assert_identical(found.load(), whole())
    assert not (folder / "journal").exists()


@pytest.mark.slow
def test_a_killed_process_leaves_a_store_to_go_on_from(tmp_path: Path) -> None:
    """In processes that load the kernels: one that compiles them differs by rounding."""
    folder, undisturbed = tmp_path / "map.zarr", tmp_path / "undisturbed.zarr"
    process = subprocess.Popen([sys.executable, "-c", program(folder, 0.05)])
    try:
        deadline = time.monotonic() + 60.0
        while time.monotonic() < deadline and process.poll() is None:
            if len(list((folder / "journal").glob("*/*.find"))) >= 2:
                break
            time.sleep(0.01)
    finally:
        process.kill()
        process.wait()
    assert (folder / "journal").exists(), "killed too late"
    for store in (folder, undisturbed):
        subprocess.run([sys.executable, "-c", program(store, 0.0)], check=True, timeout=60)
    assert not (folder / "journal").exists()
    resumed, straight = ask(save=folder).load(), ask(save=undisturbed).load()
    xr.testing.assert_identical(resumed, straight)
    xr.testing.assert_allclose(resumed, whole(), rtol=1e-9, atol=1e-10)


def test_a_complete_store_is_returned_as_it_is(tmp_path: Path) -> None:
    folder = tmp_path / "map.zarr"
    first = ask(save=folder)
    assert first.attrs == whole().attrs
    calls: list[Any] = []
    again = ask(save=str(folder), progress=lambda *a: calls.append(a))
    assert not [what for what, _, total in calls if total]
    xr.testing.assert_identical(again.load(), whole())
    xr.testing.assert_identical(
        xr.open_zarr(folder, chunks=None)[list(whole())].load().drop_attrs(), whole().drop_attrs()
    )


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"keep_q": False}, "keep_q differs"),
        ({"chunk": 4}, "chunk differs"),
        ({"outputs": "x y"}, "outputs differs"),
        ({"at": {"q3": -0.61}}, "held, start differ"),
        ({"over": {"q1": OVER["q1"][5:9], "q2": OVER["q2"][4:8]}}, "values differs"),
        ({"over": {"q2": OVER["q2"][5:9], "q1": OVER["q1"][5:9]}}, "coordinates differs"),
    ],
)
def test_a_store_of_another_map_is_refused(
    tmp_path: Path, change: dict[str, Any], named: str
) -> None:
    small = {"q1": OVER["q1"][5:9], "q2": OVER["q2"][5:9]}
    base: dict[str, Any] = {"over": small, "at": AT, "keep_q": True, "chunk": 3}
    folder = tmp_path / "map.zarr"
    cc.singularity_map(delta(), **base, save=folder, progress=False)
    with pytest.raises(cc.ClosureError, match=f"holds another map: .*{named}"):
        cc.singularity_map(delta(), **base | change, save=folder, progress=False)
    other = cc.load("linear_delta", a=0.11)
    with pytest.raises(cc.ClosureError, match=r"description, parameters.* differ"):
        cc.singularity_map(other, **base, save=folder, progress=False)


def test_folders_that_hold_something_else_are_left_alone(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    for path in (tmp_path, tmp_path / "notes.txt"):
        with pytest.raises(cc.ClosureError, match="there already and holds no map"):
            ask(save=path)
    with pytest.raises(cc.ClosureError, match="cannot be saved in"):
        ask(save=tmp_path / "notes.txt" / "map.zarr")
    assert [p.name for p in tmp_path.iterdir()] == ["notes.txt"]


@pytest.mark.slow
@pytest.mark.parametrize("workers", [1, 2])
def test_an_interrupt_stops_a_map_within_a_second(workers: int) -> None:
    """Ctrl-C, in a process of its own: the time from the signal to the end of the call."""
    text = (
        "import signal, numpy as np, closedchain as cc\n"
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "axis = np.linspace(-0.2, 0.2, 200)\n"
        "said = []\n"
        "def say(what, done, total):\n"
        "    if total and done and not said:\n"
        "        said.append(print('going', flush=True))\n"
        "over = {'x': axis, 'y': axis, 'z': axis - 0.6}\n"
        "try:\n"
        f"    cc.singularity_map(cc.load('linear_delta'), over, progress=say, workers={workers})\n"
        "except KeyboardInterrupt:\n"
        "    print('stopped', flush=True)\n"
    )
    command = [sys.executable, "-c", text]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            assert process.stdout.readline() == "going\n"
            time.sleep(0.3)
            begin = time.monotonic()
            process.send_signal(signal.SIGINT)
            assert process.stdout.readline() == "stopped\n"
            assert time.monotonic() - begin < 1.0
        finally:
            process.kill()
