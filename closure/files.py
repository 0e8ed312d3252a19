"""Mechanisms from files of any format, told by content."""

from __future__ import annotations

import os

from closedchain.closure.loading import mechanism_from_description
from closedchain.closure.mechanism import Mechanism
from closedchain.urdf.description import ParameterValue
from closedchain.urdf.files import describe_file


def load_file(
    source: str | os.PathLike[str], *, xacro: bool = True, **parameters: ParameterValue
) -> Mechanism:
    """Load a mechanism from a file of any known format; its content tells which.

    URDF and xacro, with loops as ``<constraint>`` or in the words of other programs; URDF+; SDF;
    MJCF (with the package mujoco); ``robot.yaml`` with its URDF beside it. What was read over or
    assumed stands in ``Mechanism.notes``.

    Parameters
    ----------
    source : path or str
        A file, or the text itself.
    xacro : bool
        False reads plain URDF only, and is there for text that is not trusted.
    parameters : numbers, strings or booleans
        Values for the ``<xacro:arg>`` of a xacro file.

    Raises
    ------
    DescriptionError
        Another content than those known, or anything wrong with the file or the parameters.
    """
    return mechanism_from_description(describe_file(source, parameters, xacro=xacro))
