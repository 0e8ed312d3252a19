"""The command ``closedchain``: questions to a robot of the catalogue or of a file.

Heavy imports are inside the commands. Exit codes: 0, or 1 with one line on stderr, or 2 for a
command line that cannot be parsed.
"""

from __future__ import annotations

import re
import socket
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperGroup

from closedchain import _arguments as arguments
from closedchain import _reports as reports
from closedchain._closed_forms_command import closed_forms
from closedchain._destinations import results_file, results_folder
from closedchain._export_command import export
from closedchain._follow_command import follow
from closedchain._joints_command import joints
from closedchain._options import (
    At,
    Json,
    Kinds,
    Measures,
    Mode,
    NoXacro,
    Outputs,
    Over,
    Resolution,
    Robot,
    Settings,
    Span,
    Triple,
    Values,
    Variant,
    Workers,
    reads_a_file,
)
from closedchain._postures_command import postures
from closedchain._resets_command import resets
from closedchain._simulate_command import simulate
from closedchain._statics_command import statics
from closedchain._terminal import fail, print_json, remark, say
from closedchain._transmission_command import transmission
from closedchain.urdf.errors import ClosedChainError
from closedchain.urdf.extras import require

if TYPE_CHECKING:
    from closedchain.closure import Mechanism, Solution


class _Commands(TyperGroup):
    """Commands whose expected errors become one line."""

    def invoke(self, ctx: Any) -> Any:
        try:
            return super().invoke(ctx)
        except BrokenPipeError:
            raise
        except ClosedChainError as error:
            fail(str(error))
        except OSError as error:
            fail(_told(error))


app = typer.Typer(
    cls=_Commands,
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    help="Kinematics and singularities of closed-chain (parallel) manipulators.",
)


def _version(wanted: bool) -> None:
    if wanted:
        import closedchain

        say(f"closedchain {closedchain.__version__}")
        raise typer.Exit


@app.callback()
def _common(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version.")
    ] = False,
) -> None:
    pass


@app.command("list")
def list_robots(
    family: Annotated[
        str | None, typer.Option(metavar="NAME", help="List the members of a family instead.")
    ] = None,
    json: Json = False,
) -> None:
    """List the robots of the catalogue, or a family's members.

    A member is loaded by the family's name and its choices: --set coupler=PRS --set outer=CPS.
    """
    if family is None:
        reports.catalogue(json)
    else:
        reports.members(family, json)


@app.command()
@reads_a_file
def info(
    robot: Robot,
    settings: Settings = None,
    variant: Variant = None,
    no_xacro: NoXacro = False,
    json: Json = False,
) -> None:
    """Inputs, task, closures, parameters and mobility of a robot."""
    from closedchain.robots import robot as entry
    from closedchain.robots import robots

    source = entry(robot).source if robot in robots() else ""
    reports.info(_load(robot, settings, variant, no_xacro), json, source)


@app.command()
@reads_a_file
def direct(
    robot: Robot,
    values: Values = None,
    mode: Mode = None,
    settings: Settings = None,
    variant: Variant = None,
    no_xacro: NoXacro = False,
    json: Json = False,
) -> None:
    """Direct position problem: the tip's pose for given inputs.

    On the assembly branch of home, or of another mode (--mode).
    """
    mechanism = _load(robot, settings, variant, no_xacro)
    given = arguments.input_values(mechanism, values or ())
    solution = _direct(mechanism, given, mode)
    at_home = [name for name in mechanism.inputs if name not in given]
    _answer(mechanism, solution, json, at_home=at_home)


@app.command()
@reads_a_file
def inverse(
    robot: Robot,
    xyz: Annotated[
        Triple | None,
        typer.Option(metavar="X Y Z", help="Position of the tip [m]; home's by default."),
    ] = None,
    rpy: Annotated[
        Triple | None,
        typer.Option(
            metavar="R P Y",
            help="Orientation of the tip, R = Rz(Y) Ry(P) Rx(R) [rad]; home's by default.",
        ),
    ] = None,
    outputs: Outputs = None,
    mode: Mode = None,
    settings: Settings = None,
    variant: Variant = None,
    no_xacro: NoXacro = False,
    json: Json = False,
) -> None:
    """Inverse position problem: the inputs for a pose of the tip.

    On the branch of home, or of another mode (--mode). Components of the pose that are no outputs
    are left to the mechanism.
    """
    import numpy as np
    import pinocchio as pin

    import closedchain as cc

    mechanism = _load(robot, settings, variant, no_xacro)
    if xyz is None and rpy is None:
        fail("inverse needs --xyz, --rpy or both")
    arguments.finite((*(xyz or ()), *(rpy or ())), "tip pose")
    start = arguments.start_posture(mechanism, mode, working=True)
    pose = mechanism.pose(start)
    rotation = pose.rotation if rpy is None else pin.rpy.rpyToMatrix(*rpy)
    pose = pin.SE3(rotation, pose.translation if xyz is None else np.array(xyz))
    solution = cc.inverse(mechanism, pose, start, outputs)
    _answer(mechanism, solution, json, outputs=list(mechanism.outputs(outputs)))


