"""The kinds of singularity of a posture, and their types, from its ranks.

Letters as in ``rank_loss``: K constraint Jacobian, V = ker K the closed motions, of dimension m
here and n generically, A: V -> input rates, T: V -> output rates, a, d, b the generic ranks of A,
T and [A; T] on V. n - b freedoms are idle: they move neither inputs nor outputs in any posture.

The types are those of [Zlatanov1994]_, counted beyond what is generic, so that an idle spin or a
spare input is no singularity. The kinds follow from them: constraint is IIM, inverse is IO, direct
is RO or RPM. II and RI come with the others: while m = n and the inputs drive the mechanism, II is
there exactly where direct is, and IO never without RI or RPM.

[Zlatanov1994]_ D. Zlatanov, R. G. Fenton and B. Benhabib, Singularity analysis of mechanisms and
robots via a velocity-equation model of the instantaneous kinematics, ICRA 1994.
"""

from __future__ import annotations

from closedchain.analysis.singularity.rank_loss import Ranks
from closedchain.closure.generic import GenericRanks
from closedchain.closure.singularity_kinds import COMBINED, KINDS, TYPES, title

__all__ = ["COMBINED", "KINDS", "TYPES", "kinds_of", "title", "types_of"]


def kinds_of(ranks: Ranks, generic: GenericRanks) -> frozenset[str]:
    """Kinds of a posture from its ranks."""
    found = {
        "direct": ranks.motions - ranks.inputs.value > generic.idle,
        "inverse": ranks.outputs.value < generic.outputs.value,
        "constraint": ranks.motions > generic.motions,
    }
    return frozenset(name for name, true in found.items() if true)


def types_of(ranks: Ranks, generic: GenericRanks) -> frozenset[str]:
    """Zlatanov's types of a posture from its ranks."""
    a, d, b = generic.inputs.value, generic.outputs.value, generic.together.value
    found = {
        "RI": ranks.together - ranks.outputs.value > b - d,
        "RO": ranks.together > ranks.inputs.value,
        "II": ranks.inputs.value < a,
        "IO": ranks.outputs.value < d,
        "IIM": ranks.motions > generic.motions,
        "RPM": ranks.motions - ranks.together > generic.idle,
    }
    return frozenset(name for name, true in found.items() if true)
