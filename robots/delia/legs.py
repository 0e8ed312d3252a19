"""The legs of the DeLiA family: which ones it has, and their joint values for a given tip.

A leg XYS carries a spherical joint S behind the joints X and Y. A three-legged stage needs five
freedoms a leg, an outer leg six [Gallardo-Alvarado 2010, section 2]. Every stage leg of the family
holds its tip in the vertical plane of its foot, and so every member has the planes of D1: the poses
of coupler and platform are those of D1 (``closedchain.robots.d1``), only the joint values differ.

Foot frame: x radially outwards, y up, z = x cross y tangential; the tip hangs below.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from closedchain.robots.d1.geometry import FloatArray
from closedchain.urdf.errors import DescriptionError, known_names

DRIVEN: Mapping[str, str] = MappingProxyType(
    {"RPS": "P", "RRS": "R1", "PRS": "P", "PPS": "P1"}
    | {"UPS": "P", "RRPS": "P", "CPS": "P", "URS": "U1", "RRRS": "R1", "CRS": "C1"}
)
"""Driven joint of each leg: the length where there is a telescope, else the joint at the base."""


@dataclass(frozen=True)
class Sizes:
    """Lengths of the links of one kind of leg, m; those that a leg has no use for are ignored.

    Attributes
    ----------
    shoulder : float
        Between the first two revolute axes (RRPS, RRRS).
    proximal : float
        From there, or from the foot, to the elbow (RRS, URS, CRS, RRRS).
    distal : float
        From the elbow (RRS, URS, CRS, RRRS) or the slider (PRS) to the tip.
    """

    shoulder: float = 0.0
    proximal: float = 0.0
    distal: float = 0.0


@dataclass(frozen=True, eq=False)
class LegSolution:
    """Joint values of a leg, [m or rad], each of shape (...), and where the tip is in reach (...).

    Values are finite everywhere; where ``reachable`` is false they are those of the stretched or
    folded leg that points to the tip.
    """

    joints: Mapping[str, FloatArray]
    reachable: np.ndarray


def joint_values(leg: str, tip: FloatArray, sizes: Sizes, *, mode: int = -1) -> LegSolution:
    """Joint values of a leg, by the names of its joints, for the tip in the foot frame.

    Parameters
    ----------
    leg : str
        A key of :data:`DRIVEN`.
    tip : ndarray (..., 3)
        From the foot to the tip, m, foot frame. Stage legs do not look at z.
    sizes : Sizes
        Lengths of the links.
    mode : {-1, +1}
        Working mode: the sign of the elbow's angle, or, for PRS, -1 for a link that points down.
        RPS, PPS, UPS, RRPS and CPS have only one.

    Raises
    ------
    DescriptionError
        Unknown leg or mode, or links that a leg cannot do without.
    """
    if leg not in DRIVEN:
        raise DescriptionError(known_names(leg, "leg", DRIVEN))
    if mode not in (-1, 1):
        raise DescriptionError(f"a working mode is -1 or +1, not {mode!r}")
    if leg in _ELBOWS and not (sizes.proximal > 0.0 and sizes.distal > 0.0):
        raise DescriptionError(f"leg {leg} needs proximal and distal links above zero, not {sizes}")
    if leg == "RRRS" and not sizes.proximal > sizes.shoulder:
        raise DescriptionError(f"leg {leg} needs a proximal link longer than its shoulder: {sizes}")
    x, y, z = np.moveaxis(np.asarray(tip, dtype=np.float64), -1, 0)
    joints, reachable = _SOLVERS[leg](x, y, z, sizes, mode)
    return LegSolution(MappingProxyType(joints), np.broadcast_to(reachable, x.shape))


_ELBOWS = ("RRS", "URS", "CRS", "RRRS")
_Joints = tuple[dict[str, FloatArray], np.ndarray]
_YES = np.array(True)


def _rps(x: FloatArray, y: FloatArray, z: FloatArray, sizes: Sizes, mode: int) -> _Joints:
    return {"R": np.arctan2(y, x), "P": np.hypot(x, y)}, _YES


def _elbow(
    x: FloatArray, y: FloatArray, sizes: Sizes, mode: int
) -> tuple[FloatArray, FloatArray, np.ndarray]:
    """Two links in a plane: first angle, elbow angle, in reach."""
    a, b = sizes.proximal, sizes.distal
    cosine = (x * x + y * y - a * a - b * b) / (2.0 * a * b)
    bend = mode * np.arccos(np.clip(cosine, -1.0, 1.0))
    first = np.arctan2(y, x) - np.arctan2(b * np.sin(bend), a + b * np.cos(bend))
    return first, bend, np.abs(cosine) <= 1.0


def _rrs(x: FloatArray, y: FloatArray, z: FloatArray, sizes: Sizes, mode: int) -> _Joints:
    first, bend, reachable = _elbow(x, y, sizes, mode)
    return {"R1": first, "R2": bend}, reachable


def _prs(x: FloatArray, y: FloatArray, z: FloatArray, sizes: Sizes, mode: int) -> _Joints:
    square = sizes.distal**2 - x * x
    drop = -mode * np.sqrt(np.maximum(square, 0.0))
    return {"P": -y - drop, "R": np.arctan2(-drop, x)}, square >= 0.0


def _pps(x: FloatArray, y: FloatArray, z: FloatArray, sizes: Sizes, mode: int) -> _Joints:
    return {"P1": -y, "P2": x}, _YES


def _ups(x: FloatArray, y: FloatArray, z: FloatArray, sizes: Sizes, mode: int) -> _Joints:
    joints, reachable = _rrps(x, y, z, Sizes(), mode)
    return {"U1": joints["R1"], "U2": joints["R2"], "P": joints["P"]}, reachable


def _rrps(x: FloatArray, y: FloatArray, z: FloatArray, sizes: Sizes, mode: int) -> _Joints:
    ahead = np.hypot(x, y) - sizes.shoulder
    return {"R1": np.arctan2(y, x), "R2": np.arctan2(-z, ahead), "P": np.hypot(ahead, z)}, _YES


def _cps(x: FloatArray, y: FloatArray, z: FloatArray, sizes: Sizes, mode: int) -> _Joints:
    return {"C1": np.arctan2(y, x), "C2": z, "P": np.hypot(x, y)}, _YES


def _crs(x: FloatArray, y: FloatArray, z: FloatArray, sizes: Sizes, mode: int) -> _Joints:
    first, bend, reachable = _elbow(x, y, sizes, mode)
    return {"C1": first, "C2": z, "R": bend}, reachable


def _urs(x: FloatArray, y: FloatArray, z: FloatArray, sizes: Sizes, mode: int) -> _Joints:
    no_shoulder = Sizes(proximal=sizes.proximal, distal=sizes.distal)
    joints, reachable = _rrrs(x, y, z, no_shoulder, mode)
    return {"U1": joints["R1"], "U2": joints["R2"], "R": joints["R3"]}, reachable


def _rrrs(x: FloatArray, y: FloatArray, z: FloatArray, sizes: Sizes, mode: int) -> _Joints:
    # With c = cos(elbow), X = a + b c and Y = b sin(elbow): z = -X sin(R2) and x^2 + y^2 =
    # (s + X cos(R2))^2 + Y^2. Without R2 this is (rest - 2abc)^2 = 4 s^2 (X^2 - z^2), a quadratic
    # in c; the smaller root has X cos(R2) > 0: the arm lies ahead of its shoulder (a > s).
    s, a, b = sizes.shoulder, sizes.proximal, sizes.distal
    rest = x * x + y * y + z * z - s * s - a * a - b * b
    under = (rest + 2.0 * a * a) ** 2 - 4.0 * z * z * (a * a - s * s)
    c = (a * (rest + 2.0 * s * s) - s * np.sqrt(np.maximum(under, 0.0))) / (2 * b * (a * a - s * s))
    bend = mode * np.arccos(np.clip(c, -1.0, 1.0))
    along, across = a + b * np.cos(bend), b * np.sin(bend)
    square = along * along - z * z
    ahead = np.sqrt(np.maximum(square, 0.0))
    first = np.arctan2(y, x) - np.arctan2(across, s + ahead)
    tilt = np.arctan2(-z, ahead)
    reachable = (under >= 0.0) & (np.abs(c) <= 1.0) & (square >= 0.0) & (along > 0.0)
    return {"R1": first, "R2": tilt, "R3": bend}, reachable


_SOLVERS = {"RPS": _rps, "RRS": _rrs, "PRS": _prs, "PPS": _pps, "UPS": _ups, "RRPS": _rrps}
_SOLVERS |= {"CPS": _cps, "CRS": _crs, "URS": _urs, "RRRS": _rrrs}
