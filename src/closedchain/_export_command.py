"""``closedchain export``: a robot in the words of other programs, or as a program of its own."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from closedchain import _arguments as arguments
from closedchain._destinations import results_file, results_folder
from closedchain._options import Json, NoXacro, Robot, Settings, Variant
from closedchain._terminal import fail, print_json, say

FORMATS = "urdf|mjcf|sdf|urdf+|robot.yaml"


def export(
    robot: Robot,
    form: Annotated[
        str | None, typer.Option("--format", metavar=FORMATS, help="Format to write.")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="File to write; standard output by default. The URDF of a robot.yaml is written "
            "beside it.",
        ),
    ] = None,
    c: Annotated[
        Path | None, typer.Option("--c", metavar="DIR", help="Folder for a program in C.")
    ] = None,
    js: Annotated[
        Path | None,
        typer.Option("--js", metavar="DIR", help="Folder for a module in JavaScript."),
    ] = None,
    name: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="Name of the program; the robot's by default."),
    ] = None,
    number: Annotated[
        str, typer.Option(metavar="double|float", help="Numbers of the program in C.")
    ] = "double",
    settings: Settings = None,
    variant: Variant = None,
    no_xacro: NoXacro = False,
    json: Json = False,
) -> None:
    """Write a robot for another program.

    What its format leaves out is said. With --c or --js the position problems themselves are
    written: a program without dependencies.
    """
    import closedchain as cc

    if [form, c, js].count(None) != 2:
        fail("export needs one of --format, --c and --js")
    mechanism = arguments.load_robot(robot, settings or (), variant, xacro=not no_xacro)
    for language, folder in (("c", c), ("js", js)):
        if folder is not None:
            results_folder(folder)
            texts = cc.export_code(mechanism, language, name=name, number=number)
            _write_program(texts, folder, json)
            return
    assert form is not None
    if out is not None:
        results_file(out)
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


def _write_program(texts: dict[str, str], folder: Path, json: bool) -> None:
    for file, text in texts.items():
        (folder / file).write_text(text, encoding="utf-8")
    paths = [str(folder / file) for file in texts]
    if json:
        print_json({"files": paths})
    else:
        for path in paths:
            say(path)
