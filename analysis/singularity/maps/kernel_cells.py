"""Work on a block of cells by the compiled kernel of ``closure.batch``."""

from __future__ import annotations

import numpy as np

from closedchain.analysis.singularity.maps.cells import ReferenceCells, neighbours
from closedchain.analysis.singularity.maps.measures import oriented
from closedchain.closure.batch import CLOSED, FOLD, STUCK, Batch
from closedchain.closure.chart import Chart


class KernelCells:
    """Cells in bulk; threads may share them."""

    def __init__(self, chart: Chart, outputs: tuple[str, ...], *, explain: bool = True) -> None:
        """Prepare for a chart; ``outputs`` are those of the measures.

        Without ``explain`` ways that seem to end for no reason are not looked into.
        """
        self.explain = explain
        self.chart = chart
        self.batch = Batch(chart.mechanism, chart, outputs or None)
        self.reference = ReferenceCells(chart, outputs)

    def compiled(self) -> bool:
        """Whether the kernels that every map needs lie ready."""
        from closedchain.closure.batch.compiled import is_ready
        from closedchain.closure.batch.measures import measure
        from closedchain.closure.batch.spread import spread

        return is_ready(measure) and is_ready(spread)

    def spread(
        self,
        values: np.ndarray,
        status: np.ndarray,
        q: np.ndarray,
        seeds: np.ndarray,
        label: int,
        done: np.ndarray,
    ) -> np.ndarray:
        """Breadth first, in the kernel; ways that seem to end for no reason are looked into."""
        ends = self.batch.spread(values, status, q, seeds, label, done)
        if not self.explain:
            return ends
        for cell in map(tuple, np.argwhere(ends == STUCK)):
            solved = [n for n in neighbours(cell, status.shape) if status[n] == label]
            if any(self.reference.ends_at_fold(q[n], values[n], values[cell]) for n in solved):
                ends[cell] = FOLD
        return ends

    def search(self, values: np.ndarray, starts: np.ndarray) -> np.ndarray | None:
        """Descend from each start, in the kernel."""
        found, verdict = self.batch.search(values[None], starts)
        return found[0] if verdict[0] == CLOSED else None

    def determinants(self, q: np.ndarray) -> dict[str, np.ndarray]:
        """Determinants and the residual alone of postures (n, nq), in the kernel."""
        return oriented(self.chart, self.batch.determinants(q))

    def measures(self, q: np.ndarray) -> dict[str, np.ndarray]:
        """Singular values and determinants, in the kernel."""
        return oriented(self.chart, self.batch.measures(q))
