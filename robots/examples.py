"""Robots of the package example-robot-data by name, as ``cc.load("example:NAME")``.

The package, an extra, holds URDF files and meshes of well-known robots. Few of them have loops; the
others are trees, to be taken as they are or closed with constraints of one's own.
"""

from __future__ import annotations

from pathlib import Path

from closedchain.urdf.errors import DescriptionError, known_names

PREFIX = "example:"
_PACKAGE, _FOLDER = "example-robot-data", "robots/"


def example_files() -> dict[str, Path]:
    """URDF files by name: that of the file, with its folder's where two have the same.

    Raises
    ------
    DescriptionError
        The package is not installed.
    """
    from importlib.metadata import PackageNotFoundError, distribution  # takes 10 ms

    try:
        files = distribution(_PACKAGE).files or ()
    except PackageNotFoundError:
        raise DescriptionError(
            "robots called example:NAME come from the package example-robot-data: "
            "pip install 'closedchain[examples]'"
        ) from None
    paths = sorted(
        Path(str(file.locate()))
        for file in files
        if file.suffix == ".urdf" and _FOLDER in file.as_posix()
    )
    stems = [path.stem for path in paths]
    return {
        path.stem if stems.count(path.stem) == 1 else f"{path.parents[1].name}/{path.stem}": path
        for path in paths
    }


def example_file(name: str) -> Path:
    """File of an example called ``example:NAME``, or NAME.

    Raises
    ------
    DescriptionError
        The package is not installed, or has no such robot.
    """
    known = example_files()
    name = name.removeprefix(PREFIX)
    if name not in known:
        raise DescriptionError(known_names(name, "example", tuple(known)))
    return known[name]
