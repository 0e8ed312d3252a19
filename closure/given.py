"""Checks of single numbers, tables of numbers and counts that a caller gives."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from closedchain.urdf.errors import ClosureError


def real_array(values: ArrayLike, what: str) -> np.ndarray:
    """Array of real numbers, of any shape, finite or not. Raises ``ClosureError``."""
    try:
        raw = np.asarray(values)
        if raw.dtype.kind not in "biufO":  # text and complex numbers would be cast silently
            raise TypeError
        return np.array(raw, dtype=float)
    except (TypeError, ValueError):
        raise ClosureError(f"{what} must be numbers, got {values!r}") from None


def one_number(value: Any, what: str, *, least: float = 0.0, itself: bool = False) -> float:
    """A finite number above ``least``, or that number ``itself``. Raises ``ClosureError``."""
    found = real_array(value, what)
    number = float(found) if found.ndim == 0 else np.nan
    if np.isfinite(number) and (number > least or (itself and number == least)):
        return number
    wanted = f"{least:g} or above" if itself else f"above {'zero' if least == 0.0 else least}"
    raise ClosureError(f"{what} must be {wanted}, got {value}")


def whole_number(value: Any, what: str, least: int) -> int:
    """A whole number from ``least`` on. Raises ``ClosureError``."""
    if isinstance(value, int | np.integer) and not isinstance(value, bool) and value >= least:
        return int(value)
    raise ClosureError(f"{what} must be a whole number from {least} on, got {value!r}")


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
