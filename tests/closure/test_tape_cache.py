"""Object code on disk: found again, rebuilt where damaged, never trusted where others may write."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from random_tapes import random_tape

from closedchain.closure.tape import cache, machine, native

TAPE = random_tape(1, length=40)
POSTURES = np.random.default_rng(0).uniform(-1, 1, (5, 9))
NAME = "f" * 64


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("CLOSEDCHAIN_CACHE", str(tmp_path / "kept"))
    return tmp_path / "kept" / "tapes"


@pytest.fixture
def compilations(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Grows with every compilation."""
    made: list[int] = []
    real = native.object_code

    def counted(text: str) -> bytes:
        made.append(len(text))
        return real(text)

    monkeypatch.setattr(native, "object_code", counted)
    return made


def entries(home: Path) -> list[Path]:
    return sorted(home.glob("*.tape"))


def test_code_is_made_once(home: Path, compilations: list[int]) -> None:
    first = machine.compiled(TAPE).run(POSTURES)
    again = machine.compiled(random_tape(1, length=40)).run(POSTURES)
    assert len(compilations) == 1
    assert (first == again).all()
    machine.compiled(TAPE, 1)
    machine.compiled(random_tape(2, length=40))
    assert len(compilations) == len(entries(home)) == 3
    assert home.stat().st_mode & 0o777 == 0o700
    assert all(path.stat().st_mode & 0o777 == 0o600 for path in entries(home))


