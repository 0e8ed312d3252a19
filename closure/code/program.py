"""What a program of a mechanism computes: its ways, its tapes and its numbers, in no language yet.

The position problems are those of ``closure.position``: the same steps, on the same tapes, with
the same rules. What a program does not have is Pinocchio and LAPACK. So it follows a branch by one
choice of rows and pivots, made here; where that alone fails, it ends, and ``closure.solve.ways``
would go on.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pinocchio as pin

from closedchain.closure.generic import GenericRanks, generic_ranks
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.position import driven, posed
from closedchain.closure.solve.control import Precision
from closedchain.closure.solve.outcome import Ending
from closedchain.closure.solve.problem import problem_of
from closedchain.closure.solve.step_tapes import StepTapes
from closedchain.closure.tape.bodies import Entries
from closedchain.closure.tape.elimination import parity
from closedchain.closure.tape.expression import Expr, Tape
from closedchain.closure.tape.rates import physical_rates
from closedchain.closure.tape.rows import Kinematics, kinematics
from closedchain.closure.tape.slopes import slopes_of_product
from closedchain.urdf.description import OUTPUTS

ENDINGS = (
    Ending.ARRIVED,
    Ending.UNTRIED,
    Ending.SINGULAR_START,
    Ending.OPEN_START,
    Ending.FAR,
    Ending.SLOW,
    Ending.SINGULAR,
    Ending.OTHER_SIDE,
    Ending.RANK,
    Ending.OPEN,
    Ending.DEGENERATE,
    Ending.CONTRADICTION,
    Ending.MIRRORED,
    Ending.REVERSED,
    Ending.BUDGET,
)
"""How a program's functions end, of all endings."""

FALL = -9.81
"""Free fall [m/s^2] along the world's z, unless another is given."""

MORE = 6
"""Closed motions beyond the generic ones that a program has room for."""


@dataclass(frozen=True, eq=False)
class Matrices:
    """The first-order kinematics: entries that are not zero of matrices one below the other.

    These are K, J of the outputs, P, and what loads do work on: the tip's twist [m, rad], and the
    mass moments [kg m]. ``places`` are the entries' places, row by row; ``rates`` counts rows of P.
    """

    tape: Tape
    places: tuple[int, ...]
    rates: int


