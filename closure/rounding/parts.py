"""Parts of a mechanism whose closures have no joint in common: each is judged by itself."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from closedchain.closure.closures import Closure
from closedchain.closure.equations import Equations
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.responses import paths


@dataclass(frozen=True)
class Part:
    """Closures that share joints with each other, and with no others.

    Attributes
    ----------
    closures : tuple of int
        Indices of the closures and couplings.
    joints : frozenset of str
        Joints, fixed ones too, on which their rows depend.
    rows : tuple of int
        Their rows among those of the mechanism.
    """

    closures: tuple[int, ...]
    joints: frozenset[str]
    rows: tuple[int, ...]

    def alone(self, mechanism: Mechanism) -> Mechanism:
        """The mechanism with the closures of this part only."""
        return replace(mechanism, closures=tuple(mechanism.closures[i] for i in self.closures))

    def owners(self, mechanism: Mechanism) -> frozenset[str]:
        """Joints and closures whose numbers the rows depend on."""
        return self.joints | {mechanism.closures[i].name for i in self.closures}

    def equations(self, alone: Mechanism) -> Equations:
        """Rows of the part, as ``alone`` has them, in its joints."""
        free = [
            v
            for name, joint in list(zip(alone.model.names, alone.model.joints, strict=True))[1:]
            if name in self.joints
            for v in range(joint.idx_v, joint.idx_v + joint.nv)
        ]
        return Equations(alone, np.array(free, dtype=int))


def parts_of(mechanism: Mechanism) -> tuple[Part, ...]:
    """Parts of a mechanism, in the order of their first closures."""
    above = paths(mechanism.description.joints)
    groups: list[tuple[set[int], set[str]]] = []
    for i, closure in enumerate(mechanism.closures):
        if isinstance(closure, Closure):
            joints = set(above[closure.parent] ^ above[closure.child])
        else:
            joints = {closure.follower, *closure.leaders}
        own = ({i}, joints)
        apart = []
        for group in groups:
            if group[1] & joints:
                own = (own[0] | group[0], own[1] | group[1])
            else:
                apart.append(group)
        groups = [*apart, own]
    found = []
    for indices, joints in sorted(groups, key=lambda group: min(group[0])):
        rows = [r for i in sorted(indices) for r in range(*_span(mechanism.row_slices[i]))]
        found.append(Part(tuple(sorted(indices)), frozenset(joints), tuple(rows)))
    return tuple(found)


def _span(where: slice) -> tuple[int, int]:
    return where.start, where.stop
