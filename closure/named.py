"""Named postures: what the ``<group_state>`` elements of a description state, with closed loops.

A name stands for a working or assembly mode, so closing must not leave what is stated: a search
that wandered off would end in another mode under the wrong name.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
import pinocchio as pin

from closedchain.closure.constraints import residual
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.nearest import close, closed_beside, open_closure
from closedchain.closure.solution import Solution
from closedchain.urdf.errors import ClosureError

HOME = "home"
MOVED = 1e-6  # m or rad that closing may move a stated joint value


class Postures(Mapping[str, np.ndarray]):
    """Closed postures (nq,) of a mechanism by name, read-only, "home" first.

    A posture is closed when it is first asked for and kept; names, length and membership close
    nothing. ``Mechanism.posture`` is the same with an error that lists the known names.
    """

    def __init__(self, mechanism: Mechanism) -> None:
        """Know the home posture; the others follow on demand."""
        self._mechanism = mechanism
        self._closed = {HOME: mechanism.home}

    def __getitem__(self, name: str) -> np.ndarray:
        """Posture (nq,), write-protected.

        Raises
        ------
        KeyError
            Unknown name.
        ClosureError
            The loops do not close where the description states the posture.
        """
        if name not in self._closed:
            stated = self._mechanism.description.states[name]
            # two threads may come here at once: both then return the array that was first
            return self._closed.setdefault(name, _closed(self._mechanism, name, stated))
        return self._closed[name]

    def __contains__(self, name: object) -> bool:
        """Whether there is a posture of that name."""
        return name == HOME or (
            isinstance(name, str) and name in self._mechanism.description.states
        )

    def __iter__(self) -> Iterator[str]:
        """Names, "home" first, then in document order."""
        yield HOME
        yield from self._mechanism.description.states

    def __len__(self) -> int:
        """Count the names."""
        return 1 + len(self._mechanism.description.states)

    def __repr__(self) -> str:
        """Name the postures."""
        return f"Postures({', '.join(self)})"


def _closed(mechanism: Mechanism, name: str, stated: Mapping[str, tuple[float, ...]]) -> np.ndarray:
    """Closed posture (nq,) with the stated joints where they are stated, to ``MOVED``."""
    guess = mechanism.home.copy()
    for joint_name, values in stated.items():
        joint = mechanism.model.joints[mechanism.model.getJointId(joint_name)]
        guess[joint.idx_q : joint.idx_q + joint.nq] = values
    if not mechanism.closures:
        guess.setflags(write=False)
        return guess
    solution = closed_beside(mechanism, guess)
    problem = _problem(mechanism, guess, solution, stated)
    if problem:
        # few joints stated: hold them, and only the others, which start at home, have to move
        solution = close(mechanism, guess, fixed=stated)
        if _problem(mechanism, guess, solution, stated):
            gap = open_closure(mechanism, residual(mechanism, guess))
            raise ClosureError(
                f"the posture {name!r} of {mechanism.name!r} cannot be closed as its "
                f"<group_state> states it, where {gap}: {problem}"
            )
    return solution.q


def _problem(
    mechanism: Mechanism,
    guess: np.ndarray,
    solution: Solution,
    stated: Mapping[str, tuple[float, ...]],
) -> str:
    """What is wrong with a solution as the closed form of what is stated; empty where nothing."""
    if not solution.converged:
        return solution.message
    moved = np.abs(pin.difference(mechanism.model, guess, solution.q))
    joints = [mechanism.model.joints[mechanism.model.getJointId(name)] for name in stated]
    worst = [float(moved[joint.idx_v : joint.idx_v + joint.nv].max()) for joint in joints]
    if not worst or max(worst) <= MOVED:
        return ""
    index = int(np.argmax(worst))
    joint = joints[index]
    near = " ".join(f"{x:.12g}" for x in solution.q[joint.idx_q : joint.idx_q + joint.nq])
    return (
        f"the nearest closed posture moves joint {list(stated)[index]!r} by {worst[index]:.3g}, "
        f"to {near} (at most {MOVED:g} is accepted); state values that close, or fewer joints: "
        "those left out follow, from home"
    )
