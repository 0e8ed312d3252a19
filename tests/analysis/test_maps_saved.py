"""Maps are the same whoever works on them, in memory or in a store, stopped or not."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

import closedchain as cc
from closedchain.analysis.singularity.maps.rounds import lattice_of
from closedchain.analysis.singularity.maps.tiles import TILE_CELLS, Tiles, tiles_of

OVER = {"q1": np.linspace(-0.9, 0.3, 13), "q2": np.linspace(-0.9, 0.3, 11)}
AT = {"q3": -0.6}


class Stopped(Exception):
    pass


@pytest.fixture(scope="module")
def delta() -> cc.Mechanism:
    return cc.load("linear_delta")


@pytest.fixture(scope="module")
def ask(delta: cc.Mechanism) -> Callable[..., xr.Dataset]:
    """A map of a hundred cells in 20 tiles; whatever else is asked may differ."""

    def asked(**more: Any) -> xr.Dataset:
        return cc.singularity_map(
            delta, OVER, AT, **{"progress": False, "keep_q": True, "chunk": 3, **more}
        )

    return asked


@pytest.fixture(scope="module")
def whole(ask: Callable[..., xr.Dataset]) -> xr.Dataset:
    """The same in one go, by one worker, in memory."""
    found = ask(workers=1)
    status = found["status"].to_numpy()
    assert (status == 0).sum() > 40
    assert (status == 1).sum() > 10
    return found


def test_threads_make_no_difference(ask: Callable[..., xr.Dataset], whole: xr.Dataset) -> None:
    for workers in (2, 5):
        xr.testing.assert_identical(ask(workers=workers), whole)


@pytest.mark.slow
def test_a_dask_client_makes_no_difference(
    ask: Callable[..., xr.Dataset], whole: xr.Dataset, tmp_path: Path
) -> None:
    distributed = pytest.importorskip("distributed")
    quiet = {"processes": False, "n_workers": 2, "threads_per_worker": 1}
    with distributed.Client(**quiet, dashboard_address=None) as client:
        xr.testing.assert_identical(ask(client=client), whole)
        xr.testing.assert_identical(ask(workers=client), whole)
        stored = ask(client=client, save=tmp_path / "map.zarr")
        xr.testing.assert_identical(stored.load(), whole)


def test_work_pickles(delta: cc.Mechanism) -> None:
    """What goes to workers in other processes arrives as it was sent."""
    import pickle

    from closedchain.analysis.singularity.maps.anchor import anchor_of
    from closedchain.analysis.singularity.maps.choice import chosen
    from closedchain.analysis.singularity.maps.grid import OK, UNSEEN, grid_of
    from closedchain.analysis.singularity.maps.spreading import Job, Task, work

    grid = grid_of(delta, OVER, AT)
    tiles = tiles_of(grid.shape, 4, grid.names)
    job = Job(grid, tiles, chosen(delta, ("x", "y", "z"), grid.names, None), keep_q=True)
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


def test_tiles_change_a_map_by_rounding_only(
    ask: Callable[..., xr.Dataset], whole: xr.Dataset
) -> None:
    one = ask(chunk=None)
    assert np.array_equal(one["status"] == 0, whole["status"] == 0)
    for name in ("sigma_direct", "sigma_inverse", "det_inverse", "q"):
        assert np.abs(one[name] - whole[name]).max() < 1e-10


def test_stopped_runs_go_on_where_they_stopped(
    ask: Callable[..., xr.Dataset], whole: xr.Dataset, tmp_path: Path
) -> None:
    """However often it is stopped, every run gets further, and the outcome is the same."""
    folder = tmp_path / "deep" / "map.zarr"
    stops, seen = 0, [0]
    while True:
        calls = count()
        reached = [0]

        def stop(
            what: str, done: int, total: int, calls: Iterator[int] = calls, to: list[int] = reached
        ) -> None:
            to[0] = max(to[0], done)
            if next(calls) > 6:
                raise Stopped

        try:
            found = ask(save=folder, progress=stop, workers=1)
            break
        except Stopped:
            stops += 1
            seen.append(reached[0])
    assert stops >= 3
    assert seen == sorted(seen)
    xr.testing.assert_identical(found.load(), whole)
    assert not (folder / "journal").exists()


def program(folder: Path, pause: float) -> str:
    """The map of this module asked for in a process of its own."""
    return (
        "import time, numpy as np, closedchain as cc\n"
        "over = {'q1': np.linspace(-0.9, 0.3, 13), 'q2': np.linspace(-0.9, 0.3, 11)}\n"
        f"slow = lambda *a: time.sleep({pause})\n"
        f"cc.singularity_map(cc.load('linear_delta'), over, {AT!r}, progress=slow, keep_q=True, "
        f"chunk=3, save={str(folder)!r})\n"
    )


@pytest.mark.slow
def test_a_killed_process_leaves_a_store_to_go_on_from(
    ask: Callable[..., xr.Dataset], whole: xr.Dataset, tmp_path: Path
) -> None:
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
    xr.testing.assert_allclose(resumed, whole, rtol=1e-9, atol=1e-10)


def test_a_complete_store_is_returned_as_it_is(
    ask: Callable[..., xr.Dataset], whole: xr.Dataset, tmp_path: Path
) -> None:
    folder = tmp_path / "map.zarr"
    first = ask(save=folder)
    assert first.attrs == whole.attrs
    calls: list[Any] = []
    again = ask(save=str(folder), progress=lambda *a: calls.append(a))
    assert not [what for what, _, total in calls if total]
    xr.testing.assert_identical(again.load(), whole)
    xr.testing.assert_identical(
        xr.open_zarr(folder, chunks=None)[list(whole)].load().drop_attrs(), whole.drop_attrs()
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
    delta: cc.Mechanism, tmp_path: Path, change: dict[str, Any], named: str
) -> None:
    small = {"q1": OVER["q1"][5:9], "q2": OVER["q2"][5:9]}
    base: dict[str, Any] = {"over": small, "at": AT, "keep_q": True, "chunk": 3}
    folder = tmp_path / "map.zarr"
    cc.singularity_map(delta, **base, save=folder, progress=False)
    with pytest.raises(cc.ClosureError, match=f"holds another map: .*{named}"):
        cc.singularity_map(delta, **base | change, save=folder, progress=False)
    other = cc.load("linear_delta", a=0.11)
    with pytest.raises(cc.ClosureError, match=r"description, parameters.* differ"):
        cc.singularity_map(other, **base, save=folder, progress=False)


def test_folders_that_hold_something_else_are_left_alone(
    ask: Callable[..., xr.Dataset], tmp_path: Path
) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    for path in (tmp_path, tmp_path / "notes.txt"):
        with pytest.raises(cc.ClosureError, match="there already and holds no map"):
            ask(save=path)
    with pytest.raises(cc.ClosureError, match="cannot be saved in"):
        ask(save=tmp_path / "notes.txt" / "map.zarr")
    assert [p.name for p in tmp_path.iterdir()] == ["notes.txt"]


# -- tiles ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "shape", [(7,), (5000,), (100, 100), (1000, 3), (40, 50, 60), (9,) * 6, (1, 2)]
)
def test_tiles_cover_the_grid_once(shape: tuple[int, ...]) -> None:
    tiles = tiles_of(shape, None, tuple("abcdef"[: len(shape)]))
    covered = np.zeros(shape, dtype=int)
    for tile in tiles.all():
        covered[tiles.slices(tile)] += 1
        assert np.prod(tiles.extent(tile)) <= TILE_CELLS
        assert tiles.holding(tuple(int(i) for i in tiles.origin(tile))) == tile
    assert (covered == 1).all()
    if np.prod(shape) > 2 * TILE_CELLS:
        assert np.prod(tiles.size) > TILE_CELLS / 4


def test_faces_are_the_cells_beside_other_tiles() -> None:
    tiles = Tiles((5, 6), (3, 4))
    cells = np.array(list(np.ndindex(5, 6)))
    owner = [tiles.holding(tuple(c)) for c in cells]
    for tile in tiles.all():
        mine = np.array([o == tile for o in owner])
        near = np.abs(cells[:, None] - cells[None]).sum(axis=-1) == 1
        assert np.array_equal(tiles.faces(tile, cells[mine]), (near[mine][:, ~mine]).any(axis=1))
        assert np.array_equal(tiles.beside(tile, cells[~mine]), near[~mine][:, mine].any(axis=1))
        expected = {o for o, n in zip(owner, near[:, mine].any(axis=1) & ~mine, strict=True) if n}
        assert set(tiles.neighbours(tile)) == expected


@pytest.mark.parametrize("shape", [(3,), (400,), (30, 500), (9, 9, 9), (4,) * 6])
def test_other_branches_are_sought_all_over_the_grid(shape: tuple[int, ...]) -> None:
    axes = lattice_of(shape)
    assert 1 <= np.prod([len(a) for a in axes]) <= 1024
    for n, axis in zip(shape, axes, strict=True):
        ends = np.array([-1, *axis, n])
        assert np.diff(ends).max() <= max(1, 2 * n // len(axis))


# -- verdicts -------------------------------------------------------------------------------------


def test_ways_that_end_for_no_reason_are_not_converged() -> None:
    """In a cell none is found where a way in ended at a singularity, or none was tried."""
    from closedchain.analysis.singularity.maps.grid import NONE_FOUND, NOT_CONVERGED, OK
    from closedchain.analysis.singularity.maps.storage import in_memory
    from closedchain.analysis.singularity.maps.tiles import Found
    from closedchain.closure.solve.flood import FOLD, STUCK

    store = in_memory(Tiles((6,), (6,)), (), 3, keep_q=False)
    one, none = np.array([0]), np.zeros(0, dtype=int)
    ok = np.array([OK], dtype=np.int8)
    store.add((0,), Found(one, ok, np.array([1, 2, 3]), np.array([STUCK, STUCK, FOLD])))
    store.add((0,), Found(none, ok[:0], np.array([1, 3, 4]), np.array([FOLD, STUCK, STUCK])))
    store.finish((0,))
    expected = [OK, NONE_FOUND, NOT_CONVERGED, NONE_FOUND, NOT_CONVERGED, NONE_FOUND]
    assert store.arrays["status"].tolist() == expected


def test_folds_are_told_from_regular_ways(delta: cc.Mechanism) -> None:
    """Of single ways, long ones too: of two cells the second is reached, or not for a fold."""
    from oracle.reference_cells import ReferenceCells

    from closedchain.closure.charting import chart_of
    from closedchain.closure.solve.flood import ARRIVED, FOLD, Block, flood

    chart = chart_of(delta, ("x", "y"))
    cells = ReferenceCells(chart)
    home = chart.values(delta.home)
    for outwards, end in (
        ([0.9, 0.0], FOLD),
        ([0.0, -0.9], FOLD),
        ([0.6, 0.7], FOLD),
        ([0.1, 0.1], ARRIVED),
    ):
        target = np.array(outwards)
        q = np.stack([delta.home, delta.home])
        targets = chart.targets(np.stack([home, target]))
        codes = flood(Block(chart.problem, targets, np.ones(2, dtype=bool), q), [0]).codes
        assert codes.tolist() == [ARRIVED, end]
        assert cells.ends_at_fold(delta.home, home, target) == (end == FOLD)


# -- measures of the user -------------------------------------------------------------------------


def largest_angle(mechanism: cc.Mechanism, postures: np.ndarray) -> np.ndarray:
    """Largest joint angle."""
    turning = ~mechanism.translational
    return np.abs(postures[:, turning]).max(axis=1)


def test_measures_of_the_user_are_variables(
    ask: Callable[..., xr.Dataset], whole: xr.Dataset, delta: cc.Mechanism, tmp_path: Path
) -> None:
    own = {"largest_angle": largest_angle}
    found = ask(measures=own)
    xr.testing.assert_identical(found.drop_vars("largest_angle"), whole)
    ok = found["status"].to_numpy() == 0
    values = found["largest_angle"]
    assert values.attrs == {"units": "1", "long_name": "Largest joint angle"}
    expected = largest_angle(delta, found["q"].to_numpy()[ok])
    assert np.array_equal(values.to_numpy()[ok], expected)
    assert np.isnan(values.to_numpy()[~ok]).all()
    stored = ask(measures=own, save=tmp_path / "map.zarr")
    xr.testing.assert_identical(stored.load(), found)
    xr.testing.assert_identical(ask(measures=own, save=tmp_path / "map.zarr").load(), found)
    with pytest.raises(cc.ClosureError, match="another map: functions differs"):
        ask(save=tmp_path / "map.zarr")


def test_stopped_runs_go_on_with_measures_of_the_user(
    ask: Callable[..., xr.Dataset], tmp_path: Path
) -> None:
    wanted = ["condition", {"largest_angle": largest_angle}]
    expected = ask(measures=wanted)
    assert set(expected.data_vars) == {"status", "condition", "largest_angle", "q"}
    calls = count()

    def stop(*_: object) -> None:
        if next(calls) > 6:
            raise Stopped

    with pytest.raises(Stopped):
        ask(measures=wanted, save=tmp_path / "map.zarr", progress=stop, workers=1)
    resumed = ask(measures=wanted, save=tmp_path / "map.zarr")
    xr.testing.assert_identical(resumed.load(), expected)


@pytest.mark.slow
def test_measures_of_the_user_on_dask(ask: Callable[..., xr.Dataset]) -> None:
    distributed = pytest.importorskip("distributed")
    quiet = {"processes": False, "n_workers": 2, "threads_per_worker": 1}
    with distributed.Client(**quiet, dashboard_address=None) as client:
        found = ask(client=client, measures={"largest_angle": largest_angle})
        xr.testing.assert_identical(found, ask(measures={"largest_angle": largest_angle}))


def test_names_leave_out_other_measures(ask: Callable[..., xr.Dataset], whole: xr.Dataset) -> None:
    for name in ("det_inverse", "sigma_direct"):
        found = ask(measures=[name], keep_q=False)
        assert set(found.data_vars) == {"status", name}
        xr.testing.assert_allclose(found[name], whole[name], rtol=1e-11, atol=1e-13)


@pytest.mark.parametrize(
    ("measures", "more", "message"),
    [
        (["speed"], {}, "unknown measure of 'linear_delta' 'speed'.*sigma_direct"),
        ({"condition": largest_angle}, {}, "'condition' needs another name"),
        ({"q1": largest_angle}, {}, "'q1' needs another name"),
        ({"own": 3.0}, {}, "'own' must be a function of a mechanism and postures"),
        ({"own": lambda m, q: q[:, 0]}, {"save": "map.zarr"}, "'own' cannot be pickled"),
        ({"own": lambda m, q: q}, {}, r"'own' must give one number for each of \d+ postures"),
    ],
)
def test_bad_measures_are_refused(
    ask: Callable[..., xr.Dataset],
    tmp_path: Path,
    measures: Any,
    more: dict[str, Any],
    message: str,
) -> None:
    with pytest.raises(cc.ClosureError, match=message):
        ask(measures=measures, **{k: tmp_path / v for k, v in more.items()})


# -- interrupts -----------------------------------------------------------------------------------


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
