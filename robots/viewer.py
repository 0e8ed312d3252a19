"""Showing a mechanism: one self-contained HTML page, or the same page at a local address.

Meshcat draws it. Its drawing commands are recorded in this process and written into the page, so
no server of Meshcat's runs, nothing is left over after an error, and the page needs no network.
"""

from __future__ import annotations

import contextlib
import html
import threading
import webbrowser
from collections.abc import Sequence
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from types import TracebackType

import numpy as np
from lxml import etree
from numpy.typing import ArrayLike

from closedchain.closure import Mechanism
from closedchain.robots import _controls as instrument
from closedchain.robots._overlays import Overlay, legend_of
from closedchain.robots._page import Fragment, labels, page
from closedchain.robots._player import draw_balls, player, player_data, trace_lines
from closedchain.robots._recorder import TO_Z, Recorder, Up
from closedchain.robots._scene import draw
from closedchain.robots.animation import (
    Animation,
    Readout,
    Trace,
    checked_postures,
    input_readouts,
)
from closedchain.robots.box import Box, boxed
from closedchain.robots.controls import Controls, Plane, PostureSeries
from closedchain.robots.overlays import PALETTE, Markers, Polyline, Surface
from closedchain.urdf.errors import ClosureError

__all__ = [
    "PALETTE",
    "Animation",
    "Box",
    "Controls",
    "Markers",
    "Overlay",
    "Plane",
    "Polyline",
    "PostureSeries",
    "Readout",
    "Served",
    "Surface",
    "Trace",
    "Up",
    "boxed",
    "input_readouts",
    "serve",
    "static_page",
]


def static_page(
    mechanism: Mechanism,
    q: ArrayLike | None = None,
    *,
    up: Up = "z",
    overlays: Sequence[Overlay] = (),
    animation: Animation | None = None,
    title: str | None = None,
    controls: bool | Controls = False,
) -> str:
    """Draw a mechanism as one HTML page that needs nothing but a browser.

    Visuals of the URDF are drawn with their colours. A mechanism without visuals, or with meshes
    that are not found, is drawn as sticks between its joints.

    Parameters
    ----------
    q : (nq,) array, optional
        Posture; home by default.
    up : "x", "y" or "z"
        World axis that points up on the page.
    overlays : sequence of Polyline, Surface, Markers and Box
        Drawn with the robot, in world coordinates [m]; their labels make the legend.
    animation : Animation, optional
        Motion that the page plays, in place of ``q``. The address ``page.html#t=0.5`` shows the
        posture at 0.5 s and does not play.
    title : str, optional
        Heading; the mechanism's name by default.
    controls : bool or Controls
        Whether sliders move the inputs and the tip, with read-outs, and what else there is to go
        to; not with an animation. The page then solves the position problems itself, by the module
        of ``cc.export_code``.

    Raises
    ------
    ClosureError
        Malformed ``q``, ``up``, overlays or animation, or an animation with ``q`` or controls.
    """
    if up not in TO_Z:
        raise ClosureError(f"up must be x, y or z, got {up!r}")
    if animation is not None and q is not None:
        raise ClosureError("give a posture q or an animation, not both")
    if animation is not None and controls:
        raise ClosureError("a page has controls or plays an animation, not both")
    overlays = tuple(overlays)
    for item in overlays:
        if not isinstance(item, Polyline | Surface | Markers | Box):
            raise ClosureError(
                f"overlays must be Polyline, Surface, Markers or Box, got {type(item).__name__}"
            )
    recorder, rest = Recorder(), Fragment()
    if animation is None:
        q = mechanism.configuration(mechanism.home if q is None else q)
        scene = draw(recorder, mechanism, q[None], up, overlays)
        lines = _state(mechanism, q)
        if controls:
            unmoved = instrument.immovable(mechanism, q)
            lines = [*lines, unmoved] if unmoved else []
            if not unmoved:
                offered = Controls() if controls is True else controls
                rest = instrument.controls(mechanism, q, scene, offered)
    else:
        checked_postures(mechanism, animation.q)
        traces = trace_lines(mechanism, animation)
        overlays += traces
        kept = animation.frames(mechanism.model.njoints + len(traces))
        scene = draw(recorder, mechanism, animation.q[kept], up, overlays)
        balls = draw_balls(scene.view, traces, scene.bodies.size)
        data = player_data(
            mechanism, animation, kept, scene.bodies, list(zip(balls, traces, strict=True))
        )
        rest = player(data, animation, kept)
        lines = [] if len(kept) == len(animation.q) else [_thinned(len(kept), len(animation.q))]
    if not controls:
        lines = [*lines, f"squares of {scene.cell:g} m"]
    texts = [text for item in overlays if isinstance(item, Box) for text in item.labels()]
    return page(
        mechanism.name if title is None else title,
        _legend(mechanism, [*lines, *scene.bodies.notes], legend_of(overlays)),
        recorder.commands,
        labels(scene.root, texts) + rest,
    )


