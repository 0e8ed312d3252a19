"""A mechanism as arrays of numbers: what the kernels know of it.

Lengths are divided by the characteristic length, so that every number in a kernel is
dimensionless; only q keeps its units.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
import pinocchio as pin

from closedchain.closure.closures import CoupledJoint
from closedchain.closure.kinds import DOTS, SAME_SENSE, SLIDES, Closure, Coupling
from closedchain.closure.mechanism import Mechanism
from closedchain.urdf.errors import ClosureError

REVOLUTE, PRISMATIC, FLOATING = range(3)
ROWS, FIXED = range(2)


class Tables(NamedTuple):
    """The mechanism. Joint 0 is the base; a pose is 12 numbers, see ``kinematics``.

    Attributes
    ----------
    length : characteristic length [m]
    joints : (joints + 1, 4): kind, parent, index in q, index in v
    place : (joints + 1, 12): pose on the parent of every joint's frame
    closures : (c, 6): kind, joint 1, joint 2, first row, rows, and 1 where all rows are slides xyz
    frames : (2 c, 12): frames 1 and 2 of each closure on their joints
    entries : (rows, 3): 0 a a for a slide along axis a, 1 a b for the dot of axes a and b
    path : (n, 2): joint and sign (+1 moves frame 2, -1 frame 1), closure by closure
    path_ends : (c + 1,): where the path of each closure begins
    couplings : (k, 5): row, follower's and leader's index in q, and in v
    ratios : (k, 5): ratio, offset, unit of the row, dimensionless entries of follower and leader
    row_unit, column_unit : (rows,), (nv,)
    senses : (s, 2): closure, axis that must not be opposed
    limits : (2, nq)
    """

    length: float
    joints: np.ndarray
    place: np.ndarray
    closures: np.ndarray
    frames: np.ndarray
    entries: np.ndarray
    path: np.ndarray
    path_ends: np.ndarray
    couplings: np.ndarray
    ratios: np.ndarray
    row_unit: np.ndarray
    column_unit: np.ndarray
    senses: np.ndarray
    limits: np.ndarray


class Tip(NamedTuple):
    """A frame of the tree: ``joint`` that carries it, ``place`` (1, 12) there, joints before it."""

    joint: int
    place: np.ndarray
    ancestors: np.ndarray


_TABLES: WeakKeyDictionary[Mechanism, Tables] = WeakKeyDictionary()


def tables_of(mechanism: Mechanism) -> Tables:
    """Tables of a mechanism, made once."""
    found = _TABLES.get(mechanism)
    if found is None:
        found = _TABLES[mechanism] = _tables(mechanism)
    return found


def _tables(m: Mechanism) -> Tables:
    model, length = m.model, m.length
    turns = _own_axes(m)
    joints = np.zeros((model.njoints, 4), dtype=np.int64)
    place = np.zeros((model.njoints, 12))
    for i in range(1, model.njoints):
        joint, parent = model.joints[i], model.parents[i]
        kind = _kind(joint.shortname())
        joints[i] = kind, parent, joint.idx_q, joint.idx_v
        own = pin.SE3(turns[i], np.zeros(3))
        place[i] = _pose(_on(turns[parent], model.jointPlacements[i]) * own, length)
    rows = m.row_slices
    loops = [(c, s) for c, s in zip(m.closures, rows, strict=True) if isinstance(c, Closure)]
    closures = np.zeros((len(loops), 6), dtype=np.int64)
    frames = np.zeros((2 * len(loops), 12))
    entries = np.zeros((m.rows, 3), dtype=np.int64)
    path: list[tuple[int, int]] = []
    ends, senses = [0], []
    for i, (c, where) in enumerate(loops):
        kind = FIXED if c.kind == "fixed" else ROWS
        only_point = int(c.kind == "spherical")
        closures[i] = kind, c.joint1, c.joint2, where.start, c.rows, only_point
        frames[2 * i] = _pose(_on(turns[c.joint1], c.placement1), length)
        frames[2 * i + 1] = _pose(_on(turns[c.joint2], c.placement2), length)
        if c.kind not in SLIDES and kind == ROWS:
            raise ClosureError(f"closure {c.describe()}: maps do not know this kind yet")
        if kind == ROWS:
            slides = [(0, a, a) for a in SLIDES[c.kind]]
            entries[where] = [*slides, *((1, a, b) for a, b in DOTS[c.kind])]
            senses += [(i, a) for a in SAME_SENSE.get(c.kind, ())]
        first, second = ancestors(m, c.joint1), ancestors(m, c.joint2)
        path += [(j, -1) for j in first if j not in second]
        path += [(j, 1) for j in second if j not in first]
        ends.append(len(path))
    pairs = zip(m.closures, rows, strict=True)
    coupled = [(c, s.start) for c, s in pairs if isinstance(c, Coupling)]
    indices, ratios = [], []
    for tie, row in coupled:
        one, two, ratio, offset = _as_mimic(tie)
        follower, leader = m.column_scale[[one.v, two.v]] / m.row_scale[row]
        indices.append((row, one.q, two.q, one.v, two.v))
        ratios.append((ratio, offset, m.row_scale[row], follower, -ratio * leader))
    return Tables(
        length=float(length),
        joints=joints,
        place=place,
        closures=closures,
        frames=frames,
        entries=entries,
        path=integers(path, 2),
        path_ends=np.array(ends, dtype=np.int64),
        couplings=integers(indices, 5),
        ratios=np.array(ratios, dtype=float).reshape(-1, 5),
        row_unit=np.array(m.row_scale, dtype=float),
        column_unit=np.array(m.column_scale, dtype=float),
        senses=integers(senses, 2),
        limits=np.array(m.limits),
    )


def tip_of(mechanism: Mechanism, frame: str) -> Tip:
    """Where a frame sits."""
    f = mechanism.model.frames[mechanism.frame_id(frame)]
    turn = _own_axes(mechanism)[f.parentJoint]
    place = _pose(_on(turn, f.placement), mechanism.length).reshape(1, 12)
    joints = sorted(ancestors(mechanism, f.parentJoint))
    return Tip(int(f.parentJoint), place, np.array(joints, dtype=np.int64))


def no_tip() -> Tip:
    """Stand in where there is no task."""
    place = _pose(pin.SE3.Identity(), 1.0).reshape(1, 12)
    return Tip(0, place, np.zeros(0, dtype=np.int64))


def ancestors(mechanism: Mechanism, joint: int) -> dict[int, None]:
    """Joints from ``joint`` up to the base, in this order."""
    found: dict[int, None] = {}
    while joint > 0:
        found[joint] = None
        joint = mechanism.model.parents[joint]
    return found


def touched(mechanism: Mechanism) -> np.ndarray:
    """Which entries of K can differ from zero, (rows, nv) of bool."""
    model = mechanism.model
    pattern = np.zeros((mechanism.rows, model.nv), dtype=bool)
    for c, where in zip(mechanism.closures, mechanism.row_slices, strict=True):
        if isinstance(c, Coupling):
            pattern[where, [part.v for part in c.joints]] = True
            continue
        for j in ancestors(mechanism, c.joint1).keys() ^ ancestors(mechanism, c.joint2).keys():
            pattern[where, model.idx_vs[j] : model.idx_vs[j] + model.nvs[j]] = True
    return pattern


def integers(rows: Sequence[Sequence[int]], width: int) -> np.ndarray:
    """(n, width) of int64, also for no rows."""
    return np.array(rows, dtype=np.int64).reshape(-1, width)


def _as_mimic(tie: Coupling) -> tuple[CoupledJoint, CoupledJoint, float, float]:
    """Follower, leader, ratio and offset of a coupling of two joints."""
    if len(tie.joints) == 2:
        one, two = tie.joints
        if one.coefficients == (0.0, 1.0) and len(two.coefficients) == 2:
            return one, two, -two.coefficients[1], -two.coefficients[0]
    raise ClosureError(f"{tie.describe()} is no ratio of two joints: maps do not know it yet")


def _kind(shortname: str) -> int:
    if shortname == "JointModelFreeFlyer":
        return FLOATING
    slides = "Prismatic" in shortname or shortname.startswith("JointModelP")
    return PRISMATIC if slides else REVOLUTE


def _own_axes(m: Mechanism) -> list[np.ndarray]:
    """For each joint the rotation that takes z onto its axis: then every hinge turns about z."""
    axes = {j.name: j.axis for j in m.description.joints if j.type != "floating"}
    turns = [np.eye(3)]
    for name in list(m.model.names)[1:]:
        axis = np.array(axes.get(name, (0.0, 0.0, 1.0)), dtype=float)
        turns.append(_from_z(axis / np.linalg.norm(axis)))
    return turns


def _from_z(axis: np.ndarray) -> np.ndarray:
    k = int(np.abs(axis).argmax())
    if abs(axis[k]) == 1.0:
        other = np.roll(np.eye(3)[k], 1)
        return np.stack([other, np.cross(axis, other), axis], axis=1)
    first = np.cross(axis, np.eye(3)[int(np.abs(axis).argmin())])
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(axis, first), axis], axis=1)


def _on(turn: np.ndarray, placement: pin.SE3) -> pin.SE3:
    return pin.SE3(turn.T @ placement.rotation, turn.T @ placement.translation)


def _pose(placement: pin.SE3, length: float) -> np.ndarray:
    return np.concatenate([placement.rotation.ravel(), placement.translation / length])
