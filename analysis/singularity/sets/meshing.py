"""Triangles between the cells of a grid on two sides of a surface."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from closedchain.analysis.singularity.sets.edges import Edges
from closedchain.urdf.extras import require


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles (T, 3) between edges of the grid."""

    edges: Edges
    triangles: np.ndarray


def mesh_of(inside: np.ndarray, known: np.ndarray, apart: np.ndarray) -> Mesh:
    """Mesh between the cells that are inside and the others, (nx, ny, nz) of bool each.

    Triangles in cubes with a corner that is not known are left out, and in those with an edge
    between two sheets: ``apart`` (nx, ny, nz, 3) of bool, from each cell to the next ones.
    """
    require("surfaces are cut out of a grid with scikit-image", "maps")
    from skimage import measure

    if not (inside & known).any() or not (~inside & known).any():
        none = np.zeros((0, 3), dtype=int)
        return Mesh(Edges(none, none[:, 0], none[:, 0].astype(bool)), none)
    cubes: Any = measure  # its functions have no annotations
    volume = np.where(inside, 1.0, -1.0)
    places, triangles, _, _ = cubes.marching_cubes(volume, 0.0, method="lorensen")
    lower = np.floor(places + 0.25).astype(int)
    axis = np.argmax(np.abs(places - np.rint(places)), axis=1)
    # the cube of a triangle is that of its centre
    cube = np.floor(places[triangles].mean(axis=1)).astype(int)
    whole = np.ones(len(triangles), dtype=bool)
    for corner in np.ndindex(2, 2, 2):
        at = np.minimum(cube + np.array(corner), np.array(inside.shape) - 1)
        whole &= known[tuple(at.T)]
        for way in np.flatnonzero(np.array(corner) == 0):
            whole &= ~apart[(*at.T, way)]
    kept = triangles[whole]
    used = np.unique(kept)
    number = np.full(len(places), -1)
    number[used] = np.arange(used.size)
    down = ~inside[tuple(lower[used].T)]
    return Mesh(Edges(lower[used], axis[used], down), number[kept].reshape(-1, 3))
