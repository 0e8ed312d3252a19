"""Singular curves of a two-dimensional slice of input space, from a walked grid.

Inverse singularities are the zero curves of the signed determinant inside the branch. Direct ones
are where the branch ends: the determinant of K_p falls to zero there like the root of the
distance, and beyond no posture of the branch exists. Both start as contours on the grid; every
vertex is then polished onto the singular set itself.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from closedchain.analysis.first_order import first_order
from closedchain.analysis.maps import evaluate
from closedchain.analysis.mobility import generic_rank
from closedchain.analysis.polish import Measured, polish
from closedchain.analysis.singularities import SINGULAR, classify, measures
from closedchain.analysis.walk import JOINT_LIMIT, OK, Progress, Walk, grid_of, walk
from closedchain.closure.mechanism import Mechanism
from closedchain.urdf.errors import ClosureError

_DRIFT = 2.5  # cells that polishing may move a vertex
_SAME = 1e-3  # cells below which two vertices are one
_SAG = 0.25  # of a chord: how far from its middle the set may pass


@dataclass(frozen=True, eq=False)
class SingularitySet:
    """Singular postures of one kind in a slice.

    Attributes
    ----------
    kind : str
    over : tuple of str
        Inputs that vary.
    coordinates : (N, 2) array
        Their values [m or rad], in the order of ``over``.
    q : (N, nq) array
        The postures, closed to 1e-10.
    kinds : tuple of frozenset of str
        Everything that each point is.
    sigmas : (N, 3) array
        Direct, inverse and constraint singular values.
    pieces : tuple of (n,) arrays
        Indices of the points along each polyline; single points are pieces of one.
    everywhere : bool
        True where the whole slice is singular of this kind, so that there is no curve.
    dropped : int
        Contour vertices near which no singular posture was found.
    note : str
    """

    kind: str
    over: tuple[str, ...]
    coordinates: np.ndarray
    q: np.ndarray
    kinds: tuple[frozenset[str], ...]
    sigmas: np.ndarray
    pieces: tuple[np.ndarray, ...]
    everywhere: bool
    dropped: int
    note: str


def singularity_set(
    mechanism: Mechanism,
    kind: str,
    over: Mapping[str, ArrayLike],
    at: Mapping[str, float] | ArrayLike | None = None,
    *,
    outputs: str | Sequence[str] | None = None,
    progress: bool | Progress = False,
) -> SingularitySet:
    """Find the singular curves of one kind over a grid of two inputs, on one assembly branch.

    Parameters
    ----------
    kind : "direct", "inverse" or "combined"
    over : mapping of two input names to rising values [m or rad]
        The grid on which the curves are sought; features smaller than a cell can be missed.
    at : mapping of input name to value, or (nq,) array, optional
        Values of the other inputs, or a posture whose branch is followed; home by default.

    Raises
    ------
    ClosureError
        Unknown kind or inputs, not two of them, a start that cannot be reached.
    """
    from closedchain.analysis.progress import reporting

    if kind not in ("direct", "inverse", "combined"):
        raise ClosureError(f"unknown kind {kind!r}; known: direct, inverse, combined")
    names = mechanism.outputs(
        outputs if outputs is None or isinstance(outputs, str) else tuple(outputs)
    )
    with reporting(progress) as report:
        walked = walk(mechanism, grid_of(mechanism, over, at), report)
        found = evaluate(walked, mechanism, names, report)
        if kind == "combined":
            curves = [curves_of(mechanism, k, walked, found, names) for k in ("direct", "inverse")]
            return meeting_points(mechanism, curves[0], curves[1], walked, names)
        return curves_of(mechanism, kind, walked, found, names, report)


def curves_of(
    mechanism: Mechanism,
    kind: str,
    walked: Walk,
    found: Mapping[str, np.ndarray],
    outputs: tuple[str, ...],
    progress: Progress | None = None,
) -> SingularitySet:
    """Curves of kind "direct" or "inverse" on a walked grid with its evaluated measures."""
    if len(walked.grid.names) != 2:
        raise ClosureError(
            f"singular curves need two inputs to vary, got {' '.join(walked.grid.names)}"
        )
    measure = Measured(kind, outputs)
    if f"det_{kind}" not in found or not measure.is_square(mechanism):
        note = (
            f"no signed determinant for {kind!r} with outputs {' '.join(outputs)}: inputs or "
            "outputs are not as many as freedoms, so no curve is traced"
        )
        return _collect(mechanism, kind, walked, [], outputs, 0, note=note)
    largest = _largest(mechanism, kind, walked, outputs)
    singular = found[f"sigma_{kind}"] <= SINGULAR * largest
    inside = walked.status == OK
    if np.count_nonzero(singular) > 0.5 * np.count_nonzero(inside):
        note = f"every posture of the slice is {kind}ly singular: there is no curve to draw"
        return _collect(mechanism, kind, walked, [], outputs, 0, everywhere=True, note=note)
    if kind == "direct":
        lines = _boundary(walked)
    else:
        lines = _zero_lines(walked, np.where(singular, 0.0, found["det_inverse"]))
    polished: list[np.ndarray] = []
    dropped = done = 0
    total = sum(len(line) for line in lines)
    for line in lines:
        piece: list[np.ndarray] = []
        for vertex in line:
            q = _polished(mechanism, walked, vertex, [measure])
            done += 1
            if progress is not None:
                progress(f"polishing {kind} curves", done, total)
            if q is None:
                dropped += 1
                continue
            piece.append(q)
        polished.extend(_split(mechanism, walked, piece, measure))
    return _collect(mechanism, kind, walked, polished, outputs, dropped)


def meeting_points(
    mechanism: Mechanism,
    one: SingularitySet,
    two: SingularitySet,
    walked: Walk,
    outputs: tuple[str, ...],
) -> SingularitySet:
    """Combined points: where a direct and an inverse curve meet, polished onto both.

    Where the whole slice is singular of one kind, every point of the other kind is combined.
    """
    for whole, curve in ((one, two), (two, one)):
        if whole.everywhere:
            pieces = [curve.q[piece] for piece in curve.pieces]
            note = f"the slice is {whole.kind}ly singular everywhere: the whole curve is combined"
            return _collect(mechanism, "combined", walked, list(pieces), outputs, 0, note=note)
    both = [Measured("direct", outputs), Measured("inverse", outputs)]
    points: list[np.ndarray] = []
    dropped = 0
    for vertex in _near_pairs(one.coordinates / _cells(walked), two.coordinates / _cells(walked)):
        q = _polished(mechanism, walked, vertex * _cells(walked), both)
        if q is None:
            dropped += 1
        elif all(_apart(mechanism, walked, q, other) > _SAME for other in points):
            points.append(q)
    return _collect(mechanism, "combined", walked, [q[None] for q in points], outputs, dropped)


def _boundary(walked: Walk) -> list[np.ndarray]:
    """Polylines between cells of the branch and cells beyond it; joint limits are no boundary."""
    inside = (walked.status == OK).astype(float)
    masked = np.ma.array(inside, mask=walked.status == JOINT_LIMIT)
    return _contours(walked, masked, 0.5)


def _zero_lines(walked: Walk, determinant: np.ndarray) -> list[np.ndarray]:
    return _contours(walked, np.ma.array(determinant, mask=walked.status != OK), 0.0)


def _contours(walked: Walk, z: np.ma.MaskedArray, level: float) -> list[np.ndarray]:
    """Contours as (n, 2) arrays of coordinates in the order of the grid's inputs."""
    import contourpy

    x, y = walked.grid.values
    lines = contourpy.contour_generator(y, x, z, corner_mask=True).lines(level)
    return [np.asarray(line)[:, ::-1] for line in lines]


