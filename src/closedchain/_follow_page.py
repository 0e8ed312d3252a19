"""The page of a followed task: the robot in motion, the tip's way coloured by the distance."""

from __future__ import annotations

from typing import TYPE_CHECKING

from closedchain._arguments import Up
from closedchain.robots.viewer import (
    Animation,
    Markers,
    Overlay,
    Polyline,
    Readout,
    Trace,
    input_readouts,
    static_page,
)

if TYPE_CHECKING:
    from closedchain.analysis.motion.follow import Follow, TaskPath

GREY = "#888888"


def follow_page(run: Follow, task: TaskPath, *, up: Up) -> str:
    """Draw a followed task as one page that plays it.

    The tip's way is coloured by the smaller one of the singular values that vanish at
    singularities; what of the task was not reached is grey. Where fewer than two samples were
    reached there is nothing to play, and the robot stands at the one, or at home.
    """
    m = run.problem.mechanism
    tip = m.required_task().tip
    title = f"{m.name}: {task.name}"
    overlays: list[Overlay] = []
    rest = task.positions[max(run.reached - 1, 0) :]
    if len(rest) > 1:
        overlays.append(Polyline(rest, colour=GREY, label="task, not reached"))
        where = "task stops here" if run.reached else "task begins here"
        overlays.append(Markers(rest[:1], colour="#D55E00", label=where))
    if run.reached < 2:
        return static_page(
            m, run.q[0] if run.reached else None, up=up, overlays=overlays, title=title
        )
    most = float(run.distance.max())
    trace = Trace(
        tip,
        values=run.distance,
        label=f"way of {tip}: distance to a singularity",
        limits=(0.0, most) if most > 0.0 else None,
    )
    readouts = (
        *input_readouts(m, run.q),
        Readout("distance", run.distance),
        Readout("σ direct", run.sigma_direct),
        Readout("σ inverse", run.sigma_driven),
    )
    motion = Animation(run.q, run.times, traces=[trace], readouts=readouts)
    return static_page(m, up=up, overlays=overlays, animation=motion, title=title)
