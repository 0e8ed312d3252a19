"""``input_efforts``: the efforts that hold loads at many postures, by machine code.

The same equilibrium as ``statics``, for the inputs alone: with A the independent closure rows in
the columns without inputs, A^T lambda = g_p and tau = g_a - K_a^T lambda. Weights enter joint by
joint, as the weight of all that the joint carries at its centre of mass.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from closedchain.analysis.first_order import OPEN
from closedchain.analysis.forces.loads import Gravity, Wrenches, loads
from closedchain.analysis.forces.statics import statics
from closedchain.closure.generic import sampled_rank
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.solve.problem import Problem, problem_of
from closedchain.closure.tape.expression import Expr, Graph, total
from closedchain.closure.tape.machine import Compiled, compiled
from closedchain.closure.tape.rows import Kinematics
from closedchain.closure.tape.vectors import Vector, add, cross, dot, scale, sub
from closedchain.closure.tape.verified import POSTURES, agree
from closedchain.urdf.errors import ClosureError

PIVOT = 1e-6  # dimensionless: digits are lost in proportion to the smallest pivot


@dataclass(frozen=True, eq=False)
class EffortCode:
    """Machine code for the input efforts of a mechanism under weights and wrenches at some frames.

    Attributes
    ----------
    frames : tuple of str
        Where wrenches act.
    """

    mechanism: Mechanism
    frames: tuple[str, ...]

    @cached_property
    def problem(self) -> Problem:
        """The closures with all inputs prescribed."""
        return problem_of(self.mechanism, tuple(int(v) for v in self.mechanism.input_v))

    @cached_property
    def serves(self) -> bool:
        """Whether the inputs are as many as the freedoms: nothing idle, none to spare."""
        m = self.mechanism
        spare = m.model.nv - len(m.inputs) - (sampled_rank(m).rank.value if m.rows else 0)
        return spare == 0 and self.problem.square

    def run(self, q: np.ndarray, load: np.ndarray) -> np.ndarray:
        """Smallest pivot, largest closure row [m, rad], efforts [N, N m]: (2 + n_inputs, n).

        Parameters
        ----------
        q : (n, nq) array
        load : (3 + 6 frames,) array
            Acceleration of free fall, then the wrenches.
        """
        given = np.empty((q.shape[1] + load.size, len(q)))
        given[: q.shape[1]] = q.T
        given[q.shape[1] :] = load[:, None]
        return np.asarray(self._code.run(given))

    @cached_property
    def _code(self) -> Compiled:
        m, g = self.mechanism, Graph()
        nq = m.model.nq
        closures = self.problem.eliminated(g)
        load = g.inputs(nq, 3 + 6 * len(self.frames))
        needed = [-power for power in self._powers(closures.kinematics, load)]
        entries = closures.entries
        least: Expr = g.constant(1.0)
        multipliers: list[Any] = []
        if entries:
            least = closures.factors.least
            multipliers = closures.factors.solve_transposed(
                {v: needed[v] for v in self.problem.free}
            )
        efforts = []
        for v in map(int, m.input_v):
            carried = [row[v] * x for row, x in zip(entries, multipliers, strict=True) if v in row]
            efforts.append((needed[v] - total(carried)) * (1.0 / m.column_scale[v]))
        numbers = (least, closures.residual, *efforts)
        return compiled(g.tape([g.lift(x) for x in numbers], nq + len(load)))

    def _powers(self, k: Kinematics, load: list[Expr]) -> list[Any]:
        """Power of the loads in each unit motion of the tree, lengths in m.length: moments."""
        model, length = self.mechanism.model, self.mechanism.length
        fall = load[:3]
        mass, moment = self._carried(k)
        zero = k.graph.constant(0.0)
        powers: list[Any] = [zero] * model.nv
        for joint in range(1, model.njoints):
            if mass[joint] == 0.0:
                continue
            for v in k.tangent(joint):
                screw = k.screw(v)
                if screw.point is None:
                    powers[v] = (length * mass[joint]) * dot(screw.axis, fall)
                else:
                    lever = sub(moment[joint], scale(mass[joint], screw.point))
                    powers[v] = length * dot(cross(screw.axis, lever), fall)
        for i, name in enumerate(self.frames):
            (_, place), joint = k.named(name)
            force, turn = load[3 + 6 * i : 6 + 6 * i], load[6 + 6 * i : 9 + 6 * i]
            for v, (linear, angular) in k.relative(0, joint, place).items():
                powers[v] = powers[v] + length * dot(linear, force) + dot(angular, turn)
        return powers

    def _carried(self, k: Kinematics) -> tuple[list[float], list[Vector]]:
        """Mass [kg] that each joint carries, and its first moment in the world [kg lengths]."""
        model = self.mechanism.model
        zero = k.graph.constant(0.0)
        mass = [0.0] * model.njoints
        moment: list[Vector] = [[zero] * 3 for _ in range(model.njoints)]
        for i in reversed(range(1, model.njoints)):
            inertia = model.inertias[i]
            if inertia.mass:
                _, at = k.frame(i, pin.SE3(np.eye(3), np.array(inertia.lever)))
                mass[i] += float(inertia.mass)
                moment[i] = add(moment[i], scale(float(inertia.mass), at))
            parent = model.parents[i]
            mass[parent] += mass[i]
            moment[parent] = add(moment[parent], moment[i])
        return mass, moment


def input_efforts(
    mechanism: Mechanism,
    q: ArrayLike,
    wrench: Wrenches | None = None,
    gravity: Gravity = True,
    *,
    payload: Mapping[str, float] | None = None,
) -> np.ndarray:
    """Input efforts that hold a load, for one posture or many.

    The numbers are those of ``statics``, by machine code where the inputs are as many as the
    freedoms, else posture by posture.

    Parameters
    ----------
    q : (nq,) or (n, nq) array
        Closed postures.
    wrench, gravity, payload
        As for ``statics``.

    Returns
    -------
    (n_inputs,) or (n, n_inputs) array
        [N, N m]

    Raises
    ------
    ClosureError
        Malformed numbers, open postures, or one at which the load is not carried.

    Examples
    --------
    >>> m = cc.with_inertias(cc.load("linear_delta"))
    >>> many = cc.resets(m, 100, seed=1).q
    >>> cc.input_efforts(m, many, wrench=[0, 0, -20, 0, 0, 0]).shape  # [N]
    (100, 3)
    """
    postures = mechanism.configurations(q)
    table = np.atleast_2d(postures)
    on = loads(mechanism, wrench, gravity)
    wrenches = dict(on.wrenches)
    if payload:
        loads(mechanism, None, gravity, payload)  # checks it
        for frame, mass in payload.items():
            weight = np.concatenate([float(mass) * on.gravity, np.zeros(3)])
            wrenches[frame] = wrenches.get(frame, 0.0) + weight
    code = effort_code(mechanism, tuple(wrenches))
    if not code.serves:
        found = np.array([_alone(mechanism, one, wrenches, on.gravity) for one in table])
        return found if postures.ndim == 2 else found[0]
    told = code.run(table, np.concatenate([on.gravity, *wrenches.values()]))
    if not (told[1] <= OPEN).all():
        worst = int(np.argmax(told[1]))
        raise ClosureError(f"posture {worst} is not closed: a row is open by {told[1, worst]:.3g}")
    found = np.ascontiguousarray(told[2:].T)
    fine = np.abs(told[0]) > PIVOT
    if not fine.all():
        for i in np.flatnonzero(~fine):
            found[i] = _alone(mechanism, table[i], wrenches, on.gravity)
    return found if postures.ndim == 2 else found[0]


def _alone(
    mechanism: Mechanism, q: np.ndarray, wrenches: Mapping[str, np.ndarray], fall: np.ndarray
) -> np.ndarray:
    return np.asarray(statics(mechanism, q, wrenches, fall).raise_if_failed().inputs)


def effort_code(mechanism: Mechanism, frames: tuple[str, ...]) -> EffortCode:
    """Machine code for wrenches at some frames, made once and compared with ``statics``."""
    key = ("forces.efforts", frames)
    found: EffortCode | None = mechanism.known.get(key)
    if found is None:
        found = EffortCode(mechanism, frames)
        if found.serves:
            _verify(found)
        mechanism.known[key] = found
    return found


def _verify(code: EffortCode) -> None:
    """Compare with ``statics`` at two postures. Raises ``TapeError``."""
    m = code.mechanism
    wrenches = {name: np.arange(1.0, 7.0) for name in code.frames}
    fall = np.array([1.0, -2.0, -9.0])
    tried = code.problem.regular[-POSTURES:]
    told = code.run(tried, np.concatenate([fall, *wrenches.values()]))
    good = np.abs(told[0]) > PIVOT
    expected = np.array([statics(m, q, wrenches, fall).inputs for q in tried]).T
    size = max(1.0, np.abs(expected).max(initial=0.0))
    agree(f"efforts of {m.name!r}", told[2:, good] / size, expected[:, good] / size)
