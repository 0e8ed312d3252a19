"""The decorator of all kernels: Numba without the GIL, kept on disk while no source has changed."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numba

# sums may be reordered and fused: the order is fixed at compile time, so that one machine gives
# the same bits in every thread. NaN and infinity keep their meaning.
_FAST = {"contract", "reassoc", "nsz"}


@cache
def _stamp() -> str:
    """Digest of the sources of this package."""
    digest = hashlib.sha256()
    for source in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(source.read_bytes())
    return digest.hexdigest()


def kernel(function: Callable[..., Any]) -> Any:
    """Compile a function that makes no arrays: without the GIL, and without counting references.

    Reference counts are atomic and would cost more than the work of the small functions.
    """
    return _compile(function, counting=False)


def entry(function: Callable[..., Any]) -> Any:
    """Compile a function that makes arrays, without the GIL."""
    return _compile(function, counting=True)


def _compile(function: Callable[..., Any], *, counting: bool) -> Any:
    """Compile lazily with a disk cache.

    Numba notices a change of the file that holds a function only; a kernel also holds the code of
    those that it calls, so the stamp of its cache covers the whole package.
    """
    compile_: Any = numba.njit  # its annotations do not know of _nrt
    compiled = compile_(cache=True, nogil=True, error_model="numpy", fastmath=_FAST, _nrt=counting)(
        function
    )
    index = getattr(getattr(compiled, "_cache", None), "_cache_file", None)
    if index is not None:
        index._source_stamp = _stamp()
    return compiled


def is_ready(compiled: Any) -> bool:
    """Whether a kernel is loaded, or its machine code lies in the disk cache."""
    if getattr(compiled, "signatures", None):
        return True
    index = getattr(getattr(compiled, "_cache", None), "_cache_file", None)
    return index is not None and bool(index._load_index())