def _polished(
    mechanism: Mechanism, walked: Walk, vertex: np.ndarray, measured: list[Measured]
) -> np.ndarray | None:
    """Posture on the singular set near a vertex (2,), from the nearest cell of the branch.

    A vertex lies between two cells of one row, so the input along that row is varied first: with
    one equation and one input the posture cannot slide along the set. Where that leads nowhere,
    and for two equations, both inputs vary.
    """
    ok = np.argwhere(walked.status == OK)
    x, y = walked.grid.values
    cells = _cells(walked)
    places = np.stack([x[ok[:, 0]], y[ok[:, 1]]], axis=1)
    offsets = np.abs(places - vertex) / cells
    nearest = int(np.linalg.norm(offsets, axis=1).argmin())
    start = walked.q[tuple(ok[nearest])]
    both = _varying(mechanism, walked)
    along = [both[int(offsets[nearest].argmax())]]
    for varying in (along, both) if len(measured) == 1 else (both,):
        q = polish(mechanism, start, measured, varying)
        if q is None:
            continue
        moved = np.linalg.norm((_coordinates(mechanism, walked, q) - vertex) / cells)
        if moved <= _DRIFT:
            return q
    return None


def _varying(mechanism: Mechanism, walked: Walk) -> list[int]:
    """Indices in v of the inputs that vary."""
    return [int(mechanism.input_v[c]) for c in walked.grid.columns(mechanism)]


