"""What a writer of a format returns."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from closedchain.urdf.description import Description
from closedchain.urdf.writing import unstated


@dataclass(frozen=True)
class Written:
    """A text, what it does not say, and other files that belong to it.

    Attributes
    ----------
    text : str
    losses : tuple of str
        One sentence for each thing that the format cannot say, or says otherwise.
    beside : mapping of file name to text
        Files that must lie beside it.
    """

    text: str
    losses: tuple[str, ...] = ()
    beside: Mapping[str, str] = field(default_factory=dict)


def listed(names: Iterable[str], most: int = 4) -> str:
    """Names, quoted; after some of them how many more."""
    every = [repr(name) for name in names]
    more = f" and {len(every) - most} more" if len(every) > most else ""
    return ", ".join(every[:most]) + more


def homes_left_out(description: Description) -> list[str]:
    """Sentence on joints whose home a URDF cannot state, if there are any."""
    outside = [name for name in unstated(description) if description.home[name] != (0.0,)]
    if not outside:
        return []
    return [f"home is outside the limits of {listed(outside)}: it is not stated for these joints"]
