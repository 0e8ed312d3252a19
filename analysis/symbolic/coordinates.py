"""Coordinates of all joints, cut ones too: their values at a posture, and which follow from others.

A cut revolute joint has an angle about its axis, zero where the x axes of its two frames agree; a
cut spherical joint is written as three hinges about x, y, z, from the frame on the side that the
leg comes from to that on the platform: R_leg^T R_platform = Rx Ry Rz.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from closedchain.analysis.symbolic.parameters import turn
from closedchain.analysis.symbolic.ring import Angle
from closedchain.closure.closures import Closure
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.nearest import close

_SPREAD = 0.12  # dimensionless standard deviation of the sampled postures around home
_FAR = 1.2  # joints that end farther from home [rad] are on another branch
_TIE = 1e-8


@dataclass(frozen=True, eq=False)
class Coordinates:
    """Reads joint coordinates off postures.

    ``reversed`` are the spherical closures that a leg passes from child to parent.
    """

    mechanism: Mechanism
    reversed: frozenset[str]

    def values(self, q: ArrayLike) -> dict[str, float]:
        """Value of every joint of the tree and every freedom of a cut joint [m, rad]."""
        m = self.mechanism
        q = m.configuration(q)
        data = m.workspace.data
        pin.forwardKinematics(m.model, data, q)
        out: dict[str, float] = {}
        for joint in m.description.joints:
            if joint.type not in {"fixed", "floating"}:
                out[joint.name] = float(q[m.model.joints[m.model.getJointId(joint.name)].idx_q])
        for closure in m.closures:
            if isinstance(closure, Closure) and closure.kind != "fixed":
                gap = (data.oMi[closure.joint1] * closure.placement1).actInv(
                    data.oMi[closure.joint2] * closure.placement2
                )
                out |= self._cut(closure, gap)
        return out

    def _cut(self, closure: Closure, gap: pin.SE3) -> dict[str, float]:
        r, t = gap.rotation, gap.translation
        about_z = float(np.arctan2(r[1, 0], r[0, 0]))
        found: tuple[float, ...]
        if closure.kind == "spherical":
            found = hinges(r.T if closure.name in self.reversed else r)
        elif closure.kind == "universal":
            first = float(np.arctan2(r[0, 2], -r[1, 2]))
            c, s = np.cos(first), np.sin(first)
            x_of = r.T @ np.array([c, s, 0.0])  # axis of the quarter turn, seen from frame 2
            found = first, float(np.arctan2(-x_of[1], x_of[0]))
        elif closure.kind == "cylindrical":
            found = about_z, float(t[2])
        elif closure.kind == "planar":
            found = float(t[0]), float(t[1]), about_z
        elif closure.kind == "prismatic":
            found = (float(t[2]),)
        else:
            found = (about_z,)
        suffixes = "xyz" if closure.kind == "spherical" else "123"
        one = closure.joint_kind.freedoms == 1
        names = [closure.name if one else f"{closure.name}.{s}" for s in suffixes]
        return dict(zip(names, found, strict=False))


def hinges(rotation: np.ndarray) -> tuple[float, float, float]:
    """Angles x, y, z with Rx Ry Rz = ``rotation`` (3, 3), y within a quarter turn."""
    r = rotation
    y = float(np.arctan2(r[0, 2], np.hypot(r[0, 0], r[0, 1])))
    return float(np.arctan2(-r[1, 2], r[2, 2])), y, float(np.arctan2(-r[0, 1], r[0, 0]))


def sample(mechanism: Mechanism, count: int, seed: int = 0) -> list[np.ndarray]:
    """Random closed postures (nq,) near home, home's branch as far as distance can tell."""
    rng = np.random.default_rng(seed)
    found: list[np.ndarray] = []
    unit = mechanism.column_scale
    for _ in range(3 * count):
        v = _SPREAD * rng.standard_normal(mechanism.model.nv) * unit
        solution = close(mechanism, guess=pin.integrate(mechanism.model, mechanism.home, v))
        if not solution.converged:
            continue
        away = pin.difference(mechanism.model, mechanism.home, solution.q) / unit
        if np.abs(away).max() < _FAR:
            found.append(solution.q)
        if len(found) == count:
            break
    return found


def ties(
    mechanism: Mechanism, coordinates: Coordinates, postures: list[np.ndarray]
) -> dict[str, Angle]:
    """Angles that are sums of others, and constants, on all closed postures of home's branch.

    Found on sampled postures, where the deviations from home are linearly dependent; only
    dependences with coefficients 0 and +-1 and a constant multiple of pi / 12 are taken.
    """
    angles = _angle_names(mechanism)
    home = coordinates.values(mechanism.home)
    table = np.array([[coordinates.values(q)[n] - home[n] for n in angles] for q in postures])
    if len(postures) < len(angles) + 4:
        return {}
    table = (table + np.pi) % (2.0 * np.pi) - np.pi
    # echelon form of the dependences, pivots from the last name, which is the most dependent one
    _, s, vt = np.linalg.svd(table)
    rank = int(np.count_nonzero(s > _TIE * max(1.0, s.max(initial=0.0))))
    kernel = vt[rank:, ::-1]
    names = angles[::-1]
    out: dict[str, Angle] = {}
    for pivot, row in _echelon(kernel):
        whole = np.round(row)
        if np.abs(row - whole).max() > 1e-6 or np.abs(whole).max() > 1.0:
            continue
        # pivot + sum of others = constant
        constant = turn(float(whole @ [home[n] for n in names]))
        if constant is None:
            continue
        terms = {names[k]: Fraction(-int(whole[k])) for k in np.flatnonzero(whole) if k != pivot}
        out[names[pivot]] = Angle({**terms, "pi": constant})
    return out


def _echelon(kernel: np.ndarray) -> list[tuple[int, np.ndarray]]:
    """Reduced row echelon form: pivots and rows."""
    a = kernel.copy()
    out: list[int] = []
    row = 0
    for column in range(a.shape[1]):
        if row == a.shape[0]:
            break
        best = row + int(np.abs(a[row:, column]).argmax())
        if abs(a[best, column]) < 1e-7:
            continue
        a[[row, best]] = a[[best, row]]
        a[row] /= a[row, column]
        for other in range(a.shape[0]):
            if other != row:
                a[other] -= a[other, column] * a[row]
        out.append(column)
        row += 1
    return [(column, a[i]) for i, column in enumerate(out)]


def _angle_names(mechanism: Mechanism) -> list[str]:
    """Joint angles, the most independent first: inputs, the tree's, those of cut revolutes."""
    driven = {spec.joint: i for i, spec in enumerate(mechanism.description.inputs)}
    tree = [j.name for j in mechanism.description.joints if j.type in {"revolute", "continuous"}]
    tree.sort(key=lambda n: driven.get(n, len(driven)))
    cuts = [c.name for c in mechanism.description.closures if c.type == "revolute"]
    return tree + cuts


def point_values(
    coordinates: Coordinates, q: np.ndarray, parameters: Mapping[str, float]
) -> dict[str, float]:
    """Coordinates and parameters together, for evaluation."""
    return {**parameters, **coordinates.values(q)}
