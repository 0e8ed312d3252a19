"""The measures of a map at many postures: singular values, determinants, condition, residual."""

from __future__ import annotations

import numpy as np

from closedchain.analysis.first_order import first_order
from closedchain.analysis.singularity.classify import determinants
from closedchain.analysis.structure.mobility import generic_rank
from closedchain.closure.chart import Chart
from closedchain.closure.mechanism import Mechanism

CHUNK = 1024  # postures whose matrices are held at once
KINDS = ("direct", "inverse", "constraint")
LONG_NAMES = {
    "sigma_direct": "singular value of K_p that vanishes at direct singularities",
    "sigma_inverse": "singular value of [K; J] that vanishes at inverse singularities",
    "sigma_constraint": "singular value of K that vanishes at constraint singularities",
    "det_direct": "determinant of K_p",
    "det_inverse": "determinant of [K; J]",
    "condition": "condition number of the twist map, dimensionless outputs by inputs",
    "residual": "largest closure row",
}


def measures_at(
    mechanism: Mechanism, postures: np.ndarray, outputs: tuple[str, ...]
) -> dict[str, np.ndarray]:
    """Measures of closed postures (n, nq), each (n,), by name as in ``LONG_NAMES``.

    Determinants are there where their matrices are square. The condition number is infinite where
    the inputs do not determine the tip's motion, or some output cannot be produced.

    Raises
    ------
    ClosureError
        A posture that is not closed.
    """
    if not len(postures):
        return _chunk(mechanism, mechanism.home[None], outputs, empty=True)
    parts = [
        _chunk(mechanism, postures[begin : begin + CHUNK], outputs)
        for begin in range(0, len(postures), CHUNK)
    ]
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def _chunk(
    mechanism: Mechanism, postures: np.ndarray, outputs: tuple[str, ...], *, empty: bool = False
) -> dict[str, np.ndarray]:
    """Measures of a few postures, with one LAPACK call over all of them for each matrix."""
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
    found["condition"] = condition_numbers(mechanism, closures, stacked[:, mechanism.rows :], r)
    found["residual"] = residual
    return {name: values[:0] for name, values in found.items()} if empty else found


def oriented(chart: Chart, found: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Determinants with the signs that mean something on a branch of the chart.

    Where closure rows are redundant, only the ratio of the two determinants has a sign of its own
    (see ``singularities.determinants``), and it goes to the one that can change on the branch: with
    all outputs prescribed, [K; J] keeps its sign and K_p may change.
    """
    redundant = generic_rank(chart.mechanism) < chart.mechanism.rows
    if not redundant or chart.folds != "inverse" or "det_direct" not in found:
        return found
    if "det_inverse" not in found:
        return found
    direct, inverse = found["det_direct"], found["det_inverse"]
    signed = np.where(inverse < 0.0, -direct, direct)
    return found | {"det_direct": signed, "det_inverse": np.abs(inverse)}


def condition_numbers(
    mechanism: Mechanism, closures: np.ndarray, task: np.ndarray, r: int
) -> np.ndarray:
    """Condition numbers (n,) of the dimensionless twist map, tip rates from input rates.

    With N spanning the null space of K, the closed motions are N c, their input rates A c and tip
    rates B c, A = N_a, B = J N. The twist map takes A c to B c. It is judged on the input rates
    that the loops allow, and idle freedoms, which move neither inputs nor tip, are left out.

    Parameters
    ----------
    closures : (n, rows, nv) array
        K.
    task : (n, d, nv) array
        J.
    r : int
        Generic rank of K.
    """
    _, _, vt = np.linalg.svd(closures)
    motions = vt[:, r:].swapaxes(1, 2)
    moved = task @ motions
    _, s, wt = np.linalg.svd(motions[:, mechanism.input_v], full_matrices=False)
    kept = min(mechanism.input_v.size, motions.shape[2])
    if kept == 0 or task.shape[1] == 0:
        return np.full(len(closures), np.inf)
    tiny = np.finfo(float).tiny
    least = s[:, :kept]
    regular = least[:, -1] > tiny
    scale = np.where(regular[:, None], least, 1.0)
    values = np.linalg.svd(
        moved @ wt[:, :kept].swapaxes(1, 2) / scale[:, None, :], compute_uv=False
    )
    regular &= values[:, -1] > tiny * values[:, 0]
    last = np.where(regular, values[:, -1], 1.0)
    return np.where(regular, values[:, 0] / last, np.inf)
