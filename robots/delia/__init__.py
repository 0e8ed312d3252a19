"""The DeLiA family of J. Gallardo-Alvarado, 2010, section 2: D1 with other legs.

Coupler and platform are held by the same planes in all members, so that their poses are D1's; see
``closedchain.robots.d1`` for the position problems, and ``Member.joint_values`` for what the joints
of another member read in these poses.
"""

from closedchain.robots.delia_choices import CHOICES, FREEDOMS

from .legs import DRIVEN, LegSolution, Sizes, joint_values
from .member import JointValues, Member

__all__ = [
    "CHOICES",
    "DRIVEN",
    "FREEDOMS",
    "JointValues",
    "LegSolution",
    "Member",
    "Sizes",
    "joint_values",
]
