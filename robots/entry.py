"""An entry of the catalogue."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import product
from typing import Literal

from closedchain.robots.family import Choice
from closedchain.urdf.description import ParameterValue

Overrides = Mapping[str, ParameterValue]


@dataclass(frozen=True)
class Robot:
    """An entry of the catalogue.

    ``variants`` maps a name to the parameters it changes; ``up`` is the world axis that a viewer
    should draw upwards. An entry with ``choices`` is a family: each combination of the words that
    these parameters may take is a robot of its own.
    """

    name: str
    title: str
    source: str
    file: str
    up: Literal["x", "y", "z"] = "z"
    variants: Mapping[str, Overrides] = field(default_factory=dict)
    choices: Mapping[str, Choice] = field(default_factory=dict)

    def members(self) -> tuple[Mapping[str, str], ...]:
        """Choices of every member of the family, the default member first."""
        words = (choice.words for choice in self.choices.values())
        return tuple(dict(zip(self.choices, combined, strict=True)) for combined in product(*words))
