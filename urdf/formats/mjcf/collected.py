"""What is collected while an MJCF is written: bodies, sites, and where links are in them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from lxml import etree

from closedchain.urdf import elements
from closedchain.urdf.description import Description, LoopClosure
from closedchain.urdf.poses import quaternion_of
from closedchain.urdf.shapes import Shapes

if TYPE_CHECKING:
    from lxml.etree import _Element as Element


@dataclass
class Collected:
    """A document that is being written.

    Attributes
    ----------
    balls : mapping of floating joint to the closure that makes it a ball
    bodies : elements of the bodies, by link
    places : for each link the body that carries it and its pose there
    meshes : names of the meshes, by file and scale
    order : joints in the order of ``qpos``
    massless : moving links without a mass
    """

    description: Description
    shapes: Shapes
    balls: Mapping[str, LoopClosure]
    bodies: dict[str, Element] = field(default_factory=dict)
    places: dict[str, tuple[str, np.ndarray]] = field(default_factory=dict)
    sites: set[str] = field(default_factory=set)
    meshes: dict[tuple[str, tuple[float, ...]], str] = field(default_factory=dict)
    order: list[str] = field(default_factory=list)
    losses: list[str] = field(default_factory=list)
    massless: list[str] = field(default_factory=list)

    def site(self, link: str, place: np.ndarray, wanted: str) -> str:
        """Add a site at a pose in a link; its name, with a number where it is taken."""
        name, k = wanted, 2
        while name in self.sites:
            name, k = f"{wanted}_{k}", k + 1
        self.sites.add(name)
        owner, offset = self.places[link]
        set_pose(etree.SubElement(self.bodies[owner], "site", name=name), offset @ place)
        return name


def set_pose(element: Element, place: np.ndarray) -> None:
    """Write a pose as position and quaternion; what is zero is left out."""
    if place[:3, 3].any():
        element.set("pos", numbers(*place[:3, 3]))
    if (place[:3, :3] != np.eye(3)).any():
        element.set("quat", numbers(*quaternion_of(place)))


def numbers(*values: float) -> str:
    """Numbers as an attribute."""
    return elements.written(values)
