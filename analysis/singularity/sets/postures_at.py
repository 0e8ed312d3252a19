"""What measures and equations need at postures: closures, task, derivatives, steps.

All from machine code, for one posture or for many at once.
"""

from __future__ import annotations

import threading
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from weakref import WeakKeyDictionary

import numpy as np
import pinocchio as pin

from closedchain.closure.mechanism import Mechanism
from closedchain.closure.tape.bodies import Entries
from closedchain.closure.tape.machine import Compiled, compiled
from closedchain.closure.tape.rates import physical_rates
from closedchain.closure.tape.rows import Kinematics, kinematics
from closedchain.closure.tape.slopes import slopes_of_product
from closedchain.closure.tape.verified import verify
from closedchain.urdf.description import OUTPUTS


@dataclass(frozen=True, eq=False)
class Postures:
    """Closures and task at a posture; a leading n before every shape where there are many.

    Attributes
    ----------
    residual : (rows,) array
        Closures, dimensionless.
    closures : (rows, nv) array
        K, dimensionless.
    task : (d, nv) array
        J, dimensionless: one or two rotations are components along the tip's own axes.
    """

    residual: np.ndarray
    closures: np.ndarray
    task: np.ndarray


@dataclass(frozen=True, eq=False)
class FirstOrderCode:
    """Machine code for K and J of a mechanism and outputs, and for slopes of their combinations."""

    mechanism: Mechanism
    outputs: tuple[str, ...]

    def at(self, q: np.ndarray) -> Postures:
        """Closures and task at ``q`` (nq,) or (n, nq), unchecked."""
        rows, nv, some = self.mechanism.rows, self.mechanism.model.nv, q.shape[:-1]
        numbers = self._matrices(q)
        first, second = rows, rows + rows * nv
        return Postures(
            numbers[..., :first],
            numbers[..., first:second].reshape(*some, rows, nv),
            numbers[..., second:].reshape(*some, len(self.outputs), nv),
        )

    def slopes(self, q: np.ndarray, left: np.ndarray, right: np.ndarray) -> np.ndarray:
        """Derivative (nv,) of left^T [K; J] right, left (rows + d,) and right (nv,) held.

        Along dimensionless steps in Pinocchio's v; of many postures, each with its own.
        """
        return self._slopes(q, left, right)

    def rates(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """P (n, k, nv) and the tip's motions (n, 6, nv) at postures (n, nq), dimensionless.

        P as ``closure.joint_rates.physical_rates``; motions along the world's axes.
        """
        nv, numbers = self.mechanism.model.nv, self._rates(q)
        both = numbers.reshape(len(q), -1, nv)
        return both[:, :-6], both[:, -6:]

    @cached_property
    def _rates(self) -> OnTape:
        k = kinematics(self.mechanism)
        g, nv = k.graph, self.mechanism.model.nv
        zero, one = g.constant(0.0), g.constant(1.0)
        columns = physical_rates(k, [{v: one} for v in range(nv)])
        rows: list[Entries] = [
            {v: x for v, x in enumerate(row) if x.value != 0.0}
            for row in zip(*columns, strict=True)
        ]
        rows += k.task(self.mechanism.required_task().tip, range(6))
        dense = [row.get(v, zero) for row in map(k.own, rows) for v in range(nv)]
        return OnTape(compiled(g.tape(dense, self.mechanism.model.nq)))

    @cached_property
    def _matrices(self) -> OnTape:
        k, rows, task = self._written()
        zero = k.graph.constant(0.0)
        nv = self.mechanism.model.nv
        dense = [row.get(v, zero) for row in rows + task for v in range(nv)]
        verify(self.mechanism, self.outputs)
        return OnTape(compiled(k.graph.tape([*k.closures.values, *dense], self.mechanism.model.nq)))

    @cached_property
    def _slopes(self) -> OnTape:
        k, rows, task = self._written()
        return OnTape(compiled(slopes_of_product(k, rows + task)))

    def _written(self) -> tuple[Kinematics, list[Entries], list[Entries]]:
        k = kinematics(self.mechanism, upright=False)  # K is then the derivative of open rows, too
        task: list[Entries] = []
        if self.outputs:
            tip = self.mechanism.required_task().tip
            task = k.task(tip, [OUTPUTS.index(n) for n in self.outputs])
        return k, [k.own(row) for row in k.closures.entries], [k.own(row) for row in task]


class OnTape:
    """A compiled tape on inputs in parts, for one posture or for many."""

    def __init__(self, code: Compiled) -> None:
        """Prepare single postures."""
        self._code = code
        self._alone = _Alone(code)

    def __call__(self, *parts: np.ndarray) -> np.ndarray:
        """Outputs (outputs,) for parts (k,), or (n, outputs) for parts (n, k)."""
        if parts[0].ndim == 1:
            return self._alone.run(parts)
        x = np.concatenate([part.T for part in parts])
        return self._code.run(x).T


class _Alone(threading.local):
    """Memory for one posture at a time, its own in every thread."""

    def __init__(self, code: Compiled) -> None:
        x, out = np.zeros((code.inputs, 1)), np.empty((code.outputs, 1))
        self._x, self._out, self._call = x[:, 0], out[:, 0], code.bound(x, out)

    def run(self, parts: Sequence[np.ndarray]) -> np.ndarray:
        begin = 0
        for part in parts:
            end = begin + part.size
            self._x[begin:end] = part
            begin = end
        self._call()
        return self._out.copy()


_CODES: WeakKeyDictionary[Mechanism, dict[tuple[str, ...], FirstOrderCode]] = WeakKeyDictionary()


def first_order_code(mechanism: Mechanism, outputs: tuple[str, ...]) -> FirstOrderCode:
    """Machine code for a mechanism and outputs, made once; compiled when first used."""
    known = _CODES.setdefault(mechanism, {})
    if outputs not in known:
        known[outputs] = FirstOrderCode(mechanism, outputs)
    return known[outputs]


def moved(mechanism: Mechanism, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Postures after steps v [m, rad]: ``pin.integrate`` for one (nq,) or many (n, nq)."""
    if mechanism.model.nq == mechanism.model.nv:
        return np.asarray(q + v)
    if q.ndim == 1:
        return np.asarray(pin.integrate(mechanism.model, q, v))
    return np.array([pin.integrate(mechanism.model, *both) for both in zip(q, v, strict=True)])


def apart(mechanism: Mechanism, one: np.ndarray, two: np.ndarray) -> np.ndarray:
    """Steps [m, rad] from postures to others, for one or many: ``pin.difference``."""
    if mechanism.model.nq == mechanism.model.nv:
        return np.asarray(two - one)
    if one.ndim == two.ndim == 1:
        return np.asarray(pin.difference(mechanism.model, one, two))
    one, two = np.broadcast_arrays(one, two)
    every = [pin.difference(mechanism.model, *both) for both in zip(one, two, strict=True)]
    return np.array(every).reshape(len(one), mechanism.model.nv)
