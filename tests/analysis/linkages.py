"""Small closed linkages, for tests of what holds for any mechanism."""

from __future__ import annotations

import math
from collections.abc import Mapping

from linkage_text import Cut, J, load

import closedchain as cc
from closedchain.closure.build import as_stated, length_at
from closedchain.closure.nearest import closed_beside


def nearest_home(m: cc.Mechanism) -> cc.Mechanism:
    """The mechanism with the closed posture nearest to the stated one as home, inputs moved too."""
    near = closed_beside(m, as_stated(m.description).home)
    return m.with_home(near.q, length_at(m, near.q))


def four_bar(inputs: Mapping[str, str] | None = None) -> cc.Mechanism:
    return load(
        "four_bar",
        [
            J("A", "base", "crank"),
            J("B", "crank", "coupler", "0.15 0 0"),
            J("D", "base", "rocker", "0.4 0 0"),
        ],
        [Cut("C", "coupler", "rocker", "0.35 0 0", "0.3 0 0")],
        inputs={"q1": "A"} if inputs is None else inputs,
        home={"A": 1.1, "B": -0.8, "D": 1.7},
        tip="coupler",
    )


def spinning_rod() -> cc.Mechanism:
    """An arm and a rod between two balls, which may spin about its own line."""
    return load(
        "rod",
        [
            J("A", "base", "arm", axis="0 1 0"),
            J("u1", "base", "one", "0 0.4 0", axis="1 0 0"),
            J("u2", "one", "two"),
            J("spin", "two", "rod", axis="0 1 0"),
        ],
        [Cut("ball", "arm", "rod", "0.5 0 0", "0.5 -0.4 0", type="spherical")],
        inputs={"q": "A"},
        tip="arm",
    )


def six_bar(drive: str) -> cc.Mechanism:
    """Stephenson III: a four-bar A B C D, and a dyad F G from its coupler point E to the base."""
    return load(
        "six_bar",
        [
            J("A", "base", "crank"),
            J("B", "crank", "coupler", "0.15 0 0"),
            J("D", "base", "rocker", "0.4 0 0"),
            J("G", "base", "swing", "0.6 0.1 0"),
            J("E", "coupler", "rod", "0.2 0.2 0"),
        ],
        [
            Cut("C", "coupler", "rocker", "0.35 0 0", "0.3 0 0"),
            Cut("F", "rod", "swing", "0.3 0 0", "0.25 0 0"),
        ],
        inputs={"q1": drive},
        home={"A": 1.1, "B": -0.8, "D": 1.7, "G": 1.5, "E": 0.3},
        tip="swing",
    )


def three_rrr() -> cc.Mechanism:
    """Planar 3-RRR: three legs to a triangular platform."""
    feet = [(0.0, 0.0), (0.6, 0.0), (0.3, 0.52)]
    joints, cuts = [], []
    joints.append(J("platform_pose", "base", "platform", type="floating"))
    for i, (x, y) in enumerate(feet, 1):
        joints.append(J(f"a{i}", "base", f"arm{i}", f"{x} {y} 0"))
        joints.append(J(f"b{i}", f"arm{i}", f"rod{i}", "0.2 0 0"))
        corner = f"{0.4 * (x - 0.3)} {0.4 * (y - 0.17)} 0"
        cuts.append(Cut(f"c{i}", f"rod{i}", "platform", "0.2 0 0", corner))
    home = {"a1": 1.2, "b1": -1.5, "a2": 2.9, "b2": -1.3, "a3": -1.6, "b3": -1.0}
    return load(
        "three_rrr",
        joints,
        cuts,
        inputs={f"q{i}": f"a{i}" for i in (1, 2, 3)},
        home={"platform_pose": "0.3 0.17 0 0 0 0 1", **home},
        tip="platform",
        outputs="x y rz",
    )


def spatial_four_bar(hooke: bool) -> cc.Mechanism:
    """RSSR, or with ``hooke`` RUSR, whose rod cannot spin."""
    rod = (
        [
            J("U1", "crank", "cross", "0.1 0 0", axis="0 1 0"),
            J("U2", "cross", "rod", axis="0 0 1"),
        ]
        if hooke
        else [J("rod_pose", "base", "rod", type="floating")]
    )
    cuts = [Cut("S2", "rod", "rocker", "0.4 0 0", "0 0.25 0", type="spherical")]
    if not hooke:
        cuts.insert(0, Cut("S1", "crank", "rod", "0.1 0 0", type="spherical"))
    home = {"R1": 0.7} if hooke else {"R1": 0.7, "rod_pose": "0.08 0.06 0 0 0 0 1"}
    return load(
        "rusr" if hooke else "rssr",
        [J("R1", "base", "crank"), J("R2", "base", "rocker", "0.35 0 0", axis="1 0 0"), *rod],
        cuts,
        inputs={"q1": "R1"},
        home=home,
        tip="rocker",
    )


