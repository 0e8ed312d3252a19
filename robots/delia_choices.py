"""Which legs the DeLiA family has: words XYS of the joints that the paper combines.

A leg of a stage of three needs five freedoms, an outer leg six [Gallardo-Alvarado 2010, section 2].
The words stand apart from what computes with them, so that the catalogue can be listed without it.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import product
from types import MappingProxyType

from closedchain.robots.family import Choice

FREEDOMS: Mapping[str, int] = MappingProxyType({"R": 1, "P": 1, "RR": 2, "U": 2, "C": 2, "S": 3})
"""Freedoms of the joints that the paper combines."""
STAGE_FREEDOMS, OUTER_FREEDOMS = 5, 6


def _legs(first: str, second: str, wanted: int) -> Choice:
    """All words XYS: those with the wanted freedoms, and why the others make no member."""
    members: list[str] = []
    refused: dict[str, str] = {}
    for x, y in product(first.split(), second.split()):
        word = f"{x}{y}S"
        spare = FREEDOMS[x] + FREEDOMS[y] + FREEDOMS["S"] - wanted
        if spare == 0:
            members.append(word)
            continue
        why = f"it has {wanted + spare} freedoms where {wanted} are wanted, {spare} idle"
        if x == "S":
            why += ": the leg spins about the line of its two spherical joints"
        refused[word] = why
    return Choice(tuple(members), MappingProxyType(refused))


_STAGE = _legs("R P", "P R", STAGE_FREEDOMS)
_OUTER = _legs("U C RR S", "P R C", OUTER_FREEDOMS)
CHOICES: Mapping[str, Choice] = MappingProxyType(
    {"coupler": _STAGE, "passive": _STAGE, "outer": _OUTER}
)
"""Legs base to coupler (driven), coupler to platform (passive), base to platform (driven)."""
