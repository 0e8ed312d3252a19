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
from closedchain.analysis.singularity.bulk.machine import MeasuresCode
from closedchain.analysis.singularity.bulk.plan import Plan, planned
from closedchain.analysis.singularity.bulk.singular import Found, singular_values
from closedchain.analysis.singularity.maps.measures import measures_at
from closedchain.closure.mechanism import Mechanism

DETERMINANTS = ("residual", "det_direct", "det_inverse")
PIVOT = 1e-5  # dimensionless: digits are lost in proportion to the smallest pivot
LARGE = 1e4  # of motions for unit input rates: they lose as many digits of the others
CHUNK = 256  # postures at once: what is passed between the parts stays in the cache


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
        return {k: v for k, v in self._all(postures, full=False).items() if k in DETERMINANTS}

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
        x = np.ascontiguousarray(postures.T)
        numbers = (self._code.everything if full else self._code.determinants).run(x)
        names = [name for name in DETERMINANTS if name in numbers.begins]
        found = {name: numbers.one(name) for name in names}
        good = numbers.one("residual") <= OPEN
        good &= (numbers.one("least") > PIVOT) & (numbers.one("large") < LARGE)
        if full:
            singular = singular_values(self._code, numbers)
            found |= singular.found
            good &= singular.settled & (numbers.one("size") < LARGE**2)
        doubtful = np.flatnonzero(~good)
        if doubtful.size:
            exact = measures_at(self.mechanism, postures[doubtful], self.outputs)
            for name, values in found.items():
                values[doubtful] = exact[name]
        return found

    @cached_property
    def _code(self) -> MeasuresCode:
        assert self.plan is not None
        return MeasuresCode(self.plan)


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
