"""The formats that can be written, by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

from closedchain.urdf.description import Description
from closedchain.urdf.formats import plain_urdf, robot_yaml, urdf_plus
from closedchain.urdf.formats.mjcf import writing as mjcf
from closedchain.urdf.formats.sdf import writing as sdf
from closedchain.urdf.formats.written import Written

WRITERS: Mapping[str, Callable[[Description], Written]] = MappingProxyType(
    {
        "urdf": plain_urdf.write,
        "mjcf": mjcf.write,
        "sdf": sdf.write,
        "urdf+": urdf_plus.write,
        "robot.yaml": robot_yaml.write,
    }
)
"""Writers take a description whose home is closed and lists every moving joint."""
