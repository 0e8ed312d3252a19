"""Putting a ``<constraint>`` or other elements of our own in the place of a foreign one."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from lxml import etree

from closedchain.urdf.constraint_element import CONSTRAINT, constraint_xml
from closedchain.urdf.description import JointRelation, LoopClosure

if TYPE_CHECKING:
    from lxml.etree import _Element as Element


def local_name(element: Element) -> str:
    """Tag without its namespace."""
    return str(etree.QName(element).localname)


def named_children(root: Element, *tags: str) -> Iterator[Element]:
    """Children with one of these tags, whatever their namespace."""
    for child in list(root):
        if isinstance(child.tag, str) and local_name(child) in tags:
            yield child


def replace_by(element: Element, *others: Element) -> None:
    """Put other elements where ``element`` is; they are said to stand in its line."""
    parent = element.getparent()
    place = parent.index(element)
    parent.remove(element)
    for k, other in enumerate(others):
        for part in other.iter():
            part.sourceline = element.sourceline
        parent.insert(place + k, other)


def constraint_element(constraint: LoopClosure | JointRelation) -> Element:
    """``<constraint>`` as an element."""
    return etree.fromstring(constraint_xml(constraint))


def fresh_name(root: Element, wanted: str) -> str:
    """Name that no constraint has yet: the one wanted, or with a number after it."""
    taken = {element.get("name") for element in named_children(root, CONSTRAINT)}
    name, k = wanted, 2
    while name in taken:
        name, k = f"{wanted}_{k}", k + 1
    return name
