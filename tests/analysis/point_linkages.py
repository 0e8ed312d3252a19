"""Linkages of points on lines, rods, and relations of joint values, small enough to do by hand."""

from __future__ import annotations

import math

from linkage_text import Cut, J, Tie, load

import closedchain as cc


def slider_crank(crank: float = 0.2, rod: float = 0.5) -> cc.Mechanism:
    """A crank at the base, a rod, and the rod's end P as a ball in a slot along x."""
    angle = 0.7
    lean = -math.asin(crank * math.sin(angle) / rod)
    return load(
        "slider_crank",
        [
            J("A", "base", "crank"),
            J("B", "crank", "rod", f"{crank} 0 0"),
            J("P_on", "rod", "P", f"{rod} 0 0", type="fixed"),
        ],
        [Cut("slot", "base", "P", type="point_on_line", axis="1 0 0")],
        inputs={"q1": "A"},
        home={"A": angle, "B": lean - angle},
        tip="P",
        outputs="x",
    )


def rod_four_bar(drive: str = "A") -> cc.Mechanism:
    """Planar four-bar: crank 0.15, base 0.4, rocker 0.3; the coupler is a rod of 0.35."""
    return load(
        "rod_four_bar",
        [J("A", "base", "crank"), J("D", "base", "rocker", "0.4 0 0")],
        [Cut("coupler", "crank", "rocker", "0.15 0 0", "0.3 0 0", "distance", length=0.35)],
        inputs={"q1": drive},
        home={"A": 1.1, "D": 1.7},
        tip="rocker" if drive == "A" else "crank",
        outputs="rz",
    )


def spatial_rod_four_bar() -> cc.Mechanism:
    """A crank about z, a rocker about x, and a rod between their ends."""
    return load(
        "spatial_rod_four_bar",
        [J("A", "base", "crank"), J("D", "base", "rocker", "0.5 0 0", "1 0 0")],
        [Cut("coupler", "crank", "rocker", "0.15 0 0", "0 0.3 0", "distance", length=0.6)],
        inputs={"q1": "A"},
        home={"A": 1.6, "D": 1.5},
        tip="rocker",
        outputs="rx",
    )


WIDE, NARROW, HALF, ROD = 0.5, 0.2, 0.06, 0.5
"""Delta with rods: radii of the slides and of the platform, half width of a pair, length [m]."""


def rod_ends(side: int) -> tuple[tuple[str, str], tuple[str, str]]:
    """Ends of the two rods of a side: on the slide and on the platform, in their own frames."""
    angle = 2.0 * math.pi * side / 3.0
    c, s = math.cos(angle), math.sin(angle)

    def at(radius: float, across: float) -> str:
        return f"{radius * c - across * s!r} {radius * s + across * c!r} 0"

    return (at(WIDE, HALF), at(NARROW, HALF)), (at(WIDE, -HALF), at(NARROW, -HALF))


def rod_delta(*, real: bool, rod: float = ROD) -> cc.Mechanism:
    """Three vertical slides, a platform below them, two rods of equal length a side.

    With ``real`` the rods are bodies with a cut ball at each end; else they are distances.
    """
    down = math.sqrt(max(rod**2 - (WIDE - NARROW) ** 2, 0.0))
    joints = [J(f"q{k}", "base", f"slide{k}", axis="0 0 1", type="prismatic") for k in range(3)]
    joints.append(J("pose", "base", "platform", type="floating"))
    home: dict[str, object] = {"pose": f"0 0 {-down!r} 0 0 0 1"}
    cuts: list[Cut] = []
    for k in range(3):
        for n, (top, bottom) in enumerate(rod_ends(k)):
            name = f"rod{k}{n}"
            if not real:
                cuts.append(Cut(name, f"slide{k}", "platform", top, bottom, "distance", length=rod))
                continue
            joints.append(J(f"{name}_pose", "base", name, type="floating"))
            home[f"{name}_pose"] = rod_pose(top, bottom, down)
            cuts.append(Cut(f"{name}_top", f"slide{k}", name, top, "0 0 0", "spherical"))
            cuts.append(Cut(f"{name}_end", name, "platform", f"{rod} 0 0", bottom, "spherical"))
    return load(
        "rod_delta", joints, cuts, inputs={f"q{k}": f"q{k}" for k in range(3)}, home=home,
        tip="platform", outputs="x y z",
    )  # fmt: skip


def rod_pose(top: str, bottom: str, down: float) -> str:
    """Pose of a rod along its own x axis from top to bottom, at home."""
    import numpy as np
    import pinocchio as pin

    a = np.array([float(x) for x in top.split()])
    along = np.array([float(x) for x in bottom.split()]) - [0, 0, down] - a
    turn = pin.Quaternion.FromTwoVectors(np.array([1.0, 0, 0]), along)
    return " ".join(map(repr, [*a.tolist(), *turn.coeffs().tolist()]))


def pantograph() -> cc.Mechanism:
    """An arm of links 0.4 and 0.3 whose hand keeps its direction: a + b + c = 0.2."""
    return load(
        "pantograph",
        [
            J("a", "base", "upper"),
            J("b", "upper", "fore", "0.4 0 0"),
            J("c", "fore", "hand", "0.3 0 0"),
        ],
        [Tie("parallel", "linear", ("c", "a", "b"), (1.0, 1.0, 1.0), 0.2)],
        inputs={"q1": "a", "q2": "b"},
        home={"a": 0.5, "b": 0.8, "c": -1.0},
        tip="hand",
        outputs="x y",
    )


def cam() -> cc.Mechanism:
    """A shaft and a valve that lifts by 0.02 + 0.3 shaft^2 - 0.05 shaft^3 [m], along z."""
    return load(
        "cam",
        [
            J("shaft", "base", "disc", "0.3 0 0", "0 1 0"),
            J("lift", "base", "valve", axis=Z_AXIS, type="prismatic"),
        ],
        [Tie("lobe", "polynomial", ("lift", "shaft"), (0.02, 0.0, 0.3, -0.05))],
        inputs={"q1": "shaft"},
        home={"shaft": 0.4, "lift": 0.06},
        tip="valve",
        outputs="z",
    )


Z_AXIS = "0 0 1"


def bent_finger() -> cc.Mechanism:
    """A finger: its tip joint follows 0.1 + 0.5 x + 0.4 x^2 of the base joint."""
    return load(
        "bent_finger",
        [J("knuckle", "base", "near"), J("tip", "near", "far", "0.05 0 0", "0 0.6 0.8")],
        [Tie("tendon", "polynomial", ("tip", "knuckle"), (0.1, 0.5, 0.4))],
        inputs={"q1": "knuckle"},
        home={"knuckle": 0.3, "tip": 0.286},
        tip="far",
        outputs="x y rz",
    )


def ball_on_a_table() -> cc.Mechanism:
    """A spatial arm whose end stays in the plane z = 0.1 of the base."""
    return load(
        "ball_on_a_table",
        [
            J("a", "base", "turret", "0 0 0.3"),
            J("b", "turret", "upper", axis="0 1 0"),
            J("c", "upper", "fore", "0.3 0 0", "0 1 0"),
            J("P_on", "fore", "P", "0.3 0 0", type="fixed"),
        ],
        [Cut("table", "base", "P", "0.5 -2 0.1", type="in_plane", axis="0 0 1")],
        inputs={"q1": "a", "q2": "b"},
        home={"a": 0.4, "b": 0.2, "c": 0.4},
        tip="P",
        outputs="x y",
    )
