"""The instrument of a page: sliders and numbers, read-outs, and the robot's own module of code."""

from __future__ import annotations

import html
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from typing import Any

import numpy as np

from closedchain.closure import Closure, Mechanism
from closedchain.closure.code.exporting import export_code
from closedchain.robots._page import json_in_script, module_script
from closedchain.robots._planes import plane_data, plane_maps
from closedchain.robots._player import moving
from closedchain.robots._recorder import TO_Z
from closedchain.robots._scene import Scene
from closedchain.robots.controls import Controls, PostureSeries
from closedchain.urdf.description import OUTPUTS
from closedchain.urdf.errors import ClosureError

Places = Mapping[str, np.ndarray]

FREE_FALL = 9.81
"""[m/s^2], down the page."""

SINGULAR = 1e-6
"""Singular value below which the page calls a posture singular; LAPACK decides finer."""

NEAR = 0.03
"""Singular value below which a way that stops is said to have met a singularity."""

TURN = math.pi
WIDEST = 4.0 * math.pi  # range of a joint [rad] that a slider still shows whole
ANGLES = ("roll", "pitch", "yaw")


@dataclass(frozen=True)
class Knob:
    """What a slider moves: an input, or a coordinate of the tip, number ``at`` of ``way``."""

    way: str
    at: int
    name: str
    unit: str
    lower: float
    upper: float


def immovable(mechanism: Mechanism, q: np.ndarray) -> str:
    """Why a page has nothing to move, in a sentence; empty where it has."""
    if not mechanism.inputs and mechanism.task is None:
        return "nothing can be moved here: there are no inputs and no task"
    if mechanism.home_open:
        return "nothing can be moved here: the loops are open at home"
    if mechanism.rows and np.abs(mechanism.workspace.residual(q)).max() > 1e-6:
        return "nothing can be moved here: the loops are open"
    return ""


def controls(mechanism: Mechanism, q: np.ndarray, scene: Scene, offered: Controls) -> str:
    """HTML of the instrument, at a closed posture (nq,).

    Raises
    ------
    ClosureError
        Malformed postures, or planes over what no slider moves.
    """
    bodies, series = scene.bodies, offered.series
    given = {name: mechanism.configuration(p) for name, p in offered.places.items()}
    named = _postures(mechanism) | given
    (module,) = export_code(mechanism, "js", name="robot").values()
    knobs = list(_knobs(mechanism, bodies.size))
    measured = bool(mechanism.inputs) and mechanism.task is not None
    used, parts, sticks = moving(bodies)
    data = {
        "start": q.tolist(),
        "bodies": used,
        "parts": parts,
        "sticks": sticks,
        "knobs": [{"way": k.way, "at": k.at} for k in knobs],
        "postures": [posture.tolist() for posture in named.values()],
        "series": [{"q": one.q.tolist(), "points": one.points.tolist()} for one in series],
        "planes": [plane_data(mechanism, plane) for plane in offered.planes],
        "root": [part for part in scene.root.split("/") if part],
        "names": list(_names(mechanism)),
        "fall": (-FREE_FALL * TO_Z[scene.up][2]).tolist(),
        "measured": measured,
        "singular": SINGULAR,
        "near": NEAR,
    }
    script = (files("closedchain.robots") / "controls.js").read_text(encoding="utf-8")
    return (
        '<div id="controls" role="group" aria-label="instrument">\n'
        + _rows(knobs)
        + '<p id="stop" class="told" role="alert" hidden></p>\n'
        + '<button type="button" id="across" hidden>go to the other side</button>\n'
        + '<p id="limits" class="told" role="status" hidden></p>\n'
        + _readouts(mechanism, measured)
        + plane_maps(offered.planes)
        + _series_rows(series)
        + (_load(mechanism) if measured else "")
        + _buttons(named)
        + '</div>\n<div id="signs" hidden></div>\n'
        + f'<script type="application/json" id="instrument">{json_in_script(data)}</script>\n'
        + module_script(module + script)
    )


def style() -> str:
    """CSS of the instrument."""
    return (files("closedchain.robots") / "controls.css").read_text(encoding="utf-8")


def _knobs(mechanism: Mechanism, size: float) -> Iterator[Knob]:
    """Inputs within their limits, then the tip's outputs around home."""
    lower, upper = mechanism.limits
    home = mechanism.home
    named = zip(mechanism.inputs, mechanism.input_q, mechanism.input_units, strict=True)
    for i, (name, at, unit) in enumerate(named):
        reach = 2.0 * size if unit == "m" else TURN
        low, high = float(lower[at]), float(upper[at])
        if not math.isfinite(high - low) or (unit == "rad" and high - low > WIDEST):
            low, high = max(low, home[at] - reach), min(high, home[at] + reach)
        yield Knob("direct", i, name, unit, low, high)
    if mechanism.task is None:
        return
    place = mechanism.pose(home).translation
    for name in mechanism.outputs():
        at = OUTPUTS.index(name)
        if at < 3:
            yield Knob("inverse", at, name, "m", place[at] - size, place[at] + size)
        else:
            yield Knob("inverse", at, ANGLES[at - 3], "rad", -TURN, TURN)


def _postures(mechanism: Mechanism) -> dict[str, np.ndarray]:
    """Named postures that close."""
    found = {}
    for name in mechanism.postures:
        try:
            found[name] = mechanism.posture(name)
        except ClosureError:
            continue
    return found


