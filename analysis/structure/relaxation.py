"""Which joints of an overconstrained mechanism would have to give way for it to be so no more.

A joint with more freedoms adds columns to K. With N the left null space of K, the redundancies, the
rows are independent, and the mobility is the same, where the added columns D are as many as the
redundancies and N^T D is invertible. In a mechanism so relaxed errors of manufacture, or of
rounding, do no harm.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from closedchain.closure.closures import Closure
from closedchain.closure.generic import dimensionless_jacobian, sampled_rank
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.ranks import numerical_rank
from closedchain.closure.responses import link_poses, responses
from closedchain.closure.solve.samples import closed_samples
from closedchain.closure.tree import se3, z_onto

_X, _Y, _Z = 0, 1, 2  # slides along the axes of a frame whose z is the joint's; turns are 3 to 5
_TURN_X, _TURN_Y, _TURN_Z = 3, 4, 5
_PLAIN = ("cylindrical joint", "universal joint", "ball")
_SURE = 1e-6  # smallest share of a singular value that counts
_LISTED = 6  # joints that a sentence lists

# what a joint may become, by the freedoms that it gains
_HINGE = (
    ("cylindrical joint", (_Z,)),
    ("universal joint", (_TURN_X,)),
    ("universal joint", (_TURN_Y,)),
    ("ball", (_TURN_X, _TURN_Y)),
    ("ball on a line", (_TURN_X, _TURN_Y, _Z)),
)
_BALL = (
    ("ball on a line", (_X,)),
    ("ball on a line", (_Y,)),
    ("ball on a line", (_Z,)),
    ("ball on a plane", (_X, _Y)),
)
_SLIDER = (("cylindrical joint", (_TURN_Z,)), ("ball on a line", (_TURN_X, _TURN_Y, _TURN_Z)))
_RELAXED: dict[str, tuple[str, tuple[tuple[str, tuple[int, ...]], ...]]] = {
    "revolute": ("hinge", _HINGE),
    "continuous": ("hinge", _HINGE),
    "prismatic": ("slider", _SLIDER),
    "cylindrical": ("cylindrical joint", (("ball on a line", (_TURN_X, _TURN_Y)),)),
    "spherical": ("ball", _BALL),
    "universal": ("universal joint", (("ball", (_TURN_Z,)),)),
    "planar": ("planar joint", (("ball on a plane", (_TURN_X, _TURN_Y)),)),
    "fixed": ("weld", (("ball", (_TURN_X, _TURN_Y, _TURN_Z)),)),
}


@dataclass(frozen=True)
class Relaxed:
    """A joint with more freedoms.

    Attributes
    ----------
    joint : str
        Name of the joint or closure.
    was, becomes : str
        Such as "hinge" and "ball".
    gained : int
        Freedoms that it gains.

    Examples
    --------
    >>> relaxed = cc.relaxation(cc.load("linear_delta")).together[0]
    >>> relaxed.was, relaxed.becomes, relaxed.gained
    ('hinge', 'ball', 2)
    """

    joint: str
    was: str
    becomes: str
    gained: int

    def __str__(self) -> str:
        """What is put for what, where."""
        return f"a {self.becomes} instead of the {self.was} {self.joint}"


@dataclass(frozen=True)
class Relaxation:
    """How an overconstrained mechanism becomes one without redundant rows, and as mobile.

    Attributes
    ----------
    redundant : int
        Rows that depend on the others.
    single : tuple of Relaxed
        Joints any one of which is enough.
    together : tuple of Relaxed
        Some joints that are enough together, with joints that are easily bought where these do.
        Empty where none were found.
    text : str

    Examples
    --------
    >>> found = cc.relaxation(cc.load("linear_delta"))
    >>> found.redundant, len(found.together) > 0
    (12, True)
    """

    redundant: int
    single: tuple[Relaxed, ...]
    together: tuple[Relaxed, ...]
    text: str


def relaxation(mechanism: Mechanism) -> Relaxation:
    """Joints that would have to be relaxed for no closure row to be redundant.

    Every hinge, slider, ball and other joint of the tree and of the closures is tried with the
    freedoms that it might gain; floating joints, couplings and rods are left as they are.

    Raises
    ------
    ClosureError
        Home is open.

    Examples
    --------
    >>> cc.relaxation(cc.load("d1")).redundant  # D1 is not overconstrained
    0
    """
    redundant = mechanism.rows - sampled_rank(mechanism).rank.value
    if not redundant:
        return Relaxation(0, (), (), "No closure row is redundant: nothing need be relaxed.")
    spare, q = _redundancies(mechanism, redundant)
    tried = [
        (one, spare.T @ columns)
        for one, columns in _choices(mechanism, q)
        if one.gained <= redundant and numerical_rank(spare.T @ columns, _SURE).value == one.gained
    ]
    single = tuple(
        {(one.joint, one.becomes): one for one, _ in tried if one.gained == redundant}.values()
    )
    plain = [(one, columns) for one, columns in tried if one.becomes in _PLAIN]
    together = _together(plain, redundant) or _together(tried, redundant)
    together = together if len(together) > 1 else ()
    return Relaxation(redundant, single, together, _text(redundant, single, together))


def _redundancies(mechanism: Mechanism, redundant: int) -> tuple[np.ndarray, np.ndarray]:
    """Left null space (rows, redundant) of K where it is clearest, and that closed posture."""
    best: tuple[float, np.ndarray, np.ndarray] | None = None
    rank = mechanism.rows - redundant
    for q in closed_samples(mechanism):
        u, s, _ = np.linalg.svd(dimensionless_jacobian(mechanism, q))
        least = float(s[rank - 1] / s[0]) if rank else 1.0
        if best is None or least > best[0]:
            best = least, u[:, rank:], q
    assert best is not None
    return best[1], best[2]


def _choices(mechanism: Mechanism, q: np.ndarray) -> Iterator[tuple[Relaxed, np.ndarray]]:
    """Joints with more freedoms, and the dimensionless columns (rows, gained) that these add."""
    by_joint, by_closure, _ = responses(mechanism, q)
    poses = link_poses(mechanism, q)
    unit = np.array([mechanism.length] * 3 + [1.0] * 3)
    frames: list[tuple[str, str, np.ndarray]] = []
    for joint in mechanism.description.joints:
        if joint.type not in {"fixed", "floating"}:
            frame = poses[joint.parent] * se3(joint.origin) * z_onto(joint.axis)
            frames.append((joint.name, joint.type, by_joint[joint.name] @ frame.action))
    for closure in mechanism.closures:
        if isinstance(closure, Closure):
            frames.append((closure.name, closure.kind, by_closure[closure.name]))
    for name, kind, response in frames:
        was, choices = _RELAXED.get(kind, ("", ()))
        for becomes, freedoms in choices:
            columns = (response * unit / mechanism.row_scale[:, None])[:, list(freedoms)]
            yield Relaxed(name, was, becomes, len(freedoms)), columns


def _together(tried: list[tuple[Relaxed, np.ndarray]], redundant: int) -> tuple[Relaxed, ...]:
    """Joints that together take all redundancies away, those that take most first."""
    chosen: list[Relaxed] = []
    columns = np.zeros((redundant, 0))
    for one, more in sorted(tried, key=lambda item: -item[0].gained):
        if any(one.joint == other.joint for other in chosen):
            continue
        wider = np.hstack([columns, more])
        if wider.shape[1] <= redundant and numerical_rank(wider, _SURE).value == wider.shape[1]:
            chosen.append(one)
            columns = wider
    return tuple(chosen) if columns.shape[1] == redundant else ()


def _text(redundant: int, single: tuple[Relaxed, ...], together: tuple[Relaxed, ...]) -> str:
    head = f"{redundant} closure row{'s are' if redundant > 1 else ' is'} redundant"
    ways = [str(one) for one in single[:_LISTED]]
    if together:
        words = list(map(str, together))
        ways.append(f"{', '.join(words[:-1])} and {words[-1]}")
    if not ways:
        return f"{head}; no joints were found whose relaxing would change that and nothing else."
    return f"{head}. None would be, and the mobility the same, with {'; or '.join(ways)}."