def serve(
    mechanism: Mechanism,
    q: ArrayLike | None = None,
    *,
    up: Up = "z",
    overlays: Sequence[Overlay] = (),
    animation: Animation | None = None,
    title: str | None = None,
    controls: bool | Controls = False,
    open_browser: bool = False,
    port: int = 0,
) -> Served:
    """Serve the page on this machine only, until ``close``; usable in a ``with`` statement.

    The arguments are those of ``static_page``; a ``port`` of 0 is a free one.

    Raises
    ------
    ClosureError
        As ``static_page``.
    OSError
        The port is taken.
    """
    text = static_page(
        mechanism,
        q,
        up=up,
        overlays=overlays,
        animation=animation,
        title=title,
        controls=controls,
    )
    served = Served(text, port)
    if open_browser:
        webbrowser.open(served.url)
    return served


class Served:
    """A page at a local address."""

    def __init__(self, page: str, port: int = 0) -> None:
        content = page.encode()

        class Handler(BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                found = self.path in ("/", "/index.html")
                body = content if found else b""
                self.send_response(200 if found else 404)
                self.send_header("Content-Type", "text/html; charset=utf-8")
                self.send_header("Content-Length", str(len(body)))
                self.end_headers()
                self.wfile.write(body)

            def log_message(self, format: str, *args: object) -> None:
                pass

        self._server = ThreadingHTTPServer(("127.0.0.1", port), Handler)
        self._thread = threading.Thread(target=self._server.serve_forever, daemon=True)
        self._thread.start()

    @property
    def url(self) -> str:
        """Address of the page."""
        return f"http://127.0.0.1:{self._server.server_port}/"

    def wait(self) -> None:
        """Serve until Ctrl-C."""
        with contextlib.suppress(KeyboardInterrupt):
            while self._thread.is_alive():
                self._thread.join(1.0)

    def close(self) -> None:
        """Stop serving."""
        self._server.shutdown()
        self._thread.join()
        self._server.server_close()

    def __enter__(self) -> Served:
        """Nothing to do: serving has begun."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Stop serving."""
        self.close()


def _state(mechanism: Mechanism, q: np.ndarray) -> list[str]:
    """Inputs and tip of a posture, in words."""
    lines = []
    if mechanism.inputs:
        values = zip(
            mechanism.inputs, mechanism.input_values(q), mechanism.input_units, strict=True
        )
        lines.append(", ".join(f"{name} {value:.4g} {unit}" for name, value, unit in values))
    if mechanism.task is not None:
        x, y, z = np.round(mechanism.pose(q).translation, 9) + 0.0
        lines.append(f"tip {mechanism.task.tip} at ({x:.4g}, {y:.4g}, {z:.4g}) m")
    return lines


def _thinned(kept: int, given: int) -> str:
    return f"{kept} of {given} postures shown, the others passed over"


def _legend(mechanism: Mechanism, lines: Sequence[str], overlays: str) -> str:
    paragraphs = [f"<p>{html.escape(line)}</p>" for line in lines if line]
    for name, colour in _colours(mechanism).items():
        paragraphs.append(f'<p><i style="background: {colour}"></i>{html.escape(name)}</p>')
    return "\n".join([*paragraphs, overlays])


def _colours(mechanism: Mechanism) -> dict[str, str]:
    """Materials that visuals use, and their CSS colours."""
    root = etree.fromstring(mechanism.description.text.encode())
    used = {m.get("name") for m in root.iterfind("./{*}link/{*}visual/{*}material")}
    colours = {}
    for material in root.iter("{*}material"):
        colour = material.find("{*}color")
        shown = None if colour is None else _css(colour.get("rgba", ""))
        if shown is not None and material.get("name") in used:
            colours[str(material.get("name"))] = shown
    return colours


def _css(rgba: str) -> str | None:
    """CSS colour of a URDF colour, or None where it is no colour."""
    try:
        values = np.array(rgba.split(), dtype=float)
    except ValueError:
        return None
    if values.shape not in ((3,), (4,)) or not np.isfinite(values).all():
        return None
    r, g, b = np.rint(255 * np.clip(values[:3], 0.0, 1.0)).astype(int)
    return f"rgb({r}, {g}, {b})"
