"""Shapes that links are drawn with: read from URDF text, written to it, carried between formats."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from lxml import etree

from closedchain.urdf import elements
from closedchain.urdf.description import Origin

if TYPE_CHECKING:
    from lxml.etree import _Element as Element

ShapeKind = Literal["box", "cylinder", "capsule", "sphere", "mesh"]
Colour = tuple[float, float, float, float]
Shapes = Mapping[str, tuple["Shape", ...]]
"""Shapes of each link, by its name."""
_HERE = Origin()


@dataclass(frozen=True)
class Shape:
    """One shape of a link.

    Attributes
    ----------
    kind : str
    sizes : tuple of float
        [m]: the edges of a box, radius and length of a cylinder or a capsule (without its caps),
        the radius of a sphere, the scale of a mesh along x y z.
    origin : Origin
        In the link; cylinders and capsules lie along z.
    file : str
        File of a mesh, as written.
    rgba : four numbers, optional
    density : float
        Of the material [kg/m^3]; zero where none is stated.
    """

    kind: ShapeKind
    sizes: tuple[float, ...]
    origin: Origin = _HERE
    file: str = ""
    rgba: Colour | None = None
    density: float = 0.0


def shapes_of(root: Element) -> dict[str, tuple[Shape, ...]]:
    """Visual shapes of each link of a URDF, those that URDF knows.

    Raises
    ------
    DescriptionError
        Numbers that are none, a density below zero.
    """
    materials = {m.get("name"): m for m in root.findall("material")}
    found = {}
    for link in root.findall("link"):
        shapes = [_shape(visual, materials) for visual in link.findall("visual")]
        found[str(link.get("name"))] = tuple(shape for shape in shapes if shape is not None)
    return found


def _shape(visual: Element, materials: Mapping[str | None, Element]) -> Shape | None:
    geometry = visual.find("geometry")
    element = None if geometry is None or not len(geometry) else geometry[0]
    if element is None:
        return None
    rgba, density = None, 0.0
    own = visual.find("material")
    if own is not None:
        for material in (own, materials.get(own.get("name"))):
            if material is not None:
                rgba = rgba or _colour(material)
                density = density or _density(material)
    origin = elements.origin(visual.find("origin"))
    if element.tag == "mesh":
        scale = elements.vector(element, "scale", (1.0, 1.0, 1.0))
        return Shape("mesh", scale, origin, str(element.get("filename", "")), rgba, density)
    if element.tag == "box":
        return Shape("box", elements.vector(element, "size"), origin, "", rgba, density)
    if element.tag == "sphere":
        return Shape("sphere", (elements.number(element, "radius"),), origin, "", rgba, density)
    for kind in ("cylinder", "capsule"):
        if element.tag == kind:
            sizes = elements.number(element, "radius"), elements.number(element, "length")
            return Shape(kind, sizes, origin, "", rgba, density)
    return None


def _colour(material: Element) -> Colour | None:
    element = material.find("color")
    if element is None or element.get("rgba") is None:
        return None
    r, g, b, a = elements.numbers(element, "rgba", (4,))
    return r, g, b, a


def _density(material: Element) -> float:
    density = elements.number(material, "density", 0.0)
    if density < 0.0:
        raise elements.error(material, f"density={density:g} must not be negative")
    return density


def visual_element(shape: Shape) -> Element:
    """``<visual>`` of a shape."""
    visual = etree.Element("visual")
    if shape.origin != Origin():
        visual.append(elements.origin_element(shape.origin))
    geometry = etree.SubElement(visual, "geometry")
    element = etree.SubElement(geometry, shape.kind)
    if shape.kind == "mesh":
        element.set("filename", shape.file)
        if shape.sizes != (1.0, 1.0, 1.0):
            element.set("scale", elements.written(shape.sizes))
    elif shape.kind == "box":
        element.set("size", elements.written(shape.sizes))
    else:
        for name, value in zip(("radius", "length"), shape.sizes, strict=False):
            element.set(name, elements.written((value,)))
    if shape.rgba is not None:
        words = elements.written(shape.rgba)
        material = etree.SubElement(visual, "material", name=words.replace(" ", "_"))
        etree.SubElement(material, "color", rgba=words)
    return visual
