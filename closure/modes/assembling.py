"""The result of ``cc.postures`` from what was searched and counted."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from closedchain.closure.modes.agreement import verdict_of
from closedchain.closure.modes.certificates import certified
from closedchain.closure.modes.counting import Counted
from closedchain.closure.modes.naming import branches_of, names_of, order_of
from closedchain.closure.modes.question import Question
from closedchain.closure.modes.result import Family, Postures
from closedchain.closure.modes.seeking import Sought, unwound
from closedchain.closure.nearest import beyond_limits
from closedchain.urdf.description import OUTPUTS

OPEN = 1e-9  # m or rad: what is left open is no posture


def result_of(
    question: Question,
    found: Sought,
    whole: Counted | None,
    families: tuple[Family, ...],
    notes: Sequence[str],
) -> Postures:
    """Postures that were found, closed, in order and named, with the evidence for their number."""
    problem, m = question.problem, question.problem.mechanism
    q = unwound(m, found.q)
    closed = [float(np.abs(m.workspace.residual(x)).max(initial=0.0)) < OPEN for x in q]
    q, hits = q[closed], found.hits[closed]
    branch = branches_of(question, q)
    order = order_of(question, q, branch)
    q, hits, branch, n = q[order], hits[order], branch[order], len(q)
    verdict = verdict_of(question, q, whole, families=bool(families))
    said = [*notes, *verdict.notes]
    proof = certified(problem, q, question.targets) if problem.square else None
    if problem.redundant and n:
        others = len(problem.units) - len(problem.kept)
        said.append(
            f"Proofs are of the independent rows; the {others} others hold there by the geometry."
        )
    return Postures(
        mechanism=m,
        q=q,
        names=names_of(m, q, branch),
        complete=verdict.complete,
        complex_count=verdict.complex_count,
        infinite=verdict.infinite,
        multiplicity=verdict.multiplicity,
        certified=np.zeros(n, dtype=bool) if proof is None else proof.proved,
        radius=np.full(n, np.nan) if proof is None else proof.radius,
        residual=np.array([float(np.abs(m.workspace.residual(x)).max(initial=0.0)) for x in q]),
        branch=branch,
        beyond_limits=tuple(beyond_limits(m, x) for x in q),
        families=tuple(Family(f.dimension, f.q) for f in families),
        hits=hits,
        starts=found.starts,
        unseen=found.unseen,
        held=question.held,
        pinned=_pinned(question),
        target_pose=tuple(question.targets[len(problem.pinned) :].tolist()),
        outputs=tuple(OUTPUTS[k] for _, outputs in problem.goals for k in outputs),
        notes=tuple(said),
    )


def _pinned(question: Question) -> dict[str, float]:
    """Values that are held, by joint."""
    problem = question.problem
    model = problem.mechanism.model
    at = {model.idx_vs[j]: str(model.names[j]) for j in range(1, model.njoints)}
    return {at[v]: float(x) for v, x in zip(problem.pinned, question.targets, strict=False)}
