"""Arguments and options that several commands share."""

from typing import Annotated

import typer

Robot = Annotated[
    str, typer.Argument(metavar="ROBOT", help="Name in the catalogue, or a URDF or xacro file.")
]
Values = Annotated[
    list[str] | None,
    typer.Argument(
        metavar="[INPUT=VALUE]...", help="Values of inputs [m or rad]; the others stay at home."
    ),
]
Settings = Annotated[
    list[str] | None, typer.Option("--set", metavar="NAME=VALUE", help="Parameter of the robot.")
]
Variant = Annotated[
    str | None, typer.Option(metavar="NAME", help="Variant of a robot of the catalogue.")
]
Outputs = Annotated[
    str | None,
    typer.Option(metavar='"x y z rx rz"', help="Outputs; those of the robot's task by default."),
]
Json = Annotated[bool, typer.Option("--json", help="Print JSON.")]
NoXacro = Annotated[
    bool,
    typer.Option("--no-xacro", help="Read plain URDF only; xacro in a file runs as Python code."),
]
Triple = tuple[float, float, float]
