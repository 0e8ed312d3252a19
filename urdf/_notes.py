"""Notes that say the same of several joints, as one sentence."""

from __future__ import annotations

import re
from collections.abc import Iterable

_ON_A_JOINT = re.compile(r"(line \d+: <\w+> in <joint '[^']*'>) (has|was) (.*)")


def merged(notes: Iterable[str]) -> tuple[str, ...]:
    """Notes, those that differ in nothing but line and joint as one, where the first of them is."""
    found: dict[str, list[str]] = {}
    for note in notes:
        match = _ON_A_JOINT.fullmatch(note)
        key = f"{note[note.index('<') :].split(' ')[0]} {match[2]} {match[3]}" if match else note
        found.setdefault(key, []).append(note)
    return tuple(_one(same) for same in found.values())


def _one(notes: list[str]) -> str:
    match = _ON_A_JOINT.fullmatch(notes[0])
    if len(notes) == 1 or match is None:
        return notes[0]
    verb = {"has": "have", "was": "were"}[match[2]]
    tail = match[3].replace("the joint was taken", "each was taken")
    return f"{match[1]} and in {len(notes) - 1} more {verb} {tail}"
