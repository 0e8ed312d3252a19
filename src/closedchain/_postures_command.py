"""The command ``closedchain postures``: all assembly modes, working modes, or joints held."""

from __future__ import annotations

import json as text
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from closedchain import _arguments as arguments
from closedchain._destinations import results_file
from closedchain._options import Json, NoXacro, Outputs, Robot, Settings, Triple, Values, Variant
from closedchain._terminal import fail, print_json, remark, table, tell
from closedchain.urdf.extras import require

if TYPE_CHECKING:
    from closedchain.closure import Mechanism
    from closedchain.closure.modes.connections.connected import Connections
    from closedchain.closure.modes.result import Postures


def postures(
    robot: Robot,
    values: Values = None,
    xyz: Annotated[
        Triple | None,
        typer.Option(metavar="X Y Z", help="Hold the tip here [m] instead of inputs."),
    ] = None,
    rpy: Annotated[
        Triple | None,
        typer.Option(metavar="R P Y", help="Hold the tip's orientation [rad] instead of inputs."),
    ] = None,
    fixed: Annotated[
        list[str] | None,
        typer.Option(metavar="JOINT=VALUE", help="Hold joints [m or rad] instead of inputs."),
    ] = None,
    outputs: Outputs = None,
    no_count: Annotated[
        bool, typer.Option("--no-count", help="Search only; do not count complex solutions.")
    ] = False,
    seconds: Annotated[
        float | None, typer.Option(help="Time after which counting is given up [s].")
    ] = None,
    over: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME[=LO:HI[:N]]",
            help="Say which of them are joined without a singularity, and which meet at one, while "
            "this coordinate varies [m or rad]: one to three of those held.",
        ),
    ] = None,
    no_limits: Annotated[
        bool, typer.Option("--no-limits", help="With --over: leave limits of joints aside.")
    ] = False,
    certificate: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Write what is proved, as JSON.")
    ] = None,
    html: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Write a page of the robot that goes to each of them."),
    ] = None,
    settings: Settings = None,
    variant: Variant = None,
    no_xacro: NoXacro = False,
    json: Json = False,
) -> None:
    """All assembly modes, or all working modes, of a robot.

    That is, all postures with the inputs, the tip's pose or some joints held.
    """
    import closedchain as cc

    if html is not None:
        require("a page draws with Meshcat", "view")
    mechanism = arguments.load_robot(robot, settings or (), variant, xacro=not no_xacro)
    held = _held(mechanism, values, xyz, rpy, fixed)
    wanted = _slice(mechanism, over or ())
    if seconds is not None:
        arguments.positive(seconds, "--seconds")
    for file in (certificate, html):
        if file is not None:
            results_file(file)
    found = cc.postures(
        mechanism,
        **held,
        outputs=outputs,
        count=not no_count,
        seconds=seconds,
        progress=_Told().tell,
    )
    connections = None
    if wanted is not None and found.count:
        ranges, cells = wanted
        connections = found.connections(
            ranges, resolution=cells, limits=not no_limits, progress=_Told().tell
        )
    if certificate is not None:
        certificate.write_text(text.dumps(found.certificate(mechanism), indent=1) + "\n")
        remark(f"written to {certificate}")
    if html is not None:
        modes = not {"pose", "fixed"} & set(held)
        html.write_text(_page(robot, mechanism, found, modes=modes), encoding="utf-8")
        remark(f"written to {html}")
    if json:
        more = {} if connections is None else {"connections": _connected(connections)}
        print_json({"robot": mechanism.name, "inputs": mechanism.inputs, **_data(found), **more})
        return
    _report(mechanism, found)
    if connections is not None:
        tell("\n" + connections.text)


class _Told:
    """Says each phase once, on stderr."""

    def __init__(self) -> None:
        self.last = ""

    def tell(self, what: str, done: int, total: int) -> None:
        """Say a phase where it is new."""
        if what != self.last:
            remark(f"{what} ...")
            self.last = what