def _names(mechanism: Mechanism) -> Iterator[dict[str, Any]]:
    """Joints by name, and where they are: a body (0 for the base) and a point on it [m]."""
    model = mechanism.model
    driven = dict(zip(mechanism.input_v.tolist(), mechanism.inputs, strict=True))
    for i in range(1, model.njoints):
        if model.nvs[i] == 1:
            own = str(model.names[i])
            given = driven.get(int(model.idx_vs[i]), own)
            text = own if given == own else f"{own} ({given})"
            driving = int(model.idx_vs[i]) in driven
            yield {"text": text, "body": i, "at": [0.0, 0.0, 0.0], "driven": driving}
    for closure in mechanism.closures:
        if isinstance(closure, Closure):
            at = [float(x) for x in closure.placement1.translation]
            yield {"text": closure.name, "body": int(closure.joint1), "at": at, "driven": False}


def _series_rows(series: Sequence[PostureSeries]) -> str:
    """A slider through each series."""
    if not series:
        return ""
    rows = []
    for i, one in enumerate(series):
        label = html.escape(one.label)
        rows.append(
            f'<div class="series"><label for="series-{i}">{label}</label>'
            f'<input id="series-{i}" type="range" min="0" max="{len(one.q) - 1}" step="1" '
            'value="0"></div>'
        )
    return "<h2>postures to go through, or to click at</h2>\n" + "\n".join(rows) + "\n"


def _load(mechanism: Mechanism) -> str:
    """Fields for a force at the tip, and the efforts that hold it and the weights."""
    fields = "".join(
        f'<input id="force-{i}" type="number" step="1" value="0" aria-label="force {axis} [N]">'
        for i, axis in enumerate("xyz")
    )
    units = ("N" if unit == "m" else "N m" for unit in mechanism.input_units)
    rows = "".join(
        f'<tr><th>{html.escape(name)}</th><td id="effort-{i}"></td><td>{unit}</td></tr>'
        for i, (name, unit) in enumerate(zip(mechanism.inputs, units, strict=True))
    )
    return (
        "<details><summary>efforts that hold a load and the weights</summary>"
        f'<div class="force"><span>force at the tip, x y z [N]</span>{fields}</div>'
        f"<table>{rows}</table></details>\n"
    )


def _rows(knobs: list[Knob]) -> str:
    rows = []
    for title, way in (("inputs", "direct"), ("tip", "inverse")):
        some = [(i, knob) for i, knob in enumerate(knobs) if knob.way == way]
        if some:
            rows.append(f"<h2>{title}</h2>")
        rows += [_row(i, knob) for i, knob in some]
    return "\n".join(rows) + "\n"


def _row(i: int, knob: Knob) -> str:
    name, unit = html.escape(knob.name), html.escape(knob.unit)
    step = (knob.upper - knob.lower) / 1000.0
    bounds = f'min="{float(knob.lower)!r}" max="{float(knob.upper)!r}"'
    return (
        f'<div class="knob"><label for="slider-{i}" title="{name}">{name}</label>'
        f'<input id="slider-{i}" type="range" {bounds} step="any">'
        f'<input id="number-{i}" type="number" step="{_rounded(step)}" aria-label="{name}">'
        f"<span>{unit}</span></div>"
    )


def _rounded(step: float) -> str:
    """A step of a number that is 1 with some zeros."""
    return f"{10.0 ** math.floor(math.log10(max(step, 1e-6))):g}"


def _readouts(mechanism: Mechanism, measured: bool) -> str:
    rows = ['<tr><th>loops open by</th><td id="residual"></td></tr>']
    if mechanism.task is not None:
        tip = html.escape(mechanism.task.tip)
        rows.append(f'<tr><th>tip {tip}, x y z</th><td id="tip-place" colspan="2"></td></tr>')
        rows.append('<tr><th>roll pitch yaw</th><td id="tip-turn" colspan="2"></td></tr>')
    if measured:
        rows.append('<tr><th>posture</th><td id="kinds" colspan="2"></td></tr>')
        rows += [
            f'<tr><th>sigma {kind}</th><td id="sigma-{kind}"></td>'
            f'<td class="bar"><span><b id="bar-{kind}"></b></span></td></tr>'
            for kind in ("direct", "inverse")
        ]
    joints = "".join(
        f'<tr><th>{html.escape(name)}</th><td id="q-{i}"></td></tr>'
        for i, name in enumerate(_coordinate_names(mechanism))
    )
    return (
        f"<h2>read-outs</h2><table>{''.join(rows)}</table>\n"
        f"<details><summary>all joints</summary><table>{joints}</table></details>\n"
    )


def _coordinate_names(mechanism: Mechanism) -> list[str]:
    names: list[str] = []
    for name, joint in list(zip(mechanism.model.names, mechanism.model.joints, strict=True))[1:]:
        parts = ("x", "y", "z", "qx", "qy", "qz", "qw")
        names += [name] if joint.nq == 1 else [f"{name}.{part}" for part in parts]
    return names


def _buttons(named: Places) -> str:
    options = "".join(f"<option>{html.escape(name)}</option>" for name in named)
    return (
        '<div class="buttons"><select id="postures" aria-label="go to a posture">'
        f"<option>go to</option>{options}</select>"
        '<button type="button" id="picture">picture</button>'
        '<button type="button" id="copy">q as numbers</button>'
        '<label><input type="checkbox" id="names"> joint names</label></div>\n'
        '<textarea id="copied" aria-label="numbers of q" readonly hidden></textarea>\n'
    )
