"""Which measures a map holds: those of the table, and functions of its user."""

from __future__ import annotations

import pickle
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from closedchain.analysis.singularity.bulk.measuring import bulk_measures
from closedchain.analysis.singularity.maps.measures import LONG_NAMES, oriented
from closedchain.closure.chart import Chart
from closedchain.closure.mechanism import Mechanism
from closedchain.urdf.errors import ClosureError, known_names

Function = Callable[[Mechanism, np.ndarray], np.ndarray]
"""From a mechanism and closed postures (n, nq) to a number for each, (n,)."""
Functions = Mapping[str, Function]
Wanted = Functions | Sequence[str | Functions] | None

OWN = ("status", "q")
"""Names of arrays of a map that are no measures."""


@dataclass(frozen=True, eq=False)
class Choice:
    """Measures of a map.

    Attributes
    ----------
    outputs : tuple of str
        Of the task.
    names : tuple of str
        Measures of the table, in its order.
    functions : mapping of name to function
        Measures of the user.
    """

    outputs: tuple[str, ...]
    names: tuple[str, ...]
    functions: Functions = field(default_factory=dict)

    @property
    def every(self) -> tuple[str, ...]:
        """Names of all measures."""
        return (*self.names, *self.functions)

    def at(self, chart: Chart, q: np.ndarray) -> dict[str, np.ndarray]:
        """Measures (n,) of closed postures (n, nq), by name.

        Raises
        ------
        ClosureError
            A function of the user fails, or does not give a number for each posture.
        """
        mechanism = chart.mechanism
        found: dict[str, np.ndarray] = {}
        if self.names:
            table = oriented(chart, bulk_measures(mechanism, self.outputs).measures(q))
            found = {name: table[name] for name in self.names}
        for name, function in self.functions.items():
            values = np.asarray(function(mechanism, q.copy()), dtype=float)
            if values.shape != (len(q),):
                raise ClosureError(
                    f"measure {name!r} must give one number for each posture: for postures of the "
                    f"shape {q.shape} the shape {(len(q),)}, got {values.shape}"
                )
            found[name] = values
        return found


def chosen(
    mechanism: Mechanism, outputs: tuple[str, ...], taken: Sequence[str], wanted: Wanted
) -> Choice:
    """Check a choice of measures.

    ``wanted``: None for all of the table; a mapping of name to function for these besides; or a
    sequence of names of the table and such mappings, for nothing else. ``taken`` are the names of
    coordinates.

    Raises
    ------
    ClosureError
        Unknown or repeated names, names that are taken, functions that are none.
    """
    nothing = np.zeros((0, mechanism.model.nq))
    table = tuple(bulk_measures(mechanism, outputs).measures(nothing))
    table = tuple(name for name in LONG_NAMES if name in table)
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
                _check(str(name), function, (*table, *OWN, *taken, *functions))
                functions[str(name)] = function
        elif part not in table:
            raise ClosureError(known_names(str(part), f"measure of {mechanism.name!r}", table))
        else:
            names.append(part)
    return Choice(outputs, tuple(name for name in table if name in names), functions)


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


def described(function: Function) -> str:
    """What a function says of itself: the first line of its docstring, or its name."""
    lines = (function.__doc__ or "").strip().splitlines()
    return lines[0] if lines else identity(function)


def identity(function: Function) -> str:
    """Module and name of a function, or of the class of an object that is called."""
    named = function if hasattr(function, "__qualname__") else type(function)
    return f"{named.__module__}.{named.__qualname__}"
