"""Pairs of frames ``closing_X_1`` and ``closing_X_2``, which onshape-to-robot leaves in a URDF.

The mate between them closes a loop; which joint it was the file does not say. A point that two
links share, a ball, is what the other programs that read such pairs make of them.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from closedchain.urdf.constraint_element import CONSTRAINT
from closedchain.urdf.description import LoopClosure
from closedchain.urdf.formats.substitution import (
    constraint_element,
    fresh_name,
    named_children,
)

if TYPE_CHECKING:
    from lxml.etree import _Element as Element

_FRAME = re.compile(r"closing_(.+)_([12])")


def translate(root: Element, notes: list[str]) -> None:
    """Add a spherical ``<constraint>`` for every pair that no constraint joins yet."""
    joined = {
        frozenset(str(end.get("link")) for end in named_children(constraint, "parent", "child"))
        for constraint in named_children(root, CONSTRAINT)
    }
    pairs: dict[str, dict[str, Element]] = {}
    for link in named_children(root, "link"):
        found = _FRAME.fullmatch(link.get("name", ""))
        if found:
            pairs.setdefault(found[1], {})[found[2]] = link
    for name, ends in pairs.items():
        names = [str(end.get("name")) for end in ends.values()]
        line = next(iter(ends.values())).sourceline
        if len(ends) != 2:
            notes.append(
                f"line {line}: the frame {names[0]!r} has no partner, so it closes no loop; a pair "
                f"is called closing_{name}_1 and closing_{name}_2"
            )
            continue
        parent, child = str(ends["1"].get("name")), str(ends["2"].get("name"))
        if frozenset((parent, child)) in joined:
            continue
        closure = LoopClosure(fresh_name(root, name), "spherical", parent, child)
        element = constraint_element(closure)
        for part in element.iter():
            part.sourceline = line
        root.append(element)
        notes.append(
            f"line {line}: the frames {parent!r} and {child!r} were joined by a ball, since the "
            "file "
            "does not say by which joint; in a planar loop a hinge would do the same, in a spatial "
            'one write <constraint type="revolute"> between them'
        )
