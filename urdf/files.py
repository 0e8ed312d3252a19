"""Any file that says a mechanism, whatever its format: told by its content, never by its name."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType

from lxml import etree

from closedchain.urdf import elements
from closedchain.urdf.description import Description, ParameterValue
from closedchain.urdf.errors import DescriptionError
from closedchain.urdf.expansion import read_source
from closedchain.urdf.formats import robot_yaml
from closedchain.urdf.reader import load_description, read

_NONE: Mapping[str, ParameterValue] = MappingProxyType({})
_KNOWN = "<robot> (URDF, URDF+, xacro), <mujoco> (MJCF), <sdf> (SDF) and robot.yaml"


def describe_file(
    source: str | os.PathLike[str],
    parameters: Mapping[str, ParameterValue] = _NONE,
    *,
    xacro: bool = True,
) -> Description:
    """Read a mechanism from a file of any format, or from its text.

    Parameters
    ----------
    source : path or str
        A file, or the text itself. A ``robot.yaml`` must be a file: its URDF lies beside it.
    parameters : mapping
        Values for the ``<xacro:arg>`` of a xacro file.
    xacro : bool
        False: evaluate nothing, refuse text that uses xacro.

    Raises
    ------
    DescriptionError
        Another content than those known, and whatever is wrong with it.
    """
    if isinstance(source, str) and "\n" in source and not source.lstrip().startswith("<"):
        robot_yaml.read_sidecar(source)
        raise DescriptionError("robot.yaml must be given as a file, since its URDF lies beside it")
    text, file = read_source(source)
    if file is not None and not text.lstrip("\ufeff \t\r\n").startswith("<"):
        try:
            sidecar = robot_yaml.read_sidecar(text)
        except DescriptionError as error:
            raise DescriptionError(f"{file}: {error}; known: {_KNOWN}") from None
        _refuse_parameters(parameters, "robot.yaml")
        return _beside(sidecar, Path(file), xacro)
    root = etree.QName(elements.document(text)).localname
    if root == "robot":
        found = load_description(source, parameters, xacro=xacro)
        return found if file is None else _with_hint(found, Path(file))
    if root == "mujoco":
        _refuse_parameters(parameters, "MJCF")
        from closedchain.urdf.formats.mjcf import reading as mjcf  # loading stays quick

        return replace(mjcf.read(text, file), printed=text)
    if root == "sdf":
        _refuse_parameters(parameters, "SDF")
        from closedchain.urdf.formats.sdf import reading as sdf

        return replace(sdf.read(text), printed=text)
    raise DescriptionError(f"the root element is <{root}>; known: {_KNOWN}", line=1, element=root)


def _refuse_parameters(parameters: Mapping[str, ParameterValue], what: str) -> None:
    if parameters:
        raise DescriptionError(
            f"parameters given ({', '.join(map(str, parameters))}), but {what} has none"
        )


def _beside(sidecar: robot_yaml.Sidecar, path: Path, xacro: bool) -> Description:
    """URDF beside a ``robot.yaml``, with what that says."""
    names = (f"{path.stem}.urdf", "robot.urdf")
    urdf = next((path.with_name(n) for n in names if path.with_name(n).is_file()), None)
    if urdf is None:
        raise DescriptionError(f"beside {str(path)!r} there is no {' and no '.join(names)}")
    plain, notes = robot_yaml.with_sidecar(load_description(urdf, xacro=xacro).text, sidecar)
    found = read(plain)
    return replace(found, notes=(*notes, *found.notes))


def _with_hint(found: Description, file: Path) -> Description:
    """Say that a ``robot.yaml`` lies beside a URDF which closes no loop itself."""
    if found.closures or found.relations:
        return found
    for name in (f"{file.stem}.yaml", "robot.yaml"):
        other = file.with_name(name)
        if other.is_file() and "closed_loop" in other.read_text(encoding="utf-8", errors="replace"):
            hint = f"{name} beside this file says loops; load it instead to have them"
            return replace(found, notes=(*found.notes, hint))
    return found
