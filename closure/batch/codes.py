"""Integer codes that kernels return."""

from __future__ import annotations

# status of a cell of a map
UNSEEN = -1
OK, UNREACHABLE, OTHER_BRANCH, JOINT_LIMIT = range(4)

# how the ways into a cell that was not reached ended
UNTRIED, FOLD, STUCK, MIRRORED = range(4)
"""No way in was tried; one neared a singularity of the chart; none did and Newton's method still
refused; one arrived at a posture with a mirrored cut joint."""

# verdict of a search
CLOSED, OPEN, UNDECIDED, BEYOND = range(4)
"""A closed posture; every start settled at an open one; some start did not settle; closed postures
only beyond joint limits or with a mirrored joint."""

# why Newton's method or a path was refused
REFUSALS = ("", "step", "singular", "sign", "far", "slow", "mirrored", "open start")
"""Meanings of the status that ``Batch.solve`` returns; 0 is success."""
NONE, STEP, SINGULAR, SIGN, FAR, SLOW, MIRRORED_END, OPEN_START = range(8)
