"""Singular surfaces of a slice of three coordinates: marching cubes on signs, vertices polished.

On the grid only signs are used: of the determinant inside the branch, or of belonging to the
branch where its end is the surface. Every vertex lies on an edge of the grid and is found there
exactly, all of them at once.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from closedchain.analysis.singularity.maps.grid import JOINT_LIMIT, Progress
from closedchain.analysis.singularity.sets.bordered import Measure
from closedchain.analysis.singularity.sets.lattice import Lattice, finer
from closedchain.analysis.singularity.sets.membership import reached
from closedchain.analysis.singularity.sets.meshing import Mesh, mesh_of
from closedchain.analysis.singularity.sets.seeds import brackets, middles
from closedchain.analysis.singularity.sets.singular_set import Piece, SingularitySet, collect
from closedchain.analysis.singularity.sets.slices import Slice
from closedchain.analysis.singularity.sets.touching import touching
from closedchain.analysis.singularity.sets.tracked import Tracker


@dataclass(frozen=True, eq=False)
class Meshed:
    """A mesh with points (V, nq + k) at its vertices, and how much of it was not found."""

    points: np.ndarray
    triangles: np.ndarray
    dropped: int
    holes: int
    whole: int


def surface_set(
    lattice: Lattice,
    kind: str,
    outputs: tuple[str, ...],
    progress: Progress | None = None,
    *,
    check: bool = False,
) -> SingularitySet:
    """Surface of a kind whose matrix is square, over three coordinates.

    ``check`` it against a grid twice as fine: where that shows more, its own mesh is added there.
    """
    system = Slice(lattice.chart, (Measure(lattice.chart.mechanism, kind, outputs),))
    tracker = Tracker(system, lattice)
    meshes = [_meshed(tracker, lattice, kind, None, progress)]
    missed, branch = None, [lattice]
    if check:
        fine = finer(lattice, progress)
        branch.append(fine)
        places = middles(fine, brackets(fine, kind))
        away = _away(system, meshes, places, lattice.cell)
        if away.any():
            meshes.append(_meshed(tracker, fine, kind, places[away], progress))
            away = _away(system, meshes, places, lattice.cell)
        missed = int(away.sum())
    pieces = [
        Piece(m.points, reached(system, branch, m.points), triangles=m.triangles)
        for m in meshes
        if len(m.points)
    ]
    if kind in lattice.det:
        pieces += touching(system, lattice, kind)[0]
    holes, whole = sum(m.holes for m in meshes), sum(m.whole for m in meshes)
    return collect(
        lattice.chart,
        kind,
        outputs,
        pieces,
        dimension=2,
        verdict="surface" if pieces else "none found",
        dropped=sum(m.dropped for m in meshes),
        missed=missed,
        note=f"{holes} of {whole} triangles are left out" if holes else "",
    )


def _meshed(
    tracker: Tracker,
    lattice: Lattice,
    kind: str,
    places: np.ndarray | None,
    progress: Progress | None,
) -> Meshed:
    """Mesh of a lattice, or only its part around some places (n, 3)."""
    if kind == lattice.chart.folds:
        inside, known = lattice.ok, lattice.status != JOINT_LIMIT
    else:
        det = np.where(lattice.ok, lattice.det[kind], -1.0)
        inside, known = det >= 0.0, lattice.ok
    mesh = mesh_of(inside, known, lattice.apart)
    triangles = mesh.triangles
    if places is not None:
        triangles = triangles[_around(lattice, mesh, places)]
    used = np.unique(triangles)
    edges = mesh.edges.take(used)
    if progress is not None:
        progress(f"polishing the {kind} surface", 0, len(edges))
    points = tracker.located(kind, lattice, edges)
    if progress is not None:
        progress(f"polishing the {kind} surface", len(edges), len(edges))
    found = np.isfinite(points[:, 0])
    number = np.full(len(mesh.edges), -1)
    number[used[found]] = np.arange(int(found.sum()))
    numbered = number[triangles].reshape(-1, 3)
    kept = numbered[(numbered >= 0).all(axis=1)]
    return Meshed(
        points[found], kept, int((~found).sum()), len(triangles) - len(kept), len(triangles)
    )


def _around(lattice: Lattice, mesh: Mesh, places: np.ndarray) -> np.ndarray:
    """Which triangles of a mesh lie within two cells of some places, (T,) of bool."""
    from scipy.spatial import cKDTree

    if not len(mesh.triangles):
        return np.zeros(0, dtype=bool)
    centres = middles(lattice, mesh.edges)[mesh.triangles].mean(axis=1)
    apart, _ = cKDTree(places / lattice.cell).query(centres / lattice.cell)
    return np.asarray(apart <= 2.0)


def _away(system: Slice, meshes: list[Meshed], places: np.ndarray, cell: np.ndarray) -> np.ndarray:
    """Which places (n, 3) have no vertex within a cell, (n,) of bool."""
    from scipy.spatial import cKDTree

    points = np.concatenate([system.coordinates(m.points) for m in meshes])
    if not len(points) or not len(places):
        return np.ones(len(places), dtype=bool)
    apart, _ = cKDTree(points / cell).query(places / cell)
    return np.asarray(apart > 1.0)
