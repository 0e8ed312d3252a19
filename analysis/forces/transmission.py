"""``transmission``: which motors move some joints through closed loops."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from closedchain.analysis.forces.motor_map import Transmission, joint_column
from closedchain.closure.generic import dimensionless_jacobian
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.ranks import null_space, numerical_rank
from closedchain.closure.solve.samples import closed_samples
from closedchain.urdf.errors import ClosureError, known_names

MOVES = 1e-7  # dimensionless rate above which a joint moves in a unit motion


def transmission(
    mechanism: Mechanism, joints: Sequence[str], motors: Sequence[str] | None = None
) -> Transmission:
    """Find the motors that move some joints through the loops.

    Parameters
    ----------
    joints : sequence of str
        Joints of the tree with one freedom each.
    motors : sequence of str, optional
        Inputs that move them; by default all that cannot move with the joints at rest.

    Raises
    ------
    ClosureError
        Unknown names, joints that depend on each other, or motors that do not determine them.

    Examples
    --------
    >>> m = cc.load("d1")
    >>> t = cc.transmission(m, ["leg1_R", "leg2_R", "leg3_R"])
    >>> print(t.jacobian(t.home).round(2) + 0.0)  # d motors / d joints [m/rad]
    [[1.74 0.   0.  ]
     [0.   1.74 0.  ]
     [0.   0.   1.74]]
    """
    if isinstance(joints, str) or not isinstance(joints, Sequence) or not joints:
        raise ClosureError("joints must be a list of joint names, at least one")
    columns = [joint_column(mechanism, name) for name in joints]
    if len(set(columns)) < len(columns):
        raise ClosureError(f"a joint is named twice in {', '.join(joints)}")
    motions = _generic_motions(mechanism)
    free = motions[columns]
    if numerical_rank(free).value < len(columns):
        raise ClosureError(
            f"the loops tie the joints {', '.join(joints)} to each other, or hold them still: "
            "they cannot be placed independently"
        )
    if motors is None:
        chosen = _motors_of(mechanism, motions, columns)
    else:
        for name in [motors] if isinstance(motors, str) else motors:
            if name not in mechanism.inputs:
                raise ClosureError(known_names(name, "input", mechanism.inputs))
        chosen = (motors,) if isinstance(motors, str) else tuple(motors)
    rows = [int(mechanism.input_v[mechanism.inputs.index(name)]) for name in chosen]
    still = motions @ null_space(free)[0]
    loose = [
        n for n, r in zip(chosen, rows, strict=True) if np.abs(still[r]).max(initial=0) > MOVES
    ]
    if loose:
        raise ClosureError(
            f"{', '.join(loose)} can move with the joints {', '.join(joints)} at rest"
        )
    if numerical_rank(motions[rows]).value < len(columns):
        raise ClosureError(
            _undetermined(mechanism, motions, joints, chosen if motors is not None else None)
        )
    return Transmission(mechanism, tuple(joints), chosen)


def _undetermined(
    mechanism: Mechanism,
    motions: np.ndarray,
    joints: Sequence[str],
    motors: Sequence[str] | None,
) -> str:
    """Why motors, given or found (None), do not determine joints, and what would do."""
    said = ", ".join(joints)
    if motors is not None:
        return f"the motors {', '.join(motors)} do not determine the joints {said}: name more"
    for name, moved_by in _completions(mechanism, motions, joints):
        return (
            f"the inputs that move {said} move other joints as well: name {name} beside "
            f"{'it' if len(joints) == 1 else 'them'}, and {', '.join(moved_by)} determine all"
        )
    return (
        f"no inputs are at rest whenever the joints {said} are and determine them: there are too "
        "few inputs, or they move other joints as well"
    )


def _completions(
    mechanism: Mechanism, motions: np.ndarray, joints: Sequence[str]
) -> Iterator[tuple[str, tuple[str, ...]]]:
    """Passive joints which, beside those given, are determined by inputs, and these inputs."""
    model = mechanism.model
    columns = [joint_column(mechanism, name) for name in joints]
    driven = {*columns, *map(int, mechanism.input_v)}
    for i in range(1, model.njoints):
        if model.nvs[i] != 1 or int(model.idx_vs[i]) in driven:
            continue
        more = [*columns, int(model.idx_vs[i])]
        if numerical_rank(motions[more]).value < len(more):
            continue
        motors = _motors_of(mechanism, motions, more)
        rows = [int(mechanism.input_v[mechanism.inputs.index(name)]) for name in motors]
        if rows and numerical_rank(motions[rows]).value == len(more):
            yield str(model.names[i]), motors


def _motors_of(
    mechanism: Mechanism, motions: np.ndarray, columns: Sequence[int]
) -> tuple[str, ...]:
    """Inputs that are at rest whenever the joints are, and move with them."""
    still = motions @ null_space(motions[list(columns)])[0]
    return tuple(
        name
        for name, v in zip(mechanism.inputs, mechanism.input_v, strict=True)
        if np.abs(still[v]).max(initial=0.0) < MOVES < np.abs(motions[v]).max(initial=0.0)
    )


def _generic_motions(mechanism: Mechanism) -> np.ndarray:
    """Closed motions (nv, n), dimensionless, at the sample where they are fewest."""
    found = [null_space(dimensionless_jacobian(mechanism, q))[0] for q in closed_samples(mechanism)]
    return min(reversed(found), key=lambda basis: basis.shape[1])
