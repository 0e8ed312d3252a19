"""The judgement of a trial, column by column: a loop where ``step_tapes`` has it written out.

The bound is that of ``tape.elimination.relative_change``. Written out it solves once for every
row, which makes most of a program's text; here one solution is written down and repeated.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

from closedchain.closure.solve.step_tapes import Asked, StepTapes
from closedchain.closure.tape.expression import Expr, Graph, Tape, total


@dataclass(frozen=True, eq=False)
class Judging:
    """Three tapes that judge a trial together.

    ``first``, from the state and the parameters of a way to numbers of the Jacobian. ``column``, a
    loop on ``states`` numbers, zero at first, with those as parameters. ``last``, from state,
    parameters and what the loop left, to the new state.
    """

    tapes: StepTapes

    @cached_property
    def _asked(self) -> Asked:
        return self.tapes.asked()

    @cached_property
    def _changes(self) -> list[dict[int, Expr]]:
        """Entries of the Jacobian that change, by row and free column."""
        zero, free = self._asked.lane.graph.constant(0.0), set(self.tapes.problem.free)
        rows = []
        for before, now in zip(self._asked.before, self._asked.now, strict=True):
            both = {
                c: before.get(c, zero) - now.get(c, zero) for c in {**before, **now} if c in free
            }
            rows.append({c: x for c, x in both.items() if x.value != 0.0})
        return rows

    @cached_property
    def first(self) -> Tape:
        """From state and parameters to factors and changes."""
        changes = [x for row in self._changes for x in row.values()]
        numbers = [*self._asked.lu.numbers(), *changes]
        return self._asked.lane.graph.tape(numbers, self._asked.lane.inputs)

    @property
    def size(self) -> int:
        """Number of rows, and of columns of the inverse."""
        return len(self._asked.before)

    @property
    def states(self) -> int:
        """Column, sum of squares, largest sum of a column, and sums of the rows."""
        return 3 + self.size

    @cached_property
    def column(self) -> Tape:
        """One column of the inverse, and its share of the sums."""
        g, size, lu = Graph(), self.size, self._asked.lu
        k, squares, largest, *sums = g.inputs(0, self.states)
        numbers = g.inputs(self.states, len(self.first.outputs))
        begin = len(lu.numbers())
        rest = iter(numbers[begin:])
        unit = [(abs(k - float(r)) < 0.5).select(1.0, 0.0) for r in range(size)]
        inverse = lu.renewed(g, numbers[:begin]).shortest(unit)
        column = g.constant(0.0)
        for r, row in enumerate(self._changes):
            terms = [(c, next(rest)) for c in row]
            entry = g.lift(total(x * inverse[c] for c, x in terms))
            column, sums[r] = column + abs(entry), sums[r] + abs(entry)
            squares = squares + entry * entry
        outputs = [k + 1.0, squares, largest.max(column), *sums, k + 1.5 < float(size)]
        return g.tape(outputs, self.states + len(numbers))

    @cached_property
    def last(self) -> Tape:
        """From state, parameters and sums to the new state."""
        lane, g = self._asked.lane, self._asked.lane.graph
        _, squares, largest, *sums = g.inputs(lane.inputs, self.states)
        row = g.constant(0.0)
        for one in sums:
            row = row.max(one)
        change = squares.min(largest * row).sqrt()
        tape = self.tapes.judged_tape(lane, change)
        return Tape(tape.nodes, tape.outputs[:-1], lane.inputs + self.states)

    def source(self, arrays: tuple[str, str, str]) -> Callable[[int], str]:
        """Text of an input of ``first`` and ``last``: of state, parameters or sums, by array."""
        state, parameters, sums = arrays
        states = self.tapes.states
        begin = states + 2 * self.tapes.problem.prescribed + 1

        def text(k: int) -> str:
            if k < states:
                return f"{state}[{k}]"
            return f"{parameters}[{k - states}]" if k < begin else f"{sums}[{k - begin}]"

        return text
