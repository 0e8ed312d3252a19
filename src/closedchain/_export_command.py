"""``closedchain export``: a robot in the words of other programs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from closedchain import _arguments as arguments
from closedchain._options import Json, NoXacro, Robot, Settings, Variant
from closedchain._terminal import print_json, say

FORMATS = "urdf|mjcf|sdf|urdf+|robot.yaml"


def export(
    robot: Robot,
    form: Annotated[str, typer.Option("--format", metavar=FORMATS, help="Format to write.")],
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="File to write; standard output by default. The URDF of a robot.yaml is written "
            "beside it.",
        ),
    ] = None,
    settings: Settings = None,
    variant: Variant = None,
    no_xacro: NoXacro = False,
    json: Json = False,
) -> None:
    """Write a robot for another program, and say what its format leaves out."""
    import closedchain as cc

    mechanism = arguments.load_robot(robot, settings or (), variant, xacro=not no_xacro)
    text, losses = cc.export(mechanism, form, out)
    if json:
        print_json({"format": form, "file": None if out is None else str(out), "losses": losses}
                   | ({"text": text} if out is None else {}))  # fmt: skip
        return
    if out is None:
        say(text.rstrip("\n"))
    else:
        say(str(out))
    for sentence in losses:
        typer.echo(f"note: {sentence}", err=out is None)
