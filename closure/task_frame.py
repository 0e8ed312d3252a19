"""What a mechanism is for: its task, and a choice of outputs."""

from __future__ import annotations

from dataclasses import dataclass

from closedchain.urdf.description import OUTPUTS
from closedchain.urdf.errors import ClosureError, known_names


@dataclass(frozen=True)
class TaskFrame:
    """What the mechanism is for: the motion of link ``tip`` against the fixed link ``base``.

    ``outputs``: x y z are the velocity of the tip's origin, rx ry rz its angular velocity. With
    all three rotations, or none, components are along the world's axes; with one or two, along the
    tip's own axes, so that "x y z rx rz" is a position and the direction of the tip's y axis.

    Examples
    --------
    >>> task = cc.load("linear_delta").task
    >>> task.base, task.tip, task.outputs
    ('base', 'P', ('x', 'y', 'z'))
    """

    base: str
    tip: str
    outputs: tuple[str, ...]


def chosen_outputs(outputs: str | tuple[str, ...] | list[str]) -> tuple[str, ...]:
    """Outputs such as "x y z rx rz", distinct and in order. Raises ``ClosureError``."""
    names = tuple(outputs.replace(",", " ").split() if isinstance(outputs, str) else outputs)
    for name in names:
        if name not in OUTPUTS:
            raise ClosureError(known_names(str(name), "output", OUTPUTS))
    if not names or len(set(names)) < len(names):
        raise ClosureError(f"outputs must be distinct and at least one of {' '.join(OUTPUTS)}")
    return tuple(sorted(names, key=OUTPUTS.index))


def required_task(task: TaskFrame | None, name: str) -> TaskFrame:
    """The task of a mechanism called ``name``. Raises ``ClosureError`` where it has none."""
    if task is None:
        raise ClosureError(
            f"mechanism {name!r} has no task: add "
            '<task base="..." tip="..." outputs="x y z rx ry rz"/> to its URDF'
        )
    return task
