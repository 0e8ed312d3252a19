"""Tasks over time that robots of the catalogue have by name: of their papers, or to show a point.

Only tips are told here; which inputs do a task is for analysis to find.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from closedchain.urdf.errors import DescriptionError, known_names


@dataclass(frozen=True, eq=False)
class NamedTask:
    """A motion of the tip.

    Attributes
    ----------
    times : (n,) array
        Rising [s].
    positions : (n, 3) array
        Of the tip in the world [m].
    axes : (n, 3) array or None
        Directions of the tool axis, world.
    rotations : (n, 3, 3) array or None
        Of the tip in the world; home's where there are no axes either.
    """

    times: np.ndarray
    positions: np.ndarray
    axes: np.ndarray | None = None
    rotations: np.ndarray | None = None


def named_tasks(robot: str) -> tuple[str, ...]:
    """Names of the tasks of a robot of the catalogue; empty for any other robot."""
    return tuple(_TASKS.get(robot, {}))


def named_task(robot: str, name: str) -> NamedTask:
    """Task of a robot by name. Raises ``DescriptionError``, which lists the known ones."""
    tasks = _TASKS.get(robot, {})
    if name not in tasks:
        raise DescriptionError(known_names(name, f"task of {robot}", tasks))
    return tasks[name]()


def task_outputs(robot: str) -> str | None:
    """Outputs of the robot's tasks where they are fewer than its description's, else None."""
    return _OUTPUTS.get(robot)


def _drill() -> NamedTask:
    from closedchain.robots import d1

    return _between(d1.drill_waypoints())


def _hexagon() -> NamedTask:
    from closedchain.robots import d1

    return _between(d1.hexagon_waypoints())


def _step() -> NamedTask:
    from closedchain.robots import d1

    return _between(d1.step_waypoints())


def _between(corners: np.ndarray) -> NamedTask:
    """One second from corner to corner; the tool stays as at home."""
    from closedchain.robots import d1

    return NamedTask(*d1.rest_to_rest(corners, samples=10))


def _periodic() -> NamedTask:
    """Tip and tool axis of the motion by the periodic inputs of section 6."""
    from closedchain.robots import d1

    geometry, times = d1.geometry(), np.linspace(0.0, 2.0 * np.pi, 126)
    platform = d1.follow_inputs(d1.periodic(times, geometry).inputs, geometry).platform
    # the platform's y axis is its normal
    return NamedTask(times, d1.tasks.tip(platform, geometry), axes=platform.rotation[..., 1])


def _turn() -> NamedTask:
    """Turn by 1.6 rad about the vertical, at home's place, and back."""
    from closedchain.robots import load, rus6

    mechanism = load("rus6")
    times = np.linspace(0.0, 4.0, 41)
    angles = 1.6 * np.sin(np.pi * times / 4.0) ** 2
    return NamedTask(
        times,
        np.tile(mechanism.pose(mechanism.home).translation, (times.size, 1)),
        rotations=np.array([rus6.rotation_ypr(angle, 0.0, 0.0) for angle in angles]),
    )


_TASKS: Mapping[str, Mapping[str, Callable[[], NamedTask]]] = MappingProxyType(
    {
        "d1": {"drill": _drill, "hexagon": _hexagon, "step": _step, "periodic": _periodic},
        "rus6": {"turn": _turn},
    }
)
_OUTPUTS: Mapping[str, str] = MappingProxyType({"d1": "x y z rx rz"})
