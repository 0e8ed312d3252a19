"""Visual shapes of SDF links."""

from __future__ import annotations

from typing import TYPE_CHECKING

from closedchain.urdf import elements
from closedchain.urdf.formats.sdf.frames import Frames
from closedchain.urdf.formats.sdf.text_values import child, children, number, numbers, word
from closedchain.urdf.poses import inverse, origin_of
from closedchain.urdf.shapes import Colour, Shape

if TYPE_CHECKING:
    from lxml.etree import _Element as Element


def shapes_of_link(link: Element, frames: Frames, notes: list[str]) -> tuple[Shape, ...]:
    """Shapes of a link that URDF has; the others are noted."""
    name = elements.text(link, "name")
    found = []
    for visual in children(link, "visual"):
        shape = _shape(visual, frames, name)
        if shape is None:
            notes.append(f"line {visual.sourceline}: a shape of the link {name!r} is not drawn")
        else:
            found.append(shape)
    return tuple(found)


def _shape(visual: Element, frames: Frames, link: str) -> Shape | None:
    geometry = child(visual, "geometry")
    if geometry is None or not len(geometry):
        return None
    element = geometry[0]
    place = inverse(frames.pose(link, visual)) @ frames.of(visual, link)
    origin, rgba = origin_of(place), _colour(visual)
    if element.tag == "box":
        size = child(element, "size")
        sizes = (1.0, 1.0, 1.0) if size is None else numbers(size, 3)
        return Shape("box", sizes, origin, "", rgba)
    if element.tag == "sphere":
        return Shape("sphere", (number(element, "radius", 1.0),), origin, "", rgba)
    if element.tag in ("cylinder", "capsule"):
        sizes = (number(element, "radius", 1.0), number(element, "length", 1.0))
        kind = "cylinder" if element.tag == "cylinder" else "capsule"
        return Shape(kind, sizes, origin, "", rgba)  # type: ignore[arg-type]
    if element.tag == "mesh":
        scale = child(element, "scale")
        sizes = (1.0, 1.0, 1.0) if scale is None else numbers(scale, 3)
        file = word(element, "uri").replace("model://", "package://", 1)
        return Shape("mesh", sizes, origin, file, rgba)
    return None


def _colour(visual: Element) -> Colour | None:
    material = child(visual, "material")
    if material is None:
        return None
    for tag in ("diffuse", "ambient"):
        found = child(material, tag)
        if found is not None and (found.text or "").strip():
            values = numbers(found, 3, 4)
            return values[0], values[1], values[2], values[3] if len(values) == 4 else 1.0
    return None
