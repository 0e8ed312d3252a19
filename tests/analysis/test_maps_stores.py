"""The folder of a saved map is input: links, damage, other writers, full disks and lost workers."""

from __future__ import annotations

import errno
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

import closedchain as cc
from closedchain.analysis.singularity.maps import saving
from closedchain.analysis.singularity.maps.folder import held, read_whole, write_whole

OVER = {"q1": np.linspace(-0.9, 0.3, 9), "q2": np.linspace(-0.9, 0.3, 8)}
AT = {"q3": -0.6}
Ask = Callable[..., xr.Dataset]


class Stopped(Exception):
    pass


@pytest.fixture(scope="module")
def ask() -> Ask:
    """A map of 72 cells in 12 tiles."""
    delta = cc.load("linear_delta")

    def asked(**more: Any) -> xr.Dataset:
        given = {"progress": False, "keep_q": True, "chunk": 3, "workers": 1, **more}
        given = {"measures": ["condition"], **given}
        return cc.singularity_map(delta, OVER, AT, **given)

    return asked


@pytest.fixture(scope="module")
def whole(ask: Ask) -> xr.Dataset:
    return ask()


def stop_after(calls: int) -> Callable[..., None]:
    """Progress that stops a run."""
    counter = count()

    def stop(*_: object) -> None:
        if next(counter) >= calls:
            raise Stopped

    return stop


