"""The instrument of a page: sliders and numbers, read-outs, and the robot's own module of code."""

from __future__ import annotations

import html
import itertools
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from closedchain.closure import Mechanism
from closedchain.closure.code.exporting import export_code
from closedchain.closure.generic import sampled_rank
from closedchain.closure.singularity_kinds import COMBINED, KINDS, TYPES
from closedchain.robots._layers import Reach, draw_layers, joint_names, layer_switches
from closedchain.robots._page import Fragment, data_script, json_in_script, resource
from closedchain.robots._planes import local_map, plane_data, plane_maps
from closedchain.robots._player import moving
from closedchain.robots._recorder import TO_Z
from closedchain.robots._scene import Scene
from closedchain.robots.controls import Controls, PostureSeries
from closedchain.robots.overlays import DASHES, PALETTE
from closedchain.urdf.description import OUTPUTS
from closedchain.urdf.errors import ClosureError

Places = Mapping[str, np.ndarray]

FREE_FALL = 9.81
"""[m/s^2], down the page."""

NEAR = 0.03
"""Singular value below which a way that stops is said to have met a singularity."""

SCRIPTS = (
    "angles", "instrument", "readouts", "maps", "choosing", "local_map", "layers", "console",
)  # fmt: skip
LOAD = ("fx", "fy", "fz", "mx", "my", "mz")
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


def controls(mechanism: Mechanism, q: np.ndarray, scene: Scene, offered: Controls) -> Fragment:
    """The instrument, at a closed posture (nq,).

    Raises
    ------
    ClosureError
        Malformed postures, or planes over what no slider moves.
    """
    bodies, series = scene.bodies, offered.series
    places = _closed_postures(mechanism) | _checked(mechanism, offered.places)
    modes = _checked(mechanism, offered.modes)
    (module,) = export_code(mechanism, "js", name="robot").values()
    knobs = list(_knobs(mechanism, bodies.size))
    measured = bool(mechanism.inputs) and mechanism.task is not None
    reach = Reach.of(mechanism.outputs()) if measured else None
    pairs = _pairs(knobs) if measured else []
    used, parts, sticks = moving(bodies)
    layers = draw_layers(scene, mechanism, measured=measured)
    parts += layers.parts(used)
    data = {
        "start": q.tolist(),
        "bodies": used,
        "parts": parts,
        "sticks": sticks,
        "moves": {"direct": bool(mechanism.inputs), "inverse": mechanism.task is not None},
        "knobs": [{"way": k.way, "at": k.at, "name": k.name, "unit": k.unit} for k in knobs],
        "pairs": pairs,
        "unsigned": mechanism.rows > sampled_rank(mechanism).rank.value,
        "strokes": {
            kind: {"colour": PALETTE[kind], "dashes": " ".join(map(str, DASHES[kind])) or "none"}
            for kind in ("direct", "inverse")
        },
        "postures": [posture.tolist() for posture in places.values()],
        "modes": [{"name": name, "posture": one.tolist()} for name, one in modes.items()],
        "series": [{"q": one.q.tolist(), "points": one.points.tolist()} for one in series],
        "planes": [plane_data(mechanism, plane) for plane in offered.planes],
        "root": [part for part in scene.root.split("/") if part],
        "names": list(joint_names(mechanism)),
        "layers": layers.data,
        "load": LOAD,
        "fall": (-FREE_FALL * TO_Z[scene.up][2]).tolist(),
        "measured": measured,
        "near": NEAR,
        "reach": None if reach is None else {"first": reach.first, "count": reach.count},
        "titles": {kind.name: kind.title for kind in (*KINDS.values(), COMBINED)},
        "types": {name: f"{one.title}: {one.meaning}" for name, one in TYPES.items()},
    }
    body = (
        '<div id="controls" role="group" aria-label="instrument">\n'
        + _rows(knobs)
        + '<p id="stop" class="told" role="alert" hidden></p>\n'
        + '<button type="button" id="across" hidden>go on to the other branch</button>\n'
        + '<p id="told" class="told" role="status" hidden></p>\n'
        + '<p id="limits" class="told" role="status" hidden></p>\n'
        + _lists(places, modes)
        + _readouts(mechanism, reach)
        + plane_maps(mechanism, offered.planes)
        + local_map(len(offered.planes), [f"{knobs[i].name} × {knobs[j].name}" for i, j in pairs])
        + _series_rows(series)
        + (_load(mechanism) if measured else "")
        + layer_switches(layers, reach)
        + _buttons()
        + '</div>\n<div id="signs" hidden></div>\n'
        + data_script("instrument", json_in_script(data))
    )
    script = _as_object(module) + "".join(resource(f"{name}.js") for name in SCRIPTS)
    return Fragment(body, resource("controls.css"), (f'"use strict";\n{{\n{script}}}\n',))


