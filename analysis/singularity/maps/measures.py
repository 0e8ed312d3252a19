"""The measures of a map at many postures: singular values, determinants, condition, residual.

With LAPACK, one call for many postures; what they are stands in ``singularity.rank_loss``.
"""

from __future__ import annotations

import numpy as np

from closedchain.analysis.first_order import FirstOrder, first_order
from closedchain.analysis.singularity.classify import determinants
from closedchain.analysis.singularity.deciding import Deciding
from closedchain.analysis.singularity.kinds import KINDS as TABLE
from closedchain.analysis.singularity.rank_loss import (
    closed_motions,
    condition,
    entry,
    sigma_direct,
    sigma_inverse,
)
from closedchain.analysis.structure.mobility import generic_rank
from closedchain.closure.chart import Chart
from closedchain.closure.generic import GenericRanks, generic_ranks
from closedchain.closure.joint_rates import physical_rates
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.nearness import NEAR

CHUNK = 1024  # postures whose matrices are held at once
KINDS = tuple(TABLE)
LONG_NAMES = {
    "sigma_direct": "input rates of the closed motion that needs the least, 0 at direct ones",
    "sigma_inverse": "output rates in the direction hardest to produce, 0 at inverse ones",
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
    places = [first_order(mechanism, q, outputs) for q in postures]
    closures, task = np.array([at.K for at in places]), np.array([at.J for at in places])
    residual = np.array([np.abs(at.values).max(initial=0.0) for at in places])
    generic = generic_ranks(mechanism, outputs)
    found = _on_closed_motions(places, closures, task, generic)
    signed = determinants(mechanism, closures, task)
    found |= {f"det_{kind}": values for kind, values in signed.items() if values is not None}
    found["residual"] = residual
    return {name: values[:0] for name, values in found.items()} if empty else found


def _on_closed_motions(
    places: list[FirstOrder], closures: np.ndarray, task: np.ndarray, generic: GenericRanks
) -> dict[str, np.ndarray]:
    """Sigmas and condition (n,) of postures with K (n, rows, nv) and J (n, d, nv)."""
    mechanism, n, nv = places[0].mechanism, len(closures), closures.shape[-1]
    rates = np.array([physical_rates(mechanism, at.q) for at in places])
    r = nv - generic.motions
    if closures.shape[1]:
        _, s, vt = np.linalg.svd(closures)
    else:
        s, vt = np.zeros((n, 0)), np.broadcast_to(np.eye(nv), (n, nv, nv))
    ranks = np.full(n, r)
    for i in np.flatnonzero(entry(s, r) <= NEAR * np.maximum(s.max(axis=1, initial=0.0), 1.0)):
        ranks[i] = Deciding(places[i]).closures.rank.value
    of = {"sigma_direct": sigma_direct, "sigma_inverse": sigma_inverse, "condition": condition}
    found = {name: np.empty(n) for name in of}
    found["sigma_constraint"] = entry(s, r)
    for rank in np.unique(ranks):  # almost always r; less at constraint singularities
        here = ranks == rank
        basis = vt[here, rank:].swapaxes(1, 2)
        v = closed_motions(mechanism, basis, rates[here], task[here])
        for name, measure in of.items():
            found[name][here] = measure(v, generic)
    return found


def oriented(chart: Chart, found: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Determinants with the signs that mean something on a branch of the chart.

    Where closure rows are redundant, only the ratio of the two determinants has a sign of its own
    (see ``classify.determinants``), and it goes to the one that can change on the branch: with
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