@dataclass(frozen=True, eq=False)
class Program:
    """A mechanism, an accuracy, and everything that is written about the two.

    Attributes
    ----------
    outputs : tuple of str
        Of the task, in their order; none without a task.
    """

    mechanism: Mechanism
    precision: Precision
    outputs: tuple[str, ...]

    # -- the ways ----------------------------------------------------------------------------------

    @cached_property
    def direct(self) -> StepTapes | None:
        """The direct position problem; None without inputs."""
        if not self.mechanism.inputs:
            return None
        return StepTapes(driven(self.mechanism), self.precision)

    @cached_property
    def inverse(self) -> StepTapes | None:
        """The inverse position problem; None without a task."""
        if not self.outputs:
            return None
        return StepTapes(posed(self.mechanism, self.outputs), self.precision)

    @property
    def ways(self) -> Iterator[tuple[str, StepTapes]]:
        """Those that there are, by name."""
        for name, tapes in (("direct", self.direct), ("inverse", self.inverse)):
            if tapes is not None:
                yield name, tapes

    @property
    def measured(self) -> bool:
        """Whether there are inputs and outputs to be related."""
        return self.direct is not None and self.inverse is not None

    @cached_property
    def closures(self) -> StepTapes:
        """The closures alone, with nothing prescribed: to check a posture."""
        return StepTapes(problem_of(self.mechanism), self.precision)

    # -- what a posture is -------------------------------------------------------------------------

    @cached_property
    def bodies(self) -> Tape:
        """From q to the pose of the body behind every joint of the tree.

        Twelve numbers each: the axes x, y and z, then the origin [m], in the world.
        """
        k = kinematics(self.mechanism)
        found: list[Expr] = []
        for joint in range(1, self.mechanism.model.njoints):
            turned, origin = k.frame(joint, pin.SE3.Identity())
            found += [k.graph.lift(turned[r][c]) for c in range(3) for r in range(3)]
            found += [self.mechanism.length * k.graph.lift(x) for x in origin]
        return k.graph.tape(found, self.mechanism.model.nq)

    @cached_property
    def moved(self) -> Tape:
        """From q and a dimensionless motion to q after it, for small ones."""
        k, model = kinematics(self.mechanism), self.mechanism.model
        steps = k.graph.inputs(model.nq, model.nv)
        return k.graph.tape(k.moved(k.q, dict(enumerate(steps))), model.nq + model.nv)

    @cached_property
    def matrices(self) -> Matrices:
        """From q to the matrices, for dimensionless rates."""
        k = kinematics(self.mechanism)
        nv = self.mechanism.model.nv
        one = k.graph.constant(1.0)
        columns = physical_rates(k, [{v: one} for v in range(nv)])
        rates = [{v: column[r] for v, column in enumerate(columns)} for r in range(len(columns[0]))]
        rows: list[Entries] = [*k.closures.entries, *self._task(k), *rates, *self._loaded(k)]
        places = [
            (r * nv + v, entry)
            for r, row in enumerate(rows)
            for v, entry in sorted(row.items())
            if entry.value != 0.0
        ]
        tape = k.graph.tape([entry for _, entry in places], self.mechanism.model.nq)
        return Matrices(tape, tuple(place for place, _ in places), len(rates))

    @cached_property
    def closure_values(self) -> Tape:
        """From q to the closure rows, dimensionless."""
        k = kinematics(self.mechanism)
        return k.graph.tape(k.closures.values, self.mechanism.model.nq)

    @cached_property
    def slopes(self) -> Tape:
        """From q, left and right to the slopes of left^T [K; J] right along motions.

        Floating joints move along the axes of the frame that they float in, as in ``matrices``.
        """
        k = kinematics(self.mechanism)
        return slopes_of_product(k, [*k.closures.entries, *self._task(k)], own=False)

    def _task(self, k: Kinematics) -> list[Entries]:
        if not self.outputs:
            return []
        tip = self.mechanism.required_task().tip
        return k.task(tip, [OUTPUTS.index(name) for name in self.outputs])

    def _loaded(self, k: Kinematics) -> list[Entries]:
        """Rates [m, rad] of the tip along the world's axes, then of the sum of masses times places.

        A wrench and a free fall [m/s^2] do work on them.
        """
        m, found = self.mechanism, []
        if self.outputs:
            for i, row in enumerate(k.task(m.required_task().tip, range(6))):
                unit = m.length if i < 3 else 1.0
                found.append({v: unit * entry for v, entry in row.items()})
        moments: list[Entries] = [{}, {}, {}]
        for joint in range(1, m.model.njoints):
            inertia = m.model.inertias[joint]
            if not inertia.mass > 0.0:
                continue
            _, place = k.frame(joint, pin.SE3(np.eye(3), np.array(inertia.lever)))
            for v, (linear, _) in k.relative(0, joint, place).items():
                for row, x in zip(moments, linear, strict=True):
                    entry = (inertia.mass * m.length) * k.graph.lift(x)
                    row[v] = row[v] + entry if v in row else entry
        return [*found, *moments]

    # -- numbers -----------------------------------------------------------------------------------

    @cached_property
    def generic(self) -> GenericRanks:
        """Ranks at a generic posture."""
        return generic_ranks(self.mechanism, self.outputs)

    @property
    def redundant(self) -> bool:
        """Whether closure rows depend on each other."""
        return self.mechanism.model.nv - self.generic.motions < self.mechanism.rows

    @property
    def driven_freedoms(self) -> int:
        """Freedoms at a generic posture that are not idle, less its freedoms: b - n."""
        return self.generic.together.value - self.generic.motions

    @property
    def has_det_direct(self) -> bool:
        """Whether K_p is square, of independent rows."""
        return self.generic.motions == len(self.mechanism.inputs)

    @property
    def has_det_inverse(self) -> bool:
        """Whether [K; J] is square, of independent rows."""
        return self.generic.motions == len(self.outputs)

    @property
    def order(self) -> int:
        """Sign of the permutation from all coordinates to the passive ones, then the inputs."""
        m = self.mechanism
        return parity([*(int(v) for v in m.passive_v), *(int(v) for v in m.input_v)])

    @property
    def first_rate(self) -> int:
        """Row of ``matrices`` that P begins with."""
        return self.mechanism.rows + len(self.outputs)

    @property
    def matrix_rows(self) -> int:
        """Rows of ``matrices``: those of P are followed by nine that loads do work on."""
        return self.first_rate + self.matrices.rates + 9

    @cached_property
    def constants(self) -> dict[str, int]:
        """Sizes and choices by name."""
        m, g = self.mechanism, self.generic
        rank = m.model.nv - g.motions
        return {
            "Q": m.model.nq,
            "V": m.model.nv,
            "INPUTS": len(m.inputs),
            "OUTPUTS": len(self.outputs),
            "ROWS": m.rows,
            "RATES": self.matrices.rates,
            "K_RANK": rank,
            "MOTIONS": g.motions,
            "MOST_MOTIONS": min(m.model.nv, g.motions + min(rank, MORE)),
            "DRIVEN": self.driven_freedoms,
            "PRODUCED": g.outputs.value,
            "DET_DIRECT": int(self.has_det_direct),
            "DET_INVERSE": int(self.has_det_inverse),
            "ORDER": self.order,
        }

    @cached_property
    def output_units(self) -> np.ndarray:
        """Unit of each output's rate: ``length`` or 1."""
        return np.array([self.mechanism.length if n in "xyz" else 1.0 for n in self.outputs])

    @cached_property
    def coordinates(self) -> list[tuple[str, str]]:
        """Name and unit of every number of q."""
        m = self.mechanism
        found: list[tuple[str, str]] = []
        for name, joint in list(zip(m.model.names, m.model.joints, strict=True))[1:]:
            if joint.nq == 1:
                found.append((name, "m" if m.translational[joint.idx_v] else "rad"))
            else:
                parts = zip(
                    ("x", "y", "z", "qx", "qy", "qz", "qw"), ("m",) * 3 + ("1",) * 4, strict=True
                )
                found += [(f"{name}.{part}", unit) for part, unit in parts]
        return found
