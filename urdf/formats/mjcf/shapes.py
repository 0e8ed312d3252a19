"""Shapes of a MuJoCo model, as those of links."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from closedchain.urdf.description import Origin
from closedchain.urdf.formats.mjcf.compiled import Compiled
from closedchain.urdf.poses import inverse, of_quaternion, origin_of
from closedchain.urdf.shapes import Colour, Shape

_HIDDEN = 3
"""Groups from this one on are not drawn by MuJoCo's viewer: shapes for collisions."""


def shapes_of_model(
    compiled: Compiled, bodies: Sequence[str], notes: list[str]
) -> dict[str, tuple[Shape, ...]]:
    """Shapes of each body that are drawn; those that URDF does not have are noted."""
    model, kinds = compiled.model, compiled.mujoco.mjtGeom
    found: dict[str, list[Shape]] = {}
    left_out: dict[str, int] = {}
    for geom in range(model.ngeom):
        kind, body = int(model.geom_type[geom]), int(model.geom_bodyid[geom])
        if int(model.geom_group[geom]) >= _HIDDEN or kind == kinds.mjGEOM_PLANE:
            continue
        place = of_quaternion(model.geom_quat[geom])
        place[:3, 3] = model.geom_pos[geom]
        shape = _shape(compiled, geom, kind, place)
        if shape is None:
            word = kinds(kind).name.removeprefix("mjGEOM_").lower()
            left_out[word] = left_out.get(word, 0) + 1
        else:
            found.setdefault(bodies[body], []).append(shape)
    notes += [f"{count} shapes of type {word} are not drawn" for word, count in left_out.items()]
    return {link: tuple(shapes) for link, shapes in found.items()}


def _shape(compiled: Compiled, geom: int, kind: int, place: np.ndarray) -> Shape | None:
    model, kinds = compiled.model, compiled.mujoco.mjtGeom
    size = [float(s) for s in model.geom_size[geom]]
    rgba, origin = _colour(compiled, geom), origin_of(place)
    if kind == kinds.mjGEOM_SPHERE:
        return Shape("sphere", (size[0],), origin, "", rgba)
    if kind == kinds.mjGEOM_BOX:
        return Shape("box", tuple(2.0 * s for s in size), origin, "", rgba)
    if kind == kinds.mjGEOM_CYLINDER:
        return Shape("cylinder", (size[0], 2.0 * size[1]), origin, "", rgba)
    if kind == kinds.mjGEOM_CAPSULE:
        return Shape("capsule", (size[0], 2.0 * size[1]), origin, "", rgba)
    if kind == kinds.mjGEOM_MESH:
        return _mesh(compiled, geom, place, rgba)
    return None


def _mesh(compiled: Compiled, geom: int, place: np.ndarray, rgba: Colour) -> Shape | None:
    """Mesh as in its file: MuJoCo moves it to its centre of mass and principal axes."""
    model = compiled.model
    mesh = int(model.geom_dataid[geom])
    file = compiled.meshes.get(compiled.name("mesh", mesh))
    if file is None:
        return None
    centred = of_quaternion(model.mesh_quat[mesh])
    centred[:3, 3] = model.mesh_pos[mesh]
    origin: Origin = origin_of(place @ inverse(centred))
    scale = tuple(float(s) for s in model.mesh_scale[mesh])
    return Shape("mesh", scale, origin, file, rgba)


def _colour(compiled: Compiled, geom: int) -> Colour:
    model = compiled.model
    material = int(model.geom_matid[geom])
    colour = model.mat_rgba[material] if material >= 0 else model.geom_rgba[geom]
    r, g, b, a = (float(c) for c in colour)
    return r, g, b, a
