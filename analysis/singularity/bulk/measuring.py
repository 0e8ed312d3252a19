"""``bulk_measures``: the measures of many postures, in machine code where it can be trusted.

Made once for a mechanism and outputs. Postures near which the elimination loses digits, singular
ones among them, go to LAPACK through ``measures_at``, which is the definition. So do all postures
of a mechanism whose samples do not show its generic rank. A posture's measures are the same bits
whatever its neighbours are.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from weakref import WeakKeyDictionary

import numpy as np

from closedchain.analysis.first_order import OPEN
from closedchain.analysis.singularity.bulk.plan import FirstOrderTape, Plan, planned, rows_of
from closedchain.analysis.singularity.maps.measures import measures_at
from closedchain.analysis.singularity.rank_loss import (
    ClosedMotions,
    condition,
    entry,
    sigma_direct,
    sigma_inverse,
)
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.tape.dense import over_triangle, triangle
from closedchain.closure.tape.expression import Graph
from closedchain.closure.tape.machine import Compiled, compiled
from closedchain.closure.tape.rates import physical_rates

PIVOT = 1e-5  # dimensionless: digits are lost in proportion to the smallest pivot
LARGE = 1e4  # of motions for unit input rates: they lose as many digits of the others
CHUNK = 1024  # postures at once

Found = dict[str, np.ndarray]


@dataclass(frozen=True, eq=False)
class BulkMeasures:
    """Machine code for the measures of a mechanism's closed postures.

    Attributes
    ----------
    outputs : tuple of str
        Of the task.
    """

    mechanism: Mechanism
    outputs: tuple[str, ...]

    @cached_property
    def plan(self) -> Plan | None:
        """What is eliminated; None where LAPACK does everything."""
        return planned(self.mechanism, self.outputs)

    def determinants(self, postures: np.ndarray) -> Found:
        """Residual and determinants (n,) of closed postures (n, nq), those that are defined.

        Raises
        ------
        ClosureError
            A posture that is not closed.
        """
        names = {"residual", "det_direct", "det_inverse"}
        return {k: v for k, v in self._all(postures, full=False).items() if k in names}

    def measures(self, postures: np.ndarray) -> Found:
        """All measures (n,) of closed postures (n, nq), as ``maps.measures.measures_at`` has them.

        Raises
        ------
        ClosureError
            A posture that is not closed.
        """
        return self._all(postures, full=True)

    def _all(self, postures: np.ndarray, full: bool) -> Found:
        postures = np.asarray(postures, dtype=np.float64)
        if self.plan is None or not len(postures):
            return measures_at(self.mechanism, postures, self.outputs)
        parts = [
            self._chunk(postures[begin : begin + CHUNK], full)
            for begin in range(0, len(postures), CHUNK)
        ]
        return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}

    def _chunk(self, postures: np.ndarray, full: bool) -> Found:
        code = self._first
        x = np.ascontiguousarray(postures.T)
        residual, least, large, *dets = code.run(x)
        found = {"residual": residual} | dict(zip(self._names, dets, strict=True))
        good = (residual <= OPEN) & (least > PIVOT) & (large < LARGE)
        if full:
            fine, more = self._motions(x)
            good &= fine
            found |= more
        doubtful = np.flatnonzero(~good)
        if doubtful.size:
            exact = measures_at(self.mechanism, postures[doubtful], self.outputs)
            for name, values in found.items():
                values[doubtful] = exact[name]
        return found

    @cached_property
    def _names(self) -> tuple[str, ...]:
        assert self.plan is not None
        flags = {"det_direct": self.plan.has_direct, "det_inverse": self.plan.has_inverse}
        return tuple(name for name, there in flags.items() if there)

    @cached_property
    def _first(self) -> Compiled:
        assert self.plan is not None
        tape = FirstOrderTape(self.plan, Graph())
        outputs = [tape.residual, *tape.guards, *(tape.determinants[n] for n in self._names)]
        return compiled(tape.graph.tape(outputs, self.mechanism.model.nq))

    # -- on the closed motions ---------------------------------------------------------------------

    @cached_property
    def _second(self) -> Compiled:
        assert self.plan is not None
        tape = FirstOrderTape(self.plan, Graph())
        g, k = tape.graph, tape.kinematics
        rates = physical_rates(k, tape.basis)
        upper = triangle(g, rates)
        size = g.constant(0.0)
        for row in upper:
            for x in row:
                size = size + x * x
        inputs = over_triangle(g, tape.inputs, upper)
        outputs = over_triangle(g, tape.outputs, upper)
        zero = g.constant(0.0)
        nv = self.mechanism.model.nv
        closures = [[row.get(v, zero) for v in range(nv)] for row in tape.entries]
        wanted = [size, *rows_of(inputs), *rows_of(outputs), *rows_of(closures)]
        return compiled(g.tape(wanted, self.mechanism.model.nq))

    def _motions(self, x: np.ndarray) -> tuple[np.ndarray, Found]:
        assert self.plan is not None
        generic, n, k = self.plan.generic, self.plan.motions, x.shape[1]
        size, *rest = self._second.run(x)
        matrix = np.array(rest).T
        a, d = len(self.mechanism.inputs) * n, len(self.outputs) * n
        v = ClosedMotions(
            np.empty((k, 0, n)),
            matrix[:, :a].reshape(k, len(self.mechanism.inputs), n),
            matrix[:, a : a + d].reshape(k, len(self.outputs), n),
        )
        closures = matrix[:, a + d :].reshape(k, self.mechanism.rows, self.mechanism.model.nv)
        good = size < LARGE**2
        v = ClosedMotions(
            v.motions,
            np.where(good[:, None, None], v.inputs, 0.0),
            np.where(good[:, None, None], v.outputs, 0.0),
        )
        s = np.linalg.svd(closures, compute_uv=False) if closures.shape[1] else np.zeros((k, 0))
        found = {
            "sigma_direct": sigma_direct(v, generic),
            "sigma_inverse": sigma_inverse(v, generic),
            "sigma_constraint": entry(s, len(self.plan.kept)),
            "condition": condition(v, generic),
        }
        good &= found["sigma_constraint"] > PIVOT
        return good, found


_MADE: WeakKeyDictionary[Mechanism, dict[tuple[str, ...], BulkMeasures]] = WeakKeyDictionary()


def bulk_measures(
    mechanism: Mechanism, outputs: str | tuple[str, ...] | list[str] | None = None
) -> BulkMeasures:
    """Machine code for the measures of a mechanism, made once; compiled when first used.

    Parameters
    ----------
    outputs : str, optional
        Such as "x y z rx rz"; those of the task by default.

    Raises
    ------
    ClosureError
        Unknown outputs, no task.
    """
    names = mechanism.outputs(outputs)
    known = _MADE.setdefault(mechanism, {})
    if names not in known:
        known[names] = BulkMeasures(mechanism, names)
    return known[names]
