"""The rates of all physical joints in a motion, and the closed motions measured by them.

The norm of a motion is that of the rates of all joints that are really there, cut ones included:
angles in radians, slides divided by the characteristic length. It does not depend on which joint
was cut to open a loop, on redundant rows or on any order, so neither does what is measured by it.

* A revolute or prismatic joint of the tree has its own rate.
* A cut joint has the motion of frame 2 against frame 1: the relative angular velocity where the
  joint turns, and the velocity of frame 2's origin against frame 1, divided by the length, where
  it slides. What the joint forbids vanishes on closed motions and is left out where it is known to.
* A cut rod of fixed length l between two ball joints turns in both. Its direction u, seen from
  body 1, turns at |u x v1| / l, with v1 the velocity of its far end against body 1, and likewise
  from body 2. Its spin about itself is anything: the two balls share the bodies' relative spin
  equally, which is the least they can do, and count (u . w) / sqrt(2). That is what remains of a
  rod that is a body of its own once its idle spin is left out.
* A floating joint only says where a body is. It counts nothing where real joints connect its two
  sides, and all its six rates where nothing else would see the body move.
* A coupling adds nothing: the joints that it ties are there already.
"""

from __future__ import annotations

from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np
import pinocchio as pin

from closedchain.closure.closures import Closure
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.rows import by_columns

_WORLD = pin.LOCAL_WORLD_ALIGNED


@dataclass(frozen=True, eq=False)
class CutJoint:
    """A cut joint: its frames, and whether it slides, turns, or is a rod.

    Attributes
    ----------
    joints, placements : pair
        Pinocchio's joints that carry the two frames, and the frames' placements on them.
    """

    joints: tuple[int, int]
    placements: tuple[pin.SE3, pin.SE3]
    slides: bool
    turns: bool
    rod: bool


@dataclass(frozen=True, eq=False)
class RateLayout:
    """What counts in the norm of a motion.

    Attributes
    ----------
    own : array of int
        Tangent coordinates that are rates of joints themselves.
    cut : tuple of CutJoint
        The cut joints.
    """

    own: np.ndarray
    cut: tuple[CutJoint, ...]


_LAYOUTS: WeakKeyDictionary[Mechanism, RateLayout] = WeakKeyDictionary()


def physical_rates(mechanism: Mechanism, q: np.ndarray) -> np.ndarray:
    """Matrix P (m, nv) from motions to the rates of all physical joints, both dimensionless.

    A motion is ``v / mechanism.column_scale``; |P v| is its norm, positive for every motion but
    rest on ker K. Rows: the joints of the tree in the order of ``v``, then the cut joints in the
    order of ``mechanism.closures``, along the world's axes. The order means nothing.

    Parameters
    ----------
    q : (nq,) array
        A closed posture, unchecked.
    """
    layout = rate_layout(mechanism)
    nv = mechanism.model.nv
    parts = [np.eye(nv)[layout.own]]
    if layout.cut:
        data = mechanism.workspace.data
        pin.computeJointJacobians(mechanism.model, data, q)
        parts += [_cut_rates(mechanism, cut) for cut in layout.cut]
    return np.vstack(parts)


def orthonormal_motions(basis: np.ndarray, rates: np.ndarray) -> np.ndarray:
    """The same motions (..., nv, k), orthonormal in the norm of the physical joint rates.

    Parameters
    ----------
    basis : (..., nv, k) array
        Independent closed motions, dimensionless.
    rates : (..., m, nv) array
        P.
    """
    if basis.shape[-1] == 0:
        return np.array(basis)
    upper = np.linalg.qr(rates @ basis)[1]
    return np.asarray(
        np.linalg.solve(upper.swapaxes(-1, -2), basis.swapaxes(-1, -2)).swapaxes(-1, -2)
    )


def rate_layout(mechanism: Mechanism) -> RateLayout:
    """What counts in the norm of a mechanism's motions, found once."""
    if mechanism not in _LAYOUTS:
        own = [j.idx_v + k for j in _counted(mechanism) for k in range(j.nv)]
        _LAYOUTS[mechanism] = RateLayout(np.array(own, dtype=int), _cut_joints(mechanism))
    return _LAYOUTS[mechanism]


def _cut_joints(mechanism: Mechanism) -> tuple[CutJoint, ...]:
    found = []
    for closure in mechanism.closures:
        if not isinstance(closure, Closure):
            continue  # a coupling
        pairs = {screw.pair for screw in closure.joint_kind.screws}
        found.append(
            CutJoint(
                joints=(closure.joint1, closure.joint2),
                placements=(closure.placement1, closure.placement2),
                slides="P" in pairs,
                turns="R" in pairs,
                rod="N" in pairs,
            )
        )
    return tuple(found)


def _counted(mechanism: Mechanism) -> list[pin.JointModel]:
    """Joints of the tree that count: all but floating ones between bodies that joints connect."""
    model = mechanism.model
    joints = list(model.joints)[1:]
    group = list(range(model.njoints))

    def root(body: int) -> int:
        while group[body] != body:
            body = group[body]
        return body

    ties = [(j.id, model.parents[j.id]) for j in joints if j.nv == 1]
    ties += [cut.joints for cut in _cut_joints(mechanism)]
    for one, other in ties:
        group[root(one)] = root(other)
    return [j for j in joints if j.nv == 1 or root(j.id) != root(model.parents[j.id])]


def _cut_rates(mechanism: Mechanism, cut: CutJoint) -> np.ndarray:
    """Rates (k, nv) of a cut joint; joint Jacobians must be up to date."""
    (place1, first), (place2, second) = (
        _frame(mechanism, joint, placement)
        for joint, placement in zip(cut.joints, cut.placements, strict=True)
    )
    gap = place2 - place1
    length, columns = mechanism.length, mechanism.column_scale
    spin = (second[3:] - first[3:]) * columns
    slip = (second[:3] - first[:3] + pin.skew(gap) @ first[3:]) * columns / length
    if cut.rod:
        along = gap / np.linalg.norm(gap)
        span = float(np.linalg.norm(gap)) / length
        across = pin.skew(along)
        seen_from_1 = across @ slip / span
        # seen from body 2 the other end moves with w x gap - slip
        seen_from_2 = seen_from_1 - across @ pin.skew(along).T @ spin
        return np.vstack([seen_from_1, seen_from_2, along @ spin / np.sqrt(2.0)])
    parts = [rows for rows, there in ((slip, cut.slides), (spin, cut.turns)) if there]
    return np.vstack(parts) if parts else np.zeros((0, mechanism.model.nv))


def _frame(mechanism: Mechanism, joint: int, placement: pin.SE3) -> tuple[np.ndarray, np.ndarray]:
    """Origin (3,) of a frame in the world and its Jacobian (6, nv), world-aligned."""
    if joint == 0:
        return np.array(placement.translation), np.zeros((6, mechanism.model.nv))
    model, data = mechanism.model, mechanism.workspace.data
    place = np.array(data.oMi[joint].act(placement.translation))
    found = pin.getFrameJacobian(model, data, joint, placement, _WORLD)
    return place, by_columns(np.array(found))
