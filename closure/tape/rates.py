"""The rates of all physical joints on a tape: what ``closure.joint_rates`` defines, on motions.

A motion is given by expressions for its coordinates; what comes out is P v, one expression for
each rate. Only its norm means something, so rates stand along any axes.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from closedchain.closure.joint_rates import CutJoint, rate_layout
from closedchain.closure.tape.expression import Expr
from closedchain.closure.tape.rows import Kinematics
from closedchain.closure.tape.vectors import add, cross, dot, scale, sub

Motion = dict[int, Expr]
"""Coordinates of a motion that are not zero."""


def physical_rates(k: Kinematics, motions: Sequence[Motion]) -> list[list[Expr]]:
    """P v for each motion v: the rates of all joints of the tree and the cut ones."""
    layout = rate_layout(k.mechanism)
    zero = k.graph.constant(0.0)
    found = [[motion.get(int(v), zero) for v in layout.own] for motion in motions]
    for cut in layout.cut:
        for rates, motion in zip(found, motions, strict=True):
            rates += _cut_rates(k, cut, motion)
    return found


def _cut_rates(k: Kinematics, cut: CutJoint, motion: Motion) -> list[Expr]:
    """Rates of a cut joint in a motion."""
    (first, second), (placement1, placement2) = cut.joints, cut.placements
    _, place = k.frame(second, placement2)
    slip, spin = [k.graph.constant(0.0)] * 3, [k.graph.constant(0.0)] * 3
    for v, (linear, angular) in k.relative(first, second, place).items():
        if v in motion:
            if cut.slides or cut.rod:
                slip = add(slip, scale(motion[v], linear))
            spin = add(spin, scale(motion[v], angular))
    if not cut.rod:
        return (slip if cut.slides else []) + (spin if cut.turns else [])
    _, start = k.frame(first, placement1)
    gap = sub(place, start)
    inverse = dot(gap, gap).sqrt().recip()
    along = scale(inverse, gap)
    seen_from_1 = scale(inverse, cross(along, slip))
    # seen from body 2 the other end moves with w x gap - slip
    seen_from_2 = add(seen_from_1, cross(along, cross(along, spin)))
    return [*seen_from_1, *seen_from_2, dot(along, spin) * math.sqrt(0.5)]
