"""The folder of a saved map: other writers, full disks, ends at bad moments and lost workers."""

from __future__ import annotations

import errno
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from itertools import count
from pathlib import Path
from typing import Any

import pytest
import xarray as xr
from delta_maps import Stopped, program
from stored_maps import CELLS, ask, whole

import closedchain as cc
from closedchain.analysis.singularity.maps import journal_folder, saving
from closedchain.analysis.singularity.maps.folder import held


def test_it_goes_on_from_a_copy(store: Path) -> None:
    xr.testing.assert_identical(ask(save=store).load(), whole())
    assert not (store / "journal").exists()
    assert not (store / "lock").exists()
    assert not any("ends" in path.parts for path in store.rglob("*"))
    assert not list(store.rglob("*.partial"))


def test_a_store_is_written_by_one_at_a_time(store: Path) -> None:
    with (
        held(store),
        pytest.raises(cc.ClosureError, match=rf"by process {os.getpid()} on \S+; wait"),
    ):
        ask(save=store)
    xr.testing.assert_identical(ask(save=store).load(), whole())


@pytest.mark.slow
def test_two_processes_ask_for_the_same_map(tmp_path: Path) -> None:
    """The second is told so at once, the first goes on; when it is killed the way is free."""
    folder = tmp_path / "map.zarr"
    text = program(folder, 0.2, CELLS, "workers=1, measures=['condition']")
    with subprocess.Popen([sys.executable, "-c", text]) as first:
        try:
            deadline = time.monotonic() + 60.0
            while not list(folder.glob("journal/*/*.find")) and time.monotonic() < deadline:
                assert first.poll() is None
                time.sleep(0.02)
            with pytest.raises(cc.ClosureError, match=f"written by process {first.pid} on"):
                ask(save=folder)
        finally:
            first.send_signal(signal.SIGKILL)
    xr.testing.assert_allclose(ask(save=folder).load(), whole(), rtol=1e-9, atol=1e-10)


@pytest.mark.parametrize("when", ["before it says so", "after it says so"])
def test_a_run_that_is_killed_at_its_very_end(
    store: Path, monkeypatch: pytest.MonkeyPatch, when: str
) -> None:
    def killed(*_: object) -> None:
        raise Stopped

    with monkeypatch.context() as patch:
        patch.setattr(saving, "map_labels" if when.startswith("before") else "_tidy", killed)
        with pytest.raises(Stopped):
            ask(save=store)
    assert (store / "journal").exists()
    xr.testing.assert_identical(ask(save=store).load(), whole())
    assert not (store / "journal").exists()


@pytest.mark.parametrize("where", ["journal", "chunks", "metadata"])
@pytest.mark.parametrize("code", [errno.ENOSPC, errno.EROFS])
def test_a_disk_that_gets_full_loses_nothing(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    where: str,
    code: int,
) -> None:
    from zarr.storage import _local

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
    xr.testing.assert_identical(ask(save=tmp_path / "map.zarr").load(), whole())


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


def test_a_folder_that_is_read_only(ready: Path, nobody: Path) -> None:
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
    xr.testing.assert_identical(found, whole())


@pytest.mark.slow
@pytest.mark.parametrize("lost", ["worker", "scheduler"])
def test_lost_workers_are_said_and_nothing_is_lost(tmp_path: Path, lost: str) -> None:
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
    xr.testing.assert_identical(ask(save=folder).load(), whole())
