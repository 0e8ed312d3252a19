"""Singular curves and points of a slice: seeds from a lattice, traced by continuation.

A kind at which the chart folds ends the branch; its seeds lie along the branch's boundary. The
other kinds change the sign of a determinant inside the branch. Kinds whose matrix is not square,
and those that only touch zero, are sought from the least singular values of the lattice.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from closedchain.analysis.bordered import Measure
from closedchain.analysis.lattice import Lattice, lattice_of
from closedchain.analysis.membership import along
from closedchain.analysis.seeds import Seed, ends_of_branch, least_values, sign_changes
from closedchain.analysis.singular_set import Piece, SingularitySet, collect
from closedchain.analysis.slices import Slice
from closedchain.analysis.tracked import Tracker
from closedchain.analysis.walk import Progress, Walk
from closedchain.closure.mechanism import Mechanism

VERDICTS = {-1: "none found", 0: "isolated", 1: "curve", 2: "surface", 3: "everywhere"}


def seeds_of(lattice: Lattice, kind: str) -> list[Seed]:
    """Bracketed places of a kind on a lattice: each of them must lie beside the set."""
    if kind == lattice.chart.folds:
        return ends_of_branch(lattice)
    return sign_changes(lattice, kind) if kind in lattice.det else []


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
        seeds = [*seeds_of(lattice, kind), *least_values(lattice, kind)]
        for i, seed in enumerate(seeds):
            tracker.follow([seed])
            if progress is not None:
                progress(f"tracing {kind} curves", i + 1, len(seeds))
    return tracker


def curve_set(
    tracker: Tracker, kind: str, outputs: tuple[str, ...], missed: int | None = None
) -> SingularitySet:
    """Singular set from what was traced: the pieces that the branch touches, each of them whole."""
    system, lattice = tracker.system, tracker.lattice
    curves = [
        Piece(c.points, along(system, lattice, c.points), c.ends, c.crossings)
        for c in tracker.linked()
    ]
    points = [Piece(z[None], along(system, lattice, z[None])) for z in tracker.points]
    touched = [[p for p in pieces if p.on_branch.any()] for pieces in (curves, points)]
    dimension = 1 if touched[0] else 0
    verdict = VERDICTS[tracker.degenerate or (dimension if touched[0] or touched[1] else -1)]
    return collect(
        lattice.chart,
        kind,
        outputs,
        touched[0] + touched[1],
        dimension=dimension,
        verdict=verdict,
        dropped=tracker.dropped,
        missed=missed,
        note=_note(tracker, kind, outputs),
    )


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
    missed = None
    if check and (kind in lattice.det or kind == lattice.chart.folds):
        from closedchain.analysis.completeness import complete

        missed = complete(tracker, kind, outputs, progress)
    return curve_set(tracker, kind, outputs, missed)


def curves_of(
    mechanism: Mechanism,
    kind: str,
    walked: Walk,
    found: Mapping[str, np.ndarray],
    outputs: tuple[str, ...],
    progress: Progress | None = None,
) -> SingularitySet:
    """Set of kind "direct" or "inverse" on a walked grid with its evaluated measures.

    Only what lies on the branch of the walk is kept.
    """
    return curves_on(lattice_of(walked, found, outputs), kind, outputs, progress).of_branch()
