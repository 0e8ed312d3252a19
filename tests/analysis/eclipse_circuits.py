"""Eclipse as the paper's circuits: each leg, then the 3P3R virtual chain backwards. No tests here.

A circuit is one serial chain from the base back to the base, so that the gap of its closure is the
paper's error E = T_leg T_virtual^-1 (eqs 12-15). Each leg gets a virtual chain of its own.
"""

from __future__ import annotations

import numpy as np
from linkage_text import Cut, J, urdf

import closedchain as cc
from closedchain.robots.eclipse import ECLIPSE, Geometry, trajectory
from closedchain.robots.eclipse.davies import exact_joints
from closedchain.robots.eclipse.geometry import PHASES

SECONDARY = ("theta", "d", "r", "x", "y", "z")
PRIMARY = ("px", "py", "pz", "rx", "ry", "rz")
_AXES = {"x": "1 0 0", "y": "0 1 0", "z": "0 0 1"}
_BACKWARDS = {"x": "-1 0 0", "y": "0 -1 0", "z": "0 0 -1"}


def _leg(leg: str, phase: float, g: Geometry) -> list[J]:
    """Joints of a circuit; the spherical joint is three hinges that start along the link."""
    joints = [
        ("theta", "0 0 1", "revolute", "0 0 0", "0 0 0"),
        ("d", "0 0 1", "prismatic", "0 0 0", "0 0 0"),
        ("r", "0 -1 0", "revolute", f"{g.r_g} 0 0", "0 0 0"),
        ("x", _AXES["x"], "revolute", f"{-g.r} 0 0", "0 0 0"),
        ("y", _AXES["y"], "revolute", "0 0 0", "0 0 0"),
        ("z", _AXES["z"], "revolute", "0 0 0", "0 0 0"),
        ("rz", _BACKWARDS["z"], "revolute", f"{-g.a} 0 0", f"0 0 {float(-phase)!r}"),
        ("ry", _BACKWARDS["y"], "revolute", "0 0 0", "0 0 0"),
        ("rx", _BACKWARDS["x"], "revolute", "0 0 0", "0 0 0"),
        ("pz", _BACKWARDS["z"], "prismatic", "0 0 0", "0 0 0"),
        ("py", _BACKWARDS["y"], "prismatic", "0 0 0", "0 0 0"),
        ("px", _BACKWARDS["x"], "prismatic", "0 0 0", "0 0 0"),
    ]
    chain, parent = [], "base"
    for name, axis, kind, xyz, rpy in joints:
        child = f"{leg}_after_{name}"
        chain.append(J(f"{leg}_{name}", parent, child, xyz, axis, kind, rpy))
        parent = child
    return chain


def circuits(g: Geometry = ECLIPSE) -> cc.Mechanism:
    """The three circuits at the first posture of eq. (20), 18 inputs: the virtual chains."""
    joints = [j for leg, phase in zip("abc", PHASES, strict=True) for j in _leg(leg, phase, g)]
    first = exact_joints(g)[0]
    home = {
        f"{leg}_{name}": repr(float(value))
        for leg, row in zip("abc", first, strict=True)
        for name, value in zip(SECONDARY, row, strict=True)
    }
    lead = leading()[0][0, :6]
    home |= {
        f"{leg}_{name}": repr(float(value))
        for leg in "abc"
        for name, value in zip(PRIMARY, lead, strict=True)
    }
    names = [f"{leg}_{name}" for leg in "abc" for name in PRIMARY]
    text = urdf(
        "circuits",
        joints,
        [Cut(f"circuit_{leg}", "base", f"{leg}_after_px", type="fixed") for leg in "abc"],
        inputs={f"q_{name}": name for name in names},
        home=home,
        tip="a_after_z",
    )
    return cc.load_urdf(text)


def leading() -> tuple[np.ndarray, np.ndarray]:
    """Joints of the virtual chains along eq. (20) and their rates, (101, 18) each."""
    times = trajectory.TIMES
    turn = np.broadcast_to(trajectory.ANGLES, (times.size, 3))
    values = np.concatenate([trajectory.position(times), turn], axis=-1)
    rates = np.concatenate([trajectory.velocity(times), np.zeros((times.size, 3))], axis=-1)
    return np.tile(values, 3), np.tile(rates, 3)


def secondary(m: cc.Mechanism, q: np.ndarray) -> np.ndarray:
    """Joints (n, 3, 6) of the legs at postures (n, nq): theta, d, q_r, q_x, q_y, q_z."""
    at = [
        m.model.joints[m.model.getJointId(f"{leg}_{n}")].idx_q for leg in "abc" for n in SECONDARY
    ]
    return q[:, at].reshape(len(q), 3, 6)
