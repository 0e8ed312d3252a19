"""Links without an ``<inertial>`` whose shapes are of a material with a density.

``<material name="..." density="2700">`` is a word of our own, which other readers of URDF pass
over. Densities are in kg/m^3.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from closedchain.urdf.description import Link
from closedchain.urdf.shapes import shapes_of
from closedchain.urdf.solid_shapes import inertial_of

if TYPE_CHECKING:
    from lxml.etree import _Element as Element


def solid_links(root: Element, links: tuple[Link, ...], top: str) -> tuple[Link, ...]:
    """Links, those that state no inertia with that of their shapes, by their materials' densities.

    The link that stands still, ``top``, gets none.

    Raises
    ------
    DescriptionError
        A density that is no number, or below zero.
    """
    if not any(material.get("density") is not None for material in root.iter("material")):
        return links
    return with_solids(root, links, top)


def with_solids(
    root: Element, links: tuple[Link, ...], top: str, density: float | None = None
) -> tuple[Link, ...]:
    """Links, those that state no inertia with that of their shapes, of one density if it is given.

    Raises
    ------
    DescriptionError
        Numbers of shapes or materials that are none.
    """
    shapes, found = shapes_of(root), []
    for link in links:
        stated = link.inertial is not None and not link.solid
        inertial = None if stated or link.name == top else inertial_of(shapes[link.name], density)
        found.append(link if inertial is None else replace(link, inertial=inertial, solid=True))
    return tuple(found)


def solids_note(root: Element, links: Sequence[Link], density: float | None = None) -> str:
    """What is said of links whose inertia is that of their shapes; "" where there are none."""
    solid = {link.name for link in links if link.solid}
    if not solid:
        return ""
    shapes = shapes_of(root)
    used = {shape.density for name in solid for shape in shapes[name] if shape.density}
    said = ", ".join(f"{x:g}" for x in sorted(used if density is None else {density}))
    one = len(solid) == 1
    whose = "1 link has the mass of its" if one else f"{len(solid)} links have the masses of their"
    return f"{whose} shapes, solid at {said} kg/m^3"
