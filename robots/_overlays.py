"""Overlays as Meshcat objects, labels on the page, and lines of the legend."""

from __future__ import annotations

import html
from collections.abc import Sequence
from typing import Any

import numpy as np

from closedchain.robots._shapes import balls, cividis, dashed, mapped, spelled, thinned, tube
from closedchain.robots.box import Box
from closedchain.robots.overlays import (
    Markers,
    Painted,
    Polyline,
    Surface,
    css_colour,
    limits_of,
)

Overlay = Painted | Box

_TUBE, _BALL = 0.01, 0.04  # diameters, in sizes of the robot
_TOLERANCE = 0.05  # what thinning may move a line, in widths of it
_HUES = 96.0  # steps of the colour bar that thinning may not merge
_RIM = 0.85  # radius of the rim of a line that is coloured, in widths
_FRAME = 0x8A8F98


def extent_of(overlay: Overlay) -> np.ndarray:
    """Points (n, 3) [m] that the picture must show."""
    if isinstance(overlay, Surface):
        return np.asarray(overlay.vertices[np.unique(overlay.triangles)])
    return overlay.corners if isinstance(overlay, Box) else overlay.points


def draw_overlay(node: Any, overlay: Overlay, size: float) -> None:
    """Draw at a Meshcat node; ``size`` [m] is the robot's, for widths that are not given."""
    if isinstance(overlay, Box):
        _draw_box(node, overlay)
    elif isinstance(overlay, Surface):
        _draw_mesh(node, overlay, overlay.vertices, overlay.triangles, None, overlay.opacity)
    elif isinstance(overlay, Markers):
        diameter = overlay.size if overlay.size is not None else _BALL * size
        vertices, triangles, owner = balls(overlay.points, 0.5 * diameter)
        _draw_mesh(node, overlay, vertices, triangles, owner, 1.0)
    else:
        _draw_line(node, overlay, overlay.width if overlay.width is not None else _TUBE * size)


def _draw_line(node: Any, line: Polyline, width: float) -> None:
    kept = _kept(line, width)
    points = line.points[kept]
    if line.dashes:
        if line.closed:
            points = np.vstack([points, points[:1]])
        pieces = dashed(points, tuple(width * share for share in line.dashes))
        shapes = [tube(piece, 0.5 * width, False)[:2] for piece in pieces]
        first = np.cumsum([0, *(len(vertices) for vertices, _ in shapes)])
        vertices = np.vstack([vertices for vertices, _ in shapes])
        triangles = np.vstack([faces + i for (_, faces), i in zip(shapes, first[:-1], strict=True)])
        _draw_mesh(node, line, vertices, triangles, None, 1.0)
        return
    vertices, triangles, owner = tube(points, 0.5 * width, line.closed)
    _draw_mesh(node, line, vertices, triangles, kept[owner], 1.0)
    if line.values is not None:  # a dark rim: colours are seen on any ground
        _draw_rim(node["rim"], *tube(points, _RIM * width, line.closed)[:2])


def _draw_rim(node: Any, vertices: np.ndarray, triangles: np.ndarray) -> None:
    """A shell of which only the side that looks away is drawn."""
    import meshcat.geometry as shapes

    material = shapes.MeshBasicMaterial(color=0x222222, side=1)
    node.set_object(shapes.TriangularMeshGeometry(vertices, triangles), material)


def _kept(line: Polyline, width: float) -> np.ndarray:
    """Indices of the points that are needed to show a line, its colours too."""
    if line.values is None:
        return thinned(line.points, _TOLERANCE * width)
    low, high = limits_of(line)
    hue = line.values * (_HUES * _TOLERANCE * width / (high - low) if high > low else 0.0)
    return thinned(np.column_stack([line.points, hue]), _TOLERANCE * width)


