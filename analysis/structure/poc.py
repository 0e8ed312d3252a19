"""POC set: position and orientation characteristics of a body, from twists over a finite motion.

POC sets are those of T. Yang, A. Liu, H. Shen, L. Hang, Q. Luo, Topology Design of Robot
Mechanisms, Springer 2018. They speak of finite motion, twists are instantaneous. What joins them is
the constant rank theorem: where the twists of a body have the same dimension all around, its poses
form a manifold of that dimension, and so do its orientations. So the ranks are asked at many
postures along one motion, and the displacements between these are compared with the twists.
"""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from closedchain.analysis.screws.twists import TwistSpace, rank_against, symbol, twist_space
from closedchain.analysis.structure.postures import tangent, wander
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.ranks import Rank
from closedchain.closure.task import task_jacobian
from closedchain.closure.task_frame import TaskFrame
from closedchain.urdf.description import OUTPUTS

POSTURES = 12
STEADY = 1e-6
"""Directions whose sines of angles to those of other postures are below this stay the same. The
postures lie tenths of a radian apart, so directions that change differ by far more."""


@dataclass(frozen=True, eq=False)
class Poc:
    """Position and orientation characteristics of a body against the base.

    Attributes
    ----------
    body : str
    translations, rotations : int
        Independent ones, i and j of t^i r^j: j is the rank of the angular velocities, i the
        dimension of the twists without rotation. Neither depends on the point looked at.
    slides : (3, k) array
        Orthonormal directions along the world's axes in which the body can translate at every
        posture; k is less than ``translations`` where the others change with the motion.
    spins : (3, k) array
        Directions of rotation axes that are there at every posture, likewise.
    dependent : int
        Further directions in which the body's origin moves, but only together with rotations.
    constant : bool
        Whether i and j are the same at all postures.
    travel : (float, float)
        Largest displacement of the origin [m] and rotation [rad] from the first posture.
    stray : (float or None, float or None)
        Largest part of these displacements [m] outside the ``slides``, and of these rotations
        [rad] about axes outside the ``spins``. None where nothing can be compared: where
        directions change with the motion, or the origin also moves by rotations.
    rank, angular : Rank
        Decisions on the twists and on their angular parts, with the smallest gaps that were seen.
    steady : (Rank, Rank)
        Decisions on the directions that change, among translations and rotations: the smallest
        sine of those that do, the largest of those that stay.
    postures : (n, nq) array
        Where all this was asked.

    Examples
    --------
    >>> p = cc.poc(cc.load("linear_delta"))
    >>> p.translations, p.rotations, p.finite
    (3, 0, True)
    """

    body: str
    translations: int
    rotations: int
    slides: np.ndarray
    spins: np.ndarray
    dependent: int
    constant: bool
    travel: tuple[float, float]
    stray: tuple[float | None, float | None]
    rank: Rank
    angular: Rank
    steady: tuple[Rank, Rank]
    postures: np.ndarray
    text: str

    @property
    def dimension(self) -> int:
        """Independent motions of the body."""
        return self.translations + self.rotations

    @property
    def symbol(self) -> str:
        """Such as t^3 r^1."""
        return symbol((self.translations, self.rotations))

    @property
    def finite(self) -> bool:
        """Whether it holds for the finite motion: constant ranks, and displacements that agree."""
        return self.constant and all(s is None or s < STEADY for s in self.stray)


def poc(mechanism: Mechanism, body: str | None = None, q: ArrayLike | None = None) -> Poc:
    """Find the POC set of a body against the base at generic postures.

    Parameters
    ----------
    body : str, optional
        A link or named point; the tip of the task by default.
    q : (nq,) array, optional
        Closed posture on the motion component that is asked; home by default. It is where the walk
        begins, and no evidence itself: home postures are often special.

    Raises
    ------
    ClosureError
        Unknown body, malformed or open posture, or one that no motion leads away from.

    Examples
    --------
    >>> cc.poc(cc.load("rpa3t"), "platform").symbol  # three translations, no rotation
    't^3 r^0'
    """
    looking = looking_at(mechanism, body)
    tip = looking.required_task().tip
    postures = _generic(mechanism, wander(mechanism, POSTURES, q))
    spaces = [_twists(looking, posture) for posture in postures]
    dimension = max(space.dimension for space in spaces)
    rotations = max(space.rotations for space in spaces if space.dimension == dimension)
    generic = [space for space in spaces if space.dimensions == (dimension - rotations, rotations)]
    slides, turning_slides = _kept([space.slides for space in generic])
    spins, turning_spins = _kept([space.spins for space in generic])
    travel, stray = _displacements(
        mechanism, tip, postures, slides, spins, generic[0].translations, rotations
    )
    result = Poc(
        body=tip,
        translations=dimension - rotations,
        rotations=rotations,
        slides=slides,
        spins=spins,
        dependent=max(_linear_rank(space) - space.translations for space in generic),
        constant=len(generic) == len(spaces),
        travel=travel,
        stray=stray,
        rank=min((space.rank for space in generic), key=lambda rank: rank.gap),
        angular=min((space.angular for space in generic), key=lambda rank: rank.gap),
        steady=(turning_slides, turning_spins),
        postures=np.array(postures),
        text="",
    )
    return replace(result, text=_text(result, looking))