def _cells(walked: Walk) -> np.ndarray:
    """Size of a cell along each axis."""
    return np.array([float(np.diff(v).mean()) for v in walked.grid.values])


def _coordinates(mechanism: Mechanism, walked: Walk, q: np.ndarray) -> np.ndarray:
    return np.asarray(q[..., mechanism.input_q][..., walked.grid.columns(mechanism)])


def _apart(mechanism: Mechanism, walked: Walk, one: np.ndarray, two: np.ndarray) -> float:
    difference = _coordinates(mechanism, walked, one) - _coordinates(mechanism, walked, two)
    return float(np.linalg.norm(difference / _cells(walked)))


def _split(
    mechanism: Mechanism, walked: Walk, piece: list[np.ndarray], measure: Measured
) -> Iterator[np.ndarray]:
    """Drop repeated vertices; cut a polyline where a chord does not follow the singular set.

    Near a crossing, contours swerve from one curve to the other. The posture halfway along such a
    chord, polished, does not lie halfway.
    """
    run: list[np.ndarray] = []
    for q in piece:
        if run:
            gap = _apart(mechanism, walked, run[-1], q)
            if gap < _SAME:
                continue
            if gap > 2.0 * _DRIFT or not _follows(mechanism, walked, run[-1], q, gap, measure):
                yield np.array(run)
                run = []
        run.append(q)
    if run:
        yield np.array(run)


def _follows(
    mechanism: Mechanism,
    walked: Walk,
    one: np.ndarray,
    two: np.ndarray,
    gap: float,
    measure: Measured,
) -> bool:
    """Whether the singular set passes near the middle of the chord between two of its points."""
    halfway = pin.interpolate(mechanism.model, one, two, 0.5)
    q = polish(mechanism, halfway, [measure], _varying(mechanism, walked))
    return q is not None and _apart(mechanism, walked, halfway, q) < _SAG * gap


def _near_pairs(one: np.ndarray, two: np.ndarray) -> list[np.ndarray]:
    """Midpoints of the nearest pairs of two point sets (in cells), one for each cluster."""
    if not len(one) or not len(two):
        return []
    from scipy.spatial import cKDTree

    distance, partner = cKDTree(two).query(one)
    seeds: list[np.ndarray] = []
    for i in np.argsort(distance):
        if distance[i] > _DRIFT:
            break
        middle = 0.5 * (one[i] + two[partner[i]])
        if all(np.linalg.norm(middle - other) > _DRIFT for other in seeds):
            seeds.append(middle)
    return seeds


def _largest(mechanism: Mechanism, kind: str, walked: Walk, outputs: tuple[str, ...]) -> float:
    """Largest singular value of the kind's matrix at the start: the scale of its zeros."""
    at = first_order(mechanism, walked.grid.start, outputs)
    return measures(at, generic_rank(mechanism))[1][kind]


def _collect(
    mechanism: Mechanism,
    kind: str,
    walked: Walk,
    polished: list[np.ndarray],
    outputs: tuple[str, ...],
    dropped: int,
    *,
    everywhere: bool = False,
    note: str = "",
) -> SingularitySet:
    """Classify the points and index the pieces; points that are not of the kind are dropped."""
    wanted = {"direct", "inverse"} if kind == "combined" else {kind}
    postures: list[np.ndarray] = []
    kinds: list[frozenset[str]] = []
    sigmas: list[tuple[float, float, float]] = []
    pieces: list[np.ndarray] = []
    for piece in polished:
        begin = len(postures)
        for q in piece:
            c = classify(mechanism, q, outputs)
            if not wanted <= c.kinds:
                dropped += 1  # polished onto the matrix of the kind, yet not singular by classify
                continue
            postures.append(q)
            kinds.append(c.kinds)
            sigmas.append((c.sigma_direct, c.sigma_inverse, c.sigma_constraint))
        if len(postures) > begin:
            pieces.append(np.arange(begin, len(postures)))
    q_all = np.array(postures).reshape(len(postures), mechanism.model.nq)
    return SingularitySet(
        kind=kind,
        over=walked.grid.names,
        coordinates=_coordinates(mechanism, walked, q_all).reshape(
            len(postures), len(walked.grid.names)
        ),
        q=q_all,
        kinds=tuple(kinds),
        sigmas=np.array(sigmas).reshape(len(sigmas), 3),
        pieces=tuple(pieces),
        everywhere=everywhere,
        dropped=dropped,
        note=note,
    )
