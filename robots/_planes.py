"""Small maps of two coordinates among a page's controls: singular curves, and a mark that moves."""

from __future__ import annotations

import html
from collections.abc import Sequence
from typing import Any

import numpy as np

from closedchain.closure import Mechanism
from closedchain.robots._overlays import line_sign, stroke
from closedchain.robots.controls import Plane
from closedchain.robots.overlays import DASHES, PALETTE
from closedchain.urdf.errors import ClosureError

SIZE = 200.0  # of a map, in its own units


def plane_data(mechanism: Mechanism, plane: Plane) -> dict[str, Any]:
    """What the page's script needs of a plane. Raises ``ClosureError`` where nothing moves it."""
    return {
        "axes": [_moved(mechanism, name, plane) for name in plane.over],
        "ranges": plane.ranges.tolist(),
    }


def _moved(mechanism: Mechanism, name: str, plane: Plane) -> dict[str, Any]:
    """How a coordinate is moved: as an input or as one of the tip's, and which."""
    driven = all(other in mechanism.inputs for other in plane.over)
    if driven:
        return {"way": "direct", "at": mechanism.inputs.index(name)}
    if mechanism.task is not None and all(
        other in mechanism.outputs() and other in "xyz" for other in plane.over
    ):
        return {"way": "inverse", "at": "xyz".index(name)}
    raise ClosureError(
        f"plane {' x '.join(plane.over)}: over two inputs ({' '.join(mechanism.inputs)}), or two "
        "of the tip's x y z that are outputs"
    )


def plane_maps(mechanism: Mechanism, planes: Sequence[Plane]) -> str:
    """Drawings of planes, each with the legend of its curves."""
    units = dict(zip(mechanism.inputs, mechanism.input_units, strict=True))
    return "".join(
        _map(i, plane, [units.get(name, "m") for name in plane.over])
        for i, plane in enumerate(planes)
    )


def _map(i: int, plane: Plane, units: Sequence[str]) -> str:
    across, up = (html.escape(name) for name in plane.over)
    lines = "".join(_line(plane, kind, points) for kind, points in plane.curves)
    kinds = list(dict.fromkeys(kind for kind, _ in plane.curves))
    legend = ", ".join(f"{line_sign(PALETTE[kind], DASHES[kind])} {kind}" for kind in kinds)
    (left, right), (low, high) = plane.ranges
    return (
        f"<h2>{across} across, {up} up</h2>\n"
        f'<svg class="plane" id="plane-{i}" viewBox="0 0 {SIZE:g} {SIZE:g}" tabindex="0" '
        f'role="img" aria-label="map of {across} and {up}: a click or arrow keys lead there">'
        f'{lines}<g id="mark-{i}"><circle class="mark" r="5"/></g></svg>\n'
        f'<p class="ends"><span>{across} {left:.4g} to {right:.4g} {units[0]}, '
        f"{up} {low:.4g} to {high:.4g} {units[1]}</span>; {legend}"
        f'<span id="other-{i}" hidden> other coordinates moved: the curves are of before</span>'
        "</p>\n"
    )


def _line(plane: Plane, kind: str, points: np.ndarray) -> str:
    span = plane.ranges[:, 1] - plane.ranges[:, 0]
    places = SIZE * (points - plane.ranges[:, 0]) / span
    drawn = " ".join(f"{x:.2f},{SIZE - y:.2f}" for x, y in places)
    return f'<polyline points="{drawn}" {stroke(PALETTE[kind], DASHES[kind])}/>'


def local_map(number: int, names: Sequence[str]) -> str:
    """Place of the map that the page makes around its posture, over one of some pairs by name."""
    if not names:
        return ""
    options = "".join(f"<option>{html.escape(name)}</option>" for name in names)
    return (
        '<div class="buttons"><select id="pairs" aria-label="map around here over">'
        f"<option>map around here over ...</option>{options}</select></div>\n"
        f'<div id="local" hidden><svg class="plane" id="plane-{number}" tabindex="0" '
        f'viewBox="0 0 {SIZE:g} {SIZE:g}" role="img" aria-label="map around here: a click or arrow '
        f'keys lead there"><g id="local-cells"></g><g id="mark-{number}">'
        '<circle class="mark" r="5"/></g></svg><p class="ends"><span id="local-ends"></span>. '
        f'<span id="local-legend"></span><span id="other-{number}" hidden>; other coordinates '
        "moved: it is of before</span></p></div>\n"
    )
