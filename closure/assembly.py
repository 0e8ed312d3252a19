"""Home: the closed posture nearest to the one that is stated.

Inputs are moved last: what a user says of the motors is meant, what the passive joints do follows.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from closedchain.closure.mechanism import Mechanism
from closedchain.closure.nearest import MOST_WORK, closed_beside
from closedchain.closure.solution import Solution
from closedchain.closure.solve.control import CLOSED
from closedchain.closure.solve.starts import scattered, turned


@dataclass(frozen=True)
class Assembled:
    """A posture for home.

    Attributes
    ----------
    q : (nq,) array
    open : float
        Largest closure row there [m, rad]; 0 where it is closed.
    message : str
        What is wrong with it, in words; empty where nothing is.
    """

    q: np.ndarray
    open: float = 0.0
    message: str = ""


def assembled(mechanism: Mechanism) -> Assembled:
    """Closed posture nearest to the stated home, within the limits where there is one.

    First with the inputs where they are: beside the stated posture, then from the same starts
    around it and with angles anywhere, of which the nearest counts. Then with inputs free, the last
    one first. Where nothing closes, the least open posture that was met.
    """
    guess = mechanism.home
    if not mechanism.closures:
        return Assembled(guess)
    held, everything = mechanism.input_v, np.arange(mechanism.model.nv)
    tried: list[Solution] = []
    # as many inputs as may be stay where they are: the last ones give way first
    for count in range(held.size, -1, -1):
        free = np.setdiff1d(everything, held[:count])
        if not free.size:
            continue
        tried.append(closed_beside(mechanism, guess, free))
        if not _good(tried[-1]) and count in (0, held.size):
            tried += _searched(mechanism, guess, free)
        good = [found for found in tried if _good(found)]
        if good:
            return Assembled(min(good, key=lambda one: _distance(mechanism, guess, one.q)).q)
    beyond = next((found for found in tried if found.converged), None)
    if beyond is not None:
        return Assembled(beyond.q, 0.0, beyond.message)
    return _open(min(tried, key=lambda found: found.residual))


def moved(mechanism: Mechanism, stated: np.ndarray, q: np.ndarray) -> dict[str, float]:
    """How far each joint is from where it is stated [m, rad]; the largest of a body's six."""
    change = np.abs(pin.difference(mechanism.model, stated, q))
    joints = zip(list(mechanism.model.names)[1:], list(mechanism.model.joints)[1:], strict=True)
    return {name: float(change[j.idx_v : j.idx_v + j.nv].max()) for name, j in joints}


def _good(found: Solution) -> bool:
    return found.converged and not found.beyond_limits


def _searched(mechanism: Mechanism, guess: np.ndarray, free: np.ndarray) -> list[Solution]:
    """Where descents from starts elsewhere lead to.

    The nearest starts first; those anywhere only where none of these closes.
    """
    found: list[Solution] = []
    spent, most = 0, MOST_WORK / mechanism.model.nv**3
    for starts in (scattered(mechanism, guess, free)[1:], turned(mechanism, guess, free)):
        for start in starts:
            found.append(closed_beside(mechanism, np.clip(start, *mechanism.limits), free))
            spent += found[-1].iterations
            if spent > most:
                return found
        if any(_good(one) for one in found):
            break
    return found


def _distance(mechanism: Mechanism, one: np.ndarray, two: np.ndarray) -> float:
    change = pin.difference(mechanism.model, one, two) / mechanism.column_scale
    return float(np.linalg.norm(change))


def _open(found: Solution) -> Assembled:
    # what closes only with a mirrored joint is open by half a turn
    return Assembled(found.q, found.residual if found.residual >= CLOSED else np.pi, found.message)
