"""An MJCF text compiled by MuJoCo: what its defaults, classes, includes and angles come to.

MuJoCo's own rules decide what a file means, so that they need not be written here a second time.
What only draws or collides may be missing: textures are left out, and so is each mesh whose file is
not there.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from closedchain.urdf.elements import LARGEST
from closedchain.urdf.errors import DescriptionError

_OLDEST = (3, 17)
"""Version of MuJoCo that reading is tested with, besides the newest."""

TINY_MASS = 1e-12
"""[kg] and [kg m^2] of bodies that have none: MuJoCo compiles no moving body without."""


_ARRAYS = {
    "body": ("body_pos", "body_quat", "body_ipos", "body_iquat", "body_mass", "body_inertia"),
    "joint": ("jnt_pos", "jnt_axis"),
    "geom": ("geom_pos", "geom_quat", "geom_size"),
    "site": ("site_pos", "site_quat"),
    "equality": ("eq_data",),
    "tendon": ("tendon_length0",),
    "actuator": ("actuator_gear",),
    "key": ("key_qpos",),
}
"""Numbers of MuJoCo's model that are read, by what has them."""

_ARRAY_WORDS = {
    "qpos0": "reference value",
    "jnt_range": "range",
    "dof_damping": "damping",
    "dof_frictionloss": "friction",
    "dof_armature": "armature",
}


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
        The package mujoco is missing or too old, or MuJoCo refuses the file; its words are
        repeated.
    """
    try:
        import mujoco
    except ImportError:
        raise DescriptionError(
            "MJCF is read by MuJoCo, which is not installed: pip install 'closedchain[mjcf]'"
        ) from None
    version = str(mujoco.__version__)
    if tuple(int(part) for part in version.split(".")[:2]) < _OLDEST:
        raise DescriptionError(
            f"MuJoCo {version} is too old to read MJCF with; {'.'.join(map(str, _OLDEST))} or "
            "later is needed: pip install 'closedchain[mjcf]'"
        )
    warned: list[str] = []
    try:
        with _warnings_in(mujoco, warned):
            spec, model, meshes, notes = _compiled(mujoco, text, file)
    except (ValueError, RuntimeError, mujoco.FatalError) as error:
        raise DescriptionError(f"MuJoCo: {' '.join(str(error).split())}") from None
    _refuse_huge(model)
    said = (f"MuJoCo: {' '.join(word.split())}" for word in dict.fromkeys(warned))
    return Compiled(mujoco, model, spec.modelname, meshes, (*notes, *said))


@contextmanager
def _warnings_in(mujoco: Any, warned: list[str]) -> Iterator[None]:
    """Collect MuJoCo's warnings, which it would print and append to a file of its own."""
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(warned.append)
    try:
        yield
    finally:
        mujoco.set_mju_user_warning(before)


def _compiled(
    mujoco: Any, text: str, file: str | None
) -> tuple[Any, Any, dict[str, str], tuple[str, ...]]:
    """MuJoCo's description and model, files of meshes, and notes."""
    named = file is not None and file.endswith(".xml")  # MuJoCo goes by the ending
    spec = mujoco.MjSpec.from_file(file) if named else mujoco.MjSpec.from_string(text)
    folder = os.path.dirname(file) if file is not None else os.curdir
    if file is not None and not named:
        spec.modelfiledir = folder
    meshes, notes = _without_missing_files(spec, folder)
    spec.compiler.boundmass = max(spec.compiler.boundmass, TINY_MASS)
    spec.compiler.boundinertia = max(spec.compiler.boundinertia, TINY_MASS)
    with warnings.catch_warnings():  # of inertias, which do not matter here
        warnings.simplefilter("ignore", UserWarning)
        model = spec.compile()
    return spec, model, meshes, notes


def _refuse_huge(model: Any) -> None:
    """Refuse numbers that are not finite, or too large to calculate with, before any of it."""
    for array, word in _ARRAY_WORDS.items():
        if not (np.abs(np.asarray(getattr(model, array), dtype=float)) <= LARGEST).all():
            raise DescriptionError(
                f"MuJoCo: the {word} of a joint is not finite or too large; numbers "
                f"are at most {LARGEST:g} in size (SI units)"
            )
    for kind, arrays in _ARRAYS.items():
        for array in arrays:
            values = np.atleast_2d(np.asarray(getattr(model, array), dtype=float).T).T
            wrong = ~(np.abs(values) <= LARGEST).all(axis=1)
            if array.endswith("quat"):  # MuJoCo leaves what has no direction as it is
                wrong |= np.linalg.norm(np.where(wrong[:, None], 1.0, values), axis=1) < 0.5
            if wrong.any():
                element = getattr(model, kind)(int(np.flatnonzero(wrong)[0]))
                raise DescriptionError(
                    f"MuJoCo: {array.partition('_')[2]} has a number that is not finite or too "
                    f"large, or no direction; numbers are at most {LARGEST:g} in size (SI units)",
                    element=kind,
                    name=element.name or None,
                )


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
    missing: list[str] = []
    for mesh in list(spec.meshes):
        if not mesh.file:
            continue
        path = os.path.join(folder, spec.meshdir or "", mesh.file)
        name = mesh.name or os.path.splitext(os.path.basename(mesh.file))[0]
        if os.path.isfile(path):
            found[name] = path
            continue
        missing.append(f"{name!r} ({mesh.file})")
        for geom in [g for g in spec.geoms if g.meshname == name]:
            spec.delete(geom)
        spec.delete(mesh)
    if missing:
        more = f" and {len(missing) - 3} more" if len(missing) > 3 else ""
        what = "mesh" if len(missing) == 1 else "meshes"
        notes.append(
            f"{len(missing)} {what} not found, and left out: {', '.join(missing[:3])}{more}"
        )
    for ground in list(spec.hfields):
        if ground.file and not os.path.isfile(
            os.path.join(folder, spec.meshdir or "", ground.file)
        ):
            notes.append(f"the height field {ground.name!r} is missing; it is left out")
            for geom in [g for g in spec.geoms if g.hfieldname == ground.name]:
                spec.delete(geom)
            spec.delete(ground)
    return found, tuple(notes)
