"""Classification of many closed postures at once, as ``classify`` does it for one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from closedchain.analysis.singularity.classify import SINGULAR, classify
from closedchain.analysis.singularity.rank_loss import (
    ClosedMotions,
    closed_motions,
    entry,
    sigma_direct,
    sigma_inverse,
)
from closedchain.analysis.singularity.sets.postures_at import first_order_code
from closedchain.analysis.structure.mobility import generic_rank
from closedchain.closure.generic import generic_ranks
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.nearness import NEAR

CHUNK = 256  # postures whose matrices are held at once
TRACED = 1e-12  # share of singular values that points on a traced set have


@dataclass(frozen=True, eq=False)
class Kinds:
    """What ``classify`` says of a posture, see there; ``sigmas`` (3,) in the order of ``KINDS``."""

    kinds: frozenset[str]
    sigmas: np.ndarray
    free_twists: np.ndarray
    lost_twists: np.ndarray


@dataclass(frozen=True, eq=False)
class Evidence:
    """First-order kinematics of postures (n, nq), as far as they are regular for the closures.

    Attributes
    ----------
    residual : (n,) array
        Largest closure row [m or rad].
    closures : (n, rows) array
        Singular values of K, falling.
    motions : ClosedMotions
        As many as at a generic posture.
    tip : (n, 6, m) array
        Dimensionless twists of the tip in these motions, along the world's axes.
    """

    residual: np.ndarray
    closures: np.ndarray
    motions: ClosedMotions
    tip: np.ndarray


def evidence(mechanism: Mechanism, q: np.ndarray, outputs: tuple[str, ...]) -> Evidence:
    """First-order kinematics of postures (n, nq), unchecked."""
    code, r = first_order_code(mechanism, outputs), generic_rank(mechanism)
    at, (rates, tip) = code.at(q), code.rates(q)
    if r == mechanism.rows:
        # the last columns of an orthogonal matrix whose first ones span the rows
        basis = np.linalg.qr(at.closures.swapaxes(1, 2), mode="complete")[0][..., r:]
        s = np.linalg.svd(at.closures, compute_uv=False)
    else:
        _, s, vt = np.linalg.svd(at.closures)
        basis = vt[:, r:].swapaxes(1, 2)
    motions = closed_motions(mechanism, basis, rates, at.task)
    residual = np.abs(at.residual * mechanism.row_scale).max(axis=1, initial=0.0)
    return Evidence(residual, s, motions, tip @ motions.motions)


def sigmas_of(mechanism: Mechanism, found: Evidence, outputs: tuple[str, ...]) -> np.ndarray:
    """Direct, inverse and constraint singular values (n, 3)."""
    generic, r = generic_ranks(mechanism, outputs), generic_rank(mechanism)
    v = found.motions
    return np.stack(
        [sigma_direct(v, generic), sigma_inverse(v, generic), entry(found.closures, r)], axis=1
    )


def classified(mechanism: Mechanism, q: np.ndarray, outputs: tuple[str, ...]) -> list[Kinds]:
    """Classify closed postures (n, nq), unchecked.

    By LAPACK over many postures. Where a singular value is small, so that the distance decides, or
    closures themselves are singular, ``classify`` takes it.
    """
    parts = [q[begin : begin + CHUNK] for begin in range(0, len(q), CHUNK)]
    return [kinds for part in parts for kinds in _chunk(mechanism, part, outputs)]


def _chunk(mechanism: Mechanism, q: np.ndarray, outputs: tuple[str, ...]) -> list[Kinds]:
    found, generic = evidence(mechanism, q, outputs), generic_ranks(mechanism, outputs)
    v, sigmas = found.motions, sigmas_of(mechanism, found, outputs)
    # of inputs the right singular vectors are wanted, of outputs the left ones
    _, inputs, locked = np.linalg.svd(v.inputs)
    lost, produced, _ = np.linalg.svd(v.outputs)
    scale = np.maximum(generic.output_scale, produced.max(axis=1, initial=0.0))
    limits = np.stack([np.ones_like(scale), scale, found.closures.max(axis=1, initial=1e-300)])
    every = (inputs, produced, found.closures[:, : generic_rank(mechanism)])
    hard = np.zeros(len(q), dtype=bool)
    for values, scales in zip(every, limits, strict=True):
        shares = values / scales[:, None]
        hard |= ((shares > TRACED) & (shares < NEAR)).any(axis=1)
    limits = SINGULAR * limits.T
    easy = ~hard & (sigmas[:, 2] > limits[:, 2])
    driven = (inputs > limits[:, :1]).sum(axis=1)
    kept = (produced > limits[:, 1:2]).sum(axis=1)
    direct = v.size - driven > generic.idle
    inverse = kept < generic.outputs.value
    length = np.repeat([mechanism.length, 1.0], 3)[:, None]
    out = []
    for i, one in enumerate(q):
        if not easy[i]:
            out.append(_by_itself(mechanism, one, outputs))
            continue
        free, gone = np.zeros((6, 0)), np.zeros((len(outputs), 0))
        if direct[i]:
            twists = found.tip[i] @ locked[i, driven[i] :].T
            free = length * (twists @ np.linalg.svd(twists)[2].T)
        if inverse[i]:
            gone = _rising(lost[i, :, kept[i] :])
        kinds = {"direct": direct[i], "inverse": inverse[i]}
        names = frozenset(name for name, true in kinds.items() if true)
        out.append(Kinds(names, sigmas[i], free, gone))
    return out


def _by_itself(mechanism: Mechanism, q: np.ndarray, outputs: tuple[str, ...]) -> Kinds:
    c = classify(mechanism, q, outputs)
    values = np.array([c.sigma_direct, c.sigma_inverse, c.sigma_constraint])
    return Kinds(c.kinds, values, c.free_twists, c.lost_twists)


def _rising(lost: np.ndarray) -> np.ndarray:
    """Columns with their largest entry positive, as ``classify`` gives them."""
    return np.asarray(lost * np.sign(lost[np.abs(lost).argmax(axis=0), range(lost.shape[1])]))
