"""The table of singularity kinds, and of the six types that they come in: names and colours.

How a posture's kinds and types follow from its ranks is told, and decided, in
``analysis.singularity.kinds``; exported programs and pages of robots name them by these tables.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType


@dataclass(frozen=True)
class Kind:
    """A kind of singularity.

    Attributes
    ----------
    name : str
        As in ``Classification.kinds``.
    title : str
        For people, in a sentence: "direct singularity (type 2)".
    label : str
        In the legend of a figure.
    condition : str
        At a closed posture, in the letters of ``analysis.singularity.kinds``.
    watched : str
        The singular value that vanishes there, in the letters of ``analysis.singularity.kinds``.
    meaning : str
    colour : str
        Of Okabe and Ito's palette, told apart with any colour vision.
    dashes : tuple of float
        Dashes and gaps of its lines, in widths of a line: kinds differ without their colours too.
    """

    name: str
    title: str
    label: str
    condition: str
    watched: str
    meaning: str
    colour: str
    dashes: tuple[float, ...]


@dataclass(frozen=True)
class SingularityType:
    """One of Zlatanov's six types: its abbreviation, name, condition and a sentence for people."""

    name: str
    title: str
    condition: str
    meaning: str


_KINDS = (
    Kind(
        name="direct",
        title="direct singularity (type 2)",
        label="direct singularities (type 2)",
        condition="dim ker A > n - b",
        watched="singular value b + m - n of A",
        meaning="something moves with all inputs locked",
        colour="#D55E00",
        dashes=(),
    ),
    Kind(
        name="inverse",
        title="inverse singularity (type 1)",
        label="inverse singularities (type 1)",
        condition="rank T < d",
        watched="singular value d of T",
        meaning="some combination of outputs cannot be produced",
        colour="#0072B2",
        dashes=(7.0, 3.0),
    ),
    Kind(
        name="constraint",
        title="constraint singularity",
        label="constraint singularities",
        condition="m > n",
        watched="singular value r of K",
        meaning="the mechanism itself gains mobility, or branches",
        colour="#009E73",
        dashes=(2.0, 3.0),
    ),
)
KINDS: Mapping[str, Kind] = MappingProxyType({kind.name: kind for kind in _KINDS})
"""The kinds by name, in the order that tables and maps have them."""

COMBINED = Kind(
    name="combined",
    title="combined singularity (direct and inverse, type 3)",
    label="combined (type 3)",
    condition="direct and inverse",
    watched="both of theirs",
    meaning="something moves with all inputs locked, and some output cannot be produced",
    colour="#000000",
    dashes=(9.0, 3.0, 2.0, 3.0),
)

_TYPES = (
    SingularityType(
        "RI",
        "redundant input",
        "rank [A; T] - rank T > b - d",
        "inputs move while no output does, more than they always can",
    ),
    SingularityType(
        "RO",
        "redundant output",
        "rank [A; T] > rank A",
        "outputs move with all inputs locked",
    ),
    SingularityType(
        "II",
        "impossible input",
        "rank A < a",
        "some combination of input rates, otherwise possible, is not",
    ),
    SingularityType(
        "IO",
        "impossible output",
        "rank T < d",
        "some combination of outputs cannot be produced",
    ),
    SingularityType(
        "IIM",
        "increased instantaneous mobility",
        "m > n",
        "the mechanism has more freedoms than elsewhere",
    ),
    SingularityType(
        "RPM",
        "redundant passive motion",
        "m - rank [A; T] > n - b",
        "joints move while neither inputs nor outputs do, idle freedoms apart",
    ),
)
TYPES: Mapping[str, SingularityType] = MappingProxyType({one.name: one for one in _TYPES})
"""Zlatanov's six types by abbreviation."""


def title(kinds: frozenset[str]) -> str:
    """Name of a posture of these kinds: "regular", "inverse singularity (type 1)" and so on."""
    if not kinds:
        return "regular"
    if {"direct", "inverse"} <= kinds:
        first = COMBINED.title
    elif kinds == {"constraint"}:
        return KINDS["constraint"].title
    else:
        (name,) = kinds - {"constraint"}
        first = KINDS[name].title
    return f"{first}, and constraint" if "constraint" in kinds else first
