"""Positions of all joints from those of the driven ones, kept on one branch from call to call."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike

from closedchain.analysis.motion.track.tracking import track
from closedchain.closure.given import by_name, finite_number
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.nearest import beyond_limits, limit_note
from closedchain.closure.position import direct
from closedchain.closure.solution import Solution
from closedchain.closure.solve.outcome import Ending
from closedchain.urdf.errors import ClosureError, known_names


@dataclass(frozen=True, eq=False)
class JointPositions:
    """Where all joints are, for given values of the driven ones.

    Attributes
    ----------
    q : (nq,) array
        The posture: the one asked for, or the guess where the way to it meets a singularity.
    names : tuple of str
        Joints of the spanning tree that have one freedom, in its order.
    values : (len(names),) array
        Their positions [m or rad].
    floating : mapping of str to (7,) array
        Poses of bodies that the tree carries on a floating joint, by the joint's name: x y z [m]
        and the unit quaternion x y z w.
    residual : float
        Largest closure row [m or rad].
    branch : int or None
        Sign of the determinant that is kept; None where the equations are not square.
    arrived : bool
        Whether the driven joints have the values that were asked for.
    kinds : frozenset of str
        Kinds of the singularity that stopped them, as ``cc.classify`` gives them.
    beyond_limits : tuple of str
        Joints outside their limits, which stop nothing.
    message : str
        What happened, in words.

    Examples
    --------
    >>> m = cc.load("d1")
    >>> found = cc.joint_positions(m, {"q1": 0.53})
    >>> found.arrived, list(found.floating), found.message
    (True, ['coupler_pose', 'platform_pose'], 'arrived')
    """

    q: np.ndarray
    names: tuple[str, ...]
    values: np.ndarray
    floating: Mapping[str, np.ndarray]
    residual: float
    branch: int | None
    arrived: bool
    kinds: frozenset[str]
    beyond_limits: tuple[str, ...]
    message: str

    def __post_init__(self) -> None:
        """Write-protect the arrays: a result is a value."""
        for array in (self.q, self.values, *self.floating.values()):
            array.setflags(write=False)


def driven_joints(mechanism: Mechanism) -> tuple[str, ...]:
    """Return the joint that each input drives, in the order of ``mechanism.inputs``."""
    by_name = {spec.name: spec.joint for spec in mechanism.description.inputs}
    return tuple(by_name[name] for name in mechanism.inputs)


def joint_positions(
    mechanism: Mechanism, values: Mapping[str, float], guess: ArrayLike | None = None
) -> JointPositions:
    """Positions of all joints when driven joints move to new values, from ``guess`` on its branch.

    The driven joints move on a straight line, together. Where that meets a singularity, or where
    the loops do not let the inputs have these values, nothing moves, and the answer says why. A
    program that follows a stream of values passes each answer's ``q`` as the next guess.

    Parameters
    ----------
    values : mapping of str to float
        Values [m or rad] by the name of the input, or of the joint that it drives. Those that are
        not given stay as they are at the guess.
    guess : (nq,) array, optional
        The last posture; home by default.

    Raises
    ------
    ClosureError
        A mechanism without inputs or without a closed home, unknown names, malformed numbers.

    Examples
    --------
    >>> m = cc.load("linear_delta")
    >>> found = cc.joint_positions(m, {"q1": -0.16, "leg2_P": -0.12})
    >>> found.arrived, len(found.names), found.residual < 1e-12
    (True, 16, True)
    >>> cc.joint_positions(m, {"q3": -0.1}, found.q).arrived
    True
    """
    mechanism.required_inputs()
    start = mechanism.closed_home() if guess is None else mechanism.configuration(guess)
    now = mechanism.input_values(start)
    wanted = _wanted(mechanism, values, now)
    found: Solution = direct(mechanism, wanted[None], start)[0]
    if found.converged:
        return _positions(mechanism, found, frozenset(), "")
    q, kinds, why = _stopped(mechanism, start, now, wanted)
    there = wanted if q is not None else now
    found = direct(mechanism, there[None], start if q is None else q)[0]
    return _positions(mechanism, found, kinds, why)


def _wanted(mechanism: Mechanism, values: Mapping[str, float], now: np.ndarray) -> np.ndarray:
    """Values of all inputs (n_inputs,)."""
    column = {name: i for i, name in enumerate(driven_joints(mechanism))}
    column |= {name: i for i, name in enumerate(mechanism.inputs)}
    wanted, given = now.copy(), dict[int, str]()
    for name, value in by_name(values, "values", f"{{{mechanism.inputs[0]!r}: 0.5}}").items():
        if name not in column:
            raise ClosureError(known_names(str(name), "driven joint", column))
        i = column[name]
        if i in given:
            raise ClosureError(f"{given[i]} and {name} are the same driven joint")
        given[i] = name
        wanted[i] = finite_number(value, f"the value of {name}", mechanism.input_units[i])
    return wanted


def _stopped(
    mechanism: Mechanism, start: np.ndarray, now: np.ndarray, wanted: np.ndarray
) -> tuple[np.ndarray | None, frozenset[str], str]:
    """Kinds of the singularity on the straight way and a sentence, or the posture at its end.

    ``track`` steps more finely than ``direct`` and locates what it cannot pass.
    """
    way = track(mechanism, np.array([now, wanted]), start=start)
    if way.stop is None:
        return way.q[-1], frozenset(), ""
    stop = way.stop
    if stop.ending is Ending.FOLD:
        article = "an" if min(stop.kinds) == "inverse" else "a"
        at = now + min(stop.where, 1.0) * (wanted - now)
        names = ", ".join(f"{n}={x:.6g}" for n, x in zip(mechanism.inputs, at, strict=True))
        return None, stop.kinds, (
            f"stopped: the way meets {article} {' and '.join(sorted(stop.kinds))} singularity "
            f"after {stop.where:.1%}, at {names}"
        )  # fmt: skip
    alone = direct(mechanism, wanted, start)
    return None, stop.kinds, f"stopped: {stop.message if alone.converged else alone.message}"


def _positions(
    mechanism: Mechanism, found: Solution, kinds: frozenset[str], why: str
) -> JointPositions:
    q, model = found.q, mechanism.model
    joints = list(zip(model.names, model.joints, strict=True))[1:]
    single = [(name, joint.idx_q) for name, joint in joints if joint.nq == 1]
    poses = {name: q[j.idx_q : j.idx_q + j.nq].copy() for name, j in joints if j.nq > 1}
    beyond = beyond_limits(mechanism, q)
    return JointPositions(
        q=q,
        names=tuple(name for name, _ in single),
        values=q[[i for _, i in single]],
        floating=MappingProxyType(poses),
        residual=float(np.abs(mechanism.workspace.residual(q)).max(initial=0.0)),
        branch=found.branch,
        arrived=not why,
        kinds=kinds,
        beyond_limits=beyond,
        message=(why or "arrived") + limit_note(beyond),
    )
