"""Screws in the papers' order (angular, linear): algebra here, circuits and legs beside it."""

from closedchain.analysis.screws.algebra import (
    axis,
    from_force,
    from_motion,
    helical,
    killing,
    klein,
    lie,
    pitch,
    prismatic,
    reciprocal,
    revolute,
    screw,
    shifted,
    to_force,
    to_motion,
    transformed,
)

__all__ = [
    "axis",
    "from_force",
    "from_motion",
    "helical",
    "killing",
    "klein",
    "lie",
    "pitch",
    "prismatic",
    "reciprocal",
    "revolute",
    "screw",
    "shifted",
    "to_force",
    "to_motion",
    "transformed",
]
