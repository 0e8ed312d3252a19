"""Combined singularities: where the direct and the inverse set of a slice meet."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from closedchain.analysis.singularity.sets.bordered import Measure
from closedchain.analysis.singularity.sets.curves import curve_set
from closedchain.analysis.singularity.sets.lattice import Lattice
from closedchain.analysis.singularity.sets.singular_set import SingularitySet, collect, nothing
from closedchain.analysis.singularity.sets.slices import Slice
from closedchain.analysis.singularity.sets.tracked import Tracker
from closedchain.closure.solve.solution_set import settle

REACH = 1.5  # cells from the least value on a set to where they meet
COLUMN = {"direct": 0, "inverse": 1}


def meeting(
    branch: Sequence[Lattice],
    one: SingularitySet,
    two: SingularitySet,
    outputs: tuple[str, ...],
) -> SingularitySet:
    """Combined set from the direct and the inverse set of a slice, in either order.

    On each of them, places are sought where the other kind's singular value is least; from there
    both measures are driven to zero. Where the slice is singular of one kind everywhere, the whole
    set of the other kind is combined. ``branch`` is the branch on one grid, or also on a finer one.
    """
    lattice = branch[0]
    if one.everywhere and two.everywhere:
        note = "every posture of the slice is directly and inversely singular"
        return collect(
            lattice.chart, "combined", outputs, (), dimension=0, verdict="everywhere", note=note
        )
    for whole, other in ((one, two), (two, one)):
        if whole.everywhere:
            what = "surface" if other.dimension == 2 else "curve"
            note = f"the slice is {whole.kind}ly singular everywhere: the whole {what} is combined"
            return replace(other, kind="combined", note=note)
    measures = tuple(Measure(lattice.chart.mechanism, k, outputs) for k in ("direct", "inverse"))
    if any(measure.empty for measure in measures):
        return nothing(lattice.chart, "combined", outputs)
    tracker = Tracker(Slice(lattice.chart, measures), lattice, branch[-1])
    for of, other in ((one, two), (two, one)):
        for i in _least(of, of.sigmas[:, COLUMN[other.kind]]):
            start = np.concatenate([of.q[i], of.coordinates[i]])
            found = settle(tracker.system, start)
            z = found.posture
            if not found.good or tracker.system.residual(z) > 1e-11:
                continue
            moved = (tracker.system.coordinates(z) - of.coordinates[i]) / lattice.cell
            if np.linalg.norm(moved) <= REACH:
                tracker.add(z)
    return curve_set(tracker, "combined", outputs)


def _least(of: SingularitySet, sigma: np.ndarray) -> Iterator[int]:
    """Points where a value is no larger than at their neighbours on the polyline or mesh."""
    lowest = np.ones(len(sigma), dtype=bool)
    for piece in of.pieces:
        if piece.ndim == 2:
            pairs = np.concatenate([piece[:, [0, 1]], piece[:, [1, 2]], piece[:, [2, 0]]])
        else:
            pairs = np.stack([piece[:-1], piece[1:]], axis=1)
        lowest[pairs[:, 0]] &= sigma[pairs[:, 0]] <= sigma[pairs[:, 1]]
        lowest[pairs[:, 1]] &= sigma[pairs[:, 1]] <= sigma[pairs[:, 0]]
    order = np.flatnonzero(lowest & of.on_branch)
    yield from (int(i) for i in order[np.argsort(sigma[order], kind="stable")])
