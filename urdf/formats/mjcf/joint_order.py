"""The order in which MuJoCo has the joints of an MJCF file in qpos and qvel."""

from __future__ import annotations

import os
from pathlib import Path

from closedchain.urdf.errors import DescriptionError
from closedchain.urdf.formats.mjcf.compiled import compile_text


def joint_order(file: str | os.PathLike[str]) -> tuple[str, ...]:
    """Names of the joints of an MJCF file, in the order of its qpos.

    Raises
    ------
    DescriptionError
        A file that cannot be read, or is refused by MuJoCo; joints without a name; no MuJoCo.
    """
    path = Path(file)
    try:
        text = path.read_text(encoding="utf-8")
    except UnicodeDecodeError:
        raise DescriptionError(f"{str(path)!r} is not UTF-8 text") from None
    except OSError as error:
        raise DescriptionError(f"cannot read {str(path)!r}: {error.strerror}") from None
    compiled = compile_text(text, str(path))
    names = tuple(compiled.name("joint", i) for i in range(compiled.model.njnt))
    if "" in names:
        raise DescriptionError(
            f"joint {names.index('')} of {str(path)!r} has no name: give the order by names"
        )
    return names
