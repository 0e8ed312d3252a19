"""Bulk evaluation: one compiled kernel for any mechanism, built from the mechanism's tables.

``Batch`` is its face. Numba is imported, and kernels compiled or read from disk, at the first call.
"""

if __name__ != "closedchain.closure.batch":
    raise ImportError("import closedchain.closure.batch: two copies of a class never match")

from closedchain.closure.batch.codes import (
    BEYOND,
    CLOSED,
    FOLD,
    JOINT_LIMIT,
    MIRRORED,
    OK,
    OPEN,
    OTHER_BRANCH,
    REFUSALS,
    STUCK,
    UNDECIDED,
    UNREACHABLE,
    UNSEEN,
    UNTRIED,
)
from closedchain.closure.batch.face import Batch

__all__ = [
    "BEYOND",
    "CLOSED",
    "FOLD",
    "JOINT_LIMIT",
    "MIRRORED",
    "OK",
    "OPEN",
    "OTHER_BRANCH",
    "REFUSALS",
    "STUCK",
    "UNDECIDED",
    "UNREACHABLE",
    "UNSEEN",
    "UNTRIED",
    "Batch",
]
