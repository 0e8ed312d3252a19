"""Mechanisms from files of any format, told by content."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence

from closedchain.closure.loading import JointValue, located, mechanism_from_description
from closedchain.closure.mechanism import Mechanism
from closedchain.urdf.description import ParameterValue
from closedchain.urdf.files import describe_file


def load_file(
    source: str | os.PathLike[str],
    tolerance: float | None = None,
    package_dirs: Sequence[str | os.PathLike[str]] = (),
    home: Mapping[str, JointValue] | ParameterValue | None = None,
    *,
    xacro: bool = True,
    **parameters: ParameterValue,
) -> Mechanism:
    """Load a mechanism from a file of any known format; its content tells which.

    URDF and xacro, with loops as ``<constraint>`` or in the words of other programs; URDF+; SDF;
    MJCF (with the package mujoco); ``robot.yaml`` with its URDF beside it. What was read over or
    assumed stands in ``Mechanism.notes``.

    Parameters
    ----------
    source : path or str
        A file, or the text itself.
    tolerance, package_dirs, home, xacro, parameters
        As for ``load_urdf``. Only xacro files have parameters.

    Raises
    ------
    DescriptionError
        Another content than those known, or anything wrong with the file or the parameters.

    Examples
    --------
    >>> text, losses = cc.export(cc.load("linear_delta"), "sdf")
    >>> m = cc.load_file(text)  # told by its content
    >>> m.inputs
    ('q1', 'q2', 'q3')
    """
    if home is not None and not isinstance(home, Mapping):
        parameters, home = {**parameters, "home": home}, None
    description = describe_file(source, parameters, xacro=xacro)
    return mechanism_from_description(located(description, source, package_dirs), tolerance, home)