def test_other_generators_make_other_entries(
    home: Path, compilations: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    """What cannot be told apart from the work of another version is not kept."""
    assert len(machine.generator()) == 64
    for version, kept in (("a", 1), ("b", 2), ("", 2), ("a", 2)):
        monkeypatch.setattr(machine, "generator", lambda version=version: version)
        machine.compiled(TAPE)
        assert len(entries(home)) == kept
    assert len(compilations) == 3


@pytest.mark.parametrize("what", ["flipped", "cut", "empty", "renamed", "longer", "text"])
def test_damaged_entries_are_made_again(home: Path, compilations: list[int], what: str) -> None:
    expected = machine.compiled(TAPE).run(POSTURES)
    (path,) = entries(home)
    whole = path.read_bytes()
    middle = len(whole) // 2
    other = home / "other"
    monkey = {
        "flipped": whole[:middle] + bytes([whole[middle] ^ 1]) + whole[middle + 1 :],
        "cut": whole[:middle],
        "empty": b"",
        "longer": whole + b"\0",
        "text": b"not object code",
        "renamed": cache.MAGIC + cache.checksum("0" * 64, whole[51:]) + whole[51:],
    }
    other.write_bytes(monkey[what])
    os.replace(other, path)
    assert (machine.compiled(TAPE).run(POSTURES) == expected).all()
    assert len(compilations) == 2
    assert path.read_bytes() == whole
    machine.compiled(TAPE)
    assert len(compilations) == 2


@pytest.mark.parametrize("mode", [0o777, 0o770])
def test_folders_that_others_may_write_to_are_not_used(home: Path, mode: int) -> None:
    for open_to_others in (home, home.parent):
        home.mkdir(parents=True, exist_ok=True)
        home.chmod(0o700)
        home.parent.chmod(0o700)
        assert cache.write(NAME, b"code")
        open_to_others.chmod(mode)
        assert cache.folder() is None
        assert cache.read(NAME) is None
        assert not cache.write(NAME, b"other")
        assert machine.compiled(TAPE).run(POSTURES).shape == (20, 9)
        assert len(entries(home)) == 1


def test_entries_that_others_may_write_to_or_links_are_not_used(home: Path) -> None:
    assert cache.write(NAME, b"code")
    (path,) = entries(home)
    path.chmod(0o666)
    assert cache.read(NAME) is None
    path.chmod(0o600)
    assert cache.read(NAME) == b"code"
    path.rename(home / "elsewhere")
    path.symlink_to(home / "elsewhere")
    assert cache.read(NAME) is None


def test_no_folder_no_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "file"
    file.write_text("in the way")
    monkeypatch.setenv("CLOSEDCHAIN_CACHE", str(file))
    assert cache.folder() is None
    assert not cache.write(NAME, b"code")
    assert machine.compiled(TAPE).run(POSTURES).shape == (20, 9)


def test_a_folder_that_takes_no_files(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As where it is read-only or the disk is full."""

    def refuse(*_: object, **__: object) -> None:
        raise PermissionError("read-only")

    with monkeypatch.context() as m:
        m.setattr(cache.tempfile, "mkstemp", refuse)
        assert machine.compiled(TAPE).run(POSTURES).shape == (20, 9)
    with monkeypatch.context() as m:
        m.setattr(cache.os, "replace", refuse)
        assert machine.compiled(TAPE).run(POSTURES).shape == (20, 9)
    assert list(home.iterdir()) == []


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_a_read_only_folder(home: Path) -> None:
    assert cache.write(NAME, b"code")
    home.chmod(0o500)
    try:
        assert cache.read(NAME) == b"code"
        assert not cache.write("e" * 64, b"code")
        assert machine.compiled(TAPE).run(POSTURES).shape == (20, 9)
    finally:
        home.chmod(0o700)


def test_where_the_folder_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("CLOSEDCHAIN_CACHE", raising=False)
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    assert cache.folder() == tmp_path / "home/.cache/closedchain/tapes"
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "xdg"))
    assert cache.folder() == tmp_path / "xdg/closedchain/tapes"


def test_entries_unused_for_longest_go(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cache, "LARGEST", 3500)
    names = [str(k) * 64 for k in range(6)]
    for k, name in enumerate(names[:3]):
        cache.write(name, bytes(1000))
        os.utime(home / f"{name}.tape", (k, k))
    assert cache.read(names[0]) is not None  # used now
    cache.write(names[3], bytes(1000))
    assert [cache.read(name) is not None for name in names] == [
        True,
        False,
        True,
        True,
        False,
        False,
    ]


def test_what_dead_writers_left_goes(home: Path) -> None:
    cache.write(NAME, b"code")
    old, young = home / ".new-old", home / ".new-young"
    for path in (old, young):
        path.write_bytes(b"half")
    os.utime(old, (time.time() - 2 * cache.STALE,) * 2)
    cache.write("e" * 64, b"code")
    assert not old.exists()
    assert young.exists()
    assert cache.read(NAME) == b"code"


WORKER = """
import sys, numpy as np
sys.path.insert(0, sys.argv[1])
from random_tapes import random_tape
from closedchain.closure.tape import machine
x = np.random.default_rng(0).uniform(-1, 1, (5, 9))
for seed in range(4):
    print(machine.compiled(random_tape(seed, length=25)).run(x).tobytes().hex())
"""

FOREVER = """
import os
from closedchain.closure.tape import cache
print("begun", flush=True)
while True:
    cache.write("f" * 64, os.urandom(1) * 3_000_000)
"""


def started(code: str) -> subprocess.Popen[str]:
    command = [sys.executable, "-c", code, str(Path(__file__).parent)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, text=True)


@pytest.mark.slow
def test_processes_share_the_folder(home: Path) -> None:
    workers = [started(WORKER) for _ in range(3)]
    found = {worker.communicate(timeout=120)[0] for worker in workers}
    assert all(worker.returncode == 0 for worker in workers)
    assert len(found) == 1
    assert len(entries(home)) == 4
    assert list(home.glob(".new-*")) == []


@pytest.mark.slow
def test_killed_writers_leave_no_broken_entry(home: Path) -> None:
    whole = 0
    for delay in (0.0, 0.013, 0.031, 0.057):
        writer = started(FOREVER)
        assert writer.stdout is not None
        assert writer.stdout.readline() == "begun\n"
        time.sleep(delay)
        writer.send_signal(signal.SIGKILL)
        writer.wait()
        writer.stdout.close()
        payload = cache.read(NAME)
        whole += payload is not None and len(set(payload)) == 1 and len(payload) == 3_000_000
        assert (payload is None) == (not entries(home))
    assert whole
