"""Singular sets at which a determinant touches zero without changing its sign.

Where a factor of a determinant is squared, or where two freedoms are lost at once, nothing is
bracketed on a grid, and the equations of the set are degenerate on it. The singular value is still
least there along every line of the grid that passes: it is minimised along them, in the kernel,
and where it vanishes a point of the set is found. Points on edges of the same square are joined.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from closedchain.analysis.singularity.sets.edges import CLOSED, ZERO, Edges
from closedchain.analysis.singularity.sets.lattice import Lattice
from closedchain.analysis.singularity.sets.meshing import mesh_of
from closedchain.analysis.singularity.sets.singular_set import Piece
from closedchain.analysis.singularity.sets.slices import Slice
from closedchain.closure.solve.outcome import Ending
from closedchain.closure.solve.solution_set import tangents

GOLDEN = 0.5 * (np.sqrt(5.0) - 1.0)
ITERATIONS = 48  # of golden section: to 1e-10 of a cell
LOOK = 14  # iterations after which a value that will not vanish shows it
FALLEN = 0.05  # of what it was

SLOPE = 1e-7  # share of a singular value below which the slope of a measure counts as zero

EDGE, STOPS = Ending.EDGE.word, Ending.DEGENERATE.word


def touching(
    system: Slice,
    lattice: Lattice,
    kind: str,
    knows: Callable[[np.ndarray], bool] = lambda z: False,
) -> tuple[list[Piece], np.ndarray]:
    """Pieces of a kind's set that no sign change shows: triangles, polylines or single points.

    With them points (n, nq + k) at which the set is regular: it crosses zero there, and only runs
    along a line of the grid, or comes back over it between two cells. What ``knows`` says is there
    already is left out.
    """
    edges, points = touches(lattice, kind)
    new = np.array([not knows(z) for z in points], dtype=bool)
    edges, points = edges.take(new), points[new]
    regular = np.array([_regular(system, z) for z in points], dtype=bool)
    return _joined(lattice, edges.take(~regular), points[~regular]), points[regular]


def _regular(system: Slice, z: np.ndarray) -> bool:
    """Whether the equations of the set have full rank at a point, for the ranks lost there.

    In space only where one rank is lost: nothing meshes the others.
    """
    lost = max(1, *system.lost(z, SLOPE))
    if lost > 1:
        if len(system.chart.names) > 2:
            return False
        system = system.losing((lost,))
    try:
        return tangents(system, z, SLOPE).shape[1] == len(system.chart.names) - 1
    except np.linalg.LinAlgError:  # a rank loss of two leaves the bordered matrix singular
        return False


def _joined(lattice: Lattice, edges: Edges, points: np.ndarray) -> list[Piece]:
    if not len(points):
        return []
    if edges.lower.shape[1] == 3:
        return _mesh(lattice, edges, points)
    every = np.ones(len(points), dtype=bool)
    if edges.lower.shape[1] == 1:
        return [Piece(z[None], every[:1]) for z in points]
    return [
        Piece(points[chain], every[: len(chain)], _ends(lattice, points[chain], closed))
        if len(chain) > 1
        else Piece(points[chain], every[:1])
        for chain, closed in _chains(edges)
    ]


def touches(lattice: Lattice, kind: str) -> tuple[Edges, np.ndarray]:
    """Edges on which a singular value falls to zero and rises again, and the points (n, nq + k)."""
    lower, axes, points = [], [], []
    for axis in range(lattice.ok.ndim):
        cells = _lows(lattice, kind, axis)
        z, share = _least(lattice, kind, cells, axis)
        found = np.isfinite(share)
        # a point at its very cell goes to the edge before it
        cells = cells[found]
        cells[:, axis] -= share[found] <= 1e-7
        lower.append(cells)
        axes.append(np.full(len(cells), axis))
        points.append(z[found])
    every = np.concatenate(lower)
    edges = Edges(every, np.concatenate(axes), np.zeros(len(every), dtype=bool))
    return edges, np.concatenate(points)


def _lows(lattice: Lattice, kind: str, axis: int) -> np.ndarray:
    """Cells (n, k) between two others of the branch, of one sign, where a value is least."""
    ok = np.moveaxis(lattice.ok, axis, 0)
    sigma = np.moveaxis(np.where(lattice.ok, lattice.sigma[kind], np.inf), axis, 0)
    singular = np.moveaxis(lattice.singular[kind], axis, 0)
    sign = np.sign(np.moveaxis(np.where(lattice.ok, lattice.det[kind], 0.0), axis, 0))
    here, before, after = slice(1, -1), slice(None, -2), slice(2, None)
    joined = np.moveaxis(lattice.joined[..., axis], axis, 0)
    low = ok[here] & joined[before] & joined[here]
    low &= (sigma[here] <= sigma[before]) & (sigma[here] <= sigma[after])
    low &= (sigma[here] < sigma[before]) | (sigma[here] < sigma[after])
    low &= ~singular[before] & ~singular[after] & (sign[before] == sign[after])
    low &= singular[here] | (sign[here] == sign[before])
    cells = np.argwhere(low)
    cells[:, 0] += 1
    order = np.insert(np.arange(1, lattice.ok.ndim), axis, 0)
    return np.ascontiguousarray(cells[:, order])


def _least(
    lattice: Lattice, kind: str, cells: np.ndarray, axis: int
) -> tuple[np.ndarray, np.ndarray]:
    """Points (n, nq + k) where the singular value vanishes beside cells, along an axis.

    With them the way from the cell, -1 to 1 cells; NaN where the least value is not zero.
    """
    n = len(cells)
    step = np.zeros(cells.shape[1], dtype=int)
    step[axis] = 1
    c = lattice.place(cells)
    start = lattice.q[tuple(cells.T)]
    down, up = (lattice.place(cells + s * step) - c for s in (-1, 1))
    at_cell = lattice.sigma[kind][tuple(cells.T)]
    name = f"sigma_{kind}"

    def look(i: np.ndarray, t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        goal = c[i] + np.where(t[:, None] < 0.0, -t[:, None] * down[i], t[:, None] * up[i])
        q, gone = lattice.follow(start[i], goal)
        found = lattice.measures(q)
        bad = (gone < 1.0) | ~(found["residual"] < CLOSED)
        return np.where(bad, np.inf, found[name]), q, goal

    a, b = -np.ones(n), np.ones(n)
    best, share = at_cell.copy(), np.zeros(n)
    z = np.concatenate([start, c], axis=1)
    inner = [b - GOLDEN * (b - a), a + GOLDEN * (b - a)]
    every = np.arange(n)
    running = best >= ZERO
    values = [np.full(n, np.inf), np.full(n, np.inf)]

    def note(i: np.ndarray, which: int) -> None:
        value, q, goal = look(i, inner[which][i])
        values[which][i] = value
        better = value < best[i]
        best[i[better]], share[i[better]] = value[better], inner[which][i[better]]
        z[i[better]] = np.concatenate([q[better], goal[better]], axis=1)

    if running.any():
        note(every[running], 0)
        note(every[running], 1)
    for count in range(ITERATIONS):
        if count == LOOK:
            running &= best < FALLEN * at_cell
        for which in (0, 1):
            i = np.flatnonzero(running)
            first = values[0][i] < values[1][i]
            i = i[first] if which == 0 else i[~first]
            if not i.size:
                continue
            if which == 0:  # the least value lies before the second inner point
                b[i], inner[1][i], values[1][i] = inner[1][i], inner[0][i], values[0][i]
                inner[0][i] = b[i] - GOLDEN * (b[i] - a[i])
            else:
                a[i], inner[0][i], values[0][i] = inner[0][i], inner[1][i], values[1][i]
                inner[1][i] = a[i] + GOLDEN * (b[i] - a[i])
            note(i, which)
    share[best >= ZERO] = np.nan
    return z, share


def _chains(edges: Edges) -> list[tuple[np.ndarray, bool]]:
    """Points on edges of a plane grid, in order along curves; and whether these are closed.

    Two points are neighbours where their edges, and no others, belong to one square.
    """
    of: dict[tuple[int, int], list[int]] = {}
    for i, (cell, axis) in enumerate(zip(edges.lower, edges.axis, strict=True)):
        other = 1 - int(axis)
        for shift in (0, -1):
            square = [int(cell[0]), int(cell[1])]
            square[other] += shift
            of.setdefault((square[0], square[1]), []).append(i)
    beside: dict[int, list[int]] = {i: [] for i in range(len(edges))}
    for members in of.values():
        if len(members) == 2:
            one, two = members
            beside[one].append(two)
            beside[two].append(one)
    chains, seen = [], set()
    for begin in sorted(beside, key=lambda i: (len(beside[i]) != 1, i)):  # loose ends first
        if begin in seen:
            continue
        chain, here = [begin], begin
        seen.add(begin)
        while True:
            onward = [j for j in beside[here] if j not in seen]
            if not onward:
                break
            here = onward[0]
            seen.add(here)
            chain.append(here)
        closed = len(chain) > 2 and begin in beside[here]
        chains.append((np.array(chain), closed))
    return chains


def _ends(lattice: Lattice, points: np.ndarray, closed: bool) -> tuple[str, str]:
    if closed:
        return Ending.CLOSED.word, Ending.CLOSED.word
    k = len(lattice.values)
    low, high = (np.array([v[i] for v in lattice.values]) for i in (0, -1))
    ends = []
    for z in (points[0], points[-1]):
        near = np.minimum(z[-k:] - low, high - z[-k:]) < 1e-3 * lattice.cell
        ends.append(EDGE if near.any() else STOPS)
    return ends[0], ends[1]


def _mesh(lattice: Lattice, edges: Edges, points: np.ndarray) -> list[Piece]:
    """Triangles between the two sides of the set, told apart by crossing it from cell to cell."""
    mesh = mesh_of(_sides(lattice, edges), lattice.ok, lattice.apart)
    number = {edge: i for i, edge in enumerate(_keys(edges))}
    of = np.array([number.get(edge, -1) for edge in _keys(mesh.edges)], dtype=int)
    triangles = of[mesh.triangles].reshape(-1, 3)
    kept = triangles[(triangles >= 0).all(axis=1)]
    if not len(kept):
        return []
    return [Piece(points, np.ones(len(points), dtype=bool), triangles=kept)]


def _keys(edges: Edges) -> list[tuple[int, ...]]:
    """Each edge as its lower cell and its axis."""
    both = zip(edges.lower.tolist(), edges.axis.tolist(), strict=True)
    return [(*cell, axis) for cell, axis in both]


def _sides(lattice: Lattice, edges: Edges) -> np.ndarray:
    """Side of the set, of bool, of every cell: another one beyond each edge that it crosses."""
    ok = lattice.ok
    crossed = set(_keys(edges))
    side = np.zeros(ok.shape, dtype=np.int8)
    for seed in map(tuple, np.argwhere(ok)):
        if side[seed]:
            continue
        side[seed] = 1
        stack = [seed]
        while stack:
            cell = stack.pop()
            for axis in range(ok.ndim):
                for shift in (-1, 1):
                    j = cell[axis] + shift
                    beside = (*cell[:axis], j, *cell[axis + 1 :])
                    if not 0 <= j < ok.shape[axis] or not ok[beside] or side[beside]:
                        continue
                    edge = (*(cell if shift > 0 else beside), axis)
                    side[beside] = -side[cell] if edge in crossed else side[cell]
                    stack.append(beside)
    return np.asarray(side > 0)
