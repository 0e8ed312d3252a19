"""Whether a count and a search agree, and what the count then says."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from closedchain.closure.mechanism import Mechanism
from closedchain.closure.modes.counting import Counted
from closedchain.closure.modes.question import Question
from closedchain.closure.modes.seeking import Sought, chosen, unwound
from closedchain.closure.modes.shapes import SAME, Shapes, groups, shapes_of
from closedchain.closure.solve.search import search

SINGULAR = 1e-6  # share of the largest singular value
NEAR = 0.05  # dimensionless: from the end of a path that is lost to the singular posture it meant

REAL = 1e-6
"""Largest imaginary part, of shapes, dimensionless, of a real solution."""


@dataclass(frozen=True, eq=False)
class Verdict:
    """What a count says of postures that were found.

    Attributes
    ----------
    complete : str
        "counted" where the count holds and agrees with the search, else "searched".
    complex_count : int or None
        Finite complex solutions, a multiple one as often as it counts; None where not counted.
    infinite : int
        Generic solutions that go to infinity.
    multiplicity : (n,) array of int
        How many solutions meet in each posture.
    notes : tuple of str
    """

    complete: str
    complex_count: int | None
    infinite: int
    multiplicity: np.ndarray
    notes: tuple[str, ...]


def verdict_of(
    question: Question, q: np.ndarray, whole: Counted | None, *, families: bool
) -> Verdict:
    """What a count says of postures (n, nq); ``families`` tells whether some are not isolated."""
    n = len(q)
    if whole is None:
        return Verdict("searched", None, 0, np.ones(n, dtype=int), ())
    multiplicity = _multiplicities(question, q, whole)
    explained = int(multiplicity.sum()) - n + int((multiplicity > 1).sum())
    agree = _all_counted(question.problem.mechanism, q[multiplicity == 1], whole)
    complete, complex_count = "searched", None
    notes: list[str] = []
    if families:
        notes.append("Where families stand, solutions cannot be counted.")
    elif whole.known and whole.lost == explained and agree:
        complete, complex_count = "counted", len(whole.q) + whole.lost
        if not whole.traced:
            notes.append(
                "The trace test could not be had: the number was checked by loops and random "
                "starts at several places alone."
            )
    else:
        notes.append(_why_not(whole, agree=agree))
    return Verdict(complete, complex_count, whole.infinite, multiplicity, tuple(notes))


def together(question: Question, shapes: Shapes, found: Sought, whole: Counted) -> Sought:
    """What was searched and the real solutions among those that were counted."""
    if not len(whole.q):
        return found
    imaginary = np.abs(shapes.of(whole.q).imag).max(axis=1, initial=0.0)
    real = unwound(shapes.mechanism, whole.q[imaginary < REAL].real)
    if not len(real):
        return found
    every = np.repeat(question.targets[None], len(real), axis=0)
    closed = search(question.problem, every, real[:, None])
    q = np.concatenate([found.q, closed.q])
    group = groups(shapes.of(q))
    hits = np.concatenate([found.hits, np.zeros(len(closed.q), dtype=int)])
    first = chosen(shapes.mechanism, q, group)
    count = np.bincount(group, weights=hits).astype(int)
    return Sought(q[first], count, found.starts, found.unsettled)


def _all_counted(mechanism: Mechanism, q: np.ndarray, whole: Counted) -> bool:
    """Whether every posture (n, nq) is among the solutions that were counted."""
    if not len(q):
        return True
    if not len(whole.q):
        return False
    shapes = shapes_of(mechanism)
    known, mine = shapes.of(whole.q), shapes.of(q)
    apart = np.abs(mine[:, None].astype(complex) - known[None]).max(axis=2).min(axis=1)
    return bool((apart < 1e3 * SAME).all())


def _multiplicities(question: Question, q: np.ndarray, whole: Counted) -> np.ndarray:
    """How many paths end in each posture (n, nq): those that are lost end in singular ones."""
    found = np.ones(len(q), dtype=int)
    singular = [i for i, posture in enumerate(q) if _is_singular(question, posture)]
    if not singular or not whole.lost:
        return found
    shapes = shapes_of(question.problem.mechanism)
    ends, mine = shapes.of(whole.singular), shapes.of(q[singular])
    apart = np.abs(ends[:, None] - mine[None].astype(complex)).max(axis=2)
    nearest = np.argmin(apart, axis=1)
    for k, i in enumerate(singular):
        count = int(((nearest == k) & (apart.min(axis=1) < NEAR)).sum())
        found[i] = max(count, 1)
    return found


def _is_singular(question: Question, q: np.ndarray) -> bool:
    """Whether the equations lose rank at a posture (nq,), as well as rounding tells."""
    s = np.linalg.svd(question.problem.jacobian_at(q), compute_uv=False)
    rank = len(question.problem.kept)
    return bool(rank and s[rank - 1] < SINGULAR * s[0])


def _why_not(whole: Counted, *, agree: bool) -> str:
    if not agree:
        return "The search found a posture that the count does not have: the count is not complete."
    if whole.lost:
        return (
            f"{whole.lost} paths ended before the values asked for, at singular solutions: the "
            "count is not complete."
        )
    return "The check of the number of generic solutions did not hold: the count is not complete."
