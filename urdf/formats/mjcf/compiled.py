"""An MJCF text compiled by MuJoCo: what its defaults, classes, includes and angles come to.

MuJoCo's own rules decide what a file means, so that they need not be written here a second time.
What only draws or collides may be missing: textures are left out, and so is each mesh whose file is
not there.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from closedchain.urdf.errors import DescriptionError

TINY_MASS = 1e-12
"""[kg] and [kg m^2] of bodies that have none: MuJoCo compiles no moving body without."""


@dataclass(frozen=True)
class Compiled:
    """MuJoCo's model of a file.

    Attributes
    ----------
    mujoco : module
    model : mujoco.MjModel
    title : str
        Name of the model.
    meshes : mapping of mesh name to its file
    notes : tuple of str
    """

    mujoco: Any
    model: Any
    title: str
    meshes: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    def name(self, kind: str, index: int) -> str:
        """Name of the thing of a kind ("body", "joint", ...) with an index; "" without one."""
        code = getattr(self.mujoco.mjtObj, f"mjOBJ_{kind.upper()}")
        return self.mujoco.mj_id2name(self.model, code, index) or ""


def compile_text(text: str, file: str | None) -> Compiled:
    """Compile an MJCF file, or text that is in no file.

    Raises
    ------
    DescriptionError
        The package mujoco is missing, or MuJoCo refuses the file; its words are repeated.
    """
    try:
        import mujoco
    except ImportError:
        raise DescriptionError(
            "MJCF is read by MuJoCo, which is not installed: pip install 'closedchain[mjcf]'"
        ) from None
    try:
        named = file is not None and file.endswith(".xml")  # MuJoCo goes by the ending
        spec = mujoco.MjSpec.from_file(file) if named else mujoco.MjSpec.from_string(text)
        folder = os.path.dirname(file) if file is not None else os.curdir
        if file is not None and not named:
            spec.modelfiledir = folder
        meshes, notes = _without_missing_files(spec, folder)
        spec.compiler.boundmass = max(spec.compiler.boundmass, TINY_MASS)
        spec.compiler.boundinertia = max(spec.compiler.boundinertia, TINY_MASS)
        model = spec.compile()
    except (ValueError, RuntimeError, mujoco.FatalError) as error:
        raise DescriptionError(f"MuJoCo: {' '.join(str(error).split())}") from None
    return Compiled(mujoco, model, spec.modelname, meshes, notes)


def _without_missing_files(spec: Any, folder: str) -> tuple[dict[str, str], tuple[str, ...]]:
    """Take out what needs a file that is not there; return the files of the other meshes."""
    for skin in list(spec.skins):
        spec.delete(skin)
    for material in spec.materials:
        material.textures = ["" for _ in material.textures]
    for texture in list(spec.textures):
        spec.delete(texture)
    found: dict[str, str] = {}
    notes: list[str] = []
    for mesh in list(spec.meshes):
        if not mesh.file:
            continue
        path = os.path.join(folder, spec.meshdir or "", mesh.file)
        name = mesh.name or os.path.splitext(os.path.basename(mesh.file))[0]
        if os.path.isfile(path):
            found[name] = path
            continue
        notes.append(f"the mesh {name!r} is missing ({mesh.file}); its shapes are left out")
        for geom in [g for g in spec.geoms if g.meshname == name]:
            spec.delete(geom)
        spec.delete(mesh)
    for ground in list(spec.hfields):
        if ground.file and not os.path.isfile(
            os.path.join(folder, spec.meshdir or "", ground.file)
        ):
            notes.append(f"the height field {ground.name!r} is missing; it is left out")
            for geom in [g for g in spec.geoms if g.hfieldname == ground.name]:
                spec.delete(geom)
            spec.delete(ground)
    return found, tuple(notes)
