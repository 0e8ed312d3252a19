"""The table of measures: what a map can show at a posture, one entry for each.

An entry looks at many postures at once. Those of the package share one evaluation in machine code;
a further measure is one entry more, or a plain function of (mechanism, postures).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType

import numpy as np

from closedchain.analysis.singularity.bulk.measuring import DETERMINANTS, bulk_measures
from closedchain.analysis.singularity.maps.measures import LONG_NAMES
from closedchain.closure.mechanism import Mechanism
from closedchain.urdf.errors import ClosureError, known_names

Values = np.ndarray | None
Function = Callable[[Mechanism, np.ndarray], np.ndarray]


@dataclass(frozen=True, eq=False)
class Postures:
    """Closed postures (n, nq) of a mechanism, with what entries share.

    Attributes
    ----------
    outputs : tuple of str
        Of the task.
    """

    mechanism: Mechanism
    postures: np.ndarray
    outputs: tuple[str, ...]

    @cached_property
    def all(self) -> dict[str, np.ndarray]:
        """All measures of ``bulk_measures``."""
        return bulk_measures(self.mechanism, self.outputs).measures(self.postures)

    @cached_property
    def determinants(self) -> dict[str, np.ndarray]:
        """Residual and determinants alone, which cost a small part of all."""
        return bulk_measures(self.mechanism, self.outputs).determinants(self.postures)

    def shared(self, name: str) -> Values:
        """Measure (n,) that ``bulk_measures`` has; None where it is not defined."""
        cheap = name in DETERMINANTS and "all" not in self.__dict__
        return (self.determinants if cheap else self.all).get(name)


@dataclass(frozen=True)
class Measure:
    """A measure of postures: one entry of the table.

    Attributes
    ----------
    name : str
        Of the variable in a map.
    long_name : str
        For legends and files.
    unit : str
        "" for a number without unit.
    evaluate : callable
        From ``Postures`` to values (n,); None where the mechanism has no such measure.
    """

    name: str
    long_name: str
    unit: str
    evaluate: Callable[[Postures], Values]


def _shared(name: str, unit: str = "") -> Measure:
    return Measure(name, LONG_NAMES[name], unit, lambda at: at.shared(name))


_ENTRIES = (
    _shared("sigma_direct"),
    _shared("sigma_inverse"),
    _shared("sigma_constraint"),
    _shared("condition"),
    _shared("det_direct"),
    _shared("det_inverse"),
    _shared("residual", "m or rad"),
)

MEASURES: Mapping[str, Measure] = MappingProxyType({entry.name: entry for entry in _ENTRIES})
"""Measures by name."""


def from_function(function: Function, name: str | None = None) -> Measure:
    """Entry for a function of (mechanism, postures (n, nq)) that returns values (n,).

    Its unit is its attribute ``unit``, if it has one.
    """
    called = name or function.__name__
    about = (function.__doc__ or called).strip().splitlines()[0].rstrip(".")

    def evaluate(at: Postures) -> Values:
        values = np.asarray(function(at.mechanism, at.postures), dtype=float)
        if values.shape != (len(at.postures),):
            raise ClosureError(
                f"measure {called!r} must give one number for each of {len(at.postures)} "
                f"postures, got an array of shape {values.shape}"
            )
        return values

    return Measure(called, about, str(getattr(function, "unit", "")), evaluate)


def chosen(measures: Iterable[str | Measure | Function]) -> tuple[Measure, ...]:
    """Entries for names of the table, entries and functions, in this order.

    Raises
    ------
    ClosureError
        An unknown name, or a name twice.
    """
    found = []
    for one in measures:
        if isinstance(one, str) and one not in MEASURES:
            raise ClosureError(known_names(one, "measure", MEASURES))
        if isinstance(one, str):
            found.append(MEASURES[one])
        else:
            found.append(one if isinstance(one, Measure) else from_function(one))
    names = [entry.name for entry in found]
    if len(set(names)) < len(names):
        raise ClosureError(f"measures of the same name: {', '.join(names)}")
    return tuple(found)


def evaluated(at: Postures, measures: Iterable[Measure]) -> dict[str, np.ndarray]:
    """Values (n,) of measures by name; those that the mechanism does not have are left out."""
    entries = tuple(measures)
    # determinants come from the evaluation of all where there is one
    order = sorted(entries, key=lambda entry: entry.name in DETERMINANTS)
    values = {entry.name: entry.evaluate(at) for entry in order}
    return {e.name: v for e in entries if (v := values[e.name]) is not None}
