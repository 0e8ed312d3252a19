"""``cc.postures``: all assembly modes, all working modes, or whatever joints are held."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from closedchain.closure.given import one_number, whole_number
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.modes.agreement import together
from closedchain.closure.modes.assembling import result_of
from closedchain.closure.modes.counting import are_kept
from closedchain.closure.modes.dimension import dimensions
from closedchain.closure.modes.question import Question, question_of
from closedchain.closure.modes.result import Family, Postures
from closedchain.closure.modes.seeking import LEAST, MOST, closed_postures, sought
from closedchain.closure.modes.shapes import shapes_of, turns_that_count
from closedchain.closure.modes.singular import with_singular
from closedchain.closure.modes.within_time import Search, counted_in_time, searched_in_time
from closedchain.closure.progress import Progress
from closedchain.closure.ranks import null_space
from closedchain.closure.solve.alone import system_at
from closedchain.closure.solve.problem import Problem

LOOKED_AT = 8
"""Postures at which it is seen what the motions that remain change."""


def postures(
    mechanism: Mechanism,
    inputs: ArrayLike | Mapping[str, float] | None = None,
    pose: pin.SE3 | None = None,
    fixed: Mapping[str, float] | None = None,
    *,
    outputs: str | tuple[str, ...] | None = None,
    count: bool = True,
    starts: int = MOST,
    seconds: float | None = None,
    seed: int = 0,
    progress: Progress | None = None,
) -> Postures:
    """All postures of a mechanism with something held.

    They are searched from many random starts and, unless told otherwise, counted: all complex
    solutions are found at generic values by loops of what is held, and followed to the values that
    are asked for. The first time that takes seconds to minutes for a mechanism; what was found is
    kept on disk.

    Parameters
    ----------
    inputs : (n_inputs,) array or mapping of input to value, optional
        [m or rad]. All inputs: their assembly modes.
    pose : pin.SE3, optional
        Of the tip in the world: the working modes. Components that are no outputs are not used.
    fixed : mapping of joint to value, optional
        [m or rad]. Any joints with one freedom; with none, the whole set of postures.
    outputs : str, optional
        Outputs that ``pose`` prescribes; those of the task by default.
    count : bool
        Whether complex solutions are counted; else postures are only searched.
    starts : int
        Random starts at most.
    seconds : float, optional
        Time after which counting is given up: what was found until then is returned as searched.
    seed : int
        Of the random starts.
    progress : callable, optional
        Gets (what, done, total); the total is 0 where it is not known.

    Returns
    -------
    Postures

    Raises
    ------
    ClosureError
        More than one thing held; inputs, joints or outputs that are unknown or missing; numbers
        that are none; starts below one, seconds below zero.

    Examples
    --------
    >>> m = cc.load("linear_delta")
    >>> modes = cc.postures(m, inputs=m.input_values(m.home), count=False)
    >>> [round(float(m.point(q, "P")[2]), 3) for q in modes.q]  # the platform hangs, or stands [m]
    [-0.6, 0.317]
    """
    question = question_of(mechanism, inputs, pose, fixed, outputs)
    until = None
    if seconds is not None:
        until = time.monotonic() + one_number(seconds, "seconds", itself=True)
    most, first = whole_number(starts, "starts", 1), whole_number(seed, "seed", 0)
    asked = Search(most, first, until, progress)
    if not question.problem.square:
        return _families(question, asked)
    shapes, notes = shapes_of(mechanism), list[str]()
    whole = None
    if count and turns_that_count(mechanism):
        notes.append("Relations of its joints count whole turns: its solutions are only searched.")
        count = False
    early = count and are_kept(question.problem)
    if early:
        whole = counted_in_time(question, asked, notes)
        # what was counted is all there is: a few starts then check it
        if whole is not None and whole.settled:
            asked = replace(asked, most=min(starts, LEAST))
    found, in_time = searched_in_time(question, shapes, asked)
    if not in_time:
        notes.append("The time allowed was used up while searching.")
    settled = whole is not None and whole.settled
    found, families = with_singular(question.problem, question.targets, found, settled=settled)
    if count and in_time and not early:
        whole = counted_in_time(question, asked, notes)
    if whole is not None:
        found = together(question, shapes, found, whole)
    return result_of(question, found, whole, families, notes)


def _dimension(problem: Problem, targets: np.ndarray, q: np.ndarray) -> int:
    """Dimension of the family through a posture (nq,).

    Where rows are redundant, they may promise more motions than there are, in every posture.
    """
    if problem.redundant:
        return dimensions(*system_at(problem, targets, q))[0]
    return len(problem.free) - len(problem.kept)


def _families(question: Question, asked: Search) -> Postures:
    """Postures that are not isolated: one of each family that idle motions do not join."""
    problem, targets = question.problem, question.targets
    shapes = shapes_of(problem.mechanism)
    for q in closed_postures(problem, targets, asked, LOOKED_AT):
        basis, _ = null_space(problem.jacobian_at(q))
        motions = np.zeros((problem.mechanism.model.nv, basis.shape[1]))
        motions[list(problem.free)] = basis
        shapes = shapes.without(q, motions * problem.mechanism.column_scale[:, None])
    found = sought(problem, shapes, targets, starts=asked)
    families = tuple(Family(_dimension(problem, targets, q), q) for q in found.q)
    note = "Postures that the remaining motions may join are told apart by what these leave alone."
    return result_of(question, found, None, families, [note] if families else [])
