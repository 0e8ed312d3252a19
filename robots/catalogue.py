"""Which robots there are, where their description lies, and what their variants change."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib.resources import files
from types import MappingProxyType
from typing import Literal

from closedchain.closure import Mechanism, mechanism_from_description
from closedchain.urdf import load_description
from closedchain.urdf.description import ParameterValue
from closedchain.urdf.errors import DescriptionError, known_names

Overrides = Mapping[str, ParameterValue]


@dataclass(frozen=True)
class Robot:
    """An entry of the catalogue.

    ``variants`` maps a name to the parameters it changes; ``up`` is the world axis that a viewer
    should draw upwards.
    """

    name: str
    title: str
    source: str
    file: str
    up: Literal["x", "y", "z"] = "z"
    variants: Mapping[str, Overrides] = field(default_factory=dict)


_D1 = Robot(
    name="d1",
    title="D1 of the DeLiA family: 3-RPS + 3-RPS + 3-UPS, six inputs",
    source="J. Gallardo-Alvarado, DeLiA: a new family of redundant robot manipulators, 2010",
    file="d1.xacro",
    up="y",
    variants=MappingProxyType(
        {
            "corrected": {},
            # U1 and U2 as the paper prints them; it does not print U3: mirrored
            "printed_u": {
                "U1": "0.5 -0.25 0",
                "U2": "-0.215 -0.25 -0.337",
                "U3": "-0.215 -0.25 0.337",
            },
            # U1 moved onto the circle on which U2 lies
            "circle_u": {"U2": "-0.215 -0.25 -0.337", "U3": "-0.215 -0.25 0.337"},
        }
    ),
)
_CATALOGUE: Mapping[str, Robot] = MappingProxyType({r.name: r for r in (_D1,)})


def robots() -> tuple[str, ...]:
    """Names of the robots in the catalogue."""
    return tuple(_CATALOGUE)


def robot(name: str) -> Robot:
    """Catalogue entry of a robot. Raises ``DescriptionError`` for an unknown name."""
    try:
        return _CATALOGUE[name]
    except KeyError:
        raise DescriptionError(known_names(name, "robot", _CATALOGUE)) from None


def load(name: str, *, variant: str | None = None, **parameters: ParameterValue) -> Mechanism:
    """Load a robot of the catalogue.

    Parameters
    ----------
    name : str
        One of ``robots()``.
    variant : str, optional
        A named set of parameters of that robot.
    parameters : numbers or strings
        Sizes [m], as listed in ``Mechanism.parameters``; they override the variant's.

    Raises
    ------
    DescriptionError
        Unknown robot, variant or parameter (lists the known ones), or sizes that do not close.
    """
    entry = robot(name)
    overrides: Overrides = {}
    if variant is not None:
        if variant not in entry.variants:
            raise DescriptionError(known_names(variant, f"variant of {name}", entry.variants))
        overrides = entry.variants[variant]
    path = files("closedchain.urdf") / entry.file
    return mechanism_from_description(load_description(str(path), {**overrides, **parameters}))
