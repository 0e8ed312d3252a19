"""Arguments and options that several commands share."""

import inspect
from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import Annotated, Any, get_type_hints

import typer

from closedchain._arguments import reading

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
        metavar="INPUT=VALUE", help="Values of inputs [m or rad]; the others stay at home."
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
NoGravity = Annotated[bool, typer.Option("--no-gravity", help="Without weights.")]
Gravity = Annotated[
    str | None,
    typer.Option(
        metavar='"X Y Z"',
        help="Acceleration of free fall [m/s^2], along the world's axes; by default 9.81 against "
        "the robot's up axis: z, or another one of robots of the catalogue.",
    ),
]
Wrench = Annotated[
    list[str] | None,
    typer.Option(
        metavar='[FRAME=]"fx fy fz mx my mz"',
        help="Force and moment [N, N m] on the robot along the world's axes, at the tip or at a "
        "named frame (several may be given).",
    ),
]
Payload = Annotated[
    list[str] | None, typer.Option(metavar="FRAME=KG", help="Point mass at a named frame.")
]
Density = Annotated[
    float | None,
    typer.Option(
        metavar="KG/M3",
        help="Links without masses get those of their shapes, solid of this density.",
    ),
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
    typer.Option(
        metavar="NAME|NUMBER",
        help="Posture of the description to start from, or mode of 'postures'; home by default.",
    ),
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
Measures = Annotated[
    list[str] | None,
    typer.Option(
        "--measure",
        metavar="NAME[=NUMBER,...]",
        help="Further variable of the maps: effort_per_force, effort_per_moment, least_speed, "
        "least_force, isotropy, output_transmission; with the stiffness of the drives [N/m or "
        "N m/rad] largest_compliance=1e6, least_stiffness=1e6 (several may be given).",
    ),
]
Workers = Annotated[
    int | None, typer.Option(min=1, help="Threads that map; one for each core by default.")
]
Triple = tuple[float, float, float]


_Tolerance = Annotated[
    float | None,
    typer.Option(
        metavar="METRES",
        help="What rounded numbers of a file may leave open; by its printed digits by default, 0 "
        "takes them as they stand.",
    ),
]
_Home = Annotated[
    list[str] | None,
    typer.Option(
        metavar="JOINT=VALUE",
        help="Value of a joint or input [m or rad] at home, in place of the file's.",
    ),
]
_PackageDirs = Annotated[
    list[Path] | None,
    typer.Option(
        "--package-dir", metavar="DIR", help="Folder with the packages of package:// meshes."
    ),
]


def reads_a_file(command: Callable[..., None]) -> Callable[..., None]:
    """Give a command on a robot the options that say how its file is read."""

    @wraps(command)
    def run(
        *,
        tolerance: float | None = None,
        home: list[str] | None = None,
        package_dir: list[Path] | None = None,
        **rest: Any,
    ) -> None:
        with reading(tolerance, home or (), package_dir or ()):
            command(**rest)

    more = {"tolerance": _Tolerance, "home": _Home, "package_dir": _PackageDirs}
    known = {**get_type_hints(command, include_extras=True), **more}
    own = inspect.signature(command)
    options = [
        inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=None, annotation=kind)
        for name, kind in more.items()
    ]
    parameters = [
        parameter.replace(annotation=known[parameter.name])
        for parameter in (*own.parameters.values(), *options)
    ]
    run.__signature__ = own.replace(parameters=parameters)  # type: ignore[attr-defined]
    run.__annotations__ = known
    return run
