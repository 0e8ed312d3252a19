"""Drake's ball constraints in an SDF model; their values are the text of their elements."""

from __future__ import annotations

from collections.abc import Collection
from typing import TYPE_CHECKING

from closedchain.urdf import elements
from closedchain.urdf.description import LoopClosure, Origin
from closedchain.urdf.errors import known_names
from closedchain.urdf.formats.sdf.text_values import numbers
from closedchain.urdf.formats.substitution import named_children

if TYPE_CHECKING:
    from lxml.etree import _Element as Element

BALL = "ball_constraint"


def ball_constraints(model: Element, links: Collection[str]) -> list[LoopClosure]:
    """Closures of a model's ``<drake:ball_constraint>`` elements.

    Raises
    ------
    DescriptionError
        A body or point that is missing, or a body that is no link.
    """
    found = []
    for element in named_children(model, BALL):
        names, origins = [], []
        for end, point in (("A", "AP"), ("B", "BQ")):
            name = (_part(element, f"{BALL}_body_{end}").text or "").strip()
            if name not in links:
                raise elements.error(element, known_names(name, "link", links))
            x, y, z = numbers(_part(element, f"{BALL}_p_{point}"), 3)
            names.append(name)
            origins.append(Origin((x, y, z)))
        wanted = element.get("name") or "ball"
        found.append(LoopClosure(wanted, "spherical", names[0], names[1], origins[0], origins[1]))
    return found


def _part(element: Element, tag: str) -> Element:
    for part in named_children(element, tag):
        return part
    raise elements.error(element, f"the element <drake:{tag}> is missing")
