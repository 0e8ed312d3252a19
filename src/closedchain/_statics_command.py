"""The command ``closedchain statics``: what holds a load at a posture."""

from __future__ import annotations

from typing import TYPE_CHECKING

from closedchain import _arguments as arguments
from closedchain._options import (
    Density,
    Gravity,
    Json,
    NoGravity,
    NoXacro,
    Payload,
    Robot,
    Settings,
    Values,
    Variant,
    Wrench,
)
from closedchain._terminal import fail, print_json, say, table, tell

if TYPE_CHECKING:
    import numpy as np

    from closedchain.analysis.forces.statics import Statics
    from closedchain.closure import Mechanism


def loaded(
    robot: str,
    values: list[str] | None,
    settings: list[str] | None,
    variant: str | None,
    *,
    no_xacro: bool,
    density: float | None,
) -> tuple[Mechanism, np.ndarray]:
    """Mechanism with masses, and the posture with the given inputs, home without."""
    import closedchain as cc

    mechanism = arguments.load_robot(robot, settings or (), variant, xacro=not no_xacro)
    if density is not None:
        mechanism = cc.with_inertias(mechanism, density)
    if not values:
        return mechanism, mechanism.home
    given = arguments.all_inputs(mechanism, arguments.input_values(mechanism, values))
    return mechanism, cc.direct(mechanism, given).raise_if_failed().q


def statics(
    robot: Robot,
    values: Values = None,
    wrench: Wrench = None,
    payload: Payload = None,
    gravity: Gravity = None,
    no_gravity: NoGravity = False,
    density: Density = None,
    settings: Settings = None,
    variant: Variant = None,
    no_xacro: NoXacro = False,
    json: Json = False,
) -> None:
    """Efforts and joint wrenches that hold a load at rest."""
    import closedchain as cc

    mechanism, q = loaded(robot, values, settings, variant, no_xacro=no_xacro, density=density)
    forces, masses = wrenches(mechanism, wrench), payloads(payload)
    fall = arguments.free_fall(robot, gravity, none=no_gravity)
    found = cc.statics(mechanism, q, forces, fall, payload=masses)
    if json:
        print_json({"robot": mechanism.name, "gravity": fall, **vars(found)})
    if not found.carried:
        fail(found.text)
    if not json:
        _report(mechanism, found)
        if any(fall):
            say(f"weights: {' '.join(f'{x:g}' for x in fall)} m/s^2")


def payloads(words: list[str] | None) -> dict[str, float]:
    """Masses [kg] by frame. Raises ``BadArgumentError``."""
    return {
        frame: arguments.number(text, f"--payload {frame}")
        for frame, text in arguments.assignments(words or (), "--payload").items()
    }


def wrenches(mechanism: Mechanism, words: list[str] | None) -> dict[str, list[float]]:
    """Wrenches [N, N m] by frame. Raises ``BadArgumentError``."""
    found: dict[str, list[float]] = {}
    for word in words or ():
        name, equals, text = word.partition("=")
        frame = name if equals else mechanism.required_task().tip
        if frame in found:
            raise arguments.BadArgumentError(f"--wrench: {frame} is given twice")
        numbers = (text if equals else word).replace(",", " ").split()
        found[frame] = [arguments.number(one, f"--wrench {frame}") for one in numbers]
    return found


def _report(mechanism: Mechanism, found: Statics) -> None:
    efforts = zip(mechanism.inputs, found.inputs.tolist(), mechanism.input_units, strict=True)
    table(
        ("input", "effort", "unit"),
        [(name, effort, "N" if unit == "m" else "N m") for name, effort, unit in efforts],
    )
    say("")
    table(
        ("joint", "fx [N]", "fy [N]", "fz [N]", "mx [N m]", "my [N m]", "mz [N m]"),
        [(name, *_tidy(w.tolist())) for name, w in found.joints.items()],
    )
    tell(f"\n{found.text}")


def _tidy(numbers: list[float]) -> list[float]:
    """Rounding errors as zeros, for a reader."""
    return [0.0 if abs(x) < 1e-10 else x for x in numbers]
