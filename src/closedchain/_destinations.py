"""Where results go: what cannot be written is refused before the work, not after it."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

from closedchain._arguments import BadArgumentError


def results_folder(folder: Path) -> None:
    """Make a folder, and find out whether files can be written into it.

    Raises
    ------
    BadArgumentError
        There is a file of this name.
    OSError
        It cannot be made, or nothing can be written into it.
    """
    for one in (folder, *folder.parents):
        if one.exists() and not one.is_dir():
            raise BadArgumentError(f"{one} is a file; results need a folder there, or a new name")
    folder.mkdir(parents=True, exist_ok=True)
    _try(folder)


def results_file(file: Path) -> None:
    """Find out whether a file can be written into a folder that is there.

    A file that is there stays as it is until there is something to write.

    Raises
    ------
    BadArgumentError
        There is a folder of this name, or no folder that it could lie in.
    OSError
        It cannot be written.
    """
    folder = file.absolute().parent
    if file.is_dir():
        raise BadArgumentError(f"{file} is a folder; expected the name of a file")
    if file.exists():
        if not os.access(file, os.W_OK):
            raise BadArgumentError(f"{file} is there, and must not be written")
    elif folder.is_dir():
        _try(folder)
    else:
        what = "is no folder" if folder.exists() else "is not there: make that folder first"
        raise BadArgumentError(f"{file} cannot be written: {folder} {what}")


def _try(folder: Path) -> None:
    with tempfile.TemporaryFile(dir=folder):
        pass
