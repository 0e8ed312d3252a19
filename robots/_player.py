"""An animation as data for the page's player: poses of bodies, and what hangs on them."""

from __future__ import annotations

import base64
import html
from typing import Any

import numpy as np
import pinocchio as pin

from closedchain.closure import Mechanism
from closedchain.robots._body import Bodies, Stick, at, frame_point, joint_poses, positions
from closedchain.robots._page import Fragment, data_script, json_in_script, resource
from closedchain.robots._shapes import shares, spelled
from closedchain.robots.animation import Animation, Readout
from closedchain.robots.overlays import Polyline, css_colour

_SPARKS = 300  # points of a small curve
_STILL = 1e-6  # share of a number below which its changes are drawn as none: rounding, drift
_LEFT, _ACROSS, _UP = 46.0, 220.0, 30.0  # its place and size, in pixels of a wide page


def trace_lines(mechanism: Mechanism, animation: Animation) -> tuple[Polyline, ...]:
    """Lines of the traces through all postures. Raises ``ClosureError`` for unknown links."""
    lines = []
    for trace in animation.traces:
        points = trace.along
        if isinstance(points, str):
            points = positions(mechanism, animation.q, frame_point(mechanism, points))
        lines.append(trace.line(points))
    return tuple(lines)


def draw_balls(view: Any, lines: tuple[Polyline, ...], size: float) -> list[str]:
    """Draw the ball of each line at its beginning; return their Meshcat paths."""
    import meshcat.geometry as shapes

    paths = []
    for i, line in enumerate(lines):
        colour = 0xCC79A7 if line.values is not None else int(css_colour(line.colour)[1:], 16)
        node = view["tracers"][str(i)]
        radius = 0.025 * size if line.width is None else 1.6 * line.width
        node.set_object(shapes.Sphere(radius), shapes.MeshLambertMaterial(color=colour))
        node.set_transform(at(line.points[0]))
        paths.append(node.path.lower())
    return paths


def player_data(
    mechanism: Mechanism,
    animation: Animation,
    kept: np.ndarray,
    bodies: Bodies,
    balls: list[tuple[str, Polyline]],
) -> str:
    """JSON for the player; ``kept`` are the indices of the postures that the page shows."""
    poses = joint_poses(mechanism, animation.q[kept])
    used, parts, sticks = moving(bodies)
    table = np.zeros((len(kept), len(used) + len(balls), 7), dtype="<f4")
    table[:, :, 6] = 1.0
    for i, joint in enumerate(used):
        table[:, i, :3] = poses[:, joint, :3, 3]
        table[:, i, 3:] = [pin.Quaternion(pose[:3, :3]).coeffs() for pose in poses[:, joint]]
    for i, (path, line) in enumerate(balls, start=len(used)):
        table[:, i, :3] = line.points[kept]
        parts.append({"path": path, "body": i, "matrix": rounded(np.eye(4).ravel())})
    data = {
        "times": animation.times[kept].tolist(),
        "bodies": table.shape[1],
        "poses": base64.b64encode(table.tobytes()).decode(),
        "parts": parts,
        "sticks": sticks,
        "across": _ACROSS,
        "readouts": [_shortened(readout.values[kept]) for readout in animation.readouts],
    }
    return json_in_script(data)


def moving(bodies: Bodies) -> tuple[list[int], list[dict[str, Any]], list[dict[str, Any]]]:
    """Joints that carry what is drawn, and the parts and sticks, by the joints' places in these."""
    carriers = [
        (part.begin[0], part.end[0]) if isinstance(part, Stick) else (part.joint,)
        for part in bodies.parts
    ]
    used = sorted({joint for joints in carriers for joint in joints})
    place = {joint: i for i, joint in enumerate(used)}
    parts: list[dict[str, Any]] = []
    sticks: list[dict[str, Any]] = []
    for part in bodies.parts:
        if isinstance(part, Stick):
            ends = [{"body": place[j], "at": rounded(p)} for j, p in (part.begin, part.end)]
            sticks.append({"path": part.path, "ends": ends, "length": part.length})
        else:
            matrix = rounded(part.placement.T.ravel())  # three.js takes columns
            parts.append({"path": part.path, "body": place[part.joint], "matrix": matrix})
    return used, parts, sticks


