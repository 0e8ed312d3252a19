"""The singular set of one kind in a slice, as points with their postures, kinds and twists."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from closedchain.analysis.singularity.classify import SINGULAR
from closedchain.analysis.singularity.sets.classifying import Kinds, classified
from closedchain.analysis.singularity.sets.mesh_fit import Fit
from closedchain.closure.chart import Chart
from closedchain.closure.solve.outcome import Ending

COLUMNS = {"direct": [0], "inverse": [1], "combined": [0, 1], "constraint": [2]}
"""Columns of ``SingularitySet.sigmas`` that vanish, by kind."""

KINDS = tuple(COLUMNS)


def wanted(kind: str) -> frozenset[str]:
    """What ``classify`` must say of a point of a kind."""
    return frozenset({"direct", "inverse"} if kind == "combined" else {kind})


@dataclass(frozen=True, eq=False)
class SingularitySet:
    """Singular postures of one kind in a slice.

    Attributes
    ----------
    kind : str
        "direct", "inverse", "combined" or "constraint".
    chart : Chart
        Coordinates that vary and those that are held, with their values.
    over : tuple of str
        Coordinates that vary.
    units : tuple of str
        Their units, "m" or "rad".
    coordinates : (N, k) array
        Their values [m or rad], in the order of ``over``.
    q : (N, nq) array
        The postures, closed to 1e-10 [m, rad], with the measures below 1e-10.
    kinds : tuple of frozenset of str
        Everything that each point is.
    sigmas : (N, 3) array
        Direct, inverse and constraint singular values.
    free_twists : tuple of (6, j) arrays
        Of each point: tip twists (linear, angular) [m/s, rad/s], world-aligned at the tip, that
        remain with all inputs locked; no columns where it is not directly singular.
    lost_twists : tuple of (d, j) arrays
        Of each point: combinations of outputs that cannot be produced, dimensionless.
    dimension : int
        Of the pieces: 0 points, 1 polylines, 2 triangle meshes.
    pieces : tuple of arrays of int
        Indices of points: (1,) for a point; (n,) along a polyline, a closed one without its first
        point again; (T, 3) for the triangles of a mesh.
    ends : tuple of (str, str)
        How each polyline begins and ends: "closed", "edge of the range", "limit of joint ...",
        "degenerate" (the equations lose rank) or "cut short". Empty where there are no polylines.
    branch_points : (b,) array of int
        Points of polylines where other curves cross.
    on_branch : (N,) array of bool
        Whether the branch of the start reaches the point: moving straight in the coordinates from
        the nearest cell of the branch leads to this very posture. The other points belong to
        sheets that the set leads to, with coordinates in the same range.
    everywhere : bool
        True where every posture of the slice is singular of this kind: there are no points then.
    verdict : str
        "isolated", "curve" or "surface": what the set is in this slice, by the rank of its
        equations at the points found, or by how these join where a determinant only touches zero;
        "everywhere"; or "none found". It speaks of the coordinates: where a whole self-motion
        stands above one point of the slice, the set holds one posture of it, and ``note`` says so.
    dropped : int
        Bracketed places near which no singular posture was found.
    missed : int or None
        Sign changes and ends of the branch on a grid twice as fine that are no nearer than a cell
        to the set; None where that was not checked.
    note : str
    fit : Fit or None
        How well the triangles of a surface lie on it; None where there are none.
    grid : tuple of int
        Cells along each axis of the grid from which the set was sought.
    cusps, cusps_q : (n, k) and (n, nq) arrays
        Coordinates [m or rad] and postures where a curve of folds turns back and three postures
        meet; empty where they were not asked for, and for other kinds.

    Examples
    --------
    >>> m = cc.load("eclipse")
    >>> over = {"tilt": np.linspace(0.3, 1.5, 13), "azimuth": np.linspace(-np.pi, np.pi, 19)}
    >>> found = cc.singularity_set(m, "direct", over)
    >>> found.verdict, found.missed
    ('curve', 0)
    >>> round(float(np.degrees(found.coordinates[:, 0].min())), 1)  # least singular tilt
    48.2
    """

    kind: str
    chart: Chart = field(repr=False)
    over: tuple[str, ...]
    units: tuple[str, ...]
    coordinates: np.ndarray
    q: np.ndarray
    kinds: tuple[frozenset[str], ...]
    sigmas: np.ndarray
    free_twists: tuple[np.ndarray, ...]
    lost_twists: tuple[np.ndarray, ...]
    dimension: int
    pieces: tuple[np.ndarray, ...]
    ends: tuple[tuple[str, str], ...]
    branch_points: np.ndarray
    on_branch: np.ndarray
    everywhere: bool
    verdict: str
    dropped: int
    missed: int | None
    note: str
    fit: Fit | None = None
    grid: tuple[int, ...] = ()
    cusps: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))
    cusps_q: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))

    @property
    def text(self) -> str:
        """What was found, in one line."""
        said = f"{self.kind} over {' x '.join(self.over)}: {self.verdict}"
        if self.pieces:
            said += f", {len(self.q)} point{'s' * (len(self.q) != 1)}"
        if self.pieces and self.dimension:
            one, many = (("polyline", "polylines"), ("mesh", "meshes"))[self.dimension - 1]
            count = len(self.pieces)
            said += f" in {count} {one if count == 1 else many}"
        return "; ".join(filter(None, (said, self.note.rstrip(".")))) + "."

    def of_branch(self) -> SingularitySet:
        """Only what the branch of the start reaches: polylines are cut where they leave it."""
        kept = np.flatnonzero(self.on_branch)
        number = np.full(len(self.q), -1)
        number[kept] = np.arange(len(kept))
        pieces: list[np.ndarray] = []
        ends: list[tuple[str, str]] = []
        for i, piece in enumerate(self.pieces):
            if piece.ndim == 2:
                whole = (number[piece] >= 0).all(axis=1)
                pieces.append(number[piece[whole]])
                continue
            for run, both in _runs(piece, self.on_branch[piece], self.ends[i : i + 1]):
                pieces.append(number[run])
                ends.extend(both)
        return replace(
            self,
            coordinates=self.coordinates[kept],
            q=self.q[kept],
            kinds=tuple(self.kinds[i] for i in kept),
            sigmas=self.sigmas[kept],
            free_twists=tuple(self.free_twists[i] for i in kept),
            lost_twists=tuple(self.lost_twists[i] for i in kept),
            pieces=tuple(pieces),
            ends=tuple(ends),
            branch_points=number[self.branch_points[self.on_branch[self.branch_points]]],
            on_branch=self.on_branch[kept],
        )


CLOSED, LEAVES = Ending.CLOSED.word, Ending.LEAVES.word


def _runs(
    piece: np.ndarray, keep: np.ndarray, ends: tuple[tuple[str, str], ...]
) -> Iterator[tuple[np.ndarray, tuple[tuple[str, str], ...]]]:
    """Stretches of a polyline that are kept, with how they end."""
    if not ends or keep.all():
        if keep.all():
            yield piece, ends
        return
    first, last = ends[0]
    if first == CLOSED and keep.any():
        # begin the loop where it is left, so that no stretch is cut at its seam
        seam = int(np.flatnonzero(~keep)[0])
        piece, keep = np.roll(piece, -seam), np.roll(keep, -seam)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], keep.astype(int), [0]])))
    for a, b in zip(edges[::2], edges[1::2], strict=True):
        begins = first if a == 0 and first != CLOSED else LEAVES
        stops = last if b == len(piece) and last != CLOSED else LEAVES
        yield piece[a:b], ((begins, stops),)


@dataclass(frozen=True, eq=False)
class Piece:
    """Points (n, nq + k) of a piece, with what is known of it.

    ``triangles`` is (T, 3) for a mesh. ``crossings`` are indices of branch points.
    """

    points: np.ndarray
    on_branch: np.ndarray
    ends: tuple[str, str] | None = None
    crossings: tuple[int, ...] = ()
    triangles: np.ndarray | None = None


def collect(
    chart: Chart,
    kind: str,
    outputs: tuple[str, ...],
    pieces: Sequence[Piece],
    *,
    dimension: int,
    verdict: str,
    dropped: int = 0,
    missed: int | None = None,
    note: str = "",
) -> SingularitySet:
    """Classify the points and index the pieces; points that are not of the kind are dropped."""
    nq, k = chart.mechanism.model.nq, len(chart.names)
    points: list[np.ndarray] = []
    found: list[Kinds] = []
    indices: list[np.ndarray] = []
    ends: list[tuple[str, str]] = []
    crossings: list[int] = []
    reached: list[bool] = []
    for piece in pieces:
        number = np.full(len(piece.points), -1)
        q = piece.points[:, :nq]
        for i, c in enumerate(classified(chart.mechanism, q, outputs)):
            if not wanted(kind) <= c.kinds or c.sigmas[COLUMNS[kind]].max() > SINGULAR:
                # a zero of the equations, yet not singular by classify, or not met well enough;
                # closures that lose rank take that of every matrix with them, whatever the kind
                dropped += "constraint" not in c.kinds
                continue
            number[i] = len(points)
            points.append(piece.points[i])
            found.append(c)
            reached.append(bool(piece.on_branch[i]))
        if piece.triangles is not None:
            triangles = number[piece.triangles]
            indices.append(triangles[(triangles >= 0).all(axis=1)])
        elif (number >= 0).any():
            indices.append(number[number >= 0])
            if piece.ends is not None:
                ends.append(piece.ends)
        crossings += [int(number[i]) for i in piece.crossings if number[i] >= 0]
    if not points and verdict != "everywhere":
        verdict = "none found"
    z = np.array(points).reshape(len(points), nq + k)
    return SingularitySet(
        kind=kind,
        chart=chart,
        over=chart.names,
        units=chart.units,
        coordinates=z[:, nq:],
        q=z[:, :nq],
        kinds=tuple(c.kinds for c in found),
        sigmas=np.array([c.sigmas for c in found]).reshape(len(found), 3),
        free_twists=tuple(c.free_twists for c in found),
        lost_twists=tuple(c.lost_twists for c in found),
        dimension=dimension,
        pieces=tuple(indices),
        ends=tuple(ends),
        branch_points=np.array(sorted(crossings), dtype=int),
        on_branch=np.array(reached, dtype=bool),
        everywhere=verdict == "everywhere",
        verdict=verdict,
        dropped=dropped,
        missed=missed,
        note=note,
    )


def nothing(
    chart: Chart, kind: str, outputs: tuple[str, ...], missed: int | None = None
) -> SingularitySet:
    """The set of a mechanism whose joints are all inputs, of a kind that needs another one."""
    note = "every joint is an input: with all of them held nothing can move"
    return collect(
        chart, kind, outputs, (), dimension=1, verdict="none found", missed=missed, note=note
    )