def _page(robot: str, mechanism: Mechanism, found: Postures, *, modes: bool) -> str:
    """Page of the first posture, or of home where there is none, that goes to all of them.

    Assembly modes (``modes``) are gone to at the inputs that the page then has.
    """
    from closedchain.robots.viewer import Controls, static_page

    places = dict(zip(found.names, found.q, strict=True))
    start = found.q[0] if found.count else mechanism.home
    up = arguments.up_axis(robot)
    offered = Controls(modes=places) if modes else Controls(places=places)
    return static_page(mechanism, start, up=up, controls=offered)


def _held(
    mechanism: Mechanism,
    values: list[str] | None,
    xyz: Triple | None,
    rpy: Triple | None,
    fixed: list[str] | None,
) -> dict[str, Any]:
    """What is held, as ``cc.postures`` takes it."""
    import numpy as np
    import pinocchio as pin

    posed = xyz is not None or rpy is not None
    if sum((bool(values), posed, fixed is not None)) > 1:
        fail("hold inputs, or the tip (--xyz, --rpy), or joints (--fixed), one of these")
    if posed:
        arguments.finite((*(xyz or ()), *(rpy or ())), "tip pose")
        pose = mechanism.pose(mechanism.home)
        rotation = pose.rotation if rpy is None else pin.rpy.rpyToMatrix(*rpy)
        return {"pose": pin.SE3(rotation, pose.translation if xyz is None else np.array(xyz))}
    if fixed is not None:
        given = arguments.assignments(fixed, "--fixed")
        return {"fixed": {n: arguments.number(v, f"--fixed {n}") for n, v in given.items()}}
    given_inputs = arguments.input_values(mechanism, values or ())
    return {"inputs": arguments.all_inputs(mechanism, given_inputs)}


def _slice(
    mechanism: Mechanism, words: Sequence[str]
) -> tuple[dict[str, tuple[float, float] | None], dict[str, int]] | None:
    """Ranges of the coordinates of ``--over``, and cells along them, where these are given."""
    asked = arguments.slices(mechanism, words)
    if not asked.slices:
        return None
    if len(asked.slices) > 1:
        fail(f"--over takes one to three coordinates here, got {len(words)}")
    ranges = {name: asked.ranges.get(name) for name in asked.slices[0]}
    return ranges, {name: points - 1 for name, points in asked.points.items()}


def _connected(found: Connections) -> dict[str, Any]:
    return {
        "groups": found.groups,
        "signs": found.signs,
        "bounded": found.bounded,
        "kind": found.kind,
        "passages": [
            {
                "modes": p.modes,
                "corners": p.corners,
                "values": p.values,
                "q": p.q,
                "sigma": p.sigma,
                "determinant": p.determinant,
                "residual": p.residual,
            }
            for p in found.passages
        ],
        "meetings": [
            {
                "modes": m.modes,
                "values": m.values,
                "distance": m.distance,
                "q": m.q,
                "fold": m.fold,
                "sigma": m.sigma,
            }
            for m in found.meetings
        ],
        "left_out": found.left_out,
        "unconfirmed": found.unconfirmed,
        "searched": vars(found.searched),
        "text": found.text,
    }


def _data(found: Postures) -> dict[str, Any]:
    return {
        "count": found.count,
        "complex_count": found.complex_count,
        "complete": found.complete,
        "names": found.names,
        "q": found.q,
        "certified": found.certified,
        "radius": found.radius,
        "multiplicity": found.multiplicity,
        "residual": found.residual,
        "beyond_limits": found.beyond_limits,
        "families": [{"dimension": f.dimension, "q": f.q} for f in found.families],
        "hits": found.hits,
        "starts": found.starts,
        "unseen": found.unseen,
        "text": found.text,
    }


def _report(mechanism: Mechanism, found: Postures) -> None:
    tell(found.text)
    if not found.count:
        return
    tip = mechanism.task is not None
    columns = ["mode", *(("tip x", "tip y", "tip z") if tip else ()), "proved", "beyond limits"]
    rows = []
    for i, name in enumerate(found.names):
        place = mechanism.pose(found.q[i]).translation.tolist() if tip else []
        proved = "yes" if found.certified[i] else "no"
        rows.append([name, *(x + 0.0 for x in place), proved, " ".join(found.beyond_limits[i])])
    table(columns, rows)
