"""Singular surfaces of a slice of three coordinates, each smooth sheet meshed by itself.

Sign changes of a determinant, and ends of the branch where it folds, show where a surface is. From
there its sheets are followed over the whole range, so that they cross where they cross.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from closedchain.analysis.singularity.sets.bordered import Measure
from closedchain.analysis.singularity.sets.edges import Edges
from closedchain.analysis.singularity.sets.lattice import Lattice, finer
from closedchain.analysis.singularity.sets.seeds import brackets, middles
from closedchain.analysis.singularity.sets.sheets import Sheets
from closedchain.analysis.singularity.sets.singular_set import Piece, SingularitySet, collect
from closedchain.analysis.singularity.sets.slices import Slice
from closedchain.analysis.singularity.sets.touching import touching
from closedchain.analysis.singularity.sets.tracked import Tracker
from closedchain.analysis.singularity.sets.triangles import meshed
from closedchain.closure.progress import Progress

TOUCHED = "where a determinant only touches zero, middles of triangles are not checked"
FIRST = 16
"""Places from which sheets are followed before it is asked which others these explain."""
NEAREST = 4  # vertices whose tangent planes may explain why the set passes between two cells
APART = 1.5  # cells: how far such a vertex may be
SLACK = 0.2  # cells: how far beyond the ends of an edge its plane may cut it


def surface_set(
    lattice: Lattice,
    kind: str,
    outputs: tuple[str, ...],
    progress: Progress | None = None,
    *,
    check: bool = False,
) -> SingularitySet:
    """Surface of a kind whose matrix is square, over three coordinates.

    ``check`` it against a grid twice as fine: where that shows more, this is followed, too.
    """
    system = Slice(lattice.chart, (Measure(lattice.chart.mechanism, kind, outputs),))
    tracker = Tracker(system, lattice)
    sheets = Sheets(system, kind, [lattice])
    dropped = _follow(sheets, tracker, lattice, brackets(lattice, kind), progress)
    missed = None
    if check:
        fine = finer(lattice, progress)
        sheets.branch.append(fine)
        edges = brackets(fine, kind)
        edges = edges.take(_away(sheets, fine, edges))
        dropped += _follow(sheets, tracker, fine, edges, progress)
        missed = int(_away(sheets, fine, edges).sum())
    mesh = meshed(sheets)
    pieces = []
    if len(mesh.triangles):
        pieces.append(Piece(mesh.points, mesh.on_branch, triangles=mesh.triangles))
    note = mesh.fit.text if pieces else ""
    if kind in lattice.det and (beside := touching(system, lattice, kind)[0]):
        pieces += beside
        note = "; ".join([note, TOUCHED] if note else [TOUCHED])
    found = collect(
        lattice.chart,
        kind,
        outputs,
        pieces,
        dimension=2,
        verdict="surface" if pieces else "none found",
        dropped=dropped,
        missed=missed,
        note=note,
    )
    return replace(found, fit=mesh.fit) if len(mesh.triangles) else found


def _follow(
    sheets: Sheets, tracker: Tracker, lattice: Lattice, edges: Edges, progress: Progress | None
) -> int:
    """Follow the sheets that edges of a lattice show. Returns on how many none was found."""
    total, lost, count = len(edges), 0, FIRST
    while len(edges):
        some = np.unique(np.linspace(0, len(edges) - 1, min(count, len(edges))).astype(int))
        points = tracker.located(sheets.kind, lattice, edges.take(some))
        for z in points:
            if np.isfinite(z).all():
                sheets.begin(z)
            else:
                lost += 1
        sheets.follow()
        left = np.ones(len(edges), dtype=bool)
        left[some] = False
        edges = edges.take(left)
        edges = edges.take(~_explained(sheets, lattice, edges))
        count *= 4
        if progress is not None:
            progress(f"following the {sheets.kind} surface", total - len(edges), total)
    return lost


def _explained(sheets: Sheets, lattice: Lattice, edges: Edges) -> np.ndarray:
    """Which edges the tangent plane of some vertex nearby cuts, (n,) of bool."""
    from scipy.spatial import cKDTree

    if not sheets.vertices or not len(edges):
        return np.zeros(len(edges), dtype=bool)
    cell = sheets.cubes.cell
    at = np.array([sheets.system.coordinates(v.z) for v in sheets.vertices]) / cell
    normals = np.array([v.normal for v in sheets.vertices])
    low, high = lattice.place(edges.lower) / cell, lattice.place(edges.upper) / cell
    apart, near = cKDTree(at).query(0.5 * (low + high), k=min(NEAREST, len(at)))
    apart, near = apart.reshape(len(edges), -1), near.reshape(len(edges), -1)
    one, two = (((end[:, None] - at[near]) * normals[near]).sum(axis=-1) for end in (low, high))
    cuts = (np.minimum(one, two) <= SLACK) & (np.maximum(one, two) >= -SLACK)
    return np.asarray((cuts & (apart <= APART)).any(axis=1))


def _away(sheets: Sheets, lattice: Lattice, edges: Edges) -> np.ndarray:
    """Which edges of a lattice have no vertex within a cell, (n,) of bool."""
    from scipy.spatial import cKDTree

    if not sheets.vertices or not len(edges):
        return np.ones(len(edges), dtype=bool)
    cell = sheets.cubes.cell
    at = np.array([sheets.system.coordinates(v.z) for v in sheets.vertices]) / cell
    apart, _ = cKDTree(at).query(middles(lattice, edges) / cell)
    return np.asarray(apart > 1.0)
