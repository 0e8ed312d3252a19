"""Object code kept on disk, so that a mechanism is compiled once a machine.

Entries are named by a digest of all that decides their bytes. Each carries a checksum; one that is
damaged, cut short or not ours counts as missing. Writers put a whole file in place at once, so any
number of processes may read and write, and one that is killed leaves no broken entry. Without a
folder that only its owner may write to, nothing is kept and everything else works.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import stat
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

MAGIC = b"closedchain tape 1\n"
LARGEST = 256 << 20
"""Bytes of all entries together; the ones unused for longest are dropped beyond."""

STALE = 3600.0
"""Age of an unfinished file [s] after which its writer is taken for dead."""


def folder() -> Path | None:
    """Folder of the entries, made where it is missing; None where none can be trusted.

    ``tapes`` in $CLOSEDCHAIN_CACHE, else in $XDG_CACHE_HOME/closedchain, else in
    ~/.cache/closedchain.
    """
    named = os.environ.get("CLOSEDCHAIN_CACHE")
    shared = os.environ.get("XDG_CACHE_HOME")
    try:
        if named:
            base = Path(named)
        else:
            base = (Path(shared) if shared else Path.home() / ".cache") / "closedchain"
        found = base / "tapes"
        found.mkdir(mode=0o700, parents=True, exist_ok=True)
        return found if ours(base.stat()) and ours(found.lstat()) else None
    except (OSError, RuntimeError):  # not to be made, or no home
        return None


def ours(status: os.stat_result) -> bool:
    """Whether a file or folder is ours and nobody else may write to it."""
    if not hasattr(os, "geteuid"):
        return True
    open_to_others = stat.S_IMODE(status.st_mode) & (stat.S_IWGRP | stat.S_IWOTH)
    return status.st_uid == os.geteuid() and not open_to_others


def key(*parts: str) -> str:
    """Name of an entry: a digest of all that decides its bytes."""
    digest = hashlib.sha256()
    for part in parts:
        data = part.encode()
        digest.update(len(data).to_bytes(8, "big") + data)
    return digest.hexdigest()


def read(name: str) -> bytes | None:
    """Payload of an entry, or None where there is none that is whole."""
    place = folder()
    if place is None:
        return None
    path = place / f"{name}.tape"
    try:
        with open(os.open(path, os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0)), "rb") as file:
            if not ours(os.fstat(file.fileno())):
                return None
            data = file.read()
    except OSError:
        return None
    size = len(MAGIC) + 32
    payload = data[size:]
    if data[:size] != MAGIC + checksum(name, payload):
        return None
    with contextlib.suppress(OSError):
        os.utime(path)  # used now
    return payload


def write(name: str, payload: bytes) -> bool:
    """Keep an entry; whether it could be kept."""
    place = folder()
    if place is None:
        return False
    try:
        number, made = tempfile.mkstemp(prefix=".new-", dir=place)
    except OSError:
        return False
    try:
        with open(number, "wb") as file:
            file.write(MAGIC + checksum(name, payload) + payload)
        os.replace(made, place / f"{name}.tape")
    except OSError:
        with contextlib.suppress(OSError):
            os.unlink(made)
        return False
    trim(place)
    return True


def checksum(name: str, payload: bytes) -> bytes:
    """Digest of an entry under its name: one that was renamed does not pass."""
    return hashlib.sha256(name.encode() + b"\n" + payload).digest()


def trim(place: Path) -> None:
    """Drop the entries unused for longest beyond ``LARGEST`` bytes, and what dead writers left."""
    entries = sorted(files(place))
    total = sum(size for _, size, _ in entries)
    for used, size, path in entries:
        unfinished = not path.endswith(".tape")
        if total > LARGEST if not unfinished else time.time() - used > STALE:
            with contextlib.suppress(OSError):
                os.unlink(path)
            total -= size


def files(place: Path) -> Iterator[tuple[float, int, str]]:
    """Time of last use, size and path of each file of ours, skipping what vanishes meanwhile."""
    with contextlib.suppress(OSError), os.scandir(place) as found:
        for entry in found:
            if entry.name.endswith(".tape") or entry.name.startswith(".new-"):
                with contextlib.suppress(OSError):
                    status = entry.stat(follow_symlinks=False)
                    yield status.st_mtime, status.st_size, entry.path
