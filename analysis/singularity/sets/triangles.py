"""Triangles of the sheets of a surface, split until their middles lie on it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from closedchain.analysis.singularity.sets.cubes import Cube, Face
from closedchain.analysis.singularity.sets.edges import newton, singular_points
from closedchain.analysis.singularity.sets.mesh_fit import Fit
from closedchain.analysis.singularity.sets.sheets import CHUNK, Sheets

TOLERANCE = 0.05
"""Cells: how far the middle of a triangle may be from the surface."""
ROUNDS = 4  # of splitting
ELSEWHERE = 1.0  # of the longest side, dimensionless: a point found farther away is another sheet's


@dataclass(frozen=True, eq=False)
class Meshed:
    """Points (V, nq + 3), whether the branch reaches them (V,), triangles (T, 3), and their fit."""

    points: np.ndarray
    on_branch: np.ndarray
    triangles: np.ndarray
    fit: Fit


def meshed(sheets: Sheets) -> Meshed:
    """Triangles of all sheets that the branch reaches, every middle within ``TOLERANCE``."""
    corners, holes = [], 0
    faces = _faces(sheets)
    for ring in _rings(sheets):
        if ring is None:
            holes += 1
        else:
            corners += _fan(ring, faces)
    triangles = np.array(corners, dtype=int).reshape(-1, 3)
    nq = sheets.system.mechanism.model.nq
    points = np.array([vertex.z for vertex in sheets.vertices]).reshape(-1, nq + 3)
    work = _Splitting(sheets, points, triangles)
    largest, split, left_out = work.run()
    used = np.unique(work.triangles)
    number = np.full(len(work.points), -1)
    number[used] = np.arange(used.size)
    every = np.ones(len(work.points), dtype=bool)
    every[len(points) :] = sheets.on_branch(work.points[len(points) :])
    return Meshed(
        work.points[used],
        every[used],
        number[work.triangles].reshape(-1, 3),
        Fit(TOLERANCE, largest, split, left_out, holes),
    )


def _rings(sheets: Sheets) -> Iterator[list[int] | None]:
    """Vertices round each cube's part of a sheet; None where they do not close.

    A chain between two rims is closed along them.
    """
    beside: dict[Cube, dict[int, list[int]]] = {}
    for face, pairs in sheets.links.items():
        for cube in sheets.cubes.cubes_at(face):
            for one, two in pairs:
                known = beside.setdefault(cube, {})
                known.setdefault(one, []).append(two)
                known.setdefault(two, []).append(one)
    for cube in sorted(beside):
        left = beside[cube]
        ways = {i: list(others) for i, others in left.items()}
        while left:
            begin = min(left, key=lambda i: (len(ways[i]) != 1, i))  # loose ends first
            ring, here = [begin], begin
            del left[begin]
            while onward := [i for i in ways[here] if i in left]:
                here = onward[0]
                ring.append(here)
                del left[here]
            closed = begin in ways[here] or {begin, here} <= sheets.rims
            if len(ring) > 2:
                yield ring if closed else None


def _faces(sheets: Sheets) -> dict[int, set[Face]]:
    """Faces in which each vertex is linked."""
    found: dict[int, set[Face]] = {}
    for face, pairs in sheets.links.items():
        for number in (i for pair in pairs for i in pair):
            found.setdefault(number, set()).add(face)
    return found


def _fan(ring: Sequence[int], faces: Mapping[int, set[Face]]) -> list[tuple[int, int, int]]:
    """Triangles of a ring, from the vertex whose chords run least in faces of the cube.

    In a face they might be chords of the next cube's ring, too.
    """

    def chords(turn: int) -> int:
        far = [ring[(turn + i) % len(ring)] for i in range(2, len(ring) - 1)]
        return sum(bool(faces[ring[turn]] & faces[i]) for i in far)

    turn = min(range(len(ring)), key=chords)
    turned = [*ring[turn:], *ring[:turn]]
    return [(turned[0], b, c) for b, c in pairwise(turned[1:])]


class _Splitting:
    """Triangles while those are split whose middles are off the surface."""

    def __init__(self, sheets: Sheets, points: np.ndarray, triangles: np.ndarray) -> None:
        self.sheets, self.system = sheets, sheets.system
        self.points, self.triangles = points, triangles

    def run(self) -> tuple[float, int, int]:
        """Split in rounds. Returns the largest distance left, and how many were split, left out."""
        off, split = self._off(self.triangles), 0
        for _ in range(ROUNDS):
            bad = ~(off <= TOLERANCE)
            if not bad.any():
                break
            split += int(bad.sum())
            off = self._split(bad, off)
        bad = ~(off <= TOLERANCE)
        self.triangles = self.triangles[~bad]
        return float(off[~bad].max(initial=0.0)), split, int(bad.sum())

    def _split(self, bad: np.ndarray, off: np.ndarray) -> np.ndarray:
        """Halve the longest sides of triangles, in all triangles that share them; new distances."""
        sides = [self._longest(triple) for triple in self.triangles[bad].tolist()]
        wanted = sorted(set(sides))
        places = self._polished(np.array(wanted, dtype=int).reshape(-1, 2))
        half: dict[tuple[int, int], int] = {}
        for side, z in zip(wanted, places, strict=True):
            if np.isfinite(z).all():
                half[side] = len(self.points) + len(half)
        found = np.isfinite(places).all(axis=1)
        self.points = np.concatenate([self.points, places[found]])
        kept, fresh = [], []
        for i, triple in enumerate(self.triangles.tolist()):
            parts = _halved(triple, half)
            if len(parts) == 1:
                kept.append(i)
            else:
                fresh += parts
        new = np.array(fresh, dtype=int).reshape(-1, 3)
        self.triangles = np.concatenate([self.triangles[kept], new])
        return np.concatenate([off[kept], self._off(new)])

    def _places(self, points: np.ndarray) -> np.ndarray:
        return np.asarray(self.system.coordinates(points) / self.sheets.cubes.cell)

    def _longest(self, triple: Sequence[int]) -> tuple[int, int]:
        at = self._places(self.points[list(triple)])
        sizes = [float(np.linalg.norm(at[i] - at[i - 1])) for i in range(3)]
        i = int(np.argmax(sizes))
        one, two = sorted((triple[i], triple[i - 1]))
        return one, two

    def _off(self, triangles: np.ndarray) -> np.ndarray:
        """Distances (t,) in cells from the middles of triangles to the surface; NaN: not found."""
        corners = self.points[triangles]
        if not len(corners):
            return np.zeros(0)
        middle = self._between(corners)
        at = self._places(corners)
        across = np.abs(np.cross(at[:, 1] - at[:, 0], at[:, 2] - at[:, 0]))
        found = self._solved(middle, across.argmax(axis=1), corners)
        gap = np.linalg.norm(self._places(found) - self._places(middle), axis=1)
        thin = across.max(axis=1) < 1e-12  # no area, no middle to be off
        return np.where(thin, 0.0, gap)

    def _polished(self, sides: np.ndarray) -> np.ndarray:
        """Points of the surface halfway along sides (s, 2); NaN where none is near."""
        ends = self.points[sides]
        at = self._places(ends)
        # across the side as far as may be: the coordinate that changes least along it, unless
        # that leads out of the range
        change = np.where(self._on_rim(ends).all(axis=1), np.inf, np.abs(at[:, 1] - at[:, 0]))
        order, every = change.argsort(axis=1), np.arange(len(ends))
        middle, found = self._between(ends), np.full_like(ends[:, 0], np.nan)
        for axis in order.T:
            left = np.flatnonzero(np.isnan(found[:, 0]) & np.isfinite(change[every, axis]))
            if left.size:
                found[left] = self._solved(middle[left], axis[left], ends[left])
        low, high = (np.array([p[i] for p in self.sheets.cubes.planes]) for i in (0, -1))
        place = self.system.coordinates(found)
        with np.errstate(invalid="ignore"):
            found[((place < low) | (place > high)).any(axis=1)] = np.nan
        return found

    def _on_rim(self, points: np.ndarray) -> np.ndarray:
        """Which coordinates of points (..., nq + 3) are at an end of the range, (..., 3) bool."""
        low, high = (np.array([p[i] for p in self.sheets.cubes.planes]) for i in (0, -1))
        place, slack = self.system.coordinates(points), 1e-9 * self.sheets.cubes.cell
        return np.asarray((place <= low + slack) | (place >= high - slack))

    def _between(self, corners: np.ndarray) -> np.ndarray:
        """Middles (n, nq + 3) of corners (n, m, nq + 3)."""
        m = corners.shape[1]
        first = corners[:, 0]
        steps = [self.system.difference(first, corners[:, i]) for i in range(1, m)]
        return self.system.move(first, np.sum(steps, axis=0) / m)

    def _solved(self, start: np.ndarray, axis: np.ndarray, corners: np.ndarray) -> np.ndarray:
        """Points of the same sheet that differ from starts in one coordinate; NaN: none."""
        found = np.full_like(start, np.nan)
        for first in range(0, len(start), CHUNK):
            some = slice(first, first + CHUNK)
            found[some] = newton(self.system, start[some], axis[some])
        there = np.flatnonzero(np.isfinite(found[:, 0]))
        gap = np.linalg.norm(self.system.difference(start[there], found[there]), axis=1)
        sides = [
            np.linalg.norm(self.system.difference(corners[there, 0], corners[there, i]), axis=1)
            for i in range(1, corners.shape[1])
        ]
        good = gap <= ELSEWHERE * np.max(sides, axis=0)
        good &= singular_points(self.sheets.branch[0], self.sheets.kind, found[there])
        found[there[~good]] = np.nan
        return found


def _halved(triple: Sequence[int], half: dict[tuple[int, int], int]) -> list[tuple[int, ...]]:
    """The parts of a triangle some of whose sides are halved."""
    a, b, c = triple
    middles = [half.get((min(i, j), max(i, j))) for i, j in ((a, b), (b, c), (c, a))]
    count = sum(m is not None for m in middles)
    if count == 0:
        return [(a, b, c)]
    corners = [a, b, c]
    if count == 3:
        ab, bc, ca = (int(m) for m in middles if m is not None)
        return [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    # turn so that the first side is halved, and with two halved sides the last one is not
    turn = next(
        t
        for t in range(3)
        if middles[t] is not None and (count == 1 or middles[(t + 1) % 3] is not None)
    )
    a, b, c = (corners[(turn + i) % 3] for i in range(3))
    first, second = middles[turn], middles[(turn + 1) % 3]
    assert first is not None
    if second is None:
        return [(a, first, c), (first, b, c)]
    return [(first, b, second), (a, first, c), (first, second, c)]
