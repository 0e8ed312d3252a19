"""The folder of a saved map: nothing in it leads out of it, one process at a time writes to it.

A store may come from anybody and have met with anything. What is not as it was written is refused
with its name, and so is what no run of ours leaves behind.
"""

from __future__ import annotations

import errno
import os
import stat
import zlib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from closedchain.urdf.errors import ClosureError

LOCK = "lock"
"""File that the process which writes to a store holds."""

_MARK = b"closedchain\n"
_NO_LOCKS = (errno.ENOLCK, errno.ENOTSUP, errno.EOPNOTSUPP, errno.ENOSYS)


def damaged(path: Path, what: str, folder: Path) -> ClosureError:
    """Error of a file in a store that is not as it was written."""
    return ClosureError(f"{path} {what}; delete {folder} and ask for the map again")


def check_inside(folder: Path) -> None:
    """Refuse links and whatever else is neither a file nor a folder.

    Raises
    ------
    ClosureError
        Naming the first of them.
    """
    waiting = [folder]
    while waiting:
        with os.scandir(waiting.pop()) as entries:
            for entry in entries:
                mode = entry.stat(follow_symlinks=False).st_mode
                if stat.S_ISDIR(mode):
                    waiting.append(Path(entry.path))
                elif not stat.S_ISREG(mode):
                    what = "a link" if stat.S_ISLNK(mode) else "neither a file nor a folder"
                    raise ClosureError(
                        f"{entry.path} is {what}, and a saved map holds none; give another name "
                        "to save, or take it away"
                    )


@contextmanager
def writing(folder: Path) -> Iterator[None]:
    """Say of a disk that is full, a folder that cannot be written to and the like what it means.

    Raises
    ------
    ClosureError
        In place of ``OSError``.
    """
    try:
        yield
    except OSError as error:
        why = error.strerror or str(error)
        raise ClosureError(
            f"the map cannot be saved in {folder}: {why}; what is in it is kept, and the same "
            "call goes on from there"
        ) from error


@contextmanager
def held(folder: Path) -> Iterator[None]:
    """Hold the lock of a store, where its file system knows locks.

    The system lets go of it when the process ends, however it ends.

    Raises
    ------
    ClosureError
        Another process holds it, or another call of this one.
    """
    import fcntl

    path = folder / LOCK
    with writing(folder):
        handle = os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o666)
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            if error.errno not in _NO_LOCKS:
                who = os.read(handle, 200).decode("utf-8", "replace").strip() or "another process"
                raise ClosureError(
                    f"{folder} is being written by {who}; wait for it, or give another name to save"
                ) from None
        with writing(folder):
            os.ftruncate(handle, 0)
            os.write(handle, f"process {os.getpid()} on {os.uname().nodename}\n".encode())
        yield
    finally:
        os.close(handle)


def release(folder: Path) -> None:
    """Take the lock's file away: the store is complete, and is only read from now on."""
    with suppress(FileNotFoundError):
        (folder / LOCK).unlink()


def write_whole(path: Path, content: bytes) -> None:
    """Write a file at one stroke, with a checksum at its head.

    Raises
    ------
    OSError
        As from the system.
    """
    partial = path.with_name(path.name + ".partial")
    try:
        with partial.open("wb") as file:
            file.write(_MARK + zlib.crc32(content).to_bytes(4, "big") + content)
        partial.replace(path)
    except OSError:
        with suppress(OSError):
            partial.unlink()
        raise


def read_whole(path: Path) -> bytes | None:
    """Content of such a file; None where it is damaged.

    Raises
    ------
    FileNotFoundError
        There is none.
    """
    found = path.read_bytes()
    head = len(_MARK) + 4
    content = found[head:]
    known = found[:head] == _MARK + zlib.crc32(content).to_bytes(4, "big")
    return content if known else None