def rods(count: int = 2) -> cc.Mechanism:
    """A plate on equal parallel U-S rods, as the lower arm of a Delta robot, off the axes."""
    joints = [J("frame", "base", "stand", rpy="0.3 -0.5 0.8", type="fixed")]
    joints.append(J("plate_pose", "base", "plate", type="floating"))
    cuts = []
    for i in range(1, count + 1):
        at = f"{0.1 * math.cos(i)} {0.1 * math.sin(i)} 0"
        joints.append(J(f"u{i}1", "stand", f"cross{i}", at, axis="1 0 0"))
        joints.append(J(f"u{i}2", f"cross{i}", f"rod{i}", axis="0 1 0"))
        cuts.append(Cut(f"s{i}", f"rod{i}", "plate", "0 0 -0.5", at, type="spherical"))
    return load("rods", joints, cuts, home=tilted_plate(), tip="plate")


def tilted_plate() -> dict[str, object]:
    import pinocchio as pin

    rotation = pin.rpy.rpyToMatrix(0.3, -0.5, 0.8)
    quaternion = pin.Quaternion(rotation).coeffs()
    place = rotation @ [0.0, 0.0, -0.5]
    return {"plate_pose": " ".join(f"{v:.12g}" for v in (*place, *quaternion))}


def parallelogram() -> cc.Mechanism:
    """Planar 4R parallelogram, in a plane along no axis."""
    return load(
        "parallelogram",
        [
            J("frame", "base", "stand", rpy="0.3 -0.5 0.8", type="fixed"),
            J("A", "stand", "left"),
            J("B", "left", "bar", "0.4 0 0"),
            J("D", "stand", "right", "0 0.1 0"),
        ],
        [Cut("C", "bar", "right", "0 0.1 0", "0.4 0 0")],
        inputs={"q1": "A"},
        home={"A": 0.2, "B": -0.2, "D": 0.2},
        tip="bar",
    )


def flat_parallelogram(angle: float = 0.0) -> cc.Mechanism:
    """Parallelogram whose cranks stand at an angle; at 0 all joints are in line."""
    return load(
        "parallelogram",
        [
            J("A", "base", "crank"),
            J("B", "crank", "coupler", "0.2 0 0"),
            J("D", "base", "rocker", "0.5 0 0"),
        ],
        [Cut("C", "coupler", "rocker", "0.5 0 0", "0.2 0 0")],
        inputs={"q1": "A"},
        home={"A": angle, "B": -angle, "D": angle},
        tip="coupler",
        outputs="x y",
    )


def wedges() -> cc.Mechanism:
    """Three prismatic joints in a plane."""
    return load(
        "wedges",
        [
            J("a", "base", "wedge", axis="1 0 0", type="prismatic"),
            J("b", "base", "plunger", axis="0 1 0", type="prismatic"),
        ],
        [Cut("c", "wedge", "plunger", type="prismatic", axis="0.6 0.8 0", child_axis="0.6 0.8 0")],
        inputs={"q1": "a"},
        tip="plunger",
    )


def bennett() -> cc.Mechanism:
    """Bennett's spatial four-bar: a sin(beta) = b sin(alpha)."""
    alpha, beta = 0.7, 1.2
    a, b = 0.3, 0.3 * math.sin(beta) / math.sin(alpha)
    ratio = math.sin((beta + alpha) / 2) / math.sin((beta - alpha) / 2)
    one = 0.9
    two = 2.0 * math.atan2(ratio, math.tan(one / 2))
    # each joint turns about z, then the link leads along x and twists about it
    return load(
        "bennett",
        [
            J("R1", "base", "link1"),
            J("R2", "link1", "link2", f"{a} 0 0", rpy=f"{alpha} 0 0"),
            J("R3", "link2", "link3", f"{b} 0 0", rpy=f"{beta} 0 0"),
            J("R4", "link3", "link4", f"{a} 0 0", rpy=f"{alpha} 0 0"),
            J("end", "link4", "tip", f"{b} 0 0", rpy=f"{beta} 0 0", type="fixed"),
        ],
        [Cut("weld", "base", "tip", type="fixed")],
        inputs={"q1": "R1"},
        home={"R1": one, "R2": two, "R3": -one, "R4": -two},
        tip="link2",
    )


def truss() -> cc.Mechanism:
    """Three bars, three hinges: nothing moves."""
    return load(
        "truss",
        [J("A", "base", "bar"), J("B", "base", "other", "0.4 0 0")],
        [Cut("C", "bar", "other", "0.3 0 0", "0.3 0 0")],
        home={"A": 0.8, "B": 2.3},
        tip="bar",
    )