@pytest.fixture(scope="module")
def stopped(ask: Ask, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A store that is not complete; to be copied."""
    folder = tmp_path_factory.mktemp("stopped") / "map.zarr"
    with pytest.raises(Stopped):
        ask(save=folder, progress=stop_after(14))
    assert len(list((folder / "journal").glob("*/*.find"))) > 3
    return folder


@pytest.fixture(scope="module")
def ready(ask: Ask, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A complete store; to be copied."""
    folder = tmp_path_factory.mktemp("ready") / "map.zarr"
    ask(save=folder)
    return folder


@pytest.fixture
def store(stopped: Path, tmp_path: Path) -> Path:
    """A store of one's own that is not complete."""
    return Path(shutil.copytree(stopped, tmp_path / "map.zarr"))


def test_it_goes_on_from_a_copy(ask: Ask, whole: xr.Dataset, store: Path) -> None:
    xr.testing.assert_identical(ask(save=store).load(), whole)
    assert not (store / "journal").exists()
    assert not (store / "lock").exists()
    assert not any("ends" in path.parts for path in store.rglob("*"))
    assert not list(store.rglob("*.partial"))


# -- names that lead elsewhere --------------------------------------------------------------------


@pytest.mark.parametrize("inner", ["journal", "status", "journal/sums", "status/c", "q/zarr.json"])
def test_links_are_refused_and_not_followed(ask: Ask, store: Path, inner: str) -> None:
    """As they stand in the store, or with what they replace moved out of it."""
    outside = store.parent / "outside"
    for folder in (outside, outside / "precious"):
        folder.mkdir()
    (outside / "precious" / "letter.txt").write_text("dear")
    moved = store.parent / "moved"
    for target in (outside, moved):
        place = store / inner
        if target == moved:
            place.unlink()
            moved.symlink_to(store.parent / "kept")
        place.rename(store.parent / "kept") if target == outside else None
        place.symlink_to(target)
        before = sorted(store.rglob("*"))
        with pytest.raises(cc.ClosureError, match=f"{inner} is a link, and a saved map holds none"):
            ask(save=store)
        assert sorted(p for p in store.rglob("*") if p.name != "lock") == [
            p for p in before if p.name != "lock"
        ]
    assert [p.name for p in outside.rglob("*")] == ["precious", "letter.txt"]
    assert (outside / "precious" / "letter.txt").read_text() == "dear"


def test_links_in_a_complete_store_are_refused(ask: Ask, ready: Path, tmp_path: Path) -> None:
    store = Path(shutil.copytree(ready, tmp_path / "map.zarr"))
    chunk = next((store / "status" / "c").rglob("0"))
    chunk.rename(tmp_path / "elsewhere")
    chunk.symlink_to(tmp_path / "elsewhere")
    with pytest.raises(cc.ClosureError, match="is a link"):
        ask(save=store)
    chunk.unlink()
    os.mkfifo(chunk)
    with pytest.raises(cc.ClosureError, match="is neither a file nor a folder"):
        ask(save=store)


def test_a_lock_that_is_a_link_is_not_written_through(ask: Ask, store: Path) -> None:
    (store / "lock").unlink(missing_ok=True)
    target = store.parent / "letter.txt"
    target.write_text("dear")
    (store / "lock").symlink_to(target)
    with pytest.raises(cc.ClosureError, match="cannot be saved in"):
        ask(save=store)
    assert target.read_text() == "dear"


@pytest.mark.parametrize(
    "forged",
    [
        {"stage": "../../evil"},
        {"stage": "/evil"},
        {"stage": "nowhere"},
        {"round": -1},
        {"round": "../1"},
        {"round": 1.5},
        {"seen": True},
        {"seen": None},
        {"active": [["../../evil", 0]]},
        {"active": [[0, 99]]},
        {"active": [[-1, 0]]},
        {"active": [[0]]},
        {"active": 3},
        {"listed": "all"},
    ],
    ids=str,
)
def test_forged_states_are_refused(ask: Ask, store: Path, forged: dict[str, Any]) -> None:
    """With a checksum that is right."""
    path = store / "journal" / "state.json"
    content = read_whole(path)
    assert content is not None
    write_whole(path, json.dumps(json.loads(content) | forged).encode())
    before = sorted(store.parent.rglob("*"))
    with pytest.raises(cc.ClosureError, match=r"state\.json is damaged; delete"):
        ask(save=store)
    assert [p for p in sorted(store.parent.rglob("*")) if p.name != "lock"] == [
        p for p in before if p.name != "lock"
    ]


@pytest.mark.parametrize("forged", [{"held": 3}, {"held": {"q3": "x"}}, {"start": ["a"] * 12}, []])
def test_forged_requests_are_refused(ask: Ask, store: Path, forged: Any) -> None:
    path = store / "zarr.json"
    kept = json.loads(path.read_text())
    request = kept["attributes"]["request"]
    kept["attributes"]["request"] = request | forged if isinstance(forged, dict) else forged
    path.write_text(json.dumps(kept))
    with pytest.raises(cc.ClosureError, match=r"holds another map: .* differs|holds no map"):
        ask(save=store)


def test_forged_lists_are_refused(ask: Ask, store: Path) -> None:
    import zlib

    path = store / "journal" / "list.txt"
    for name in ("../../evil/0_0.find", "branch-0/../../evil", "aside/walls-branch-x-0_0.find"):
        kept = path.read_text()
        path.write_text(kept + f"{name} {zlib.crc32(name.encode()):08x}\n")
        with pytest.raises(cc.ClosureError, match=r"list\.txt is damaged; delete"):
            ask(save=store)
        path.write_text(kept)


def test_names_that_are_no_names_for_a_file_are_refused(ask: Ask, tmp_path: Path) -> None:
    for name in ("../own", "a/b", ".hidden", "journal", "checksums", "__own"):
        with pytest.raises(cc.ClosureError, match=f"{name!r} is no name for a file"):
            ask(save=tmp_path / "map.zarr", measures={name: np.sum})
    assert list(tmp_path.iterdir()) == []


# -- damage ---------------------------------------------------------------------------------------


def damage(path: Path, how: str, chance: random.Random) -> None:
    content = bytearray(path.read_bytes())
    if how == "deleted":
        path.unlink()
        return
    if how == "emptied":
        content = bytearray()
    elif how == "truncated":
        content = content[: chance.randrange(len(content))]
    else:
        content[chance.randrange(len(content))] ^= 1 << chance.randrange(8)
    path.write_bytes(content)


HOW = ("truncated", "flipped", "emptied", "deleted")


def refused_or_right(ask: Ask, whole: xr.Dataset, store: Path) -> bool:
    """Whether a store is refused by name; if not, the map is the right one."""
    try:
        found = ask(save=store).load()
    except cc.ClosureError as error:
        message = str(error)
    else:
        xr.testing.assert_equal(found, whole)
        return False
    assert str(store) in message
    assert "delete" in message or "another name" in message
    return True


@pytest.mark.slow
@pytest.mark.parametrize("how", HOW)
def test_a_damaged_store_is_never_believed(
    ask: Ask, whole: xr.Dataset, stopped: Path, tmp_path: Path, how: str
) -> None:
    """A file of each kind: recomputed where that can be, else refused."""
    chance = random.Random(HOW.index(how))
    kinds = (
        *("zarr.json", "status/zarr.json", "journal/state.json", "journal/list.txt"),
        *("journal/branch-*/*.find", "journal/sums/status/*", "status/c/*/*", "q/c/*/*/*"),
    )
    refused = 0
    for i, kind in enumerate(kinds):
        name = chance.choice(sorted(stopped.glob(kind))).relative_to(stopped)
        store = Path(shutil.copytree(stopped, tmp_path / f"{i}.zarr"))
        damage(store / name, how, chance)
        refused += refused_or_right(ask, whole, store)
        shutil.rmtree(store)
    assert refused > len(kinds) / 2


@pytest.mark.parametrize("how", HOW)
def test_a_damaged_chunk_of_a_complete_map_is_refused(
    ask: Ask, whole: xr.Dataset, ready: Path, tmp_path: Path, how: str
) -> None:
    chance = random.Random(10 + HOW.index(how))
    chunks = sorted(
        p.relative_to(ready) for p in ready.rglob("*") if "c" in p.parts and p.is_file()
    )
    assert len(chunks) > 30
    store = Path(shutil.copytree(ready, tmp_path / "map.zarr"))
    for name in chance.sample(chunks, 8):
        damage(store / name, how, chance)
        assert refused_or_right(ask, whole, store), name
        shutil.copy(ready / name, store / name)
    xr.testing.assert_identical(ask(save=store).load(), whole)


@pytest.mark.parametrize("folder", ["status", "journal", "journal/sums", "journal/branch-1", "q"])
def test_folders_that_are_gone_are_missed(
    ask: Ask, whole: xr.Dataset, store: Path, folder: str
) -> None:
    found = [p.name for p in (store / "journal").iterdir()]
    if not (store / folder).exists():
        (folder,) = (f"journal/{name}" for name in found if name.startswith("branch-"))
    shutil.rmtree(store / folder)
    assert refused_or_right(ask, whole, store)


# -- other writers, and ends ----------------------------------------------------------------------


def test_a_store_is_written_by_one_at_a_time(ask: Ask, whole: xr.Dataset, store: Path) -> None:
    with (
        held(store),
        pytest.raises(cc.ClosureError, match=rf"by process {os.getpid()} on \S+; wait"),
    ):
        ask(save=store)
    xr.testing.assert_identical(ask(save=store).load(), whole)


@pytest.mark.slow
def test_two_processes_ask_for_the_same_map(ask: Ask, whole: xr.Dataset, tmp_path: Path) -> None:
    """The second is told so at once, the first goes on; when it is killed the way is free."""
    folder = tmp_path / "map.zarr"
    program = (
        "import time, numpy as np, closedchain as cc\n"
        "over = {'q1': np.linspace(-0.9, 0.3, 9), 'q2': np.linspace(-0.9, 0.3, 8)}\n"
        "slow = lambda *a: time.sleep(0.2)\n"
        f"cc.singularity_map(cc.load('linear_delta'), over, {AT!r}, progress=slow, keep_q=True,\n"
        f"    chunk=3, workers=1, measures=['condition'], save={str(folder)!r})\n"
    )
    with subprocess.Popen([sys.executable, "-c", program]) as first:
        try:
            deadline = time.monotonic() + 60.0
            while not list(folder.glob("journal/*/*.find")) and time.monotonic() < deadline:
                assert first.poll() is None
                time.sleep(0.02)
            with pytest.raises(cc.ClosureError, match=f"written by process {first.pid} on"):
                ask(save=folder)
        finally:
            first.send_signal(signal.SIGKILL)
    xr.testing.assert_allclose(ask(save=folder).load(), whole, rtol=1e-9, atol=1e-10)


@pytest.mark.parametrize("when", ["before it says so", "after it says so"])
def test_a_run_that_is_killed_at_its_very_end(
    ask: Ask, whole: xr.Dataset, store: Path, monkeypatch: pytest.MonkeyPatch, when: str
) -> None:
    def killed(*_: object) -> None:
        raise Stopped

    with monkeypatch.context() as patch:
        patch.setattr(saving, "map_labels" if when.startswith("before") else "_tidy", killed)
        with pytest.raises(Stopped):
            ask(save=store)
    assert (store / "journal").exists()
    xr.testing.assert_identical(ask(save=store).load(), whole)
    assert not (store / "journal").exists()


@pytest.mark.parametrize("where", ["journal", "chunks", "metadata"])
@pytest.mark.parametrize("code", [errno.ENOSPC, errno.EROFS])
def test_a_disk_that_gets_full_loses_nothing(
    ask: Ask,
    whole: xr.Dataset,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    where: str,
    code: int,
) -> None:
    from zarr.storage import _local

    from closedchain.analysis.singularity.maps import journal_folder

    module, name = (journal_folder, "write_whole") if where == "journal" else (_local, "_put")
    real, calls = getattr(module, name), count()
    fine = {"journal": 9, "chunks": 40, "metadata": 4}[where]

    def full(*args: Any, **kwargs: Any) -> Any:
        if next(calls) > fine:
            raise OSError(code, os.strerror(code))
        return real(*args, **kwargs)

    with monkeypatch.context() as patch:
        patch.setattr(module, name, full)
        with pytest.raises(cc.ClosureError, match=r"cannot be saved.*is kept") as e:
            ask(save=tmp_path / "map.zarr")
    assert os.strerror(code) in str(e.value)
    kept = len(list((tmp_path / "map.zarr").glob("journal/*/*.find")))
    assert kept > 0 or where == "metadata"
    xr.testing.assert_identical(ask(save=tmp_path / "map.zarr").load(), whole)


@pytest.fixture
def nobody() -> Iterator[Path]:
    """A folder that this process may read and not write to."""
    folder = Path(tempfile.mkdtemp())
    folder.chmod(0o755)
    try:
        yield folder
    finally:
        os.chmod(folder, 0o755)
        shutil.rmtree(folder)


def test_a_folder_that_is_read_only(ask: Ask, whole: xr.Dataset, ready: Path, nobody: Path) -> None:
    """Nothing can be saved there; a complete map in it can be opened."""
    store = Path(shutil.copytree(ready, nobody / "map.zarr"))
    root = os.geteuid() == 0
    for path in (*nobody.rglob("*"), nobody):
        path.chmod(0o555 if path.is_dir() else 0o444)
    if root:
        os.seteuid(65534)
    try:
        with pytest.raises(cc.ClosureError, match=r"cannot be saved in .*: Permission denied"):
            ask(save=nobody / "other.zarr")
        found = ask(save=store).load()
    finally:
        if root:
            os.seteuid(0)
        for path in (nobody, *nobody.rglob("*")):
            path.chmod(0o755 if path.is_dir() else 0o644)
    xr.testing.assert_identical(found, whole)


# -- Dask -----------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("lost", ["worker", "scheduler"])
def test_lost_workers_are_said_and_nothing_is_lost(
    ask: Ask, whole: xr.Dataset, tmp_path: Path, lost: str
) -> None:
    distributed = pytest.importorskip("distributed")
    folder, calls = tmp_path / "map.zarr", count()
    quiet = {"n_workers": 1, "threads_per_worker": 1, "dashboard_address": None}
    cluster = distributed.LocalCluster(processes=False, **quiet)
    client = distributed.Client(cluster)
    try:

        def lose(what: str, done: int, total: int) -> None:
            if done > 20 and next(calls) == 0:
                cluster.scale(0) if lost == "worker" else client.close()

        with pytest.raises(cc.ClosureError, match="the Dask workers of the map are gone"):
            ask(save=folder, client=client, workers=None, progress=lose)
    finally:
        client.close()
        cluster.close()
    assert list(folder.glob("journal/*/*.find"))
    xr.testing.assert_identical(ask(save=folder).load(), whole)
