"""Arrays whose row k holds number k of every posture, and their addresses."""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def matching(x: Any, count: int, name: str) -> Array:
    """Array of ``count`` rows of numbers, copied where the rows are not contiguous."""
    x = np.asarray(x, dtype=np.float64)
    if x.ndim != 2 or x.shape[0] != count:
        raise ValueError(f"{name} must have the shape ({count}, n), got {x.shape}")
    return x if straight(x) else np.ascontiguousarray(x)


def in_place(x: Array, count: int, name: str) -> None:
    """Refuse an array that cannot be written row by row."""
    if x.dtype != np.float64 or x.ndim != 2 or x.shape[0] != count:
        raise ValueError(f"{name} must be float64 of shape ({count}, n), got {x.dtype} {x.shape}")
    if not (x.flags.writeable and straight(x)):
        raise ValueError(f"{name} must be writeable, its rows contiguous")


def straight(x: Array) -> bool:
    """Whether the rows are contiguous and follow each other in whole steps."""
    if x.size == 0:
        return True
    rows, columns = x.strides
    return rows % 8 == 0 and (columns == 8 or x.shape[1] == 1) and x.flags.aligned


def step(x: Array) -> int:
    """Numbers from one row to the next."""
    return x.strides[0] // 8


def address(x: Any) -> int:
    """Address of the first number of an array; it holds while the array is kept."""
    try:
        return ctypes.addressof(ctypes.c_char.from_buffer(x))  # three times as quick as the other
    except (TypeError, ValueError):  # empty, read-only or with gaps
        return int(x.ctypes.data)


def at(begin: int, count: int, n: int, step: int) -> Array:
    """Return the array (count, n) at an address, its rows ``step`` numbers apart."""
    if not count or not n:
        return np.empty((count, n))
    if step < 0:
        return at(begin + 8 * (count - 1) * step, count, n, -step)[::-1]
    flat = (ctypes.c_double * ((count - 1) * step + n)).from_address(begin)
    return np.lib.stride_tricks.as_strided(np.ctypeslib.as_array(flat), (count, n), (8 * step, 8))


def sums(rows: Array) -> Array:
    """Sums (n,) of rows (k, n), one after the other.

    numpy's own adds in another order where n is 1, and the last bits would tell.
    """
    found = np.zeros(rows.shape[1])
    for row in rows:
        found += row
    return found
