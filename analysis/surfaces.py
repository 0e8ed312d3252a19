"""Singular surfaces of a slice of three coordinates: marching cubes on signs, vertices polished.

On the grid only signs are used: of the determinant inside the branch, or of belonging to the
branch where its end is the surface. Every vertex lies on an edge of the grid and is found there by
Newton's method in the one coordinate along the edge, closures and measure together.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from closedchain.analysis.bordered import Measure
from closedchain.analysis.lattice import Lattice
from closedchain.analysis.seeds import FAR, Seed
from closedchain.analysis.singular_set import Piece, SingularitySet, collect
from closedchain.analysis.slices import Slice
from closedchain.analysis.tracked import Tracker
from closedchain.analysis.walk import JOINT_LIMIT, Progress

MEMBER = 2.0  # of the change of posture along an edge: how far a vertex's posture may lie


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles between edges of the grid.

    Attributes
    ----------
    lower : (V, 3) array of int
        Cell at the lower end of each vertex's edge.
    axis : (V,) array of int
        Axis along which the edge runs.
    triangles : (T, 3) array of int
    """

    lower: np.ndarray
    axis: np.ndarray
    triangles: np.ndarray


def mesh_of(inside: np.ndarray, known: np.ndarray) -> Mesh:
    """Mesh between the cells that are inside and the others, (nx, ny, nz) of bool each.

    Triangles in cubes with a corner that is not known are left out.
    """
    from skimage.measure import marching_cubes

    if not (inside & known).any() or not (~inside & known).any():
        none = np.zeros((0, 3), dtype=int)
        return Mesh(none, np.zeros(0, dtype=int), none)
    volume = np.where(inside, 1.0, -1.0)
    cubes: Any = marching_cubes
    places, triangles, _, _ = cubes(volume, 0.0, method="lorensen")
    lower = np.floor(places + 0.25).astype(int)
    axis = np.argmax(np.abs(places - np.rint(places)), axis=1)
    # the cube of a triangle is that of its centre
    cube = np.floor(places[triangles].mean(axis=1)).astype(int)
    whole = np.ones(len(triangles), dtype=bool)
    for corner in np.ndindex(2, 2, 2):
        at = np.minimum(cube + np.array(corner), np.array(inside.shape) - 1)
        whole &= known[tuple(at.T)]
    kept = triangles[whole]
    used = np.unique(kept)
    number = np.full(len(places), -1)
    number[used] = np.arange(used.size)
    return Mesh(lower[used], axis[used], number[kept].reshape(-1, 3))


def surface_set(
    lattice: Lattice, kind: str, outputs: tuple[str, ...], progress: Progress | None = None
) -> SingularitySet:
    """Surface of a kind whose matrix is square, over three coordinates."""
    folds = kind == lattice.chart.folds
    if folds:
        inside, known = lattice.ok, lattice.status != JOINT_LIMIT
    else:
        det = np.where(lattice.ok, lattice.det[kind], -1.0)
        inside, known = det >= 0.0, lattice.ok
    mesh = mesh_of(inside, known)
    system = Slice(lattice.chart, (Measure(lattice.chart.mechanism, kind, outputs),))
    tracker = Tracker(system, lattice)
    points: list[np.ndarray] = []
    member: list[bool] = []
    number = np.full(len(mesh.lower), -1)
    for i, (lower, axis) in enumerate(zip(mesh.lower, mesh.axis, strict=True)):
        found = _vertex(tracker, lower, int(axis), kind, folds=folds)
        if found is not None:
            number[i] = len(points)
            points.append(found[0])
            member.append(found[1])
        if progress is not None:
            progress(f"polishing the {kind} surface", i + 1, len(mesh.lower))
    triangles = number[mesh.triangles]
    kept = triangles[(triangles >= 0).all(axis=1)]
    dropped = int(np.count_nonzero(number < 0))
    holes = len(triangles) - len(kept)
    note = f"{holes} of {len(triangles)} triangles are left out" if holes else ""
    z = np.array(points).reshape(len(points), system.mechanism.model.nq + 3)
    pieces = [Piece(z, np.array(member, dtype=bool), triangles=kept)] if len(z) else []
    return collect(
        lattice.chart,
        kind,
        outputs,
        pieces,
        dimension=2,
        verdict="surface" if len(z) else "none found",
        dropped=dropped,
        note=note,
    )


def _vertex(
    tracker: Tracker, lower: np.ndarray, axis: int, kind: str, *, folds: bool
) -> tuple[np.ndarray, bool] | None:
    """Point of the surface on an edge of the grid, and whether it lies on the branch."""
    lattice = tracker.lattice
    one = tuple(int(i) for i in lower)
    two = (*one[:axis], one[axis] + 1, *one[axis + 1 :])
    start = one if lattice.ok[one] else two
    if lattice.ok[one] and lattice.ok[two] and lattice.sigma[kind][two] < lattice.sigma[kind][one]:
        start = two
    ends = lattice.place(np.array([one, two]))
    z = tracker.polished(Seed(0.5 * (ends[0] + ends[1]), start, axis, FAR))
    if z is None:
        return None
    if folds:
        return z, True
    model = tracker.system.mechanism.model
    way = tracker.system.difference(
        tracker.system.point(lattice.q[one], ends[0]), tracker.system.point(lattice.q[two], ends[1])
    )[: model.nv]
    moved = tracker.system.difference(tracker.system.point(lattice.q[start], ends[0]), z)
    size = float(np.linalg.norm(way))
    return z, float(np.linalg.norm(moved[: model.nv])) <= MEMBER * size + 1e-9
