"""``with_inertias``: masses of links from their shapes, where a description states none."""

from __future__ import annotations

from dataclasses import replace

from closedchain.closure.given import one_number
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.tree import weighed_anew
from closedchain.urdf.solid_links import solids_note, with_solids
from closedchain.urdf.writing import document_text, inertial_element, urdf_document

DENSITY = 2700.0
"""Of aluminium [kg/m^3]."""


def with_inertias(mechanism: Mechanism, density: float = DENSITY) -> Mechanism:
    """Return the same mechanism with masses and inertias of the links that state none.

    They are those of the links' visual shapes, solid and of one density; what lies in two shapes
    counts twice, meshes count nothing, and what stands still has none. ``notes`` say so. Links
    with an ``<inertial>`` keep it; inertias by the densities of materials are replaced.

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
    density = one_number(density, "density")
    before = mechanism.description
    root = urdf_document(before)
    links = with_solids(root, before.links, before.root, density)
    note, old = solids_note(root, links, density), solids_note(root, before.links)
    for element in root.findall("link"):
        link = next(link for link in links if link.name == element.get("name"))
        if link.solid and link.inertial is not None:
            for stated in element.findall("inertial"):
                element.remove(stated)
            element.insert(0, inertial_element(link.inertial))
    described = replace(
        before,
        links=tuple(replace(link, solid=False) for link in links),
        notes=tuple(said for said in before.notes if said != old),
        text=document_text(root),
    )
    return replace(
        mechanism,
        model=weighed_anew(mechanism.model, described),
        description=described,
        assumed=(*mechanism.assumed, note) if note else mechanism.assumed,
    )
