"""Well-known mechanisms whose numbers are settled: one description each, without closed forms."""

from __future__ import annotations

from math import sqrt
from types import MappingProxyType

from closedchain.robots.entry import Overrides, Robot


def _classic(name: str, title: str, source: str, **variants: Overrides) -> Robot:
    file = f"classics/{name}.xacro"
    return Robot(name, title, source, file, variants=MappingProxyType(variants))


def _regular_hexagon(radius: float) -> str:
    """Corners x y z of a hexagon in the plane z = 0."""
    c, s = 0.5 * radius, 0.5 * sqrt(3.0) * radius
    corners = ((radius, 0.0), (c, s), (-c, s), (-radius, 0.0), (-c, -s), (c, -s))
    return " ".join(f"{x!r} {y!r} 0" for x, y in corners)


_TEXTBOOK: Overrides = {
    "feet": "0 0 5 0 0 6",
    "sides": f"3 3 {3.0 * sqrt(2.0)!r}",
    "home": "4.572016172949128 2.0239919178282046 2.1159090140864576",
}
_DIETMAIER: Overrides = {
    "feet": "0 0 0 1.107915 0 0 0.549094 0.756063 0 0.735077 -0.223935 0.525991 "
    "0.514188 -0.526063 -0.368418 0.590473 0.094733 -0.205018",
    "tops": "0 0 0 0.542805 0 0 0.956919 -0.528915 0 0.665885 -0.353482 1.402538 "
    "0.478359 1.158742 0.107672 -0.137087 -0.235121 0.353913",
    # one of the forty, for legs 1, 0.645275, 1.086284, 1.503439, 1.281933, 0.771071
    "home": "0.6361117806578848 0.771451960366541 0.014955779982200027 "
    "-0.6634530831683868 0.008880171196940238 0.5458237692108213 -0.5116908851624844",
    "leg_max": 5,
}

CLASSICS = (
    _classic("five_bar", "planar 5R, two driven cranks", "textbooks; sizes of ours"),
    _classic(
        "three_rrr",
        "planar, three driven arms",
        "C. M. Gosselin, J. Angeles, The optimum kinematic design of a planar three-degree-of-"
        "freedom parallel manipulator, 1988; sizes of ours",
    ),
    _classic(
        "three_rpr",
        "planar, three driven slides",
        "C. Innocenti, V. Parenti-Castelli, Singularity-free evolution from one configuration to "
        "another in serial and fully-parallel manipulators, 1998; T. Sauer, Numerical Analysis",
        innocenti={},
        textbook=_TEXTBOOK,
    ),
    _classic(
        "gough_stewart",
        "6-UPS, six driven legs",
        "V. E. Gough, 1956; D. Stewart, A platform with six degrees of freedom, 1965; "
        "P. Dietmaier, The Stewart-Gough platform of general geometry can have 40 real postures, "
        "1998",
        regular={},
        dietmaier=_DIETMAIER,
        # similar hexagons: rank 5 in every posture (O. Ma, J. Angeles, 1991)
        hexagons={"feet": _regular_hexagon(0.3), "tops": _regular_hexagon(0.2)},
    ),
    _classic(
        "three_rps",
        "spatial, three driven legs",
        "K. H. Hunt, Structural kinematics of in-parallel-actuated robot-arms, 1983",
    ),
    _classic(
        "three_upu",
        "three driven legs, U joints",
        "L.-W. Tsai, Kinematics of a three-DOF platform with three extensible limbs, 1996; "
        "C. Han et al., Kinematic sensitivity analysis of the 3-UPU parallel mechanism, 2002",
        tsai={},
        tsai_equal={"platform_side": 1},
        snu={"axes": "radial"},
    ),
    _classic(
        "delta",
        "rotary, three arms, six rods",
        "R. Clavel, Delta, a fast robot with parallel geometry, 1988; sizes of ours",
    ),
    _classic(
        "agile_eye",
        "spherical 3-RRR",
        "C. M. Gosselin, J.-F. Hamel, The agile eye: a high-performance three-degree-of-freedom "
        "camera-orienting device, 1994",
    ),
    _classic(
        "six_r",
        "6R loop with 16 postures",
        "D. Manocha, J. F. Canny, Efficient inverse kinematics for general 6R manipulators, 1994",
    ),
    _classic("bennett", "spatial four-bar", "G. T. Bennett, A new mechanism, 1903"),
    _classic(
        "wren",
        "two hexagons, six equal rods",
        "C. Wren, 1669; K. Wohlhart, Kinematotropic linkages, 1996",
    ),
    _classic(
        "double_butterfly",
        "planar eight-bar",
        "C. W. Wampler, Solving the kinematics of planar mechanisms by Dixon determinant and a "
        "complex-plane formulation, 2001",
    ),
    _classic("ankle", "two motors, two rods, one foot", "sizes of ours"),
    _classic("excavator", "bucket: cylinder and four-bar", "sizes of ours"),
)