@app.command()
@reads_a_file
def classify(
    robot: Robot,
    values: Values = None,
    outputs: Outputs = None,
    mode: Mode = None,
    settings: Settings = None,
    variant: Variant = None,
    no_xacro: NoXacro = False,
    json: Json = False,
) -> None:
    """Kinds of singularity of a posture."""
    import closedchain as cc

    mechanism = _load(robot, settings, variant, no_xacro)
    found = _posture(mechanism, values, mode)
    reports.classification(mechanism, found, cc.classify(mechanism, found, outputs), json)


@app.command()
@reads_a_file
def view(
    robot: Robot,
    values: Values = None,
    html: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Write one HTML page and exit.")
    ] = None,
    open_browser: Annotated[bool, typer.Option("--open", help="Open a browser.")] = False,
    port: Annotated[
        int, typer.Option(min=0, max=65535, help="Port to serve at; a free one by default.")
    ] = 0,
    up: Annotated[
        str | None, typer.Option(metavar="x|y|z", help="World axis that points up.")
    ] = None,
    no_modes: Annotated[
        bool, typer.Option("--no-modes", help="Do not search other assembly modes to go to.")
    ] = False,
    mode: Mode = None,
    settings: Settings = None,
    variant: Variant = None,
    no_xacro: NoXacro = False,
) -> None:
    """Show a robot in a browser, or write it as a page.

    Sliders move it, and its loops stay closed.
    """
    from closedchain._modes import searched_modes
    from closedchain.robots.viewer import Controls, Served, static_page

    require("a page draws with Meshcat", "view")
    upwards = arguments.up_axis(robot, up)
    mechanism = _load(robot, settings, variant, no_xacro)
    for note in reports.undrawn(mechanism):
        remark(note)
    if html is None:
        _refuse_taken(port)
    else:
        results_file(html)
    q = _posture(mechanism, values, mode)
    modes = {} if no_modes else searched_modes(mechanism, q)
    page = static_page(mechanism, q, up=upwards, controls=Controls(modes=modes))
    if html is not None:
        html.write_text(page, encoding="utf-8")
        say(str(html))
        if open_browser:
            typer.launch(html.absolute().as_uri())
        return
    with Served(page, port) as served:
        say(f"{served.url}  (Ctrl-C ends)")
        if open_browser:
            typer.launch(served.url)
        served.wait()


@app.command()
@reads_a_file
def urdf(
    robot: Robot,
    settings: Settings = None,
    variant: Variant = None,
    no_xacro: NoXacro = False,
) -> None:
    """Print the expanded URDF of a robot.

    Error messages refer to its lines.
    """
    say(_load(robot, settings, variant, no_xacro).description.text.rstrip("\n"))


@app.command()
@reads_a_file
def singularities(
    robot: Robot,
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for the results.")],
    over: Over = None,
    kind: Kinds = None,
    at: At = None,
    mode: Mode = None,
    resolution: Resolution = None,
    span: Span = None,
    outputs: Outputs = None,
    measure: Measures = None,
    workers: Workers = None,
    settings: Settings = None,
    variant: Variant = None,
    no_xacro: NoXacro = False,
    json: Json = False,
    details: Annotated[
        bool, typer.Option("--details", help="Say how sets were sought and what led to nothing.")
    ] = False,
) -> None:
    """Map the singularities of a robot, into a folder.

    Over coordinates of one's choice; by default: two slices of input space, and of the workspace
    where home allows.
    """
    from closedchain._index_page import write_index
    from closedchain._survey_page import survey_page
    from closedchain.analysis.progress import reporting
    from closedchain.analysis.survey.captions import caption
    from closedchain.analysis.survey.results_folder import write_survey
    from closedchain.analysis.survey.surveying import survey

    require("a survey writes maps, figures and a page", "maps", "figures", "view")
    kinds, more = arguments.kinds(kind or ()), arguments.measures(measure or ())
    mechanism = _load(robot, settings, variant, no_xacro)
    wanted = arguments.slices(mechanism, over or ())
    if span is not None:
        arguments.positive(span, "--span")
    held = arguments.coordinate_values(mechanism, at or (), "--at")
    for name in held:
        if wanted.slices and all(name in names for names in wanted.slices):
            fail(f"--at {name}: every slice varies {name} itself")
    start = arguments.start_posture(mechanism, mode)
    results_folder(out)
    with reporting(True) as progress:
        found = survey(
            mechanism,
            wanted.slices or None,
            ranges=wanted.ranges,
            at=held,
            mode=mode,
            kinds=kinds,
            resolution=arguments.resolution(wanted, resolution),
            span=span,
            outputs=outputs,
            workers=workers,
            progress=progress,
            measures=more,
        )
    written = write_survey(found, out)
    page = out / f"{re.sub(r'[^A-Za-z0-9._-]', '_', mechanism.name)}.html"
    page.write_text(survey_page(found, start, up=arguments.up_axis(robot)), encoding="utf-8")
    files = {**written, page.name: page}
    captions = [caption(part.map, part.sets, notes=False) for part in found.slices]
    text = [*captions, *found.notes, f"At home: {found.redundancy.text}"]
    table = [
        {**row, "slice": " × ".join(part.over)}
        for part, row in zip(found.slices, found.summary(), strict=True)
    ]
    folded = {"How sets were sought, and what led to nothing": found.details}
    index = write_index(found.title, files, text, table, folded)
    reports.survey(found, {**files, index.name: index}, json, details=details)


