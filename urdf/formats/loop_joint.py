"""``<loop_joint>`` of Isaac Sim's URDF: a cut joint with a frame on each of two links.

The documentation writes ``<link1>`` twice, writers of such files ``<link1>`` and ``<link2>``; both
are read::

    <loop_joint name="c" type="spherical">
      <link1 link="a" xyz="0 0 0" rpy="0 0 0"/> <link2 link="b" xyz="0 0 0" rpy="0 0 0"/>
    </loop_joint>
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from closedchain.urdf import elements
from closedchain.urdf.constraint_element import SPELLINGS
from closedchain.urdf.description import CLOSURE_TYPES, ClosureType, LoopClosure, Origin, Vector3
from closedchain.urdf.errors import known_names
from closedchain.urdf.formats.substitution import (
    constraint_element,
    fresh_name,
    local_name,
    named_children,
    replace_by,
)

if TYPE_CHECKING:
    from lxml.etree import _Element as Element

TAG = "loop_joint"
_ZERO: Vector3 = (0.0, 0.0, 0.0)


def translate(root: Element, notes: list[str]) -> None:
    """Replace every ``<loop_joint>`` under the root by the ``<constraint>`` that says the same.

    Raises
    ------
    DescriptionError
        Another number of links than two, or a type that no closure has.
    """
    for element in named_children(root, TAG):
        element.tag = TAG
        closure = _closure(root, element, notes)
        replace_by(element, constraint_element(closure))


def _closure(root: Element, element: Element, notes: list[str]) -> LoopClosure:
    ends = [child for child in element if local_name(child) in ("link1", "link2")]
    if len(ends) != 2:
        raise elements.error(
            element, f"it needs two links, <link1 link=> and <link2 link=>, and has {len(ends)}"
        )
    wanted = element.get("type", "")
    kind = {"ball": "spherical", "continuous": "revolute"}.get(wanted, wanted)
    if kind not in CLOSURE_TYPES or SPELLINGS[kind].sizes:
        raise elements.error(element, known_names(wanted, "type of a loop joint", CLOSURE_TYPES))
    name = fresh_name(root, element.get("name") or "loop_joint")
    axis = _axis(element, kind, name, notes)
    origins = [
        Origin(elements.vector(end, "xyz", _ZERO), elements.vector(end, "rpy", _ZERO))
        for end in ends
    ]
    return LoopClosure(
        name=name,
        type=kind,
        parent=elements.text(ends[0], "link"),
        child=elements.text(ends[1], "link"),
        parent_origin=origins[0],
        child_origin=origins[1],
        parent_axis=axis,
        child_axis=axis,
        line=element.sourceline,
    )


def _axis(element: Element, kind: ClosureType, name: str, notes: list[str]) -> Vector3:
    if not SPELLINGS[kind].parent_axis:
        return (0.0, 0.0, 1.0)
    for child in element:
        if local_name(child) == "axis":
            return elements.unit_vector(child)
    notes.append(
        f"line {element.sourceline}: the loop joint {name!r} has no <axis>: x of its two frames "
        "was "
        "taken, as for a joint of URDF"
    )
    return (1.0, 0.0, 0.0)
