"""Many square systems of linear equations at once, some of which may be singular."""

from __future__ import annotations

from contextlib import suppress

import numpy as np


def solutions(matrices: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Solutions of square systems, real or complex; NaN for those singular to the last bit.

    Parameters
    ----------
    matrices : (..., k, k) array
    right : (..., k, j) array
        Broadcast over the matrices.

    Returns
    -------
    (..., k, j) array
    """
    right = np.broadcast_to(right, (*matrices.shape[:-1], right.shape[-1]))
    try:
        return np.asarray(np.linalg.solve(matrices, right))
    except np.linalg.LinAlgError:
        # one singular system fails all: each alone, then
        found = np.full(right.shape, np.nan, dtype=np.result_type(matrices, right))
        for i in np.ndindex(matrices.shape[:-2]):
            with suppress(np.linalg.LinAlgError):
                found[i] = np.linalg.solve(matrices[i], right[i])
        return found
