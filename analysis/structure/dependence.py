"""Which outputs depend on which inputs: input-output decoupling, seen at random postures.

Motion decoupling is that of the topology theory: H. Shen, K. Xiong, Kinematic decoupling design
method and application of parallel mechanism, 2016; claimed for the robot of H. Shen, C. Wu, D.
Chablat, G. Wu, T. Yang, DETC2018-85709, 2018.
"""

from __future__ import annotations

import textwrap
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from closedchain.analysis.first_order import first_order
from closedchain.analysis.structure.poc import looking_at
from closedchain.analysis.structure.postures import wander
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.ranks import RANK_TOLERANCE, null_space, numerical_rank
from closedchain.urdf.errors import ClosureError

POSTURES = 12
LOCKED = 1e-8  # dimensionless output rate that counts as none where the inputs are at rest
AT_REST = 1e-4  # a twist map without a larger entry is measured against this, not against itself


@dataclass(frozen=True, eq=False)
class Dependence:
    """Dependence of outputs on inputs along one motion.

    Attributes
    ----------
    body : str
        Whose motion the outputs are.
    outputs, inputs : tuple of str
    matrix : (d, n_inputs) array of bool
        Whether an output's rate depends on an input's rate at some posture.
    largest : (d, n_inputs) array
        Evidence: the largest size of each entry of the dimensionless twist map, as a share of the
        largest entry at the same posture.
    smallest_dependent, largest_independent : float
        Entries of ``largest`` around the decision, 0 where there are none.
    postures : (n, nq) array
        Those at which the inputs determine the outputs.

    Examples
    --------
    >>> m = cc.load("rpa3t")
    >>> d = cc.dependence(m)
    >>> print(d.matrix.astype(int))  # rows x y z, columns theta1 theta2 theta3
    [[1 1 1]
     [1 1 1]
     [1 1 0]]
    >>> d.decoupled
    False
    """

    body: str
    outputs: tuple[str, ...]
    inputs: tuple[str, ...]
    matrix: np.ndarray
    largest: np.ndarray
    smallest_dependent: float
    largest_independent: float
    postures: np.ndarray
    text: str

    @property
    def decoupled(self) -> bool:
        """Whether each output depends on one input at most, and no two on the same."""
        return bool((self.matrix.sum(axis=0) <= 1).all() and (self.matrix.sum(axis=1) <= 1).all())


def dependence(
    mechanism: Mechanism,
    q: ArrayLike | None = None,
    outputs: str | tuple[str, ...] | list[str] | None = None,
    *,
    body: str | None = None,
) -> Dependence:
    """Find which outputs depend on which inputs.

    An entry of the twist map V = T qdot that is zero along the whole motion means that the output
    is no function of that input; one that is zero at a posture, as often at home, means nothing.
    So the map is taken at postures of a random walk.

    Parameters
    ----------
    q : (nq,) array, optional
        Closed posture where the walk begins; home by default.
    outputs : str, optional
        Such as "x y z"; those of the task by default, all six for another body.
    body : str, optional
        Link or named point whose motion is asked; the tip of the task by default.

    Raises
    ------
    ClosureError
        No inputs, unknown outputs or body, malformed or open posture; or inputs that determine the
        outputs, or can move independently of each other, at none of the postures.

    Examples
    --------
    >>> m = cc.load("rpa3t")
    >>> d = cc.dependence(m)
    >>> bool(d.matrix[d.outputs.index("z"), d.inputs.index("theta3")])  # z is free of theta3
    False
    """
    looking = looking_at(mechanism, body)
    if not mechanism.inputs:
        raise ClosureError(f"mechanism {mechanism.name!r} has no inputs for outputs to depend on")
    names = looking.outputs(outputs)
    found = [(at, _input_map(looking, at, names)) for at in wander(mechanism, POSTURES, q)]
    maps = [np.abs(m) for _, m in found if not isinstance(m, str)]
    if not maps:
        raise ClosureError(
            f"the inputs of {mechanism.name!r} {found[0][1]}, so what depends on them is undefined"
        )
    largest = np.max([m / max(float(m.max()), AT_REST) for m in maps], axis=0)
    matrix = largest > RANK_TOLERANCE
    result = Dependence(
        body=looking.required_task().tip,
        outputs=names,
        inputs=mechanism.inputs,
        matrix=matrix,
        largest=largest,
        smallest_dependent=float(largest[matrix].min()) if matrix.any() else 0.0,
        largest_independent=float(largest[~matrix].max(initial=0.0)),
        postures=np.array([at for at, m in found if not isinstance(m, str)]),
        text="",
    )
    return replace(result, text=_text(result))


def _input_map(mechanism: Mechanism, q: np.ndarray, outputs: tuple[str, ...]) -> np.ndarray | str:
    """Dimensionless twist map (d, n_inputs) at a posture, or why there is none.

    Freedoms beside the inputs that leave the outputs at rest, such as the spin of a rod between
    spherical joints, do not matter here.
    """
    at = first_order(mechanism, q, outputs)
    motions, _ = null_space(at.K)
    driven = motions[mechanism.input_v]
    if numerical_rank(driven).value < len(mechanism.inputs):
        return "cannot move independently of each other"
    locked, _ = null_space(driven)
    if np.abs(at.J @ motions @ locked).max(initial=0.0) > LOCKED:
        return "do not determine the motion"
    return np.asarray(at.J @ motions @ np.linalg.pinv(driven))


def _text(d: Dependence) -> str:
    lines = [f"{d.body}, over {len(d.postures)} postures of one motion:"]
    for name, row in zip(d.outputs, d.matrix, strict=True):
        depends = " ".join(i for i, yes in zip(d.inputs, row, strict=True) if yes)
        lines.append(f"  {name} depends on {depends or 'no input'}")
    if d.matrix.all():
        lines.append("Fully coupled: every output depends on every input.")
    elif d.decoupled:
        lines.append("Decoupled: each output that moves has an input of its own.")
    else:
        lines.append("Partly decoupled: some outputs do not depend on some inputs.")
    lines.append(
        f"Smallest entry that counts {d.smallest_dependent:.2g}, largest that does not "
        f"{d.largest_independent:.1g}, as shares of the largest entry of the twist map."
    )
    return "\n".join(textwrap.fill(line, 80, subsequent_indent="    ") for line in lines)
