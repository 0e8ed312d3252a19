"""``with_inertias``: masses of links from their shapes, where a description states none."""

from __future__ import annotations

import math
from dataclasses import replace

from closedchain.closure.mechanism import Mechanism
from closedchain.closure.tree import inertia_of
from closedchain.urdf.description import Description, Inertial
from closedchain.urdf.errors import ClosureError
from closedchain.urdf.shapes import shapes_of
from closedchain.urdf.solid_shapes import inertial_of
from closedchain.urdf.writing import document_text, inertial_element, urdf_document

DENSITY = 2700.0
"""Of aluminium [kg/m^3]."""


def with_inertias(mechanism: Mechanism, density: float = DENSITY) -> Mechanism:
    """Return the same mechanism with masses and inertias of links that have none.

    They are those of the links' visual shapes, solid and of one density; what lies in two shapes
    counts twice, and meshes count nothing. ``notes`` say so. Links with an ``<inertial>`` keep it.

    Parameters
    ----------
    density : float
        [kg/m^3]; 2700 (aluminium) by default.

    Raises
    ------
    ClosureError
        A density that is not above zero.

    Examples
    --------
    >>> m = cc.with_inertias(cc.load("linear_delta"), density=7850.0)  # steel
    >>> sum(body.mass for body in m.model.inertias) > 1.0  # [kg]
    True
    """
    if not (math.isfinite(density) and density > 0.0):
        raise ClosureError(f"density must be above zero, got {density}")
    root = urdf_document(mechanism.description)
    found: dict[str, Inertial] = {}
    for name, shapes in shapes_of(root).items():
        inertial = inertial_of(shapes, density)
        if inertial is not None:
            found[name] = inertial
    given = {link.name for link in mechanism.description.links if link.inertial is not None}
    found = {name: inertial for name, inertial in found.items() if name not in given}
    for element in root.findall("link"):
        if element.get("name") in found:
            element.insert(0, inertial_element(found[element.get("name")]))
    described = _described(mechanism.description, found, document_text(root))
    note = (
        f"{len(found)} links have the masses of their shapes, solid at {density:g} kg/m^3; "
        f"{len(described.links) - len(found) - len(given)} have none"
    )
    model = mechanism.model.copy()
    for link in described.links:
        frame = model.frames[mechanism.frame_id(link.name)]
        if link.name in found and link.inertial is not None and frame.parentJoint:
            inertia = inertia_of(link, link.inertial)
            model.appendBodyToJoint(frame.parentJoint, inertia, frame.placement)
    return replace(
        mechanism, model=model, description=described, assumed=(*mechanism.assumed, note)
    )


def _described(description: Description, found: dict[str, Inertial], text: str) -> Description:
    links = tuple(replace(link, inertial=found.get(link.name, link.inertial))
                  for link in description.links)  # fmt: skip
    return replace(description, links=links, text=text)
