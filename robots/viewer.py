"""Showing a mechanism: one self-contained HTML page, or the same page at a local address.

Meshcat draws it. Its drawing commands are recorded in this process and written into the page, so
no server of Meshcat's runs, nothing is left over after an error, and the page needs no network.
"""

from __future__ import annotations

import base64
import contextlib
import html
import threading
import webbrowser
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib.resources import files
from types import TracebackType
from typing import Literal

import numpy as np
from lxml import etree
from numpy.typing import ArrayLike

from closedchain.closure import Mechanism
from closedchain.robots._scene import Recorder, draw

Up = Literal["x", "y", "z"]

_PAGE = """<!DOCTYPE html>
<html lang="en">
<head><meta charset="utf-8"><title>{title}</title>
<style>
body {{ margin: 0; font: 14px/1.5 system-ui, sans-serif; color: #222; }}
#meshcat-pane {{ width: 100vw; height: 100vh; overflow: hidden; }}
#legend {{ position: fixed; left: 16px; top: 12px; pointer-events: none; }}
#legend h1 {{ font-size: 20px; margin: 0; }}
#legend p {{ margin: 2px 0; max-width: 24em; }}
#legend i {{ display: inline-block; width: 11px; height: 11px; margin-right: 7px; }}
.dg.main {{ display: none; }}
</style></head>
<body><div id="meshcat-pane"></div>
<div id="legend"><h1>{title}</h1>
{legend}</div>
<script>{library}</script>
<script>
var viewer = new MeshCat.Viewer(document.getElementById("meshcat-pane"));
for (const command of [
{commands}
]) viewer.handle_command_bytearray(Uint8Array.from(atob(command), c => c.charCodeAt(0)));
</script></body></html>
"""


def static_page(mechanism: Mechanism, q: ArrayLike | None = None, *, up: Up = "z") -> str:
    """Draw a mechanism as one HTML page that needs nothing but a browser.

    Visuals of the URDF are drawn with their colours. A mechanism without visuals, or with meshes
    that are not found, is drawn as sticks between its joints.

    Parameters
    ----------
    q : (nq,) array, optional
        Posture; home by default.
    up : "x", "y" or "z"
        World axis that points up on the page.

    Raises
    ------
    ClosureError
        Malformed ``q``.
    """
    q = mechanism.configuration(mechanism.home if q is None else q)
    recorder = Recorder()
    note = draw(recorder, mechanism, q, up)
    library = (files("meshcat") / "viewer" / "dist" / "main.min.js").read_text(encoding="utf-8")
    encoded = (base64.b64encode(command).decode() for command in recorder.commands)
    return _PAGE.format(
        title=html.escape(mechanism.name),
        legend=_legend(mechanism, q, note),
        library=library,
        commands=",\n".join(f'"{command}"' for command in encoded),
    )


def serve(
    mechanism: Mechanism,
    q: ArrayLike | None = None,
    *,
    up: Up = "z",
    open_browser: bool = False,
) -> Served:
    """Serve the page on this machine only, until ``close``; usable in a ``with`` statement.

    Raises
    ------
    ClosureError
        Malformed ``q``.
    """
    served = Served(static_page(mechanism, q, up=up))
    if open_browser:
        webbrowser.open(served.url)
    return served


class Served:
    """A page at a local address."""

    def __init__(self, page: str) -> None:
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

        self._server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
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


def _legend(mechanism: Mechanism, q: np.ndarray, note: str) -> str:
    lines = []
    if mechanism.inputs:
        values = zip(
            mechanism.inputs, mechanism.input_values(q), mechanism.input_units, strict=True
        )
        lines.append(", ".join(f"{name} {value:.4g} {unit}" for name, value, unit in values))
    if mechanism.task is not None:
        x, y, z = np.round(mechanism.pose(q).translation, 9) + 0.0
        lines.append(f"tip {mechanism.task.tip} at ({x:.4g}, {y:.4g}, {z:.4g}) m")
    paragraphs = [f"<p>{html.escape(line)}</p>" for line in (*lines, note) if line]
    for name, colour in _colours(mechanism).items():
        paragraphs.append(f'<p><i style="background: {colour}"></i>{html.escape(name)}</p>')
    return "\n".join(paragraphs)


def _colours(mechanism: Mechanism) -> dict[str, str]:
    """Materials that visuals use, and their CSS colours."""
    root = etree.fromstring(mechanism.description.text.encode())
    used = {m.get("name") for m in root.iterfind("./{*}link/{*}visual/{*}material")}
    colours = {}
    for material in root.iter("{*}material"):
        colour = material.find("{*}color")
        if colour is not None and material.get("name") in used:
            r, g, b, *_ = (round(255 * float(x)) for x in colour.get("rgba", "").split())
            colours[str(material.get("name"))] = f"rgb({r}, {g}, {b})"
    return colours