def _as_object(module: str) -> str:
    """A module of JavaScript as one object ``robot``."""
    names = [*re.findall(r"^export (?:function|const) (\w+)", module, re.M)]
    inner = re.sub(r"^export ", "", module, flags=re.M)
    if re.search(r"^function singularValues", inner, re.M):
        names.append("singularValues")  # for ellipsoids
    return f"const robot = (() => {{\n{inner}\nreturn {{{', '.join(names)}}};\n}})();\n"


def _checked(mechanism: Mechanism, given: Mapping[str, ArrayLike]) -> dict[str, np.ndarray]:
    """Postures by name. Raises ``ClosureError`` for malformed ones."""
    return {name: mechanism.configuration(one) for name, one in given.items()}


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


def _pairs(knobs: Sequence[Knob]) -> list[tuple[int, int]]:
    """Pairs of knobs that a map may be over: two inputs, or two coordinates of the tip's place."""
    every = itertools.combinations(enumerate(knobs), 2)
    return [
        (i, j)
        for (i, one), (j, other) in every
        if one.way == other.way and (one.way == "direct" or max(one.at, other.at) < 3)
    ]


def _closed_postures(mechanism: Mechanism) -> dict[str, np.ndarray]:
    """Named postures that close."""
    found = {}
    for name in mechanism.postures:
        try:
            found[name] = mechanism.posture(name)
        except ClosureError:
            continue
    return found


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
    """Fields for a load at the tip, and the efforts that hold it and the weights."""
    fields = "".join(
        f'<input id="load-{i}" type="number" step="1" value="0" '
        f'aria-label="{what} {axis} [{unit}]">'
        for i, (what, axis, unit) in enumerate(
            [("force", axis, "N") for axis in "xyz"] + [("moment", axis, "N m") for axis in "xyz"]
        )
    )
    units = ("N" if unit == "m" else "N m" for unit in mechanism.input_units)
    rows = "".join(
        f'<tr><th>{html.escape(name)}</th><td id="effort-{i}"></td><td>{unit}</td></tr>'
        for i, (name, unit) in enumerate(zip(mechanism.inputs, units, strict=True))
    )
    weighty = any(inertia.mass > 0.0 for inertia in list(mechanism.model.inertias)[1:])
    weights = "weights of the bodies" if weighty else "weights: the description gives no masses"
    return (
        "<details><summary>efforts that hold a load and the weights</summary>"
        '<div class="load"><span>force [N] and moment [N m] on the tip, x y z</span>'
        f'{fields}</div><label><input type="checkbox" id="weights" checked> {weights}</label>'
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


def _readouts(mechanism: Mechanism, reach: Reach | None) -> str:
    rows = ['<tr><th>loop error [m, rad]</th><td id="residual" colspan="2"></td></tr>']
    if mechanism.task is not None:
        tip = html.escape(mechanism.task.tip)
        rows.append(f'<tr><th>tip {tip}, x y z [m]</th><td id="tip-place" colspan="2"></td></tr>')
        rows.append('<tr><th>roll pitch yaw [rad]</th><td id="tip-turn" colspan="2"></td></tr>')
    if reach is not None:
        rows.append('<tr><th>posture</th><td id="kinds" colspan="2"></td></tr>')
        rows.append('<tr><th>types (Zlatanov)</th><td id="types" colspan="2"></td></tr>')
        rows.append('<tr><th>singular posture</th><td id="distance" colspan="2"></td></tr>')
        rows += [
            f'<tr><th>sigma {kind}</th><td id="sigma-{kind}"></td>'
            f'<td class="bar"><span><b id="bar-{kind}"></b></span></td></tr>'
            for kind in ("direct", "inverse")
        ]
        if reach.count > 1:
            rows.append('<tr><th>isotropy of the tip</th><td id="evenness" colspan="2"></td></tr>')
        rows.append(
            f'<tr><th>most effort for {reach.load}</th><td id="effort-per-force"></td>'
            f"<td>{_effort_units(mechanism)}</td></tr>"
        )
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


def _effort_units(mechanism: Mechanism) -> str:
    units = {"N" if unit == "m" else "N m" for unit in mechanism.input_units}
    return " or ".join(sorted(units))


def _lists(places: Places, modes: Places) -> str:
    """Lists of postures to go to."""
    lists = []
    for name, title, some in (("modes", "mode", modes), ("postures", "go to", places)):
        if some:
            options = "".join(f"<option>{html.escape(one)}</option>" for one in some)
            lists.append(
                f'<select id="{name}" aria-label="{title}"><option>{title} ...</option>'
                f"{options}</select>"
            )
    return f'<div class="buttons">{"".join(lists)}</div>\n' if lists else ""


def _buttons() -> str:
    return (
        '<div class="buttons"><button type="button" id="picture">picture</button>'
        '<button type="button" id="copy">q as numbers</button></div>\n'
        '<textarea id="copied" aria-label="numbers of q" readonly hidden></textarea>\n'
    )
