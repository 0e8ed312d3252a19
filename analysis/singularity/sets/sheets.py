"""Sheets of a singular surface, each followed by itself through the cubes of a grid.

A surface may cross itself: where a determinant is a product, its sheets are the factors' own. Signs
at the corners of a cube then do not tell which points belong together, the tangent planes of the
points do. Every vertex lies on an edge of the grid, exactly. From there the sheet is followed
through the faces that meet at the edge: in a face it is a curve, which leads from edge to edge.
What leads round a cube is the sheet's polygon in it [Allgower2003]_.

[Allgower2003]_ E. L. Allgower and K. Georg, Introduction to numerical continuation methods, SIAM,
2003.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from closedchain.analysis.singularity.sets.cubes import Cubes, Edge, Face
from closedchain.analysis.singularity.sets.edges import newton, singular_points
from closedchain.analysis.singularity.sets.lattice import Lattice
from closedchain.analysis.singularity.sets.membership import reached, turned_alike
from closedchain.analysis.singularity.sets.slices import Slice
from closedchain.closure.nearest import LIMIT_TOLERANCE
from closedchain.closure.solve.solution_set import tangents
from closedchain.closure.solve.square_systems import solutions

ASTRAY = 0.35  # of a step: farther from where it was expected, a point may be another sheet's
SAME = 1e-5  # dimensionless: points of one edge that are one
ALIKE = 0.8  # cosine between normals of neighbours on one sheet
OTHERS = np.array([[1, 2], [0, 2], [0, 1]])  # axes beside one
FARTHEST = 1e6  # m or rad: no unknown is larger
CHUNK = 256  # points whose matrices are held at once
ROUNDS = 9  # trials of a walk through a face


@dataclass(frozen=True, eq=False)
class Vertex:
    """A point (nq + 3,) of a sheet on an edge; of none at a rim, where the branch leaves the sheet.

    Attributes
    ----------
    slopes : (nv + 3, 3) array
        Dimensionless steps along the sheet, for a unit step of each coordinate but that along
        the edge, whose column is zero.
    normal : (3,) array
        Of the sheet, in cells.
    """

    z: np.ndarray
    edge: Edge | None
    slopes: np.ndarray
    normal: np.ndarray


@dataclass(eq=False)
class Walk:
    """From a vertex through a face, along the curve in which the face cuts the sheet.

    Attributes
    ----------
    vertex : int
    face : Face
    z : (nq + 3,) array
        How far it came.
    tangent : (nv + 3,) array
        Dimensionless step per cell.
    share : float
        Of the way to the end of the face that is tried next.
    """

    vertex: int
    face: Face
    z: np.ndarray
    tangent: np.ndarray
    share: float = 1.0


@dataclass(frozen=True, eq=False)
class Trial:
    """Where the next point of a walk is expected: its free coordinate, and the edge, if on one."""

    z: np.ndarray
    size: float
    free: int
    edge: Edge | None


@dataclass(eq=False)
class Sheets:
    """Sheets of a kind's set over a lattice, as far as the branch reaches them.

    Attributes
    ----------
    branch : list of Lattice
        The branch on all grids where it is known.
    vertices : list of Vertex
    at : mapping of edge to numbers of vertices
    links : mapping of face to pairs of vertices that a sheet joins in it
    rims : set of int
        Vertices beyond which a sheet could not be followed.
    """

    system: Slice
    kind: str
    branch: list[Lattice]
    vertices: list[Vertex] = field(default_factory=list)
    at: dict[Edge, list[int]] = field(default_factory=dict)
    links: dict[Face, list[tuple[int, int]]] = field(default_factory=dict)
    rims: set[int] = field(default_factory=set)
    _waiting: list[Walk] = field(init=False, default_factory=list, repr=False)

    @cached_property
    def cubes(self) -> Cubes:
        """Between the planes."""
        return Cubes.of(self.branch[0])

    # -- starting --------------------------------------------------------------------------------

    def begin(self, z: np.ndarray) -> bool:
        """Follow the sheet through a solution (nq + 3,), if it crosses an edge of its cube."""
        nv = self.system.mechanism.model.nv
        try:
            basis = tangents(self.system, z)
        except np.linalg.LinAlgError:
            return False
        if basis.shape[1] != 2:
            return False
        unit = self.system.chart.scale / self.cubes.cell
        normal = np.cross(*(basis[nv:] * unit[:, None]).T)
        place = self.system.coordinates(z)
        starts, edges = [], []
        for edge in self.cubes.edges_of(self.cubes.holding(place)):
            away = self._corner(edge) - place
            low, high = self.cubes.ends_of(edge)
            slope = normal[edge[3]]
            offset = float(normal @ (away / self.cubes.cell))
            if slope == 0.0:
                continue
            away[edge[3]] -= offset / slope * self.cubes.cell[edge[3]]
            if not low <= place[edge[3]] + away[edge[3]] <= high:
                continue
            share = np.linalg.lstsq(basis[nv:], away / self.system.chart.scale, rcond=None)[0]
            starts.append(self._placed(self.system.move(z, basis @ share), place + away))
            edges.append(edge)
        if not starts:
            return False
        found = self._solved(np.array(starts), [edge[3] for edge in edges])
        return any(number is not None for number in self._enter(found, edges))

    def _corner(self, edge: Edge) -> np.ndarray:
        return np.array([p[i] for p, i in zip(self.cubes.planes, edge[:3], strict=True)])

    def _placed(self, z: np.ndarray, place: np.ndarray) -> np.ndarray:
        return np.concatenate([self.system.posture(z), place])

    # -- points ----------------------------------------------------------------------------------

    def _solved(self, starts: np.ndarray, free: Sequence[int]) -> np.ndarray:
        """Points (n, nq + 3) near starts, all coordinates held but one each; NaN: none."""
        axes, found = np.array(free, dtype=int), np.full_like(starts, np.nan)
        # a sheet that runs along an edge is expected nowhere
        sane = np.flatnonzero((np.abs(starts) < FARTHEST).all(axis=1))
        for first in range(0, len(sane), CHUNK):
            some = sane[first : first + CHUNK]
            found[some] = newton(self.system, starts[some], axes[some])
        return found

    def _on_edge(self, z: np.ndarray, edge: Edge) -> bool:
        low, high = self.cubes.ends_of(edge)
        return bool(low <= self.system.coordinates(z)[edge[3]] <= high)

    def _known(self, z: np.ndarray, edge: Edge) -> int | None:
        for i in self.at.get(edge, ()):
            if np.abs(self.system.difference(self.vertices[i].z, z)).max() < SAME:
                return i
        return None

    def _enter(self, points: np.ndarray, edges: Sequence[Edge]) -> list[int | None]:
        """Numbers of the vertices at points of edges, new ones made.

        None where there is no point, or the branch does not reach it.
        """
        numbers: list[int | None] = [None] * len(edges)
        fresh = []
        for i, (z, edge) in enumerate(zip(points, edges, strict=True)):
            if np.isfinite(z).all() and self._on_edge(z, edge):
                numbers[i] = self._known(z, edge)
                if numbers[i] is None:
                    fresh.append(i)
        good = self.on_branch(points[fresh])
        good &= singular_points(self.branch[0], self.kind, points[fresh])
        fresh = [i for i, fine in zip(fresh, good, strict=True) if fine]
        slopes, normals = self._slopes(points[fresh], [edges[i][3] for i in fresh])
        for i, slope, normal in zip(fresh, slopes, normals, strict=True):
            if not np.isfinite(slope).all():
                continue
            numbers[i] = self._known(points[i], edges[i])  # twice in one go
            if numbers[i] is None:
                numbers[i] = self._new(Vertex(points[i], edges[i], slope, normal), edges[i])
        return numbers

    def _new(self, vertex: Vertex, edge: Edge) -> int:
        number = len(self.vertices)
        self.vertices.append(vertex)
        self.at.setdefault(edge, []).append(number)
        for face, into, sense in self.cubes.faces_at(edge):
            tangent = self._tangent(vertex.slopes[:, into], face)
            if np.isfinite(tangent).all():
                self._waiting.append(Walk(number, face, vertex.z, sense * tangent))
        return number

    def on_branch(self, points: np.ndarray) -> np.ndarray:
        """Which points (n, nq + 3) the branch reaches within the joint limits, (n,) of bool."""
        lower, upper = self.system.mechanism.limits
        q = self.system.posture(turned_alike(self.system, self.branch[0], points))
        within = ((q >= lower - LIMIT_TOLERANCE) & (q <= upper + LIMIT_TOLERANCE)).all(axis=1)
        return np.asarray(within & reached(self.system, self.branch, points))

    def _slopes(self, z: np.ndarray, free: Sequence[int]) -> tuple[np.ndarray, np.ndarray]:
        """``Vertex.slopes`` (n, nv + 3, 3) and ``normal`` (n, 3) for a free coordinate each."""
        nv, n = self.system.mechanism.model.nv, len(z)
        axes = np.array(free, dtype=int)
        slopes, every = np.zeros((n, self.system.size, 3)), np.arange(n)
        for first in range(0, n, CHUNK):
            some = every[first : first + CHUNK]
            _, jacobian = self.system.evaluate(z[some], self.system.frame(z[some]))
            held = OTHERS[axes[some]]
            rows = np.eye(self.system.size)[nv + held]
            square = np.concatenate([jacobian, rows], axis=1)
            right = np.zeros((square.shape[1], 2))
            right[-2:] = np.eye(2)
            found = solutions(square, right)
            for j in range(2):
                slopes[some, :, held[:, j]] = found[:, :, j]
        rise = slopes[every, nv + axes]  # of the free coordinate, for each other one
        normals = -rise * self._unit[axes][:, None] / self._unit
        normals[every, axes] = 1.0
        return slopes, normals / np.linalg.norm(normals, axis=1, keepdims=True)

    @cached_property
    def _unit(self) -> np.ndarray:
        """Cells (3,) in a dimensionless unit of each coordinate."""
        return np.asarray(self.system.chart.scale / self.cubes.cell)

    def _tangent(self, step: np.ndarray, face: Face) -> np.ndarray:
        """A step (nv + 3,) along a sheet in a face, scaled to a cell."""
        two = OTHERS[face[3]]
        along = step[self.system.mechanism.model.nv + two] * self._unit[two]
        return np.asarray(step / np.linalg.norm(along))

    # -- following -------------------------------------------------------------------------------

    def follow(self) -> None:
        """Follow the sheets through all faces that wait."""
        while self._waiting:
            walks = [walk for walk in self._waiting if not self._linked(walk)]
            self._waiting = []
            for first in range(0, len(walks), CHUNK):
                self._cross([w for w in walks[first : first + CHUNK] if not self._linked(w)])

    def _linked(self, walk: Walk) -> bool:
        return any(walk.vertex in pair for pair in self.links.get(walk.face, ()))

    def _link(self, walk: Walk, other: int) -> bool:
        """Join the vertex of a walk to another one, if that is not joined in this face already."""
        pairs = self.links.setdefault(walk.face, [])
        for pair in pairs:
            if other in pair:
                if not self.rims.intersection(pair):
                    return False
                pairs.remove(pair)  # what could not be followed from there was from here
                break
        pairs.append((walk.vertex, other))
        return True

    def _cross(self, walks: list[Walk]) -> None:
        """Walk from vertices to those that their sheets lead to, and link them."""
        for _ in range(ROUNDS):
            trials = [self._trial(walk) for walk in walks]
            for walk, trial in zip(walks, trials, strict=True):
                other = self._expected(walk, trial)
                if other is not None and not self._linked(walk) and not self._link(walk, other):
                    walk.share *= 0.5
            both = [b for b in zip(walks, trials, strict=True) if not self._linked(b[0])]
            if not both:
                return
            self._step([walk for walk, _ in both], [trial for _, trial in both])
            walks = [walk for walk, _ in both if not self._linked(walk)]
            if not walks:
                return
        self._stop([walk for walk in walks if not self._linked(walk)])

    def _trial(self, walk: Walk) -> Trial:
        """Where a walk is tried to be led to: out of its face, or some of the way."""
        nv, cell = self.system.mechanism.model.nv, self.cubes.cell
        place, two = self.system.coordinates(walk.z), OTHERS[walk.face[3]]
        cells = walk.tangent[nv + two] * self._unit[two]
        ahead = [
            self.cubes.planes[k][walk.face[k] + (d > 0)] for k, d in zip(two, cells, strict=True)
        ]
        with np.errstate(divide="ignore", invalid="ignore"):
            far = (np.array(ahead) - place[two]) / (cells * cell[two])
        far = np.where(np.isfinite(far), np.maximum(far, 0.0), np.inf)
        first = int(far.argmin())
        size = walk.share * float(far[first])
        z = self.system.move(walk.z, size * walk.tangent)
        at = self.system.coordinates(z).copy()
        at[walk.face[3]] = place[walk.face[3]]
        edge = None
        if walk.share == 1.0:
            into, along = int(two[first]), int(two[1 - first])
            edge = self.cubes.along(walk.face[:3], along, into=into, far=bool(cells[first] > 0))
            at[into], free = ahead[first], along
        else:
            free = int(two[np.abs(cells).argmin()])
        size *= float(np.linalg.norm(walk.tangent))
        return Trial(np.concatenate([self.system.posture(z), at]), size, free, edge)

    def _expected(self, walk: Walk, trial: Trial) -> int | None:
        """The vertex that is known near where a sheet is expected, on the same sheet."""
        if trial.edge is None:
            return None
        normal, best, least = self.vertices[walk.vertex].normal, None, np.inf
        for i in self.at.get(trial.edge, ()):
            gap = float(np.linalg.norm(self.system.difference(trial.z, self.vertices[i].z)))
            alike = abs(float(normal @ self.vertices[i].normal)) > ALIKE
            if i != walk.vertex and alike and gap < least and gap <= ASTRAY * trial.size:
                best, least = i, gap
        return best

    def _step(self, walks: Sequence[Walk], trials: Sequence[Trial]) -> None:
        """Lead walks on as tried, or make the next trial shorter."""
        starts = np.array([trial.z for trial in trials])
        points = self._solved(starts, [trial.free for trial in trials])
        sizes = np.array([trial.size for trial in trials])
        there = np.flatnonzero(np.isfinite(points[:, 0]))
        gap = np.linalg.norm(self.system.difference(starts[there], points[there]), axis=1)
        points[there[gap > ASTRAY * sizes[there]]] = np.nan
        out = [i for i, trial in enumerate(trials) if trial.edge is not None]
        edges = [edge for trial in trials if (edge := trial.edge) is not None]
        for i, other in zip(out, self._enter(points[out], edges), strict=True):
            if self._linked(walks[i]):
                continue
            if other is None or other == walks[i].vertex or not self._link(walks[i], other):
                walks[i].share *= 0.5
        within = [i for i, trial in enumerate(trials) if trial.edge is None]
        good = np.isfinite(points[within]).all(axis=1)
        good[good] = self.on_branch(points[within][good])
        for i, fine in zip(within, good, strict=True):
            if not fine:
                walks[i].share *= 0.5
        on = [i for i, fine in zip(within, good, strict=True) if fine]
        slopes, _ = self._slopes(points[on], [trials[i].free for i in on])
        for i, slope in zip(on, slopes, strict=True):
            walk = walks[i]
            (held,) = (k for k in OTHERS[walk.face[3]] if k != trials[i].free)
            tangent = self._tangent(slope[:, held], walk.face)
            if np.isfinite(tangent).all():
                nv = self.system.mechanism.model.nv
                sense = np.sign(tangent[nv:] @ (self._unit**2 * walk.tangent[nv:]))
                walk.z, walk.tangent = points[i], sense * tangent
                walk.share = min(1.0, 2.0 * walk.share)

    def _stop(self, walks: Sequence[Walk]) -> None:
        """End sheets where walks could not be led on."""
        for walk in walks:
            begin = self.vertices[walk.vertex]
            number = walk.vertex
            if walk.z is not begin.z:
                number = len(self.vertices)
                self.vertices.append(replace(begin, z=walk.z, edge=None))
                self._link(walk, number)
            self.rims.add(number)
