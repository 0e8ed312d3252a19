"""The numbers by which ranks at a posture are decided, in Python and in exported programs alike.

What they decide is told in ``analysis.singularity.deciding`` and ``distance``: singular values that
are neither zero to rounding nor far from it are judged by how far the nearest singular posture is.
"""

NEAR = 1e-5
"""Share of its scale above which a singular value counts without a distance."""

UNFOUND = 1e-8
"""Share below which one is zero where no distance can be had: where Newton's method finds no
singular posture, too many ranks are lost, or K nearly loses one and closed motions are blurred."""

FARTHEST = 1e-2
"""Share that the accuracy of a posture may raise ``NEAR`` to."""

MOST = 64
"""Equations of a loss of ranks beyond which it is not sought, but decided by ``UNFOUND``."""

SAME = 1e-9
"""What is missing to 1 of the squared cosine of motions that are one."""

ROUNDING = 1e-15
"""Share of its scale below which a singular value is zero, and rounding of dimensionless rows."""

KNOWN = 1e-9
"""Accuracy [rad, or lengths by ``mechanism.length``] that no posture is taken to exceed."""

SAFETY = 4.0
"""Times what rows and their rounding alone would allow."""

ROOT = 3.0
"""Times the root of the rounding: the farthest that a fold can be mistaken."""

STEPS = 60
"""Of Newton's method to a singular posture."""

LONGEST = 0.3
"""Such a step, dimensionless."""

FLOATING = 1e-6
"""Weight of motions that no joint rate sees: they follow from the closures."""

CUT = 1e-8
"""Share of singular values of the equations, rows of equal size, that are none."""

FALLEN = 1e-3
"""Share of the first corner that the last may be."""
