"""``cc.direct`` and ``cc.inverse``: position problems from a guess, or from a mode by name."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from closedchain.closure import position
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.modes.choosing import mode_posture
from closedchain.urdf.errors import ClosureError


def direct(
    mechanism: Mechanism,
    input_values: ArrayLike | Mapping[str, float],
    guess: ArrayLike | None = None,
    *,
    mode: str | int | None = None,
) -> Any:
    """Direct position problem: the posture with given inputs, on the assembly branch of ``guess``.

    The inputs move on a straight line from those of the guess; the branch is followed in
    sub-steps. A path that meets a direct singularity ends there: the answer then says where, and
    carries the closest posture that could be found.

    Parameters
    ----------
    input_values : (n_inputs,) array, or mapping of input name to value
        [m or rad]. (n, n_inputs) for many at once.
    guess : (nq,) array, optional
        Posture whose branch is kept; home by default. It need not be closed to the last digit.
        (n, nq) gives each of many its own.
    mode : str or int, optional
        A named posture of the description in the place of the guess, or the name or number that a
        mode has in ``cc.postures(m, inputs=m.input_values(m.home))``.

    Returns
    -------
    Solution
        ``Solutions`` for many at once.

    Raises
    ------
    ClosureError
        Malformed numbers, unknown or missing inputs, an unknown mode, a guess and a mode, or a
        mechanism without inputs.

    Examples
    --------
    >>> m = cc.load("linear_delta")
    >>> s = cc.direct(m, {"q1": -0.1, "q2": -0.15, "q3": -0.2}).raise_if_failed()
    >>> print(m.point(s.q, "P").round(4))  # where the tip is [m]
    [ 0.1117  0.0597 -0.5885]
    >>> cc.direct(m, np.tile([-0.1, -0.15, -0.2], (1000, 1))).q.shape  # a thousand at once
    (1000, 16)
    """
    if mode is not None:
        guess = _start(mechanism, guess, mode, working=False)
    return position.direct(mechanism, input_values, guess)


def inverse(
    mechanism: Mechanism,
    pose: pin.SE3 | Sequence[pin.SE3] | np.ndarray,
    guess: ArrayLike | None = None,
    outputs: str | tuple[str, ...] | list[str] | None = None,
    *,
    mode: str | int | None = None,
) -> Any:
    """Inverse position problem: a posture with the tip at ``pose``, on the branch of ``guess``.

    The tip moves from its pose at the guess: its origin on a straight line, its rotation about a
    fixed axis. Where the guess itself is singular there is no branch to follow; the equations are
    then solved by descent from the guess and from nearby starts.

    Parameters
    ----------
    pose : pin.SE3
        Of the tip in the world. Components that are no outputs are not used. For many at once a
        sequence of them, or an (n, 7) array of origins [m] and unit quaternions x y z w.
    guess : (nq,) array, optional
        Home by default; (n, nq) gives each of many its own.
    outputs : str, optional
        Outputs that are prescribed; those of the task by default.
    mode : str or int, optional
        A named posture of the description in the place of the guess, or the name or number that a
        working mode has in ``cc.postures(m, pose=m.pose(m.home))``.

    Returns
    -------
    Solution
        ``Solutions`` for many at once. With fewer outputs than freedoms, the posture is the one
        that short steps from the guess lead to.

    Raises
    ------
    ClosureError
        No task, malformed pose, outputs or guess, an unknown mode, a guess and a mode.

    Examples
    --------
    >>> m = cc.load("linear_delta")
    >>> goal = m.pose(m.home)
    >>> goal.translation = np.array([0.05, 0.0, -0.55])
    >>> s = cc.inverse(m, goal).raise_if_failed()
    >>> print(m.input_values(s.q).round(4))  # sliders [m]
    [-0.073  -0.1056 -0.1056]
    """
    if mode is not None:
        guess = _start(mechanism, guess, mode, working=True)
    return position.inverse(mechanism, pose, guess, outputs)


def _start(
    mechanism: Mechanism, guess: ArrayLike | None, mode: str | int, *, working: bool
) -> np.ndarray:
    """Posture (nq,) of a mode that stands in the place of a guess."""
    if guess is not None:
        raise ClosureError("give either a guess or a mode to start from, not both")
    return mode_posture(mechanism, mode, working=working)
