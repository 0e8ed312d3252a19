"""Checks of numbers that a caller gives: single ones, vectors, tables, ranges and counts."""

from __future__ import annotations

import reprlib
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from closedchain.urdf.errors import ClosureError, known_names

FLOAT = np.dtype(float)
LARGEST_NUMBER = 1e6  # metres or radians: beyond it rounding alone breaks the closure tolerance
LARGEST_SQUARE = LARGEST_NUMBER**2


def real_array(values: ArrayLike, what: str, wanted: str = "numbers") -> np.ndarray:
    """Array of real numbers, of any shape, finite or not.

    Raises ``ClosureError``, which says that ``what`` must be ``wanted``.
    """
    try:
        raw = np.asarray(values)
        if raw.dtype.kind not in "biufO":  # text and complex numbers would be cast silently
            raise TypeError
        return np.array(raw, dtype=float)
    except (TypeError, ValueError):
        raise ClosureError(f"{what} must be {wanted}, got {reprlib.repr(values)}") from None


def finite_number(value: Any, what: str, unit: str) -> float:
    """A finite real number, at most ``LARGEST_NUMBER`` in size. Raises ``ClosureError``."""
    number = np.asarray(value)
    if number.ndim or number.dtype.kind not in "iuf" or not abs(number) <= LARGEST_NUMBER:
        raise ClosureError(
            f"{what} must be a finite number [{unit}] of {LARGEST_NUMBER:g} at most, got {value!r}"
        )
    return float(number)


def one_number(value: Any, what: str, *, least: float = 0.0, itself: bool = False) -> float:
    """A finite number above ``least``, or that number ``itself``. Raises ``ClosureError``."""
    found = real_array(value, what)
    number = float(found) if found.ndim == 0 else np.nan
    if np.isfinite(number) and (number > least or (itself and number == least)):
        return number
    wanted = f"{least:g} or above" if itself else f"above {'zero' if least == 0.0 else least}"
    raise ClosureError(f"{what} must be {wanted}, got {value}")


def by_name(values: Any, what: str, example: str) -> Mapping[str, Any]:
    """A mapping of names to values. Raises ``ClosureError`` that shows one."""
    if isinstance(values, Mapping):
        return values
    raise ClosureError(f"{what} must be a mapping, such as {example}, got {values!r}")


def whole_number(value: Any, what: str, least: int) -> int:
    """A whole number from ``least`` on. Raises ``ClosureError``."""
    if isinstance(value, int | np.integer) and not isinstance(value, bool) and value >= least:
        return int(value)
    raise ClosureError(f"{what} must be a whole number from {least} on, got {value!r}")


def finite_vector(
    values: ArrayLike, size: int, what: str, unit: str, largest: float = LARGEST_NUMBER
) -> np.ndarray:
    """Check (size,) finite real numbers, at most ``largest`` in size; a single one may come bare.

    Raises ``ClosureError``.
    """
    if type(values) is np.ndarray and values.dtype is FLOAT and values.shape == (size,):
        array = values.copy()
        if array.dot(array) <= LARGEST_SQUARE:  # also false for what is not finite
            return array
    array = real_array(values, what, f"{size} numbers ({unit})")
    if size == 1 and array.ndim == 0:
        array = array.reshape(1)
    if array.shape != (size,):
        raise ClosureError(f"{what} must have shape ({size},) ({unit}), got {array.shape}")
    if not np.isfinite(array).all():
        bad = np.flatnonzero(~np.isfinite(array))
        raise ClosureError(f"{what} has entries that are not finite, at index {bad.tolist()}")
    if array.size and np.abs(array).max() > largest:
        bad = np.flatnonzero(np.abs(array) > largest)
        raise ClosureError(
            f"{what} has entries beyond {largest:g} (SI units), at index {bad.tolist()}"
        )
    return array


def vector_by_name(
    values: ArrayLike | Mapping[str, float],
    names: Sequence[str],
    what: str,
    largest: float = LARGEST_NUMBER,
) -> np.ndarray:
    """Check (n,) finite numbers, one an input, given in order or by name.

    Raises ``ClosureError``.
    """
    if type(values) is not np.ndarray and isinstance(values, Mapping):
        for name in values:
            if name not in names:
                raise ClosureError(known_names(str(name), "input", names))
        missing = [name for name in names if name not in values]
        if missing:
            raise ClosureError(f"{what}: no value for input {', '.join(missing)}")
        values = [values[name] for name in names]
    return finite_vector(values, len(names), what, " ".join(names), largest)


def finite_rows(values: ArrayLike, names: Sequence[str], what: str) -> np.ndarray:
    """Check (n, k) finite numbers, k names. Raises ``ClosureError``."""
    rows = real_array(values, what)
    if rows.ndim != 2 or rows.shape[1] != len(names):
        raise ClosureError(
            f"{what} must be (n, {len(names)}) ({' '.join(names)}), got {rows.shape}"
        )
    if not np.isfinite(rows).all() or np.abs(rows).max(initial=0.0) > LARGEST_NUMBER:
        bad = np.flatnonzero(~(np.abs(rows) <= LARGEST_NUMBER).all(axis=1))
        raise ClosureError(
            f"{what}: rows {bad[:5].tolist()} have numbers that are not finite, or beyond "
            f"{LARGEST_NUMBER:g}"
        )
    return rows


def number_table(values: ArrayLike, names: Sequence[str]) -> np.ndarray:
    """Finite numbers (n, k) of one (k,) or many (n, k), k names. Raises ``ClosureError``."""
    told = " ".join(names)
    found = real_array(values, f"values of {told}")
    if found.ndim == 0 and len(names) == 1:
        found = found.reshape(1)
    found = np.atleast_2d(found)
    if found.ndim != 2 or found.shape[1] != len(names) or not np.isfinite(found).all():
        raise ClosureError(
            f"expected finite numbers ({len(names)},) or (n, {len(names)}) for {told}, got an "
            f"array {np.shape(values)}"
        )
    return found


def range_of(value: Any, what: str) -> tuple[float, float]:
    """Finite lower and upper end, not falling. Raises ``ClosureError``."""
    ends = real_array(value, f"the range of {what}")
    if ends.shape == (2,) and np.isfinite(ends).all() and ends[0] <= ends[1]:
        return float(ends[0]), float(ends[1])
    raise ClosureError(f"the range of {what}, {value}, does not rise from one number to another")
