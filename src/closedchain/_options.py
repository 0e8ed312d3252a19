"""Arguments and options that several commands share."""

from typing import Annotated

import typer

Robot = Annotated[
    str,
    typer.Argument(
        metavar="ROBOT",
        help="Name in the catalogue, or a file: URDF, xacro, MJCF, SDF, robot.yaml.",
    ),
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
Over = Annotated[
    list[str] | None,
    typer.Option(
        metavar="NAME[=LO:HI[:N]]",
        help="A coordinate that varies [m or rad]: an input, a joint, or x y z rx ry rz tilt "
        "azimuth of the tip. One: a line; two: a slice; three: a volume; four or six: slices.",
    ),
]
At = Annotated[
    list[str] | None,
    typer.Option(metavar="NAME=VALUE", help="Value of a coordinate that does not vary."),
]
Kinds = Annotated[
    list[str] | None,
    typer.Option(
        "--kind",
        metavar="direct|inverse|combined|constraint|all",
        help="Sets to look for (several may be given); all by default.",
    ),
]
Mode = Annotated[
    str | None,
    typer.Option(metavar="NAME", help="Posture of the description to start from; home by default."),
]
Resolution = Annotated[
    int | None,
    typer.Option(
        min=3,
        max=5000,
        help="Points along coordinates without their own number; 401, 101 or 25 for a line, "
        "a slice or a volume by default.",
    ),
]
Span = Annotated[
    float | None,
    typer.Option(
        help="Half width of ranges not given, around the start [characteristic lengths, or rad]; "
        "by default 1, or less where the branch takes up little of that."
    ),
]
Workers = Annotated[
    int | None, typer.Option(min=1, help="Threads that map; one for each core by default.")
]
Triple = tuple[float, float, float]
