"""Singular curves and points of a slice: seeds from a lattice, traced by continuation.

A kind at which the chart folds ends the branch; its seeds lie along the branch's boundary. The
other kinds change the sign of a determinant inside the branch. Kinds whose matrix is not square
are sought from the least singular values; determinants that touch zero, along the grid's lines.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain

import numpy as np

from closedchain.analysis.singularity.classify import SINGULAR
from closedchain.analysis.singularity.sets.bordered import Measure
from closedchain.analysis.singularity.sets.everywhere import singular_throughout
from closedchain.analysis.singularity.sets.lattice import Lattice, finer
from closedchain.analysis.singularity.sets.membership import along, met, reached
from closedchain.analysis.singularity.sets.seeds import brackets
from closedchain.analysis.singularity.sets.singular_set import (
    Piece,
    SingularitySet,
    collect,
    nothing,
)
from closedchain.analysis.singularity.sets.slices import Slice
from closedchain.analysis.singularity.sets.touching import touching
from closedchain.analysis.singularity.sets.tracked import Tracker
from closedchain.closure.progress import Progress

UPRIGHT = 1e-6  # of a cell: a curve whose coordinates vary less stands above a point
VERDICTS = {-1: "none found", 0: "isolated", 1: "curve", 2: "surface"}


def is_everywhere(lattice: Lattice, kind: str) -> bool:
    """Whether all cells of the branch are singular of a kind, but for a few by rounding."""
    cells = int(lattice.ok.sum())
    return cells > 0 and int(lattice.singular[kind].sum()) >= 0.99 * cells


def tracker_of(
    lattice: Lattice,
    kinds: Sequence[str],
    outputs: tuple[str, ...],
    progress: Progress | None = None,
) -> Tracker:
    """Trace the common zeros of some kinds; for one kind, from all its seeds."""
    measures = tuple(Measure(lattice.chart.mechanism, kind, outputs) for kind in kinds)
    tracker = Tracker(Slice(lattice.chart, measures), lattice)
    if len(kinds) == 1:
        (kind,) = kinds
        found = tracker.located(kind, lattice, brackets(lattice, kind))
        tracker.dropped = int(np.isnan(found[:, :1]).sum())
        wide = tracker.system.codimension > 1
        work = chain(tracker.follow(found), tracker.least(kind, lattice, wide=wide))
        for i, _ in enumerate(work):
            if progress is not None:
                progress(f"tracing {kind} curves", i + 1, max(i + 1, len(found)))
    return tracker


def curve_set(
    tracker: Tracker,
    kind: str,
    outputs: tuple[str, ...],
    missed: int | None = None,
    touched: Sequence[Piece] = (),
) -> SingularitySet:
    """Singular set from what was traced: the pieces that the branch meets, each of them whole.

    ``touched`` are those that have no sign change, see ``touching``.
    """
    system, lattice = tracker.system, tracker.lattice
    curves = [
        Piece(c.points, along(system, tracker.branch, c.points), c.ends, c.crossings)
        for c in tracker.linked()
    ]
    points = [Piece(z[None], reached(system, tracker.branch, z[None])) for z in tracker.alone()]
    curves += [p for p in touched if p.ends is not None]
    points += [p for p in touched if p.ends is None]
    points += _alone(tracker, [*curves, *points])
    curves, standing = _upright(tracker, curves)
    points += standing
    curves, points = ([p for p in ps if p.on_branch.any()] for ps in (curves, points))
    if standing:
        tracker.above = max(tracker.above, 1)
    dimension = 1 if curves else 0
    verdict = VERDICTS[max(dimension, tracker.degenerate) if curves or points else -1]
    return collect(
        lattice.chart,
        kind,
        outputs,
        curves + points,
        dimension=dimension,
        verdict=verdict,
        dropped=tracker.dropped,
        missed=missed,
        note=_note(tracker, outputs),
    )


def _upright(tracker: Tracker, curves: Sequence[Piece]) -> tuple[list[Piece], list[Piece]]:
    """Curves whose coordinates vary, and single points of those whose coordinates do not.

    On the latter only the posture moves: they are self-motions above one point of the slice.
    """
    lattice = tracker.lattice
    k = len(lattice.values)
    varying, standing = [], []
    for piece in curves:
        if (np.ptp(piece.points[:, -k:], axis=0) > UPRIGHT * lattice.cell).any():
            varying.append(piece)
            continue
        i = int(np.argmax(piece.on_branch))
        on_branch = piece.on_branch[i] or met(tracker.system, tracker.branch, piece.points[i])
        standing.append(Piece(piece.points[i : i + 1], np.array([on_branch])))
    return varying, standing


def _alone(tracker: Tracker, pieces: Sequence[Piece]) -> list[Piece]:
    """Solutions with degenerate equations that lie beside no piece, each of them once."""
    system, lattice = tracker.system, tracker.lattice
    near = [system.coordinates(p.points) for p in pieces]
    found: list[Piece] = []
    for z in tracker.flat:
        c = system.coordinates(z)
        if any((np.abs(n - c) <= lattice.cell).all(axis=1).any() for n in near):
            continue
        near.append(c[None])
        on_branch = reached(system, tracker.branch, z[None])
        if not on_branch[0] and tracker.above:
            on_branch[0] = met(system, tracker.branch, z)
        found.append(Piece(z[None], on_branch))
    return found


def _note(tracker: Tracker, outputs: tuple[str, ...]) -> str:
    """What has to be said of the way the set was sought."""
    notes = []
    measures, k = tracker.system.measures, len(tracker.lattice.chart.names)
    for measure in measures:
        if measure.codimension > 1:
            rows, columns = measure.shape
            notes.append(
                f"no signed determinant for {measure.kind!r} with inputs "
                f"{' '.join(measure.mechanism.inputs)} and outputs {' '.join(outputs)}: a rank "
                f"loss of {rows} x {columns} is {measure.codimension} conditions on {k} "
                "coordinates; it was sought from the least singular values of the grid"
            )
    if tracker.tried and tracker.system.codimension > 1:
        notes.append(
            f"{tracker.lost} of {tracker.tried} least values led to no singular posture in range"
        )
    if tracker.above:
        notes.append(
            "above some of its points stand whole sets of singular postures with the same "
            f"coordinates, of dimension {tracker.above}: a self-motion; the verdict speaks of the "
            "coordinates alone"
        )
    return "; ".join(notes)


def curves_on(
    lattice: Lattice,
    kind: str,
    outputs: tuple[str, ...],
    progress: Progress | None = None,
    *,
    check: bool = False,
) -> SingularitySet:
    """Curves and points of one kind on a lattice; ``check`` them against a grid twice as fine."""
    if is_everywhere(lattice, kind):
        whole = singular_throughout(lattice, kind)
        verdict = "everywhere" if whole else "none found"
        note = (
            f"every posture of the slice is {kind}ly singular: there is no curve to draw"
            if whole
            else f"all {kind} singular values of this range are below {SINGULAR:g}, though generic "
            "postures of the slice are regular: the range is too small to trace curves in it"
        )
        return collect(lattice.chart, kind, outputs, (), dimension=0, verdict=verdict, note=note)
    if Measure(lattice.chart.mechanism, kind, outputs).empty:
        return nothing(lattice.chart, kind, outputs, missed=0 if check else None)
    tracker = tracker_of(lattice, (kind,), outputs, progress)
    touched: list[Piece] = []
    if kind in lattice.det:
        touched, passing = touching(tracker.system, lattice, kind, tracker.knows)
        for z in passing:
            tracker.add(z)
    missed = None
    if check and tracker.system.codimension > 1:
        tracker.finer = finer(lattice, progress)
        for _ in tracker.least(kind, tracker.finer, wide=True):
            pass
    elif check and (kind in lattice.det or kind == lattice.chart.folds):
        from closedchain.analysis.singularity.sets.completeness import complete

        k = len(lattice.values)
        there = np.concatenate([np.zeros((0, k)), *(p.points[:, -k:] for p in touched)])
        missed = complete(tracker, kind, there, progress)
    return curve_set(tracker, kind, outputs, missed, touched)
