"""Searching and counting within the time that is allowed."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

from closedchain.closure.modes.counting import Counted, counted
from closedchain.closure.modes.question import Question
from closedchain.closure.modes.seeking import LEAST, Sought, Starts, sought
from closedchain.closure.modes.shapes import Shapes, shapes_of
from closedchain.closure.progress import Progress
from closedchain.closure.turns import tied, turning, without_turns


class OutOfTime(Exception):
    """The time that was allowed is used up."""


@dataclass(frozen=True, eq=False)
class Search(Starts):
    """Random starts, until when, and who is told."""

    until: float | None = None
    progress: Progress | None = None

    def report(self, what: str, done: int) -> None:
        """Tell how far it is. Raises ``OutOfTime``."""
        if self.until is not None and time.monotonic() > self.until:
            raise OutOfTime
        if self.progress is not None:
            self.progress(what, done, 0)


def searched_in_time(question: Question, shapes: Shapes, asked: Search) -> tuple[Sought, bool]:
    """What random starts lead to, and whether the time sufficed."""
    problem, targets = question.problem, question.targets
    try:
        return sought(problem, shapes, targets, starts=asked, report=asked.report), True
    except OutOfTime:
        return sought(problem, shapes, targets, starts=replace(asked, most=LEAST)), False


def counted_in_time(question: Question, asked: Search, notes: list[str]) -> Counted | None:
    """Complex solutions, with whole turns of what is held left out; a note where there are none."""
    problem = question.problem
    m, targets = problem.mechanism, question.targets.copy()
    turns = (turning(m) & ~tied(m))[list(problem.pinned)]
    held = targets[: len(problem.pinned)]
    targets[: len(problem.pinned)] = without_turns(held, turns)
    try:
        return counted(problem, shapes_of(m), targets, asked.report)
    except OutOfTime:
        notes.append("The time allowed was used up before the solutions were counted.")
    except TypeError as error:  # what complex numbers do not have
        notes.append(f"The solutions cannot be counted: {error}.")
    return None
