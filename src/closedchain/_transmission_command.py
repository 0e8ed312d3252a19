"""The command ``closedchain transmission``: joints and the motors that move them, as tables."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
import typer

from closedchain import _arguments as arguments
from closedchain._destinations import results_folder
from closedchain._options import Json, NoXacro, Robot, Settings, Variant
from closedchain._terminal import print_json, say, table, tell
from closedchain.urdf.extras import require

if TYPE_CHECKING:
    from closedchain.analysis.forces.motor_map import Transmission


def transmission(
    robot: Robot,
    joints: Annotated[
        list[str],
        typer.Option("--joints", metavar="JOINT", help="Joint to move (several may be given)."),
    ],
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for the results.")],
    motors: Annotated[
        list[str] | None,
        typer.Option("--motor", metavar="INPUT", help="Motors; found by themselves by default."),
    ] = None,
    over: Annotated[
        list[str] | None,
        typer.Option(metavar="JOINT=LO:HI[:N]", help="Range of a joint, and points along it."),
    ] = None,
    effort: Annotated[
        list[str] | None,
        typer.Option(metavar="INPUT=LIMIT", help="Largest effort of a motor [N, N m]."),
    ] = None,
    speed: Annotated[
        list[str] | None,
        typer.Option(metavar="INPUT=LIMIT", help="Largest speed of a motor [m/s, rad/s]."),
    ] = None,
    code: Annotated[
        list[str] | None,
        typer.Option("--code", metavar="c|js", help="Write both ways as programs, too."),
    ] = None,
    settings: Settings = None,
    variant: Variant = None,
    no_xacro: NoXacro = False,
    json: Json = False,
) -> None:
    """Tabulate joints over the motors that move them.

    Positions, rates, limits and toggles.
    """
    import closedchain as cc
    from closedchain.analysis.figures.transmissions import draw_transmission
    from closedchain.analysis.forces.transmission_table import csv_text

    require("a table is written as dataset and figure", "maps", "figures")
    mechanism = arguments.load_robot(robot, settings or (), variant, xacro=not no_xacro)
    found = cc.transmission(mechanism, joints, motors or None)
    ranges, points = _ranges(over or ())
    efforts = _limits(found.motor_names, effort or (), "--effort")
    speeds = _limits(found.motor_names, speed or (), "--speed")
    results_folder(out)
    tabulated = cc.transmission_table(found, ranges, points, efforts=efforts, speeds=speeds)
    files = [out / "transmission.csv", out / "transmission.nc"]
    files[0].write_text(csv_text(tabulated), encoding="utf-8")
    tabulated.to_netcdf(files[1], engine="h5netcdf")
    if len(joints) < 3:
        files.append(out / "transmission.png")
        draw_transmission(tabulated, files[-1])
    for language in code or ():
        for name, source in (("motors", found.driven_by_joints), ("joints", mechanism)):
            for file, text in cc.export_code(source, language, name=name).items():
                files.append(out / language / file)
                files[-1].parent.mkdir(exist_ok=True)
                files[-1].write_text(text, encoding="utf-8")
    there = tabulated["reached"].values
    within = there & tabulated["within"].values
    if json:
        names = {"joints": found.joint_names, "motors": found.motor_names}
        counts = {"positions": there.size, "reached": there.sum(), "within": within.sum()}
        paths = [str(path) for path in files]
        print_json({**names, "home": found.home, **counts, "files": paths})
        return
    _report(found)
    tell(
        f"{there.sum()} of {there.size} positions are reached, {within.sum()} with the motors "
        "within their limits"
    )
    for path in files:
        say(str(path))


def _report(found: Transmission) -> None:
    rows = found.jacobian(found.home)
    y = np.atleast_1d(found.motors(found.home))
    table(
        ("motor", "at home", "unit", *(f"d / d {name}" for name in found.joint_names)),
        [
            (name, round(float(value), 12) + 0.0, unit, *row.tolist())
            for name, value, unit, row in zip(
                found.motor_names, y, found.motor_units, rows, strict=True
            )
        ],
    )
    say(f"\ndistance from a toggle at home: {float(found.toggle(found.home)):.4g}")


def _ranges(words: Sequence[str]) -> tuple[dict[str, tuple[float, float]], dict[str, int]]:
    ranges, points = {}, {}
    for name, text in arguments.assignments(words, "--over").items():
        parts = text.split(":")
        if len(parts) not in (2, 3):
            raise arguments.BadArgumentError(f"--over {name}={text}: expected lo:hi or lo:hi:n")
        low, high = (arguments.number(part, f"--over {name}") for part in parts[:2])
        ranges[name] = (low, high)
        if len(parts) == 3:
            count = arguments.number(parts[2], f"--over {name}")
            arguments.positive(count, f"--over {name}, points")
            points[name] = int(count)
    return ranges, points


def _limits(motors: Sequence[str], words: Sequence[str], option: str) -> np.ndarray | None:
    if not words:
        return None
    given = arguments.assignments(words, option)
    for name in given:
        if name not in motors:
            raise arguments.BadArgumentError(f"{option}: {name} is none of {', '.join(motors)}")
    if missing := [name for name in motors if name not in given]:
        raise arguments.BadArgumentError(f"{option}: no limit for {', '.join(missing)}")
    limits = np.array([arguments.number(given[name], f"{option} {name}") for name in motors])
    for name, limit in zip(motors, limits.tolist(), strict=True):
        arguments.positive(limit, f"{option} {name}")
    return limits
