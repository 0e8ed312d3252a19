"""Classification of many closed postures at once, as ``classify`` does it for one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from closedchain.analysis.singularity.bulk.measuring import bulk_measures
from closedchain.analysis.singularity.classify import SINGULAR, classify
from closedchain.analysis.singularity.maps.measures import KINDS
from closedchain.analysis.singularity.sets.bordered import Measure
from closedchain.analysis.singularity.sets.postures_at import kinematics
from closedchain.analysis.structure.mobility import generic_rank
from closedchain.closure.mechanism import Mechanism

CHUNK = 256  # postures whose matrices are held at once
UNSURE = 100.0  # within this factor of the tolerance, ``classify`` itself decides


@dataclass(frozen=True, eq=False)
class Kinds:
    """What ``classify`` says of a posture, see there; ``sigmas`` (3,) in the order of ``KINDS``."""

    kinds: frozenset[str]
    sigmas: np.ndarray
    free_twists: np.ndarray
    lost_twists: np.ndarray


def classified(mechanism: Mechanism, q: np.ndarray, outputs: tuple[str, ...]) -> list[Kinds]:
    """Classify closed postures (n, nq), unchecked.

    Singular values come in bulk, null spaces from LAPACK over many postures. Where
    a decision is close, or closures themselves are singular, ``classify`` takes it.
    """
    if not len(q):
        return []
    found = bulk_measures(mechanism, outputs).measures(q)
    sigmas = np.stack([found[f"sigma_{kind}"] for kind in KINDS], axis=1)
    out = []
    for begin in range(0, len(q), CHUNK):
        part = slice(begin, begin + CHUNK)
        out += _chunk(mechanism, q[part], outputs, sigmas[part])
    return out


def _chunk(
    mechanism: Mechanism, q: np.ndarray, outputs: tuple[str, ...], sigmas: np.ndarray
) -> list[Kinds]:
    at = kinematics(mechanism, q, tip=True)
    task = Measure(mechanism, "inverse", outputs).task_rows(at)
    # the largest singular values hardly change over a set: those of one posture do
    limits = SINGULAR * _largest(at.closures[0], task[0])
    singular = sigmas <= limits
    sure = (sigmas <= limits / UNSURE) | (sigmas >= limits * UNSURE)
    easy = sure.all(axis=1) & ~singular[:, 2]
    r, p, nv = generic_rank(mechanism), mechanism.passive_v, mechanism.model.nv
    free: dict[int, np.ndarray] = {}
    lost: dict[int, np.ndarray] = {}
    direct = np.flatnonzero(easy & singular[:, 0])
    if direct.size:
        _, s, vt = np.linalg.svd(at.closures[direct][..., p])
        for i, values, rows in zip(direct.tolist(), s, vt, strict=True):
            null = rows[int((values > limits[0]).sum()) :]
            motions = np.zeros((nv, len(null)))
            motions[p] = null.T * mechanism.column_scale[p, None]
            free[i] = at.tip[i] @ motions
    inverse = np.flatnonzero(easy & singular[:, 1])
    if inverse.size:
        _, _, vt = np.linalg.svd(at.closures[inverse])
        u, s, _ = np.linalg.svd(task[inverse] @ vt[:, r:].swapaxes(1, 2))
        for i, left, values in zip(inverse.tolist(), u, s, strict=True):
            produced = min(int((values > limits[1]).sum()), max(values.size - 1, 0))
            lost[i] = _rising(left[:, produced:])
    none, all_produced = np.zeros((6, 0)), np.zeros((len(outputs), 0))
    out = []
    for i, one in enumerate(q):
        if not easy[i]:
            c = classify(mechanism, one, outputs)
            values = np.array([c.sigma_direct, c.sigma_inverse, c.sigma_constraint])
            out.append(Kinds(c.kinds, values, c.free_twists, c.lost_twists))
            continue
        kinds = frozenset(kind for kind, s in zip(KINDS, singular[i], strict=True) if s)
        out.append(Kinds(kinds, sigmas[i], free.get(i, none), lost.get(i, all_produced)))
    return out


def _largest(closures: np.ndarray, task: np.ndarray) -> np.ndarray:
    """Largest singular values (3,) to compare with, of K (rows, nv), [K; J] and K; J (d, nv).

    For the direct kind K and not K_p, which is nothing where it has a single row and is singular.
    """
    watched = (closures, np.concatenate([closures, task]), closures)
    return np.array([np.linalg.norm(m, ord=2) if m.size else 1.0 for m in watched])


def _rising(lost: np.ndarray) -> np.ndarray:
    """Columns with their largest entry positive, as ``classify`` gives them."""
    return np.asarray(lost * np.sign(lost[np.abs(lost).argmax(axis=0), range(lost.shape[1])]))
