"""Which measures a map holds: entries of the table, and functions of its user."""

from __future__ import annotations

import hashlib
import pickle
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from types import FunctionType

import numpy as np

from closedchain.analysis.forces.tip_measures import NAMED
from closedchain.analysis.singularity.maps.measures import oriented
from closedchain.analysis.singularity.measures_table import (
    MEASURES,
    Function,
    Measure,
    Postures,
    evaluated,
    from_function,
)
from closedchain.closure.chart import Chart
from closedchain.closure.mechanism import Mechanism
from closedchain.urdf.errors import ClosureError, known_names

Functions = Mapping[str, Function]
Wanted = Functions | Sequence[str | Functions] | None

OWN = ("status", "joined", "q")
"""Names of arrays of a map that are no measures."""

_SIGNED = ("det_direct", "det_inverse")  # each tells the sign of the other


@dataclass(frozen=True, eq=False)
class Choice:
    """Measures of a map. Pickles where its functions do.

    Attributes
    ----------
    outputs : tuple of str
        Of the task.
    names : tuple of str
        Measures of the table, in its order.
    functions : mapping of name to function
        Measures of the user.
    whole : bool
        Whether ``names`` are all that the mechanism has.
    """

    outputs: tuple[str, ...]
    names: tuple[str, ...]
    functions: Functions = field(default_factory=dict)
    whole: bool = True

    @property
    def every(self) -> tuple[str, ...]:
        """Names of all measures."""
        return (*self.names, *self.functions)

    @cached_property
    def entries(self) -> Mapping[str, Measure]:
        """Entries by name; both determinants where either is wanted."""
        signed = _SIGNED if set(self.names) & set(_SIGNED) else ()
        entries = {name: MEASURES[name] for name in (*self.names, *signed)}
        return entries | {name: from_function(f, name) for name, f in self.functions.items()}

    def at(self, chart: Chart, q: np.ndarray) -> dict[str, np.ndarray]:
        """Measures (n,) of closed postures (n, nq), by name.

        Raises
        ------
        ClosureError
            A function of the user does not give a number for each posture.
        """
        found = evaluated(Postures(chart.mechanism, q, self.outputs), self.entries.values())
        found = oriented(chart, found)
        return {name: found[name] for name in self.every}

    def __getstate__(self) -> dict[str, object]:
        """Pickle the fields, not the entries made from them."""
        return {name: getattr(self, name) for name in self.__dataclass_fields__}


def chosen(
    mechanism: Mechanism, outputs: tuple[str, ...], taken: Sequence[str], wanted: Wanted
) -> Choice:
    """Check a choice of measures.

    ``wanted``: None for all of the table; a mapping of name to function for these besides; or a
    sequence of names of the table or of ``forces.tip_measures`` and such mappings, for nothing
    else. ``taken`` are the names of
    coordinates.

    Raises
    ------
    ClosureError
        Unknown names, names that are taken, functions that are none.
    """
    nothing = Postures(mechanism, np.zeros((0, mechanism.model.nq)), outputs)
    table = tuple(evaluated(nothing, MEASURES.values()))
    parts: list[str | Functions]
    if wanted is None or isinstance(wanted, Mapping):
        parts = [*table, wanted or {}]
    else:
        parts = [wanted] if isinstance(wanted, str) else list(wanted)
    names: list[str] = []
    functions: dict[str, Function] = {}
    for part in parts:
        if isinstance(part, Mapping):
            for name, function in part.items():
                _check(str(name), function, (*MEASURES, *OWN, *taken, *functions))
                functions[str(name)] = function
        elif part in table:
            names.append(part)
        elif part in NAMED:
            _check(part, NAMED[part], (*functions, *taken))
            functions[part] = NAMED[part]
        else:
            every = (*table, *NAMED)
            raise ClosureError(known_names(str(part), f"measure of {mechanism.name!r}", every))
    kept = tuple(name for name in table if name in names)
    return Choice(outputs, kept, functions, whole=kept == table)


def _check(name: str, function: object, taken: tuple[str, ...]) -> None:
    if name in taken:
        raise ClosureError(f"measure {name!r} needs another name: this one is taken")
    if not callable(function):
        raise ClosureError(
            f"measure {name!r} must be a function of a mechanism and postures (n, nq), got "
            f"{function!r}"
        )


def check_portable(functions: Functions) -> None:
    """Refuse functions that other processes, or a run that goes on with this one, cannot import.

    Raises
    ------
    ClosureError
        A function that does not pickle.
    """
    for name, function in functions.items():
        try:
            pickle.dumps(function)
        except (pickle.PicklingError, AttributeError, TypeError) as error:
            raise ClosureError(
                f"measure {name!r} cannot be pickled ({error}): a map that is saved, or made by "
                "Dask, needs functions that can be imported, such as those at the top of a module"
            ) from None


def identity(function: Function) -> str:
    """Module and name of a function; of any other object the class, and what it holds.

    A method, or an object such as a measure with stiffnesses of drives, is another one with other
    numbers in it.
    """
    named = function if isinstance(function, FunctionType) else type(function)
    name = f"{named.__module__}.{named.__qualname__}"
    if isinstance(function, FunctionType):
        return name
    held = hashlib.sha256(pickle.dumps(function, protocol=4)).hexdigest()
    return f"{name} {held[:16]}"
