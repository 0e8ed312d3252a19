"""The shapes that a description gives its links, as Pinocchio reads them."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from lxml import etree

from closedchain.closure import Mechanism
from closedchain.urdf.meshes import with_mesh_paths


def read_visuals(mechanism: Mechanism) -> tuple[pin.GeometryModel | None, tuple[str, ...]]:
    """Shapes of the URDF, or None where there are none; and sentences on what is not drawn.

    A mesh that is not found, or cannot be read, is missing alone.
    """
    if not any(link.visuals for link in mechanism.description.links):
        return None, ("no visuals: drawn as sticks between the joints",)
    text, notes = with_mesh_paths(mechanism.description)
    root = etree.fromstring(text.encode("utf-8"))
    for capsule in root.iter("{*}capsule"):  # Pinocchio's parser knows none
        capsule.tag = capsule.tag.replace("capsule", "cylinder")
    model = _built(mechanism, root)
    if isinstance(model, str):
        notes += _without_bad_meshes(mechanism, root)
        model = _built(mechanism, root)
    if isinstance(model, str):
        return None, (*notes, f"drawn as sticks: the visuals cannot be read ({model})")
    if not len(model.geometryObjects):
        return None, (*notes, "drawn as sticks between the joints")
    for shape in model.geometryObjects:
        if shape.meshPath:
            # Its triangles, read and scaled by Pinocchio, are drawn. The file itself would bring
            # all else that it holds into the page, and images that it names, wherever they lie.
            shape.meshPath, shape.meshScale = "", np.ones(3)
    return model, notes


def _built(mechanism: Mechanism, root: etree._Element) -> pin.GeometryModel | str:
    """The shapes, or why Pinocchio does not read them."""
    text = etree.tostring(root, encoding="unicode")
    try:
        return pin.buildGeomFromUrdfString(mechanism.model, text, pin.GeometryType.VISUAL)
    except (ValueError, RuntimeError) as error:
        return str(error).strip()[:200]


def _without_bad_meshes(mechanism: Mechanism, root: etree._Element) -> tuple[str, ...]:
    """Take out visuals whose mesh cannot be read, each tried alone; a sentence for each."""
    visuals = [
        (link, v) for link in root.iterfind("./{*}link") for v in link.findall("./{*}visual")
    ]
    with_mesh = [(link, v) for link, v in visuals if v.find("./{*}geometry/{*}mesh") is not None]
    for link, visual in with_mesh:
        link.remove(visual)
    notes, good = [], []
    for link, visual in with_mesh:
        link.append(visual)
        why = _built(mechanism, root)
        link.remove(visual)
        if isinstance(why, str):
            name = visual.find("./{*}geometry/{*}mesh").get("filename")
            notes.append(f"mesh {name!r} of link {link.get('name')!r} cannot be read: {why}")
        else:
            good.append((link, visual))
    for link, visual in good:
        link.append(visual)
    return tuple(notes)
