"""Statics: the input efforts that hold a load, and what the loops and joints carry."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from closedchain.analysis.first_order import FirstOrder, first_order, moving_joints, tip_twists
from closedchain.analysis.forces.balance import Balance, balance, settled
from closedchain.analysis.forces.carrying import Carrying, Motion
from closedchain.analysis.forces.cut_wrenches import (
    coupling_efforts,
    cut_wrenches,
    row_wrenches,
)
from closedchain.analysis.forces.loads import (
    Gravity,
    Loads,
    Wrenches,
    added,
    body_forces,
    loads,
    moving_efforts,
    needed_efforts,
    no_forces,
)
from closedchain.analysis.singularity.deciding import Deciding
from closedchain.closure.closures import Coupling
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.ranks import Rank
from closedchain.urdf.errors import ClosureError

UNCARRIED = 1e-9  # work of a load on free motions, as a share of its size, that is rounding
COMPONENTS = ("fx", "fy", "fz", "mx", "my", "mz")
DETERMINED = 1e-9  # change by unit internal forces, in characteristic units, that is rounding


@dataclass(frozen=True, eq=False)
class Statics:
    """What holds a load.

    Attributes
    ----------
    inputs : (n_inputs,) array
        Efforts of the inputs [N for slides, N m for angles]. Where more than one choice holds the
        load, the least in the sum of squares, forces multiplied by the characteristic length.
    closures : mapping of str to (6,) array
        (force, moment) [N, N m] of each cut joint on its child, at the origin of its frame 2,
        along the axes of its frame 1.
    couplings : mapping of str to mapping of str to float
        Efforts [N, N m] that each mimic or relation puts on its joints.
    joints : mapping of str to (6,) array
        The wrench that each joint carries, cut ones included: for those of the tree (force,
        moment) on the child, at the joint's frame on the child, in its axes. The component along
        a driven joint's axis is the effort of its drive and of couplings. Fixed joints are no
        joints here, nor are floating ones. Where several choices go with the same input efforts,
        the least in the sum of squares of all forces, times the length, and moments.
    internal : (n_inputs + rows, k) array
        Basis of what may be added to efforts and closure multipliers without a load: with S the
        rows of the inputs, [S^T K^T] internal = 0.
    internal_joints : mapping of str to (6, k) array
        What it adds to ``joints``.
    undetermined : mapping of str to tuple of str
        Inputs, joints, closures and couplings whose values rigid bodies leave open, those that
        internal forces change, and which of their components: fx fy fz mx my mz, or the effort.
        What is not named is certain.
    multipliers : (rows,) array
        Of the closure rows.
    carried : bool
        Whether the inputs and loops hold the whole load. Else all numbers are for the load less
        the part that nothing holds.
    residual : float
        Work of the load on the free motions, of unit size in dimensionless form [N m]; rounding
        where it is carried.
    free_motions : (nv, f) array
        Motions that are possible with all inputs locked: at a direct singularity, of idle parts.
    free_twists : (6, f) array
        Twists of the tip in them, world-aligned; no rows without a task. A wrench at the tip that
        does work on one of them cannot be carried.
    uncarried : mapping of str to (f,) array
        Work on the free motions of each part of the load that does any, by name.
    text : str
        All of it that needs saying, in sentences.

    Examples
    --------
    >>> m = cc.with_inertias(cc.load("linear_delta"))
    >>> s = cc.statics(m, m.home, wrench=[0, 0, -20, 0, 0, 0])
    >>> s.carried, s.joints["leg1_B"].shape, s.internal.shape[1]
    (True, (6,), 12)
    >>> "q1" in s.undetermined  # the drives' efforts are certain, in spite of internal forces
    False
    """

    inputs: np.ndarray
    closures: Mapping[str, np.ndarray]
    couplings: Mapping[str, Mapping[str, float]]
    joints: Mapping[str, np.ndarray]
    internal: np.ndarray
    internal_joints: Mapping[str, np.ndarray]
    undetermined: Mapping[str, tuple[str, ...]]
    multipliers: np.ndarray
    carried: bool
    residual: float
    free_motions: np.ndarray
    free_twists: np.ndarray
    uncarried: Mapping[str, np.ndarray]
    text: str

    def raise_if_failed(self) -> Statics:
        """Return the result, or raise ``ClosureError`` where the load is not carried."""
        if not self.carried:
            raise ClosureError(self.text)
        return self


def statics(
    mechanism: Mechanism,
    q: ArrayLike,
    wrench: Wrenches | None = None,
    gravity: Gravity = True,
    *,
    payload: Mapping[str, float] | None = None,
) -> Statics:
    """Input efforts, loop forces and joint wrenches that hold a load at rest.

    Equilibrium of the tree under gravity and wrenches, of the inputs' efforts tau and of the
    closures' multipliers lambda: S^T tau + K^T lambda + J^T w = g. Joints have no friction here.

    Parameters
    ----------
    q : (nq,) array
        Closed posture.
    wrench : (6,) array, or mapping of frame name to (6,) array, optional
        (force, moment) [N, N m] on the mechanism, along the world's axes, at the origin of the tip
        or of named frames.
    gravity : bool or (3,) array
        9.81 m/s^2 against the world's z, none, or an acceleration of free fall [m/s^2]. Masses are
        those of the description.
    payload : mapping of frame name to mass, optional
        Point masses [kg] at the origins of named frames.

    Raises
    ------
    ClosureError
        Malformed numbers, an open posture, unknown frames.

    Examples
    --------
    >>> m = cc.load("linear_delta")
    >>> s = cc.statics(m, m.home, wrench=[0, 0, -30, 0, 0, 0], gravity=False)
    >>> print(s.inputs.round(6))  # a third of the load on each slider [N]
    [10. 10. 10.]
    """
    at = first_order(mechanism, q, task=mechanism.task is not None)
    on = loads(mechanism, wrench, gravity, payload)
    still = np.zeros(mechanism.model.nv)
    return held(at, on, (at.q, still, still), Deciding(at).locked.rank)


def held(
    at: FirstOrder, on: Loads, motion: Motion, rank: Rank, passive: np.ndarray | None = None
) -> Statics:
    """What holds loads on a motion (q, v, a) against efforts (nv,) of friction and the like.

    ``rank`` is that of K_p.
    """
    m = at.mechanism
    parts = body_forces(m, at.q, on)
    total = added(list(parts.values()), m.model)
    friction = np.zeros(m.model.nv) if passive is None else passive
    needed = moving_efforts(m, on, motion, total) + friction
    whole = balance(at, needed, rank)
    rows = row_wrenches(m, at.q)
    joints = Carrying(at, on, rows)
    internal = joints.internal(whole.internal[len(m.inputs) :])
    first = joints.of(whole.row_multipliers, motion, total)
    whole = settled(
        whole,
        joints.strain(first, whole.multipliers),
        joints.strain(internal, whole.internal_multipliers),
    )
    works = _works(at, on, parts, motion, whole)
    if passive is not None:
        works["friction"] = friction * at.column_unit
    size = max((float(np.abs(w).max(initial=0.0)) for w in works.values()), default=0.0)
    works = {name: whole.free.T @ w for name, w in works.items()}
    missing = float(np.linalg.norm(whole.missing))
    holds = missing <= UNCARRIED * size
    guilty = {n: w for n, w in works.items() if np.abs(w).max(initial=0.0) > UNCARRIED * size}
    guilty = {} if holds else guilty
    open_names = _undetermined(whole, internal, m)
    return Statics(
        inputs=whole.input_efforts,
        closures=cut_wrenches(m, rows, whole.row_multipliers),
        couplings=coupling_efforts(m, at.q, whole.row_multipliers),
        joints=joints.of(whole.row_multipliers, motion, total),
        internal=whole.internal,
        internal_joints=internal,
        undetermined=open_names,
        multipliers=whole.row_multipliers,
        carried=holds,
        residual=missing,
        free_motions=whole.free_motions,
        free_twists=_twists(m, at.q, whole.free_motions),
        uncarried=guilty,
        text=_text(m, whole, guilty, open_names) + _weightless(on),
    )


def _works(
    at: FirstOrder,
    on: Loads,
    parts: Mapping[str, list[pin.Force]],
    motion: Motion,
    whole: Balance,
) -> dict[str, np.ndarray]:
    """Generalised force (nv,), dimensionless, of each part of the load, by name."""
    if not whole.free.shape[1]:
        return {}
    m = at.mechanism
    found = {
        name: needed_efforts(m, on, at.q, forces) * at.column_unit for name, forces in parts.items()
    }
    if np.abs(motion[1]).max(initial=0.0) or np.abs(motion[2]).max(initial=0.0):
        found["the motion"] = moving_efforts(m, on, motion, no_forces(m.model)) * at.column_unit
    return found


def _undetermined(
    whole: Balance, internal: Mapping[str, np.ndarray], mechanism: Mechanism
) -> dict[str, tuple[str, ...]]:
    """Components, by input, joint and coupling, that internal forces change."""
    unit = np.array([mechanism.length] * 3 + [1.0] * 3)[:, None]
    found: dict[str, tuple[str, ...]] = {}
    for name, row in zip(mechanism.inputs, whole.internal_efforts, strict=True):
        found[name] = ("effort",) if np.abs(row).max(initial=0.0) > DETERMINED else ()
    for name, wrenches in internal.items():
        sizes = np.abs(unit * wrenches).max(axis=1, initial=0.0)
        found[name] = tuple(c for c, x in zip(COMPONENTS, sizes, strict=True) if x > DETERMINED)
    for closure, where in zip(mechanism.closures, mechanism.row_slices, strict=True):
        if isinstance(closure, Coupling):
            size = np.abs(whole.internal_multipliers[where]).max(initial=0.0)
            found[closure.name] = ("effort",) if size > DETERMINED else ()
    return {name: components for name, components in found.items() if components}


def _twists(mechanism: Mechanism, q: np.ndarray, motions: np.ndarray) -> np.ndarray:
    if mechanism.task is None:
        return np.zeros((0, motions.shape[1]))
    return tip_twists(mechanism, q, motions)


def _text(
    mechanism: Mechanism,
    whole: Balance,
    guilty: Mapping[str, np.ndarray],
    undetermined: Mapping[str, tuple[str, ...]],
) -> str:
    said = []
    if guilty:
        moving = whole.free_motions @ whole.missing
        what = ", ".join(guilty)
        said.append(
            f"the load is not carried: with all inputs locked the joints "
            f"{', '.join(moving_joints(mechanism, moving))} can move, and on that motion the load "
            f"does work ({what})"
        )
    elif whole.free.shape[1]:
        count = whole.free.shape[1]
        motions = "motion is" if count == 1 else "motions are"
        said.append(f"{count} {motions} free with all inputs locked, and the load does none there")
    k = whole.internal_multipliers.shape[1]
    if k:
        forces = "internal force is" if k == 1 else "internal forces are"
        said.append(f"{k} {forces} possible: rigid bodies do not determine {_listed(undetermined)}")
    return "; ".join(said) if said else "all forces are determined"


def _weightless(on: Loads) -> str:
    """What is said where weights were asked for and nothing has a mass."""
    if not on.gravity.any() or any(inertia.mass for inertia in on.model.inertias):
        return ""
    return "; no link that moves has a mass, so that weights are none (cc.with_inertias, --density)"


def _listed(undetermined: Mapping[str, tuple[str, ...]]) -> str:
    told = [f"{name} ({' '.join(parts)})" for name, parts in undetermined.items()]
    more = f" and {len(told) - 6} more" if len(told) > 7 else ""
    return ", ".join(told[:6] if more else told) + more