@app.command()
def plot(
    folder: Annotated[
        Path, typer.Argument(metavar="DIR", help="Results of 'singularities', or a saved map.")
    ],
    image_format: Annotated[
        str | None, typer.Option("--format", metavar="png|svg|pdf", help="png by default.")
    ] = None,
    dpi: Annotated[int, typer.Option(min=20, max=1200, help="Dots per inch of the image.")] = 130,
    measure: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME",
            help="Variable to draw, such as det_direct or condition (several may be given); "
            "sigma_direct and sigma_inverse by default.",
        ),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Image; map.png in the folder by default.")
    ] = None,
    grey: Annotated[
        bool, typer.Option("--grey", help="Without colours, for print: kinds differ by dashes.")
    ] = False,
) -> None:
    """Draw the results of a folder again, from its files alone."""
    from closedchain.analysis.figures.drawing import draw_survey
    from closedchain.analysis.survey.results_folder import read_results

    require("figures are drawn from datasets", "maps", "figures")
    image = arguments.image_file(folder, out, image_format)
    results = read_results(folder)
    results_file(image)
    for page in draw_survey(results, image, measures=measure or None, dpi=dpi, grey=grey):
        say(str(page))


app.command()(reads_a_file(follow))
app.command()(reads_a_file(closed_forms))
app.command()(reads_a_file(export))
app.command()(reads_a_file(postures))
app.command()(reads_a_file(joints))
app.command()(reads_a_file(statics))
app.command()(reads_a_file(simulate))
app.command()(reads_a_file(resets))
app.command()(reads_a_file(transmission))


def _refuse_taken(port: int) -> None:
    """End where a port of this machine is taken, before any work."""
    with socket.socket() as one:
        one.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)  # as the server does
        try:
            one.bind(("127.0.0.1", port))
        except OSError as error:
            fail(
                f"port {port} cannot be served at ({error.strerror}): choose another with --port, "
                "or leave it out for a free one"
            )


def _load(robot: str, settings: list[str] | None, variant: str | None, no_xacro: bool) -> Mechanism:
    return arguments.load_robot(robot, settings or (), variant, xacro=not no_xacro)


def _direct(mechanism: Mechanism, given: dict[str, float], mode: str | None) -> Solution:
    import closedchain as cc

    start = arguments.start_posture(mechanism, mode)
    return cc.direct(mechanism, arguments.all_inputs(mechanism, given, mode), start)


def _posture(mechanism: Mechanism, values: list[str] | None, mode: str | None) -> Any:
    """Configuration with the given inputs, that of the mode where there are none.

    The way of the inputs may end at a direct singularity that has these very inputs.
    """
    import closedchain as cc

    if not values:
        return arguments.start_posture(mechanism, mode)
    given = arguments.input_values(mechanism, values)
    solution = _direct(mechanism, given, mode)
    if not solution.converged and mechanism.task is not None:
        end = cc.close(mechanism, solution.q, fixed=arguments.all_inputs(mechanism, given, mode))
        if end.converged and "direct" in cc.classify(mechanism, end.q).kinds:
            return end.q
    return solution.raise_if_failed().q


def _answer(mechanism: Mechanism, solution: Solution, json: bool, **more: list[str]) -> None:
    if json:
        print_json(reports.solution_data(mechanism, solution) | more)
    if not solution.converged:
        fail(solution.message)
    if not json:
        reports.solution(mechanism, solution, more)


def _told(error: OSError) -> str:
    """Words for what the system refuses: the file, and why."""
    where = f"{error.filename}: " if error.filename else ""
    return f"{where}{error.strerror or error}"


def main() -> None:
    """Run the command line."""
    if sys.stdout is None:
        sys.exit("closedchain: standard output is closed, there is nowhere to answer")
    try:
        app()
    except OSError as error:  # of --help and --version, which are no commands
        sys.exit(f"closedchain: {_told(error)}")


if __name__ == "__main__":
    main()
