"""The command ``closedchain simulate``: a motion under efforts and weights, into a folder."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated

import typer

from closedchain import _arguments as arguments
from closedchain._destinations import results_folder
from closedchain._options import (
    Density,
    Gravity,
    Json,
    NoGravity,
    NoXacro,
    Payload,
    Robot,
    Settings,
    Values,
    Variant,
    Wrench,
)
from closedchain._statics_command import loaded, payloads, wrenches
from closedchain._terminal import print_json, say, tell
from closedchain.urdf.extras import require


def simulate(
    robot: Robot,
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for the results.")],
    values: Values = None,
    until: Annotated[float, typer.Option(metavar="S", help="Time of the end [s].")] = 1.0,
    every: Annotated[
        float | None,
        typer.Option(metavar="S", help="Time between samples [s]; a hundredth of the whole."),
    ] = None,
    effort: Annotated[
        list[str] | None,
        typer.Option(metavar="INPUT=EFFORT", help="Constant effort of an input [N, N m]; else 0."),
    ] = None,
    hold: Annotated[
        bool, typer.Option("--hold", help="Add the efforts that hold the loads at the start.")
    ] = False,
    no_limits: Annotated[
        bool, typer.Option("--no-limits", help="Go on where a joint meets its limit.")
    ] = False,
    wrench: Wrench = None,
    payload: Payload = None,
    gravity: Gravity = None,
    no_gravity: NoGravity = False,
    density: Density = None,
    settings: Settings = None,
    variant: Variant = None,
    no_xacro: NoXacro = False,
    json: Json = False,
) -> None:
    """Move a robot from rest under efforts and weights.

    Writes its states as NetCDF, and a page that plays the motion.
    """
    import numpy as np

    import closedchain as cc
    from closedchain._index_page import write_index
    from closedchain.robots.animation import Animation, Readout, input_readouts
    from closedchain.robots.viewer import static_page

    mechanism, q = loaded(robot, values, settings, variant, no_xacro=no_xacro, density=density)
    require("a motion is written as dataset and page", "maps", "view")
    given = arguments.input_values(mechanism, effort or (), "--effort")
    tau = np.array([given.get(name, 0.0) for name in mechanism.inputs])
    forces, masses = wrenches(mechanism, wrench), payloads(payload)
    fall = arguments.free_fall(robot, gravity, none=no_gravity)
    if hold:
        held = cc.statics(mechanism, q, forces, fall, payload=masses)
        tau += held.raise_if_failed().inputs
    results_folder(out)
    found = cc.simulate(
        *(mechanism, q, None, tau, until),
        every=every, wrench=forces, payload=masses, gravity=fall, limits=not no_limits,
    )  # fmt: skip
    data, page = out / "motion.nc", out / _file(mechanism.name)
    found.to_dataset().to_netcdf(data, engine="h5netcdf")
    files = [data]
    if len(found.t) > 1:
        told = (*input_readouts(mechanism, found.q), Readout("energy", found.energy, "J"))
        samples = (len(found.t) - 1) / (found.t[-1] - found.t[0])  # all, for slow motion
        shown = Animation(found.q, found.t, readouts=told, frame_rate=max(30.0, samples))
        up = arguments.up_axis(robot)
        page.write_text(static_page(mechanism, up=up, animation=shown), encoding="utf-8")
        files.append(page)
    lines = [found.message, *(event.text for event in found.events if event.text != found.message)]
    files.append(write_index(f"{mechanism.name}, simulated", {f.name: f for f in files}, lines))
    if json:
        facts = {"ending": found.ending.word, "message": found.message, "until": found.t[-1]}
        numbers = {"residual": found.residual, "drift": found.drift, "steps": found.steps}
        events = [vars(event) for event in found.events]
        paths = [str(path) for path in files]
        print_json({"robot": mechanism.name, **facts, **numbers, "events": events, "files": paths})
        return
    for line in lines:
        tell(line)
    say(f"loops closed to {found.residual:.1e}, energy drifts by {found.drift:.1e} W")
    for path in files:
        say(str(path))


def _file(name: str) -> str:
    return re.sub(r"[^A-Za-z0-9._-]", "_", name) + ".html"
