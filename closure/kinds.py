"""Slides and dots of the closure kinds that the batch kernels know, from the table of kinds."""

from __future__ import annotations

from closedchain.closure.closures import Closure, Coupling
from closedchain.closure.joint_kinds import JOINT_KINDS, Dot, Slide

__all__ = ["DOTS", "FREEDOMS", "SAME_SENSE", "SLIDES", "Closure", "Coupling"]

_PLAIN = {
    name: kind
    for name, kind in JOINT_KINDS.items()
    if all(isinstance(row, Slide | Dot) for row in kind.equations)
}
SLIDES: dict[str, tuple[int, ...]] = {
    name: tuple(row.a for row in kind.equations if isinstance(row, Slide))
    for name, kind in _PLAIN.items()
}
DOTS: dict[str, tuple[tuple[int, int], ...]] = {
    name: tuple((row.a, row.b) for row in kind.equations if isinstance(row, Dot))
    for name, kind in _PLAIN.items()
}
# Axis pairs that the rows leave mirrored: a closed posture has them parallel, not opposed.
SAME_SENSE: dict[str, tuple[int, ...]] = {
    name: kind.senses for name, kind in JOINT_KINDS.items() if kind.senses
}
FREEDOMS: dict[str, int] = {name: kind.freedoms for name, kind in JOINT_KINDS.items()}
