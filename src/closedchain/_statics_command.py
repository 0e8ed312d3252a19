"""The command ``closedchain statics``: what holds a load at a posture."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from closedchain import _arguments as arguments
from closedchain._options import (
    Density,
    Json,
    NoGravity,
    NoXacro,
    Robot,
    Settings,
    Values,
    Variant,
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
    wrench: Annotated[
        list[str] | None,
        typer.Option(
            metavar='[FRAME=]"fx fy fz mx my mz"',
            help="Force and moment [N, N m] on the robot along the world's axes, at the tip or at "
            "a named frame (several may be given).",
        ),
    ] = None,
    payload: Annotated[
        list[str] | None,
        typer.Option(metavar="FRAME=KG", help="Point mass at a named frame."),
    ] = None,
    no_gravity: NoGravity = False,
    density: Density = None,
    settings: Settings = None,
    variant: Variant = None,
    no_xacro: NoXacro = False,
    json: Json = False,
) -> None:
    """Efforts of the inputs and wrenches of the joints that hold a load at rest."""
    import closedchain as cc

    mechanism, q = loaded(robot, values, settings, variant, no_xacro=no_xacro, density=density)
    masses = {
        frame: arguments.number(text, f"--payload {frame}")
        for frame, text in arguments.assignments(payload or (), "--payload").items()
    }
    found = cc.statics(
        mechanism, q, _wrenches(mechanism, wrench or ()), not no_gravity, payload=masses
    )
    if json:
        print_json({"robot": mechanism.name, **vars(found)})
    if not found.carried:
        fail(found.text)
    if not json:
        _report(mechanism, found)


def _wrenches(mechanism: Mechanism, words: list[str] | tuple[str, ...]) -> dict[str, list[float]]:
    found: dict[str, list[float]] = {}
    for word in words:
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
