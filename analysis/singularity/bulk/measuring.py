"""``bulk_measures``: the measures of many postures, in machine code where it can be trusted.

Made once for a mechanism and outputs. Postures near which the elimination loses digits, singular
ones among them, go to LAPACK through ``measures_at``, which is the definition. So do all postures
of a mechanism whose samples do not show its generic rank. A posture's measures are the same bits
whatever its neighbours are.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from weakref import WeakKeyDictionary

import numpy as np

from closedchain.analysis.first_order import OPEN
from closedchain.analysis.singularity.bulk.machine import MeasuresCode, Numbers
from closedchain.analysis.singularity.bulk.plan import Plan, planned
from closedchain.analysis.singularity.bulk.singular import Found, Workspace
from closedchain.analysis.singularity.classify import SINGULAR
from closedchain.analysis.singularity.maps.measures import measures_at
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.tape.verified import POSTURES, agree, verify

DETERMINANTS = ("residual", "det_direct", "det_inverse")
PIVOT = 1e-5  # dimensionless: digits are lost in proportion to the smallest pivot
LARGE = 1e4  # of motions for unit input rates: they lose as many digits of the others
LEFT_OUT = 1e-10  # rows that do not depend on the kept ones here: the rank is not the generic one

CHUNK = 504
"""Postures at once: what is passed between the parts stays in the cache, and rows do not begin at
multiples of a power of two, which would share a few places of it."""


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
    _spare: list[Workspace] = field(init=False, default_factory=list, repr=False)
    _verified: set[bool] = field(init=False, default_factory=set, repr=False)

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
        if full not in self._verified:
            self._verify(self.plan, full)
        parts = []
        for begin in range(0, len(postures), CHUNK):
            part = postures[begin : begin + CHUNK]
            found, good = self._in_lanes(part, full)
            doubtful = np.flatnonzero(~good)
            if doubtful.size:
                exact = measures_at(self.mechanism, part[doubtful], self.outputs)
                for name, values in found.items():
                    values[doubtful] = exact[name]
            parts.append(found)
        return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}

    def _in_lanes(self, postures: np.ndarray, full: bool) -> tuple[Found, np.ndarray]:
        """Measures by machine code, and which postures' can be trusted."""
        if not full:
            return determinants(self._code.determinants.run(np.ascontiguousarray(postures.T)))
        memory = self._borrowed()
        try:
            return measured(memory, postures)
        finally:
            self._spare.append(memory)

    def _verify(self, plan: Plan, full: bool) -> None:
        """Compare with Pinocchio and LAPACK at two postures.

        Raises
        ------
        TapeError
            They differ.
        """
        verify(self.mechanism, self.outputs)
        postures = plan.samples[-POSTURES:]
        found, good = self._in_lanes(postures, full)
        exact = measures_at(self.mechanism, postures[good], self.outputs)
        for name, values in found.items():
            pair = [values[good], exact[name]]
            if name == "condition":  # of rounding where no output moves
                moves = exact["sigma_inverse"] > SINGULAR
                pair = [1.0 / x[moves] for x in pair]
            agree(f"{name} of {self.mechanism.name!r}", *pair)
        self._verified.add(full)

    @cached_property
    def _code(self) -> MeasuresCode:
        assert self.plan is not None
        return MeasuresCode(self.plan)

    def _borrowed(self) -> Workspace:
        """Memory that no other call is using."""
        try:
            return self._spare.pop()
        except IndexError:
            return Workspace.of(self._code, CHUNK)


def determinants(numbers: Numbers) -> tuple[Found, np.ndarray]:
    """Residual and determinants, and which postures' can be trusted."""
    names = [name for name in DETERMINANTS if name in numbers.begins]
    found = {name: numbers.one(name).copy() for name in names}
    good = numbers.one("residual") <= OPEN
    good &= (numbers.one("least") > PIVOT) & (numbers.one("large") < LARGE)
    good &= numbers.one("left_out") < LEFT_OUT
    return found, good


def measured(memory: Workspace, postures: np.ndarray) -> tuple[Found, np.ndarray]:
    """All measures, and which postures' can be trusted."""
    at = memory.evaluated(postures)
    found, good = determinants(at.numbers)
    singular = at.singular()
    good &= singular.settled & (at.numbers.one("size") < LARGE**2)
    return found | singular.found, good


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