def looking_at(mechanism: Mechanism, body: str | None) -> Mechanism:
    """Give the mechanism with ``body`` as tip and all outputs; as it is where none is named.

    Raises
    ------
    ClosureError
        Unknown body, or none named and the mechanism has no task.
    """
    if body is None:
        mechanism.required_task()
        return mechanism
    mechanism.frame_id(body)
    task = mechanism.task
    base = mechanism.description.root if task is None else task.base
    return replace(mechanism, task=TaskFrame(base, body, OUTPUTS))


def _generic(mechanism: Mechanism, postures: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Those where K has the greatest rank: elsewhere motions appear that lead nowhere."""
    ranks = [tangent(mechanism, q)[1].value for q in postures]
    return [q for q, rank in zip(postures, ranks, strict=True) if rank == max(ranks)]


def _twists(mechanism: Mechanism, q: np.ndarray) -> TwistSpace:
    """Twists of the tip that the loops allow, at its origin, dimensionless."""
    motions, _ = tangent(mechanism, q)
    units = np.repeat([mechanism.length, 1.0], 3)
    jacobian = task_jacobian(mechanism, q, OUTPUTS) * mechanism.column_scale / units[:, None]
    return twist_space(jacobian @ motions)


def _linear_rank(space: TwistSpace) -> int:
    values = np.linalg.svd(space.basis[:3], compute_uv=False) if space.dimension else np.zeros(0)
    return rank_against(values, 1.0, STEADY).value


def _kept(bases: Sequence[np.ndarray]) -> tuple[np.ndarray, Rank]:
    """Directions (3, k) common to all spans, and the decision on how many of them change.

    A direction common to all is annulled by every projector onto a complement.
    """
    complements = np.vstack([np.eye(3) - basis @ basis.T for basis in bases]) / np.sqrt(len(bases))
    _, s, vt = np.linalg.svd(complements, full_matrices=False)
    rank = rank_against(s, 1.0, STEADY)
    return vt[rank.value :].T, rank


def _displacements(
    mechanism: Mechanism,
    body: str,
    postures: Sequence[np.ndarray],
    slides: np.ndarray,
    spins: np.ndarray,
    translations: int,
    rotations: int,
) -> tuple[tuple[float, float], tuple[float | None, float | None]]:
    """Travel of a body between postures, and what of it lies outside the directions found."""
    poses = [mechanism.pose(q, body) for q in postures]
    moved = np.array([pose.translation - poses[0].translation for pose in poses]).T
    turned = np.array([pin.log3(pose.rotation @ poses[0].rotation.T) for pose in poses]).T

    def outside(vectors: np.ndarray, directions: np.ndarray) -> float:
        return float(np.linalg.norm(vectors - directions @ (directions.T @ vectors), axis=0).max())

    same_slides = slides.shape[1] == translations and (rotations == 0 or translations == 3)
    same_spins = spins.shape[1] == rotations
    travel = (
        float(np.linalg.norm(moved, axis=0).max()),
        float(np.linalg.norm(turned, axis=0).max()),
    )
    return travel, (
        outside(moved, slides) if same_slides else None,
        outside(turned, spins) if same_spins else None,
    )


def _text(p: Poc, mechanism: Mechanism) -> str:
    base = mechanism.description.root
    lines = [
        f"{p.body} against {base}: POC set {p.symbol}, at {len(p.postures)} postures of one motion "
        f"(twists: {p.rank}; rotations: {p.angular})."
    ]
    lines.append(_directions("translation", p.translations, p.slides, p.steady[0]))
    lines.append(_directions("rotation", p.rotations, p.spins, p.steady[1]))
    if p.dependent:
        lines.append(f"Its origin moves in {p.dependent} more direction(s), only by rotating.")
    moved = f"Between the postures it moved by up to {p.travel[0]:.3g} m and {p.travel[1]:.3g} rad"
    strays = [
        f"{s:.1g} {unit}" for s, unit in zip(p.stray, ("m", "rad"), strict=True) if s is not None
    ]
    outside = f"; outside these directions by {' and '.join(strays)}" if strays else ""
    lines.append(f"{moved}{outside}.")
    lines.append(
        "The ranks are the same at all postures, so this holds for the finite motion."
        if p.finite
        else "The ranks or displacements disagree between postures: true at some of them only."
    )
    return "\n".join(textwrap.fill(line, 80, subsequent_indent="  ") for line in lines)


def _directions(what: str, count: int, kept: np.ndarray, decision: Rank) -> str:
    if count == 0:
        return f"No {what}."
    if count == 3:
        return f"{what.capitalize()}s: 3, every direction."
    directions = ", ".join(direction_text(d) for d in kept.T) or "none"
    if kept.shape[1] == 2:
        directions = f"the plane normal to {direction_text(np.cross(kept[:, 0], kept[:, 1]))}"
    changing = count - kept.shape[1]
    note = f"; {changing} whose direction changes with the motion" if changing else ""
    return (
        f"{what.capitalize()}s: {count}; fixed directions: {directions}{note} (smallest change "
        f"{decision.above:.2g}, largest of a fixed one {decision.below:.1g})."
    )


def direction_text(direction: np.ndarray) -> str:
    """A direction as x, y, z where it is along an axis, else its components."""
    along = int(np.argmax(np.abs(direction)))
    if np.abs(np.delete(direction, along)).max() < STEADY:
        return "xyz"[along]
    shown = np.sign(direction[along]) * direction.round(4) + 0.0  # no -0
    return "(" + " ".join(f"{x:g}" for x in shown) + ")"
