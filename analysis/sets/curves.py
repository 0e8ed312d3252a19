"""Singular curves and points of a slice: seeds from a lattice, traced by continuation.

A kind at which the chart folds ends the branch; its seeds lie along the branch's boundary. The
other kinds change the sign of a determinant inside the branch. Kinds whose matrix is not square
are sought from the least singular values; determinants that touch zero, along the grid's lines.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain

import numpy as np

from closedchain.analysis.maps.grid import Progress
from closedchain.analysis.sets.bordered import Measure
from closedchain.analysis.sets.lattice import Lattice
from closedchain.analysis.sets.membership import along, reached
from closedchain.analysis.sets.seeds import brackets, least_values
from closedchain.analysis.sets.singular_set import Piece, SingularitySet, collect
from closedchain.analysis.sets.slices import Slice
from closedchain.analysis.sets.touching import touching
from closedchain.analysis.sets.tracked import Tracker

VERDICTS = {-1: "none found", 0: "isolated", 1: "curve", 2: "surface", 3: "everywhere"}


def is_everywhere(lattice: Lattice, kind: str) -> bool:
    """Whether all cells of the branch are singular of a kind, but for a few by rounding."""
    return int(lattice.singular[kind].sum()) >= 0.99 * int(lattice.ok.sum())


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
        least = least_values(lattice, kind)
        points = chain(found, map(tracker.polished, least))
        for i, _ in enumerate(tracker.follow(points)):
            if progress is not None:
                progress(f"tracing {kind} curves", i + 1, len(found) + len(least))
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
        Piece(c.points, along(system, lattice, c.points), c.ends, c.crossings)
        for c in tracker.linked()
    ]
    points = [Piece(z[None], reached(system, lattice, z[None])) for z in tracker.points]
    square = kind in lattice.det or kind == lattice.chart.folds
    curves += [p for p in touched if p.ends is not None]
    points += [p for p in touched if p.ends is None]
    if square:
        points += _alone(tracker, [*curves, *points])
    curves, points = ([p for p in ps if p.on_branch.any()] for ps in (curves, points))
    dimension = 1 if curves else 0
    verdict = VERDICTS[dimension if curves or points else -1]
    if tracker.degenerate and not square:
        verdict = VERDICTS[tracker.degenerate]
    return collect(
        lattice.chart,
        kind,
        outputs,
        curves + points,
        dimension=dimension,
        verdict=verdict,
        dropped=tracker.dropped,
        missed=missed,
        note=_note(tracker, kind, outputs),
    )


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
        found.append(Piece(z[None], reached(system, lattice, z[None])))
    return found


def _note(tracker: Tracker, kind: str, outputs: tuple[str, ...]) -> str:
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
        note = f"every posture of the slice is {kind}ly singular: there is no curve to draw"
        return collect(
            lattice.chart, kind, outputs, (), dimension=0, verdict="everywhere", note=note
        )
    tracker = tracker_of(lattice, (kind,), outputs, progress)
    touched: list[Piece] = []
    if kind in lattice.det:
        touched, passing = touching(tracker.system, lattice, kind, tracker.knows)
        for z in passing:
            tracker.add(z)
    missed = None
    if check and (kind in lattice.det or kind == lattice.chart.folds):
        from closedchain.analysis.sets.completeness import complete

        k = len(lattice.values)
        there = np.concatenate([np.zeros((0, k)), *(p.points[:, -k:] for p in touched)])
        missed = complete(tracker, kind, there, progress)
    return curve_set(tracker, kind, outputs, missed, touched)
