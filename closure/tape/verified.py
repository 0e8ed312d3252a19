"""Tapes compared with Pinocchio, which stays the authority: what differs does not serve.

Rows of closures, their Jacobian and the tip's task Jacobian, as ``closure.tape.rows`` writes them,
against those of ``Mechanism.workspace`` and ``closure.task`` at closed postures.
"""

from __future__ import annotations

from collections.abc import Sequence
from weakref import WeakKeyDictionary

import numpy as np

from closedchain.closure.closures import Closure
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.solve.samples import closed_samples
from closedchain.closure.tape.bodies import Entries
from closedchain.closure.tape.expression import Expr
from closedchain.closure.tape.numbers import evaluate
from closedchain.closure.tape.rows import Kinematics, kinematics
from closedchain.closure.task import task_jacobian
from closedchain.urdf.description import OUTPUTS
from closedchain.urdf.errors import ClosedChainError

AGREE = 1e-10
"""Largest difference from Pinocchio, relative to 1 or to the number itself where that is larger."""

POSTURES = 2

_VERIFIED: WeakKeyDictionary[Mechanism, set[tuple[str, ...]]] = WeakKeyDictionary()


class TapeError(ClosedChainError):
    """A tape does not compute what Pinocchio does: an error of this package, not of its user."""


def verify(mechanism: Mechanism, outputs: tuple[str, ...] = ()) -> None:
    """Compare a mechanism's expressions with Pinocchio at two closed postures, once.

    Raises
    ------
    TapeError
        They differ.
    """
    known = _VERIFIED.setdefault(mechanism, set())
    if outputs not in known:
        postures = closed_samples(mechanism)[-POSTURES:]
        compare(kinematics(mechanism), outputs, postures)
        known.add(outputs)


def compare(k: Kinematics, outputs: tuple[str, ...], postures: np.ndarray) -> None:
    """Compare expressions, whose q are the graph's first inputs, at closed postures (n, nq).

    Raises
    ------
    TapeError
        They differ.
    """
    m = k.mechanism
    rows = k.closures
    task = k.task(m.required_task().tip, [OUTPUTS.index(n) for n in outputs]) if outputs else []
    wanted = [*rows.values, *_dense(k, rows.entries), *_dense(k, task)]
    tape = k.graph.tape(wanted, m.model.nq)
    found = np.array(
        [np.broadcast_to(x, len(postures)) for x in evaluate(tape, list(postures.T))], dtype=float
    ).reshape(len(wanted), len(postures))
    expected = np.array([_pinocchio(k, outputs, q) for q in postures]).T
    agree(f"the expressions of {m.name!r}", found, expected)


def agree(what: str, found: np.ndarray, expected: np.ndarray) -> None:
    """Refuse numbers that differ from what they should be.

    Raises
    ------
    TapeError
        They differ by more than ``AGREE``, or are no numbers.
    """
    off = np.abs(found - expected) / np.maximum(1.0, np.abs(expected))
    if not (off <= AGREE).all():
        raise TapeError(
            f"{what} differ from Pinocchio's by {np.max(off):.3g}, more than {AGREE:g}: "
            "machine code is not used; please report this with the mechanism"
        )


def _dense(k: Kinematics, rows: Sequence[Entries]) -> list[Expr]:
    """All entries of a Jacobian in Pinocchio's v, row by row."""
    zero = k.graph.constant(0.0)
    return [own.get(v, zero) for own in map(k.own, rows) for v in range(k.mechanism.model.nv)]


def _pinocchio(k: Kinematics, outputs: tuple[str, ...], q: np.ndarray) -> np.ndarray:
    """Rows, their Jacobian and the task Jacobian, dimensionless and flat."""
    m = k.mechanism
    values, jacobian = m.workspace.evaluate(q)
    values = np.array(values) / m.row_scale
    jacobian = np.array(jacobian) * m.column_scale / m.row_scale[:, None]
    if k.upright:
        _upright(m, values, jacobian)
    parts = [values, jacobian.ravel()]
    if outputs:
        units = np.array([m.length if name in "xyz" else 1.0 for name in outputs])
        task = task_jacobian(m, q, outputs) * m.column_scale / units[:, None]
        parts.append(task.ravel())
    return np.concatenate(parts)


def _upright(m: Mechanism, values: np.ndarray, jacobian: np.ndarray) -> None:
    """Turn rows that hold a point into the world's axes; joint placements are up to date."""
    begin = 0
    for closure in m.closures:
        if isinstance(closure, Closure) and closure.joint_kind.holds_point:
            three = slice(begin, begin + 3)
            turn = (m.workspace.data.oMi[closure.joint1] * closure.placement1).rotation
            values[three], jacobian[three] = turn @ values[three], turn @ jacobian[three]
        begin += closure.rows
