"""Values of all joints of the description, from a posture of the closed forms.

The spanning tree of ``rpa3t.xacro`` carries the platform on leg 2; the rods of leg 1 end at cut
spherical joints and leg 3 at cut revolutes, so that every joint value has a closed form.
"""

from __future__ import annotations

import numpy as np

from .geometry import FloatArray, Geometry, points, split


def joint_values(q: FloatArray, theta: FloatArray, g: Geometry) -> dict[str, FloatArray]:
    """Joint values (...), rad, in (-pi, pi], of postures q (..., 3) with arm angles (..., 3).

    Rods of leg 1: ``U1`` about x, then ``U2`` about the rod's own second axis; both rods alike. The
    rods of leg 3 lean out of the plane y = 0 by Re = Rf = -Rg = asin(y / l4).
    """
    found = points(q, theta, g)
    t1, t2, t3 = split(theta)
    rods = {i: found[f"C{i}"] - found[f"B{i}"] for i in (1, 2, 3)}
    swing1 = np.arctan2(rods[1][..., 2], rods[1][..., 1])
    swing2 = np.arctan2(rods[2][..., 2], rods[2][..., 0])
    swing3 = np.arctan2(rods[3][..., 2], rods[3][..., 0])
    tilt1 = -np.arcsin(np.clip(rods[1][..., 0] / g.l4, -1.0, 1.0))
    tilt3 = np.arcsin(np.clip(rods[3][..., 1] / g.l4, -1.0, 1.0))
    beta = split(q)[2]
    values = {
        "R11": t1,
        "Ua1": swing1 - t1,
        "Ua2": tilt1,
        "Ub1": swing1 - t1,
        "Ub2": tilt1,
        "R21": t2,
        "R22": swing2 - t2,
        "R23": -swing2,
        "R12": beta,
        "R13": -beta,
        "R31": t3,
        "R32": swing3 - t3,
        "Re": tilt3,
        "Rf": tilt3,
        "Rg": -tilt3,
    }
    return {name: np.arctan2(np.sin(v), np.cos(v)) for name, v in values.items()}
