"""Cubes between planes that lie askew to the values of a lattice over three coordinates."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from closedchain.analysis.singularity.sets.lattice import Lattice

SHARES = (0.31, 0.54, 0.79)
"""Where, between two values of the lattice, the planes lie: each axis has its own share, so that
the sets of symmetric mechanisms do not run along edges and corners."""
MARGINS = (1e-3, 2e-3, 3.3e-3)  # cells: from the ends of a range to the outermost planes

Edge = tuple[int, int, int, int]
"""Lower corner, and axis along which it runs."""
Face = tuple[int, int, int, int]
"""Lower corner, and axis across it."""
Cube = tuple[int, int, int]


@dataclass(frozen=True, eq=False)
class Cubes:
    """Planes across each axis of a lattice, between which the cubes lie."""

    planes: tuple[np.ndarray, ...]
    cell: np.ndarray

    @classmethod
    def of(cls, lattice: Lattice) -> Cubes:
        """Planes between the values of a lattice over three coordinates."""
        planes = []
        for i, values in enumerate(lattice.values):
            inner = values[:-1] + SHARES[i] * np.diff(values)
            margin = MARGINS[i] * lattice.cell[i]
            ends = values[0] + margin, values[-1] - margin
            planes.append(np.concatenate([ends[:1], inner, ends[1:]]))
        return cls(tuple(planes), lattice.cell)

    def holding(self, place: np.ndarray) -> Cube:
        """The cube around a place (3,)."""
        at = [int(np.searchsorted(p, x)) - 1 for p, x in zip(self.planes, place, strict=True)]
        i, j, k = (min(max(a, 0), len(p) - 2) for a, p in zip(at, self.planes, strict=True))
        return i, j, k

    def edges_of(self, cube: Cube) -> list[Edge]:
        """The twelve edges of a cube."""
        found: list[Edge] = []
        for axis in range(3):
            for corner in np.ndindex(2, 2, 2):
                if not corner[axis]:
                    i, j, k = (a + b for a, b in zip(cube, corner, strict=True))
                    found.append((i, j, k, axis))
        return found

    def faces_at(self, edge: Edge) -> list[tuple[Face, int, int]]:
        """Faces that meet at an edge, with the axis into each, and its sense."""
        corner, axis = edge[:3], edge[3]
        found = []
        for into in range(3):
            if into == axis:
                continue
            across = 3 - axis - into
            for sense in (1, -1):
                lower = list(corner)
                lower[into] -= sense < 0
                if 0 <= lower[into] < len(self.planes[into]) - 1:
                    found.append(((lower[0], lower[1], lower[2], across), into, sense))
        return found

    def cubes_at(self, face: Face) -> list[Cube]:
        """The one or two cubes that a face belongs to."""
        across, found = face[3], []
        for shift in (0, -1):
            lower = list(face[:3])
            lower[across] += shift
            if 0 <= lower[across] < len(self.planes[across]) - 1:
                found.append((lower[0], lower[1], lower[2]))
        return found

    def ends_of(self, edge: Edge) -> tuple[float, float]:
        """Values between which an edge runs, along its axis."""
        planes, i = self.planes[edge[3]], edge[edge[3]]
        return float(planes[i]), float(planes[i + 1])

    def along(self, corner: Sequence[int], axis: int, *, into: int, far: bool) -> Edge:
        """Edge of a face along one axis, at the near or the far end of another one."""
        at = list(corner)
        at[into] += far
        return at[0], at[1], at[2], axis
