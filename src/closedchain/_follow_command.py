"""The command ``closedchain follow``: a task over time, written into a folder."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from closedchain import _arguments as arguments
from closedchain import _follow_words as words
from closedchain._destinations import results_folder
from closedchain._follow_report import report
from closedchain._options import (
    Gravity,
    Json,
    NoXacro,
    Outputs,
    Payload,
    Robot,
    Settings,
    Variant,
    Wrench,
)
from closedchain._statics_command import payloads, wrenches
from closedchain._terminal import fail
from closedchain.urdf.errors import ClosureError, known_names
from closedchain.urdf.extras import require

if TYPE_CHECKING:
    from closedchain.analysis.motion.follow import Comparison, Follow, TaskPath


def follow(
    robot: Robot,
    task: Annotated[
        str,
        typer.Option(
            metavar="NAME|FILE.csv",
            help="Task of the robot (d1: drill, hexagon, step, periodic; rus6: turn), or "
            "a CSV file with columns t [s], x, y, z [m] and, if wanted, ax, ay, az (tool axis).",
        ),
    ],
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for the results.")],
    objective: Annotated[
        str,
        typer.Option(
            metavar="singularity|range|speed",
            help="What the redundancy is for: distance to singularities, middle of the inputs' "
            "ranges, slow inputs.",
        ),
    ] = "singularity",
    method: Annotated[
        str,
        typer.Option(metavar="gradient|path", help="Step by step, or the whole path at once."),
    ] = "gradient",
    lock: Annotated[
        list[str] | None,
        typer.Option(
            metavar="INPUT[=VALUE]",
            help="Input that stands still, at home's value or the one given [m or rad]; several "
            "may be given.",
        ),
    ] = None,
    compare: Annotated[
        bool,
        typer.Option("--compare", help="Also with each input locked, and by both methods."),
    ] = False,
    limit: Annotated[
        list[str] | None,
        typer.Option(
            metavar="INPUT=LO:HI", help="Limits of an input [m or rad] in place of its own."
        ),
    ] = None,
    speed_limit: Annotated[
        list[str] | None,
        typer.Option(
            metavar="[INPUT=]SPEED", help="Largest speed of all inputs, or of one [m/s or rad/s]."
        ),
    ] = None,
    gain: Annotated[
        float | None,
        typer.Option(
            min=0.0,
            help="Of gradient: null motion per second and slope of the objective; 20 by default.",
        ),
    ] = None,
    outputs: Outputs = None,
    efforts: Annotated[
        bool,
        typer.Option("--efforts", help="Also the efforts of the inputs and what joints carry."),
    ] = False,
    wrench: Wrench = None,
    payload: Payload = None,
    gravity: Gravity = None,
    settings: Settings = None,
    variant: Variant = None,
    no_xacro: NoXacro = False,
    json: Json = False,
) -> None:
    """Follow a task over time, into a folder.

    The freedoms that it leaves are used. Where it cannot be followed, says when and why, writes
    what was reached, and ends with 1.
    """
    import closedchain as cc
    from closedchain._index_page import write_index
    from closedchain.analysis.forces.loads import loads as checked_loads
    from closedchain.analysis.motion.follow.following import METHODS
    from closedchain.analysis.motion.follow.objectives import OBJECTIVES
    from closedchain.analysis.progress import reporting
    from closedchain.robots.named_tasks import task_outputs

    require("a run is written as dataset, figures and page", "maps", "figures", "view")
    if objective not in OBJECTIVES:
        fail(known_names(objective, "objective", OBJECTIVES))
    way = next((known for known in METHODS if known == method), None)
    if way is None:
        fail(known_names(method, "method", METHODS))
    if compare and lock:
        fail("--compare locks each input in turn: leave out --lock")
    if not efforts and (wrench or payload or gravity):
        fail("--wrench, --payload and --gravity are for --efforts")
    m = arguments.load_robot(robot, settings or (), variant, xacro=not no_xacro)
    names = m.outputs(outputs or task_outputs(robot))
    options: dict[str, Any] = {"outputs": names, "objective": objective}
    options["limits"] = words.limits(m, limit or ())
    options["speed_limits"] = words.speed_limits(m, speed_limit or ())
    if gain is not None:
        options["gain"] = gain
    locks = words.locks(m, lock or ())
    wanted = words.read_task(m, robot, task, names)
    loads: dict[str, Any] = {
        "wrench": wrenches(m, wrench),
        "payload": payloads(payload),
        "gravity": arguments.free_fall(robot, gravity, none=False),
    }
    checked_loads(m, **loads)
    results_folder(out)
    found: Comparison | None = None
    with reporting(True) as progress:
        if compare:
            found = cc.compare(m, wanted, progress=progress or False, **options)
            row = [r.name for r in found.rows].index(way)
            run = found.follows[row]
        else:
            run = cc.follow(
                *(m, wanted), method=way, lock=locks, progress=progress or False, **options
            )
    files = write(run, wanted, found, out, arguments.up_axis(robot))
    effortless = ""
    if efforts:
        try:
            files |= write_efforts(run, loads, out)
        except ClosureError as error:  # the run is there all the same
            effortless = f"no efforts: {error}"
    index = write_index(f"{m.name}, {wanted.name}", files, [run.message])
    files[index.name] = index
    report(run, wanted, found, files, json)
    if not run.converged:
        fail(run.message)
    if effortless:
        fail(effortless)


def write(
    run: Follow, task: TaskPath, comparison: Comparison | None, folder: Path, up: arguments.Up
) -> dict[str, Path]:
    """Write the results of a run; return the paths by name. Raises ``OSError``."""
    from closedchain._follow_page import follow_page
    from closedchain.analysis.motion.follow.figures import draw_follow, draw_inputs

    others = {} if comparison is None else _others(comparison, run)
    title = f"{run.problem.mechanism.name}, {task.name}"
    page = re.sub(r"[^A-Za-z0-9._-]", "_", f"{run.problem.mechanism.name}_{task.name}") + ".html"
    writers: dict[str, Callable[[Path], object]] = {
        "path.csv": run.to_csv,
        "path.nc": lambda path: run.to_dataset().to_netcdf(path, engine="h5netcdf"),
        "path.png": lambda path: draw_follow(run, others, title=title, path=path),
        "inputs.png": lambda path: draw_inputs(run, others, title=title, path=path),
        page: lambda path: path.write_text(follow_page(run, task, up=up), encoding="utf-8"),
    }
    files = {name: folder / name for name in writers}
    for name, writer in writers.items():
        writer(files[name])
    return files


def write_efforts(run: Follow, loads: Mapping[str, Any], folder: Path) -> dict[str, Path]:
    """Write efforts, powers and joint wrenches of a run; return the paths by name.

    Raises
    ------
    ClosureError
        Unknown frames, too few samples, a posture at which inputs do not determine the motion.
    OSError
        The folder cannot be written.
    """
    import closedchain as cc
    from closedchain.analysis.figures.efforts import draw_efforts
    from closedchain.analysis.forces.effort_history import FEWEST

    if run.reached < FEWEST:
        raise ClosureError(f"they need {FEWEST} samples or more, and {run.reached} were reached")
    found = cc.efforts_along(run.problem.mechanism, run.times, run.q, **loads)
    files = {name: folder / name for name in ("efforts.nc", "efforts.png")}
    found.to_dataset().to_netcdf(files["efforts.nc"], engine="h5netcdf")
    draw_efforts(found, files["efforts.png"])
    return files


def _others(found: Comparison, run: Follow) -> dict[str, Follow]:
    """Runs of a comparison other than the one that is written."""
    both = zip(found.rows, found.follows, strict=True)
    return {row.name: other for row, other in both if other is not run}
