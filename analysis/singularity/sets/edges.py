"""Points of a singular set on the edges of a grid: between two neighbours, exactly.

Inside the branch a determinant changes sign along the edge, and its zero is bracketed: postures
follow the branch in the kernel, so that nothing can slide to another sheet. Where the branch ends
on the edge, it is followed up to its end; from there Newton's method solves closures and measure
together, for all edges at once, in the posture and the one coordinate along the edge.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from closedchain.analysis.singularity.maps.measures import KINDS
from closedchain.analysis.singularity.sets.classifying import evidence, sigmas_of
from closedchain.analysis.singularity.sets.lattice import Lattice
from closedchain.analysis.singularity.sets.slices import Frame, Slice
from closedchain.closure.solve.solution_set import SOLVED
from closedchain.closure.solve.square_systems import solutions

ITERATIONS = 80  # of a bracket; most need seven
NEWTON = 15
CHUNK = 256  # points whose matrices are held at once
LONGEST = 0.3  # dimensionless step of Newton's method
BEYOND = 0.6  # cells: how far from its edge the end of a branch may be found
ZERO = 1e-11  # singular value of a point that is found
CLOSED = 1e-11


@dataclass(frozen=True, eq=False)
class Edges:
    """Edges of a grid, from cells (n, k) to the next ones along axes (n,).

    ``down`` (n,): whether a branch that ends on the edge is that of the upper cell.
    """

    lower: np.ndarray
    axis: np.ndarray
    down: np.ndarray

    @property
    def upper(self) -> np.ndarray:
        """Cells (n, k) at the other ends."""
        upper = self.lower.copy()
        upper[np.arange(len(upper)), self.axis] += 1
        return upper

    def __len__(self) -> int:
        """Number of edges."""
        return len(self.axis)

    def and_also(self, others: Edges) -> Edges:
        """These edges and others."""
        return Edges(
            np.concatenate([self.lower, others.lower]),
            np.concatenate([self.axis, others.axis]),
            np.concatenate([self.down, others.down]),
        )

    def take(self, which: np.ndarray) -> Edges:
        """Some of the edges."""
        return Edges(self.lower[which], self.axis[which], self.down[which])


def on_edges(system: Slice, lattice: Lattice, kind: str, edges: Edges) -> np.ndarray:
    """Points (n, nq + k) of a kind's set on edges; NaN where none is found.

    The kind must have a determinant that changes sign on the edge, or be that at which the chart
    folds, the edge leading out of the branch.
    """
    found = np.full((len(edges), lattice.q.shape[-1] + edges.lower.shape[1]), np.nan)
    inside = np.full(len(edges), kind != lattice.chart.folds)
    for which, search in ((inside, _zeros), (~inside, _ends)):
        chosen = np.flatnonzero(which)
        if chosen.size:
            found[chosen] = search(system, lattice, kind, edges.take(chosen))
    return found


def _zeros(system: Slice, lattice: Lattice, kind: str, edges: Edges) -> np.ndarray:
    """Zeros of the determinant on edges whose ends both lie in the branch.

    Regula falsi with the Illinois rule, and a halving wherever that is slow.
    """
    n = len(edges)
    name = f"det_{kind}"
    low, high = lattice.place(edges.lower), lattice.place(edges.upper)
    at_low, at_high = (
        np.where(lattice.singular[kind][c], 0.0, lattice.det[kind][c])
        for c in (tuple(edges.lower.T), tuple(edges.upper.T))
    )
    nearer = np.abs(at_low) <= np.abs(at_high)
    best = np.where(
        nearer[:, None], lattice.q[tuple(edges.lower.T)], lattice.q[tuple(edges.upper.T)]
    )
    place, value = np.where(nearer[:, None], low, high), np.where(nearer, at_low, at_high)
    a, b = np.zeros(n), np.ones(n)
    f, g = at_low.copy(), at_high.copy()
    scale = np.maximum(np.abs(f), np.abs(g))
    running = (f * g < 0.0) & (value != 0.0)
    failed = ~running & (value != 0.0)
    halve, side = np.zeros(n, dtype=bool), np.zeros(n, dtype=int)
    for _ in range(ITERATIONS):
        i = np.flatnonzero(running)
        if not i.size:
            break
        width = b[i] - a[i]
        t = np.where(halve[i], 0.5, np.clip(f[i] / (f[i] - g[i]), 1e-3, 1.0 - 1e-3))
        t = a[i] + t * width
        c = low[i] + t[:, None] * (high[i] - low[i])
        q, gone = lattice.follow(best[i], c)
        with np.errstate(invalid="ignore"):
            h = lattice.determinants(q)[name]
        good = (gone == 1.0) & np.isfinite(h)
        failed[i[~good]] = True
        running[i[~good]] = False
        i, t, h, width = i[good], t[good], h[good], width[good]
        better = np.abs(h) <= np.abs(value[i])
        best[i[better]], place[i[better]] = q[good][better], c[good][better]
        value[i[better]] = h[better]
        left = np.sign(h) == np.sign(f[i])
        # Illinois: an end that stays twice counts half
        g[i] = np.where(left, np.where(side[i] < 0, 0.5, 1.0) * g[i], h)
        f[i] = np.where(left, h, np.where(side[i] > 0, 0.5, 1.0) * f[i])
        side[i] = np.where(left, -1, 1)
        a[i], b[i] = np.where(left, t, a[i]), np.where(left, b[i], t)
        halve[i] = b[i] - a[i] > 0.5 * width
        done = (np.abs(h) <= 1e-15 * scale[i]) | (b[i] - a[i] <= 1e-15)
        running[i[done]] = False
    z = np.concatenate([best, place], axis=1)
    return _checked(lattice, kind, z, ~failed)


def _ends(system: Slice, lattice: Lattice, kind: str, edges: Edges) -> np.ndarray:
    """Ends of the branch on edges that lead out of it."""
    upward = ~edges.down[:, None]
    inner = np.where(upward, edges.lower, edges.upper)
    outer = np.where(upward, edges.upper, edges.lower)
    begin, target = lattice.place(inner), lattice.place(outer)
    q, gone = lattice.follow(lattice.q[tuple(inner.T)], target)
    z = system.point(q, begin + gone[:, None] * (target - begin))
    out = np.full_like(z, np.nan)
    chosen = np.flatnonzero(gone < 1.0)
    for first in range(0, len(chosen), CHUNK):
        some = chosen[first : first + CHUNK]
        out[some] = newton(system, z[some], edges.axis[some])
    moved = (system.coordinates(out) - 0.5 * (begin + target)) / lattice.cell
    with np.errstate(invalid="ignore"):
        good = np.linalg.norm(moved, axis=1) <= 0.5 + BEYOND
    return _checked(lattice, kind, out, good)


def newton(system: Slice, z: np.ndarray, axis: np.ndarray) -> np.ndarray:
    """Solutions (n, nq + k) near points, all coordinates but those along ``axis`` (n,) held.

    NaN where Newton's method does not settle. Equations are held as they are at the start.
    """
    out = np.full_like(z, np.nan)
    if not len(z):
        return out
    k = len(system.chart.names)
    frame = system.frame(z)
    held = np.array([[i for i in range(k) if i != a] for a in range(k)], dtype=int)[axis]
    rows = np.eye(system.size)[system.mechanism.model.nv + held]
    index, last = np.arange(len(z)), np.full(len(z), np.inf)
    for _ in range(NEWTON):
        values, jacobian = system.evaluate(z, frame)
        values = np.concatenate([values, np.zeros((len(z), k - 1))], axis=1)
        square = np.concatenate([jacobian, rows], axis=1)
        if square.shape[1] != square.shape[2]:
            return out
        worst = np.abs(values).max(axis=1)
        done = (worst < SOLVED) | ((worst < 100.0 * SOLVED) & (worst >= 0.5 * last))
        out[index[done]] = z[done]
        steps = solutions(square, values[:, :, None])[:, :, 0]
        sizes = np.linalg.norm(steps, axis=1)
        going = ~done & np.isfinite(sizes)
        if not going.any():
            break
        scale = np.minimum(1.0, LONGEST / np.maximum(sizes[going], LONGEST))
        z = system.move(z[going], -steps[going] * scale[:, None])
        index, last, rows = index[going], worst[going], rows[going]
        frame = _some(frame, going)
    return out


def _some(frame: Frame, which: np.ndarray) -> Frame:
    combine = None if frame.combine is None else frame.combine[which]
    return Frame(combine, tuple((b[which], c[which]) for b, c in frame.borders))


def _checked(lattice: Lattice, kind: str, z: np.ndarray, found: np.ndarray) -> np.ndarray:
    """Points (n, nq + k) that were found, are closed, and singular; NaN for the others."""
    out = np.full_like(z, np.nan)
    chosen = np.flatnonzero(found & np.isfinite(z).all(axis=1))
    good = singular_points(lattice, kind, z[chosen])
    out[chosen[good]] = z[chosen[good]]
    return out


def singular_points(lattice: Lattice, kind: str, z: np.ndarray) -> np.ndarray:
    """Which points (n, nq + k) are closed postures that are singular, (n,) of bool."""
    mechanism, outputs, column = lattice.chart.mechanism, lattice.outputs, KINDS.index(kind)
    good = np.zeros(len(z), dtype=bool)
    for begin in range(0, len(z), CHUNK):
        some = slice(begin, begin + CHUNK)
        seen = evidence(mechanism, z[some, : lattice.q.shape[-1]], outputs)
        sigmas = sigmas_of(mechanism, seen, outputs)
        good[some] = (sigmas[:, column] < ZERO) & (seen.residual < CLOSED)
    return good