def _draw_mesh(
    node: Any,
    overlay: Painted,
    vertices: np.ndarray,
    triangles: np.ndarray,
    owner: np.ndarray | None,
    opacity: float,
) -> None:
    """Draw triangles; ``owner`` gives the point of the overlay that a vertex takes its value of."""
    import meshcat.geometry as shapes

    colours = None
    if overlay.values is not None:
        values = overlay.values if owner is None else overlay.values[owner]
        colours = mapped(values, limits_of(overlay))
    look: dict[str, Any] = {
        "color": 0xFFFFFF if colours is not None else int(css_colour(overlay.colour)[1:], 16),
        "vertexColors": colours is not None,
        "side": 2,  # both
    }
    if isinstance(overlay, Surface):
        # flat: the mesh need not be oriented; without depth: what is behind shows through
        look |= {"flatShading": True, "shininess": 12, "opacity": opacity}
        look |= {"depthWrite": opacity == 1.0}
        material = shapes.MeshPhongMaterial(**look)
    elif isinstance(overlay, Markers):
        material = shapes.MeshLambertMaterial(**look)
    else:
        material = shapes.MeshBasicMaterial(**look)  # no light: colours as in the legend
    geometry = shapes.TriangularMeshGeometry(vertices, triangles, color=colours)
    node.set_object(geometry, material)


def _draw_box(node: Any, box: Box) -> None:
    import meshcat.geometry as shapes

    lines = box.lines().reshape(-1, 3).astype(np.float32)
    material = shapes.LineBasicMaterial(color=_FRAME)
    node.set_object(shapes.LineSegments(shapes.PointsGeometry(lines.T), material))


def legend_of(overlays: tuple[Overlay, ...]) -> str:
    """Lines of the legend: labels with their colours, colour bars; each said once."""
    lines = []
    for overlay in overlays:
        if isinstance(overlay, Box):
            if overlay.label:
                lines.append(f"<p>{html.escape(overlay.label)}</p>")
        elif overlay.values is not None:
            lines.append(_bar(overlay))
        elif overlay.label:
            label = html.escape(overlay.label)
            lines.append(f"<p>{_sign(overlay)}{label}</p>")
    return "\n".join(dict.fromkeys(lines))


def _sign(overlay: Painted) -> str:
    """Sign of an overlay in the legend: a line with its dashes, a ball, or a face."""
    colour = css_colour(overlay.colour)
    if isinstance(overlay, Polyline):
        return line_sign(colour, overlay.dashes or ())
    shape = "ball" if isinstance(overlay, Markers) else "face"
    return f'<i class="{shape}" style="background: {colour}{_see_through(overlay)}"></i>'


def line_sign(colour: str, dashes: Sequence[float]) -> str:
    """A short line as it is drawn."""
    return (
        '<svg width="26" height="8" aria-hidden="true"><line x1="0" x2="26" y1="4" y2="4" '
        f"{stroke(colour, dashes)}/></svg>"
    )


def stroke(colour: str, dashes: Sequence[float]) -> str:
    """Attributes of a line of SVG."""
    pattern = " ".join(f"{x:g}" for x in dashes) or "none"
    return f'fill="none" stroke="{colour}" stroke-width="2" stroke-dasharray="{pattern}"'


def _see_through(overlay: Painted) -> str:
    """Style that makes a colour of the legend as faint as in the scene."""
    if isinstance(overlay, Surface) and overlay.opacity < 1.0:
        return f"; opacity: {overlay.opacity:.3g}"
    return ""


def _bar(overlay: Painted) -> str:
    """Colour bar with its numbers; ``≤`` and ``≥`` where values lie beyond its ends."""
    assert overlay.values is not None
    low, high = limits_of(overlay)
    stops = [f"#{r:02x}{g:02x}{b:02x}" for r, g, b in np.rint(255 * cividis()[::15]).astype(int)]
    marks = spelled(np.linspace(low, high, 3), (low, high))
    if overlay.values.min() < low:
        marks[0] = f"≤ {marks[0]}"
    if overlay.values.max() > high:
        marks[2] = f"≥ {marks[2]}"
    unit = f" [{overlay.unit}]" if overlay.unit else ""
    return (
        f'<div class="bar"><p>{html.escape(overlay.label + unit)}</p>'
        f'<b style="background: linear-gradient(to right, {", ".join(stops)})'
        f'{_see_through(overlay)}"></b>'
        f"<p>{''.join(f'<span>{mark}</span>' for mark in marks)}</p></div>"
    )
