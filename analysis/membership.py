"""Whether a singular posture is met by the branch of a lattice, or lies on another sheet."""

from __future__ import annotations

import numpy as np

from closedchain.analysis.lattice import Lattice
from closedchain.analysis.slices import Slice
from closedchain.closure.charting import straight
from closedchain.closure.continuation import follow
from closedchain.closure.equations import correct

SMALLEST_STEP = 1e-4  # share of the way: the distance from a fold goes with its root
CELLS = 2  # nearest cells of the branch that are tried
AWAY = 2.5  # cells: how far they may be
SAMPLE = 10  # points of a curve between two that are looked at, while they agree
SAME = 1e-6  # dimensionless: postures that are one
MERGING = 0.02  # the same, short of a fold by ``SMALLEST_STEP``


def reached(system: Slice, lattice: Lattice, z: np.ndarray) -> bool:
    """Whether the straight way from a nearby cell of the branch leads to this very posture.

    At a fold of the chart the way ends just before the point.
    """
    c = system.coordinates(z)
    shape = lattice.status.shape
    box = []
    for v, x, n in zip(lattice.values, c, shape, strict=True):
        i = int(np.clip(np.searchsorted(v, x), 0, n - 1))
        box.append(slice(max(0, i - 3), min(n, i + 3)))
    corner = np.array([b.start for b in box])
    cells = np.argwhere(lattice.ok[tuple(box)]) + corner
    if not len(cells):
        return False
    apart = np.linalg.norm((lattice.place(cells) - c) / lattice.cell, axis=1)
    for i in np.argsort(apart)[:CELLS]:
        if apart[i] > AWAY:
            break
        cell = tuple(int(j) for j in cells[i])
        if _leads(system, lattice, cell, z):
            return True
    return False


def _leads(system: Slice, lattice: Lattice, cell: tuple[int, ...], z: np.ndarray) -> bool:
    chart = lattice.chart
    begin, target = lattice.place(np.array([cell]))[0], system.coordinates(z)
    here = correct(chart.equations(begin), lattice.q[cell])
    if here.refusal is not None:
        return False
    path = follow(straight(chart, begin, target), here, SMALLEST_STEP)
    if path.refusal is not None and path.reached < 0.98:
        return False
    gap = system.difference(z, system.point(path.last.q, target))
    if path.refusal is None and float(np.abs(gap).max()) < SAME:
        return True
    # short of a fold by the share s of the way, postures differ like the root of s
    short = max(1.0 - path.reached, SMALLEST_STEP)
    return float(np.abs(gap).max()) < MERGING + 2.0 * np.sqrt(short)


def along(system: Slice, lattice: Lattice, points: np.ndarray) -> np.ndarray:
    """``reached`` for the points (n, nq + k) of a curve, found by halving where it changes."""
    n = len(points)
    known: dict[int, bool] = {}

    def at(i: int) -> bool:
        if i not in known:
            known[i] = reached(system, lattice, points[i])
        return known[i]

    out = np.zeros(n, dtype=bool)
    marks = [*range(0, n, SAMPLE), n - 1] if n > 1 else [0]
    for low, high in zip(marks, marks[1:] or marks, strict=False):
        if at(low) == at(high):
            out[low : high + 1] = at(low)
            continue
        for i in range(low, high + 1):
            out[i] = at(i)
    return out
