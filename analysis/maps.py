"""Maps of the singularity measures over input values, as labelled arrays."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from closedchain.analysis.first_order import first_order
from closedchain.analysis.mobility import generic_rank
from closedchain.analysis.singularities import determinants
from closedchain.analysis.walk import OK, STATUSES, Grid, Progress, Walk, grid_of, walk
from closedchain.closure.mechanism import Mechanism

if TYPE_CHECKING:
    import xarray as xr

CHUNK = 1024  # cells whose matrices are held at once
KINDS = ("direct", "inverse", "constraint")
_LONG_NAMES = {
    "sigma_direct": "singular value of K_p that vanishes at direct singularities",
    "sigma_inverse": "singular value of [K; J] that vanishes at inverse singularities",
    "sigma_constraint": "singular value of K that vanishes at constraint singularities",
    "det_direct": "determinant of K_p, without sign where closure rows are redundant",
    "det_inverse": "signed determinant of [K; J]",
    "residual": "largest closure row",
}


def singularity_map(
    mechanism: Mechanism,
    over: Mapping[str, ArrayLike],
    at: Mapping[str, float] | ArrayLike | None = None,
    *,
    outputs: str | Sequence[str] | None = None,
    progress: bool | Progress = True,
    keep_q: bool = False,
) -> xr.Dataset:
    """Evaluate the singularity measures over a grid of input values, on one assembly branch.

    Parameters
    ----------
    over : mapping of input name to rising values [m or rad]
        One or more inputs; the branch is followed from the cell nearest to ``at`` outwards.
    at : mapping of input name to value, or (nq,) array, optional
        Values of the other inputs, or a posture whose branch is followed; home by default.
    outputs : str, optional
        Outputs of the task; those of the description by default.
    progress : bool or callable
        True shows a bar on a terminal; a callable gets (what, done, total).
    keep_q : bool
        Also return the posture of every cell.

    Returns
    -------
    xarray.Dataset
        Per cell: ``status`` (an index into its ``flag_meanings``), the three singular values, the
        two signed determinants (where the matrices are square) and the residual, all missing (NaN)
        where the status is not ok.

    Raises
    ------
    ClosureError
        Unknown inputs or outputs, values that do not rise, a start that cannot be reached.
    """
    from closedchain.analysis.progress import reporting

    names = mechanism.outputs(
        outputs if outputs is None or isinstance(outputs, str) else tuple(outputs)
    )
    with reporting(progress) as report:
        walked = walk(mechanism, grid_of(mechanism, over, at), report)
        columns = evaluate(walked, mechanism, names, report)
    return dataset(mechanism, walked, columns, names, keep_q=keep_q)


def evaluate(
    walked: Walk,
    mechanism: Mechanism,
    outputs: tuple[str, ...],
    progress: Progress | None = None,
) -> dict[str, np.ndarray]:
    """Measures of every cell that is ok, NaN elsewhere: name to array of the grid's shape."""
    cells = np.argwhere(walked.status == OK)
    found: dict[str, np.ndarray] = {}
    for begin in range(0, len(cells), CHUNK):
        chunk = cells[begin : begin + CHUNK]
        where = tuple(chunk.T)
        for name, values in _chunk(mechanism, walked.q[where], outputs).items():
            if name not in found:
                found[name] = np.full(walked.status.shape, np.nan)
            found[name][where] = values
        if progress is not None:
            progress("singular values", begin + len(chunk), len(cells))
    return found


def _chunk(
    mechanism: Mechanism, postures: np.ndarray, outputs: tuple[str, ...]
) -> dict[str, np.ndarray]:
    """Measures of a few postures (n, nq), with one LAPACK call over the chunk for each matrix."""
    n, r, d = len(postures), generic_rank(mechanism), len(outputs)
    stacked = np.empty((n, mechanism.rows + d, mechanism.model.nv))
    residual = np.empty(n)
    for i, q in enumerate(postures):
        stacked[i] = first_order(mechanism, q, outputs).stacked
        residual[i] = np.abs(mechanism.workspace.residual(q)).max(initial=0.0)
    closures, p = stacked[:, : mechanism.rows], mechanism.passive_v
    passive = closures[:, :, p]
    watched = {
        "direct": (passive, min(r, p.size)),
        "inverse": (stacked, r + d),
        "constraint": (closures, r),
    }
    found = {}
    for kind, (matrices, number) in watched.items():
        values = np.linalg.svd(matrices, compute_uv=False)
        none = np.full(n, 1.0 if number == 0 else 0.0)
        in_range = 0 < number <= values.shape[1]
        found[f"sigma_{kind}"] = values[:, number - 1] if in_range else none
    signed = determinants(mechanism, closures, stacked[:, mechanism.rows :])
    found |= {f"det_{kind}": values for kind, values in signed.items() if values is not None}
    found["residual"] = residual
    return found


def dataset(
    mechanism: Mechanism,
    walked: Walk,
    columns: Mapping[str, np.ndarray],
    outputs: tuple[str, ...],
    *,
    keep_q: bool = False,
) -> xr.Dataset:
    """Label the arrays of a map."""
    import pinocchio as pin
    import xarray as xr

    import closedchain

    grid = walked.grid
    units = dict(zip(mechanism.inputs, mechanism.input_units, strict=True))
    coordinates = {
        name: (name, values, {"units": units[name], "long_name": f"input {name}"})
        for name, values in zip(grid.names, grid.values, strict=True)
    }
    meanings = {
        "flag_values": np.arange(len(STATUSES), dtype=np.int8),
        "flag_meanings": " ".join(s.replace(" ", "_") for s in STATUSES),
    }
    variables = {"status": (grid.names, walked.status, meanings)}
    for name, values in columns.items():
        labels: dict[str, object] = {"units": "m or rad" if name == "residual" else "1"}
        variables[name] = (grid.names, values, {**labels, "long_name": _LONG_NAMES[name]})
    if keep_q:
        valid = np.where((walked.status == OK)[..., None], walked.q, np.nan)
        variables["q"] = ((*grid.names, "nq"), valid, {"long_name": "configuration"})
    held = {
        f"held_{name}": float(value)
        for name, value in zip(mechanism.inputs, grid.base, strict=True)
        if name not in grid.names
    }
    return xr.Dataset(
        variables,
        coords=coordinates,
        attrs={
            "mechanism": mechanism.name,
            "outputs": " ".join(outputs),
            "characteristic_length": mechanism.length,
            **{f"parameter_{k}": v for k, v in mechanism.parameters.items()},
            **held,
            "closedchain_version": closedchain.__version__,
            "pinocchio_version": pin.__version__,
            "numpy_version": np.__version__,
        },
    )


__all__ = ["CHUNK", "KINDS", "Grid", "dataset", "evaluate", "singularity_map"]
