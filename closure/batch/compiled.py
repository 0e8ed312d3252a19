"""The decorator of all kernels: Numba without the GIL, kept on disk while no source has changed."""

from __future__ import annotations

import contextlib
import hashlib
import threading
from collections.abc import Callable, Iterator
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
    kept: Any = getattr(compiled, "_cache", None)
    index = getattr(kept, "_cache_file", None)
    if index is not None:
        index._source_stamp = _stamp()
        compile_one = compiled.compile

        def compile_alone(signature: Any) -> Any:
            with _alone(Path(kept.cache_path)):
                return compile_one(signature)

        compiled.compile = compile_alone
    return compiled


_turn = threading.RLock()
_holding: list[Path] = []


@contextlib.contextmanager
def _alone(folder: Path) -> Iterator[None]:
    """Let one process compile at a time; the others then load what it has written.

    Two compilations of one source may order sums differently. With the machine code of one of
    them in all processes, all of them give the same bits.
    """
    with _turn:
        if _holding:  # a kernel within a kernel
            yield
            return
        with contextlib.ExitStack() as held:
            # where nothing can be locked (Windows) or written, there is nothing to share
            with contextlib.suppress(ImportError, OSError):
                import fcntl

                folder.mkdir(parents=True, exist_ok=True)
                file = held.enter_context((folder / "compiling.lock").open("w"))
                fcntl.flock(file, fcntl.LOCK_EX)
            _holding.append(folder)
            try:
                yield
            finally:
                _holding.clear()


def is_ready(compiled: Any) -> bool:
    """Whether a kernel is loaded, or its machine code lies in the disk cache."""
    if getattr(compiled, "signatures", None):
        return True
    index = getattr(getattr(compiled, "_cache", None), "_cache_file", None)
    return index is not None and bool(index._load_index())
