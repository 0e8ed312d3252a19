"""``Batch``: the compiled kernel of a mechanism in a chart, with checked arguments."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from closedchain.closure.batch.tables import Tables, Tip, no_tip, tables_of, tip_of
from closedchain.closure.generic import sampled_rank
from closedchain.closure.mechanism import Mechanism
from closedchain.urdf.errors import ClosureError

if TYPE_CHECKING:
    from closedchain.closure.chart import Chart


@dataclass(frozen=True, eq=False)
class Batch:
    """Bulk kinematics of a mechanism: thousands of postures a call, no Python loop over them.

    All methods release the GIL, keep their scratch memory to the call and write to nothing but
    their results, so that threads may share a batch. A result depends on its own posture (or
    block of cells) only, never on the other rows of a call or on threads. Nothing of size
    (n, rows, nv) is stored but by ``jacobians``, which is for small use.

    The first call in a process loads the kernels from the disk cache, or compiles them (tens of
    seconds, once a machine): ``compiled`` says which, so that a caller may tell its user.

    Attributes
    ----------
    mechanism : Mechanism
    chart : Chart, optional
        Prescribed coordinates, for ``solve``, ``spread`` and ``search``.
    outputs : tuple of str, str or None
        Outputs of the task, for determinants and measures; those of the description by default.
    rank : int, optional
        Generic rank r of the constraint Jacobian; found from postures around home by default.
    """

    mechanism: Mechanism
    chart: Chart | None = None
    outputs: tuple[str, ...] | str | None = None
    rank: int | None = field(default=None)

    def compiled(self) -> bool:
        """Whether the kernels are loaded, or lie in the disk cache: else a call compiles."""
        from closedchain.closure.batch.compiled import is_ready
        from closedchain.closure.batch.entries import ENTRIES

        return all(is_ready(entry) for entry in ENTRIES)

    def warm(self) -> None:
        """Load or compile every kernel now, on no posture."""
        import closedchain.closure.batch.entries as kernels
        from closedchain.closure.batch.problems import no_equations

        e = no_equations() if self.chart is None else self._equations
        kernels.warm(self._tables, no_tip(), self._problem, e)

    # -- evaluation ------------------------------------------------------------------------------

    def residuals(self, Q: ArrayLike) -> np.ndarray:
        """Closure residuals (n, rows) [m, rad] at postures (n, nq)."""
        values, _ = self._evaluate(Q, jacobian=False)
        return values

    def jacobians(self, Q: ArrayLike) -> np.ndarray:
        """Constraint Jacobians (n, rows, nv) [m, rad] at postures (n, nq)."""
        _, matrices = self._evaluate(Q, jacobian=True)
        return matrices

    def determinants(self, Q: ArrayLike) -> dict[str, np.ndarray]:
        """Residual and determinants at postures (n, nq).

        Returns
        -------
        dict
            "residual" (n,): largest closure row [m, rad]; "det_direct" and "det_inverse" (n,),
            where K_p and [K; J] are square, as in ``analysis.singularity.classify.determinants``.
        """
        return self._measure(Q, full=False)

    def measures(self, Q: ArrayLike) -> dict[str, np.ndarray]:
        """Every measure of postures (n, nq); those of ``determinants`` and besides, each (n,).

        "sigma_direct", "sigma_inverse", "sigma_constraint": singular values of the dimensionless
        K_p, [K; J], K that vanish at the three kinds; "condition": ratio of the largest to the
        smallest singular value of the dimensionless twist map, infinite where there is none or it
        is singular. A mechanism without a task has no "sigma_inverse", "det_inverse" and
        "condition".
        """
        return self._measure(Q, full=True)

    # -- positions -------------------------------------------------------------------------------

    def solve(self, Q: ArrayLike, values: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        """Follow each posture's branch from where it is to other coordinates of the chart.

        Joints and the tip's origin move on straight lines, its rotation about a fixed axis, from
        what they are at the posture (held coordinates as the chart says).

        Parameters
        ----------
        Q : (n, nq) array
            Closed postures.
        values : (n, k) array
            Wanted values of ``chart.names``.

        Returns
        -------
        Q : (n, nq) array
            Closed to 1e-12 where the status is 0; else the last posture on the way.
        status : (n,) int8 array
            0, or the index of the refusal in ``REFUSALS``.
        """
        from closedchain.closure.batch.spread import solve

        self._charted()
        found = self._postures(Q).copy()
        targets = self.targets(values)
        if len(targets) != len(found):
            raise ClosureError(f"got {len(found)} postures and {len(targets)} rows of coordinates")
        status = np.zeros(len(found), dtype=np.int8)
        solve(self._tables, self._goal_tip, self._equations, found, targets, status)
        return found, status

    def spread(
        self,
        values: ArrayLike,
        status: np.ndarray,
        q: np.ndarray,
        seeds: ArrayLike,
        label: int = 0,
        done: np.ndarray | None = None,
    ) -> np.ndarray:
        """Reach the unseen cells of a block by continuation from its seeds, breadth first.

        Every cell of status ``UNSEEN`` may be reached, from its neighbours along the axes; the
        others stay as they are, and only seeds lead on from among them. A cell that is reached
        gets the status ``label``; one reached beyond its joint limits becomes ``JOINT_LIMIT``
        where the label is ``OK`` (else it stays unseen), and does not lead on. The order is
        fixed: seeds as given, neighbours axis by axis, down before up.

        Parameters
        ----------
        values : (*shape, k) array
            Coordinates of the cells; one to six axes.
        status : (*shape) int8 array
            Changed in place.
        q : (*shape, nq) array
            Posture of every seed; those of reached cells are written in place.
        seeds : (s,) int array
            Flat indices (C order) of cells whose ``q`` is closed at their coordinates.
        label : int
            Status of reached cells. Seeds get it as well.
        done : (1,) int64 array, optional
            Cells reached so far, added to while the call runs: for progress bars.

        Returns
        -------
        ends : (*shape) int8 array
            For each cell that stays unseen how the ways into it ended: ``UNTRIED``, ``FOLD``,
            ``STUCK`` or ``MIRRORED``; ``UNTRIED`` for the others.
        """
        from closedchain.closure.batch.spread import spread

        chart = self._charted()
        shape = status.shape
        nq, k = self.mechanism.model.nq, len(chart.names)
        cells = np.asarray(values, dtype=float)
        if cells.shape != (*shape, k) or q.shape != (*shape, nq):
            raise ClosureError(
                f"a block of cells {shape} needs values {(*shape, k)} and q {(*shape, nq)}, got "
                f"{cells.shape} and {q.shape}"
            )
        for name, array, kind in (("status", status, np.int8), ("q", q, np.float64)):
            if array.dtype != kind or not (array.flags.c_contiguous and array.flags.writeable):
                raise ClosureError(
                    f"{name} must be a writeable array in C order of {np.dtype(kind)}"
                )
        first = np.atleast_1d(np.asarray(seeds, dtype=np.int64))
        if first.size and not 0 <= first.min() <= first.max() < status.size:
            raise ClosureError(f"seeds must be flat indices of cells, 0 to {status.size - 1}")
        targets = self.targets(cells.reshape(-1, k))
        ends = np.zeros(status.size, dtype=np.int8)
        spread(
            self._tables,
            self._goal_tip,
            self._equations,
            np.array(shape, dtype=np.int64),
            targets,
            status.reshape(-1),
            q.reshape(-1, nq),
            first,
            int(label),
            ends,
            np.zeros(1, dtype=np.int64) if done is None else done,
        )
        return ends.reshape(shape)

    def search(self, values: ArrayLike, starts: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        """Look for a closed posture at prescribed coordinates, from any start.

        Parameters
        ----------
        values : (n, k) array
            Wanted values of ``chart.names``.
        starts : (s, nq) array, or (n, s, nq) array
            Starts that each cell tries in order until one closes within joint limits and without
            a mirrored joint; see ``random_starts``.

        Returns
        -------
        Q : (n, nq) array
            The posture where the verdict is ``CLOSED``; else the end with the smallest residual.
        verdict : (n,) int8 array
            ``CLOSED``, ``OPEN``, ``UNDECIDED`` or ``BEYOND``.
        """
        from closedchain.closure.batch.search import search

        self._charted()
        targets = self.targets(values)
        nq = self.mechanism.model.nq
        begin = np.asarray(starts, dtype=float)
        shared = begin.ndim == 2
        if begin.shape[-1] != nq or begin.ndim not in (2, 3):
            raise ClosureError(f"starts must be (s, {nq}) or (n, s, {nq}), got {begin.shape}")
        if not shared and len(begin) != len(targets):
            raise ClosureError(f"got starts for {len(begin)} cells and {len(targets)} coordinates")
        flat = self._postures(begin.reshape(-1, nq))
        found = np.zeros((len(targets), nq))
        verdicts = np.zeros(len(targets), dtype=np.int8)
        search(
            self._tables,
            self._goal_tip,
            self._equations,
            flat,
            shared,
            targets,
            found,
            verdicts,
        )
        return found, verdicts

    def random_starts(self, count: int, seed: int = 0) -> np.ndarray:
        """Postures (count, nq) far around home: any angle, lengths within about ``length``."""
        m = self.mechanism
        rng = np.random.default_rng(seed)
        v = rng.uniform(-np.pi, np.pi, (count, m.model.nv))
        slides = m.translational
        v[:, slides] = m.column_scale[slides] * rng.standard_normal((count, int(slides.sum())))
        found = [pin.integrate(m.model, m.home, one) for one in v]
        return np.array(found).reshape(count, m.model.nq)

    def targets(self, values: ArrayLike) -> np.ndarray:
        """What coordinates (n, k) prescribe, (n, joints + 12): pins, tip's rotation, tip's origin.

        Pins in m or rad; the rotation row by row; the origin divided by ``mechanism.length``.
        """
        chart = self._charted()
        rows = np.asarray(values, dtype=float)
        if rows.ndim != 2 or rows.shape[1] != len(chart.names):
            raise ClosureError(
                f"coordinates must be (n, {len(chart.names)}) ({' '.join(chart.names)}), got "
                f"{rows.shape}"
            )
        if not np.isfinite(rows).all():
            raise ClosureError("coordinates must be finite")
        pins, turns, places = chart.prescribed(rows)
        flat = turns.reshape(len(rows), 9)
        return np.ascontiguousarray(np.hstack([pins, flat, places / self.mechanism.length]))

    # -- tables ----------------------------------------------------------------------------------

    def __getstate__(self) -> dict[str, Any]:
        """Pickle the fields only; tables are rebuilt."""
        return {name: getattr(self, name) for name in self.__dataclass_fields__}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Restore the fields."""
        for name, value in state.items():
            object.__setattr__(self, name, value)

    @cached_property
    def _tables(self) -> Tables:
        return tables_of(self.mechanism)

    @cached_property
    def _outputs(self) -> tuple[str, ...]:
        if self.outputs is None and self.mechanism.task is None:
            return ()
        return self.mechanism.outputs(self.outputs)

    @cached_property
    def _rank(self) -> int:
        return sampled_rank(self.mechanism).rank.value if self.rank is None else self.rank

    @cached_property
    def _tip(self) -> Tip:
        task = self.mechanism.task
        return no_tip() if task is None else tip_of(self.mechanism, task.tip)

    @cached_property
    def _goal_tip(self) -> Tip:
        return self._tip if self._charted().outputs else no_tip()

    @cached_property
    def _problem(self) -> Any:
        from closedchain.closure.batch.problems import problem

        return problem(self.mechanism, self._rank, self._outputs)

    @cached_property
    def _equations(self) -> Any:
        from closedchain.closure.batch.problems import equations

        return equations(self._charted())

    def _charted(self) -> Chart:
        if self.chart is None:
            raise ClosureError("this batch has no chart: give chart=chart_of(mechanism, names)")
        return self.chart

    def _postures(self, Q: ArrayLike) -> np.ndarray:
        nq = self.mechanism.model.nq
        postures = np.ascontiguousarray(Q, dtype=float)
        if postures.ndim != 2 or postures.shape[1] != nq:
            raise ClosureError(f"postures must be (n, {nq}), got {postures.shape}")
        if not np.isfinite(postures).all():
            bad = np.flatnonzero(~np.isfinite(postures).all(axis=1))
            raise ClosureError(f"postures {bad[:5].tolist()} have entries that are not finite")
        if not postures.flags.writeable:  # the kernels are compiled for arrays that can be written
            postures = postures.copy()
        return postures

    def _evaluate(self, Q: ArrayLike, *, jacobian: bool) -> tuple[np.ndarray, np.ndarray]:
        from closedchain.closure.batch.evaluate import evaluate

        postures, m = self._postures(Q), self.mechanism
        values = np.zeros((len(postures), m.rows))
        matrices = np.zeros((len(postures) if jacobian else 0, m.rows, m.model.nv))
        column = np.arange(m.model.nv)
        evaluate(self._tables, column, postures, jacobian, values, matrices)
        return values, matrices

    def _measure(self, Q: ArrayLike, *, full: bool) -> dict[str, np.ndarray]:
        from closedchain.closure.batch.measures import NAMES, measure

        postures = self._postures(Q)
        out = np.full((len(postures), len(NAMES)), np.nan)
        p, d, m = self._problem, len(self._outputs), self.mechanism
        measure(self._tables, self._tip, p, postures, full, out)
        absent = set() if full else set(NAMES[3:])
        if p.rank != p.passive:
            absent.add("det_direct")
        if p.rank + d != m.model.nv:
            absent.add("det_inverse")
        if not d:
            absent |= {"det_inverse", "sigma_inverse", "condition"}
        return {n: out[:, i].copy() for i, n in enumerate(NAMES) if n not in absent}