def player(data: str, animation: Animation, kept: np.ndarray) -> Fragment:
    """Controls of a motion, and its read-outs with their curves over time beside the scene."""
    first, last = float(animation.times[0]), float(animation.times[-1])
    speeds = "".join(
        f'<option value="{speed:g}"{" selected" if speed == 1 else ""}>× {speed:g}</option>'
        for speed in (0.1, 0.25, 0.5, 1, 2, 5)
    )
    rows = _readout_rows(animation, kept)
    body = (
        (f'<div id="readouts">\n{rows}</div>\n' if rows else "")
        + '<div id="player"><button type="button" id="play">play</button>'
        f'<input id="time" type="range" aria-label="time" min="{first!r}" max="{last!r}" '
        f'step="any" value="{first!r}"><output id="clock"></output>'
        f'<select id="speed" aria-label="speed">{speeds}</select></div>\n'
        + data_script("motion", data)
    )
    style = resource("player.css") + (resource("with_readouts.css") if rows else "")
    return Fragment(body, style, (resource("player.js"),))


def _readout_rows(animation: Animation, kept: np.ndarray) -> str:
    """Rows of the page's table: name, number, curve over time with numbers at its axes."""
    times = animation.times
    few = kept[np.unique(np.linspace(0, len(kept) - 1, min(_SPARKS, len(kept))).astype(int))]
    return "\n".join(_row(readout, times, few) for readout in animation.readouts)


def _row(readout: Readout, times: np.ndarray, few: np.ndarray) -> str:
    low, high = float(readout.values.min()), float(readout.values.max())
    still = high - low <= _STILL * max(abs(low), abs(high))
    if still:
        low = high = 0.5 * (low + high)
    across = _LEFT + _ACROSS * (times[few] - times[0]) / (times[-1] - times[0])
    shown = np.full(len(few), low) if still else readout.values[few]
    down = _UP + 2.0 - _UP * shares(shown, (low, high))
    curve = " ".join(f"{x:.1f},{y:.1f}" for x, y in zip(across, down, strict=True))
    least, most = spelled(np.array([low, high]), (low, high))
    right, base = _LEFT + _ACROSS, _UP + 4.0
    numbers = [(_LEFT - 4, 9, "end", most), (_LEFT - 4, base, "end", least)]
    if still:
        numbers = [(_LEFT - 4, 0.5 * base + 3, "end", most)]
    ends = spelled(times[[0, -1]], (float(times[0]), float(times[-1])))
    numbers += [(_LEFT, base + 9, "start", ends[0]), (right, base + 9, "end", f"{ends[1]} s")]
    texts = "".join(
        f'<text x="{x:g}" y="{y:g}" text-anchor="{anchor}">{text}</text>'
        for x, y, anchor, text in numbers
    )
    name, unit = html.escape(readout.name), html.escape(readout.unit)
    return (
        f'<div class="readout"><b>{name}</b><output></output><span>{unit}</span>'
        f'<svg viewBox="0 0 {right + 4:g} {base + 11:g}" role="img" aria-label="{name} over time, '
        f'from {least} to {most} {unit}"><path class="axes" '
        f'd="M{_LEFT:g} 0 V{base:g} H{right:g}"/>{texts}<polyline points="{curve}"/>'
        f'<line class="now" x1="{_LEFT:g}" x2="{_LEFT:g}" y1="0" y2="{base:g}"/></svg></div>'
    )


def _shortened(values: np.ndarray) -> list[float]:
    return [float(f"{value:.6g}") for value in values]


def rounded(values: np.ndarray) -> list[float]:
    """Numbers to nine digits behind the point, without a negative zero."""
    return [float(x) for x in np.round(values, 9) + 0.0]