def five_bar(coupled: bool = False, inputs: Mapping[str, str] | None = None) -> cc.Mechanism:
    joints = [
        J("A", "base", "left"),
        J("B", "left", "left_rod", "0.2 0 0"),
        J("E", "base", "right", "0.3 0 0", mimic="A" if coupled else ""),
        J("D", "right", "right_rod", "0.2 0 0"),
    ]
    inputs = inputs or ({"q1": "A"} if coupled else {"q1": "A", "q2": "E"})
    return load(
        "five_bar",
        joints,
        [Cut("C", "left_rod", "right_rod", "0.3 0 0", "0.3 0 0")],
        inputs=inputs,
        home={"A": 2.2, "B": -1.3, "E": 0.9, "D": 1.3},
        tip="left_rod",
        outputs="x y",
    )


def arm_with_parallelogram() -> cc.Mechanism:
    """A slide, a parallelogram on it, a wrist on that: the slide and the wrist are in no loop."""
    return load(
        "arm",
        [
            J("slide", "base", "carriage", axis="0 0 1", type="prismatic"),
            J("A", "carriage", "left"),
            J("B", "left", "bar", "0.4 0 0"),
            J("D", "carriage", "right", "0 0.1 0"),
            J("wrist", "bar", "hand", axis="1 0 0"),
        ],
        [Cut("C", "bar", "right", "0 0.1 0", "0.4 0 0")],
        inputs={"q1": "slide", "q2": "A", "q3": "wrist"},
        home={"A": 0.2, "B": -0.2, "D": 0.2},
        tip="hand",
    )


def sarrus(between: float = math.pi / 2, lean: float = 0.0) -> cc.Mechanism:
    """A platform on two legs of three parallel hinges: one row is redundant, and it rises.

    ``between`` [rad] are the legs' planes; ``lean`` [rad] is what one hinge is off them.
    """
    joints, home = [], {}
    for leg, (plane, radius, lower, upper) in enumerate(
        [(0.0, 0.4, 0.31, 0.27), (between, 0.35, 0.24, 0.36)]
    ):
        c, s = math.cos(plane), math.sin(plane)
        axis, leaning = f"{-s!r} {c!r} 0", f"{-s!r} {c!r} {lean!r}"
        low, high = f"low{leg}", f"high{leg}"
        joints += [
            J(f"A{leg}", "base", low, f"{radius * c!r} {radius * s!r} 0", axis),
            J(f"B{leg}", low, high, f"0 0 {lower}", leaning if leg else axis),
        ]
        # the ends of both legs stand 0.42 above and 0.05 outside their feet
        reach, towards = math.hypot(0.05, 0.42), math.atan2(0.05, 0.42)
        knee = (lower**2 + reach**2 - upper**2) / (2.0 * lower * reach)
        first = towards + math.acos(knee)
        second = math.atan2(0.05 - lower * math.sin(first), 0.42 - lower * math.cos(first))
        home |= {f"A{leg}": first, f"B{leg}": second - first}
        if leg == 0:
            joints.append(J("C0", high, "platform", f"0 0 {upper}", axis))
            home["C0"] = -second
        else:
            place = f"{0.4 * c - 0.45!r} {0.4 * s!r} 0"
            cut = Cut("C1", high, "platform", f"0 0 {upper}", place, axis=axis, child_axis=axis)
    return load(
        "sarrus", joints, [cut], inputs={"q1": "A0"}, home=home, tip="platform", outputs="z"
    )


def bricard() -> cc.Mechanism:
    """A ring of six equal links, with each hinge at right angles to the next."""
    turns = [math.pi / 2, -math.pi / 2] * 3
    joints = [J("R0", "base", "link0")]
    for i in range(1, 6):
        rpy = f"{turns[i - 1]!r} 0 0"
        joints.append(J(f"R{i}", f"link{i - 1}", f"link{i}", "0.2 0 0", rpy=rpy))
    joints.append(J("end", "link5", "tip", "0.2 0 0", rpy=f"{turns[5]!r} 0 0", type="fixed"))
    home = {f"R{i}": (1.0, -1.929196796)[i % 2] for i in range(6)}
    cut = Cut("weld", "base", "tip", type="fixed")
    return load("bricard", joints, [cut], inputs={"q1": "R0"}, home=home, tip="link2")


def lone_arm() -> cc.Mechanism:
    return load(
        "lone_arm",
        [J("A", "base", "upper"), J("B", "upper", "lower", "0.3 0 0", axis="0 1 0")],
        inputs={"q1": "A", "q2": "B"},
        home={"A": 0.1, "B": 0.2},
        tip="lower",
    )


def gantry() -> cc.Mechanism:
    """Three slides in series: fully decoupled."""
    return load(
        "gantry",
        [
            J("a", "base", "bridge", axis="1 0 0", type="prismatic"),
            J("b", "bridge", "trolley", axis="0 1 0", type="prismatic"),
            J("c", "trolley", "hook", axis="0 0 1", type="prismatic"),
        ],
        inputs={"q1": "a", "q2": "b", "q3": "c"},
        tip="hook",
        outputs="x y z",
    )
