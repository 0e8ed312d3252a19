"""The HTML page around a scene: style, legend, labels in the scene, player.

It loads nothing, and says so to the browser: a content security policy allows the scripts that
stand in the page, known by their digests, and forbids every other script and every connection.
Names from a description reach the page as text only, through `html.escape` or `json_in_script`.
"""

from __future__ import annotations

import base64
import html
import json
import re
from collections.abc import Sequence
from hashlib import sha256
from importlib.resources import files
from typing import Any

import numpy as np

_STYLE = """
body { margin: 0; font: 14px/1.5 system-ui, sans-serif; color: #222; }
#meshcat-pane { width: 100vw; height: 100vh; overflow: hidden; }
#legend { position: fixed; left: 16px; top: 12px; pointer-events: none;
  text-shadow: 0 0 3px #fff, 0 0 3px #fff; }
#legend h1 { font-size: 20px; margin: 0; }
#legend p { margin: 2px 0; max-width: 22em; }
#legend i { display: inline-block; width: 11px; height: 11px; margin-right: 7px; }
#legend i.line { height: 3px; vertical-align: middle; }
#legend i.ball { border-radius: 50%; }
#legend .bar { width: 200px; margin: 6px 0; }
#legend .bar b { display: block; height: 11px; }
#legend .bar b + p { display: flex; justify-content: space-between; }
#labels span { position: fixed; transform: translate(-50%, -50%); pointer-events: none;
  font-size: 12px; white-space: nowrap; text-shadow: 0 0 3px #fff, 0 0 3px #fff; }
#labels span.name { font-size: 14px; font-weight: 600; }
#player { position: fixed; left: 16px; right: 16px; bottom: 12px; display: flex; gap: 10px;
  align-items: center; }
#player input { flex: 1; }
#player button { width: 64px; }
#player output { min-width: 7em; font-variant-numeric: tabular-nums; }
#readouts { position: fixed; right: 8px; top: 6px; border-collapse: collapse;
  background: rgba(255, 255, 255, 0.75); pointer-events: none; font-size: 13px; }
#readouts th { text-align: left; font-weight: 600; padding: 1px 8px; }
#readouts td { padding: 1px 4px; font-variant-numeric: tabular-nums; }
#readouts td:nth-child(2) { min-width: 5.5em; text-align: right; }
#readouts td:last-child { font-size: 9px; line-height: 11px; color: #555; padding-right: 8px; }
#readouts svg { display: block; }
#readouts polyline { fill: none; stroke: #0072b2; }
#readouts line { stroke: #222; }
.dg.main { display: none; }
"""

_DRAW = """
var viewer = new MeshCat.Viewer(document.getElementById("meshcat-pane"));
for (const command of [
%s
]) viewer.handle_command_bytearray(Uint8Array.from(atob(command), c => c.charCodeAt(0)));
"""

# texts stay upright and sharp when the scene is turned: HTML, moved after each drawing
_LABELS = """
const root = viewer.scene_tree.find(%s).object;
const texts = %s.map(([name, text, at]) => {
  const span = document.getElementById("labels").appendChild(document.createElement("span"));
  span.textContent = text;
  if (name) span.className = "name";
  return [span, new MeshCat.THREE.Vector3(...at)];
});
const drawScene = viewer.render.bind(viewer);
viewer.render = () => {
  drawScene();
  for (const [span, at] of texts) {
    const seen = at.clone().applyMatrix4(root.matrixWorld).project(viewer.camera);
    span.hidden = !(Math.abs(seen.z) < 1);
    span.style.left = 50 * (1 + seen.x) + "vw";
    span.style.top = 50 * (1 - seen.y) + "vh";
  }
};
viewer.set_dirty();
"""

_PLAYER = """
(() => {
const {Matrix4, Quaternion, Vector3} = MeshCat.THREE;
const data = JSON.parse(document.getElementById("motion").textContent);
const bytes = Uint8Array.from(atob(data.poses), c => c.charCodeAt(0));
const poses = new Float32Array(bytes.buffer), times = data.times, last = times.length - 1;
const node = path => viewer.scene_tree.find(path.split("/").filter(x => x)).object;
for (const part of data.parts) {
  part.node = node(part.path);
  part.matrix = new Matrix4().fromArray(part.matrix);
}
for (const stick of data.sticks) {
  stick.node = node(stick.path);
  for (const end of stick.ends) end.at = new Vector3(...end.at);
}
const bodies = Array.from({length: data.bodies}, () => new Matrix4());
const element = id => document.getElementById(id);
const slider = element("time"), clock = element("clock"), button = element("play");
const rows = [...document.querySelectorAll("#readouts tr")];
const one = new Vector3(1, 1, 1), up = new Vector3(0, 1, 0);
let now = times[0], playing = false, before = null;

function show(time) {
  now = Math.min(Math.max(time, times[0]), times[last]);
  let low = 0, high = last;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (times[middle] <= now) low = middle; else high = middle;
  }
  const share = (now - times[low]) / (times[high] - times[low]);
  bodies.forEach((matrix, i) => {
    const a = 7 * (low * data.bodies + i), b = 7 * (high * data.bodies + i);
    const place = new Vector3().fromArray(poses, a).lerp(new Vector3().fromArray(poses, b), share);
    const turn = new Quaternion().fromArray(poses, a + 3);
    matrix.compose(place, turn.slerp(new Quaternion().fromArray(poses, b + 3), share), one);
  });
  for (const part of data.parts) {
    const matrix = bodies[part.body].clone().multiply(part.matrix);
    matrix.decompose(part.node.position, part.node.quaternion, part.node.scale);
  }
  for (const stick of data.sticks) {
    const [begin, end] = stick.ends.map(e => e.at.clone().applyMatrix4(bodies[e.body]));
    const along = end.clone().sub(begin), length = along.length();
    stick.node.position.copy(begin).lerp(end, 0.5);
    if (length > 0) stick.node.quaternion.setFromUnitVectors(up, along.divideScalar(length));
    stick.node.scale.set(1, Math.max(length / stick.length, 1e-6), 1);
  }
  slider.value = now;
  clock.textContent = now.toFixed(3) + " s";
  rows.forEach((row, i) => {
    const values = data.readouts[i];
    row.cells[1].textContent = ((1 - share) * values[low] + share * values[high]).toPrecision(4);
    const x = 120 * (now - times[0]) / (times[last] - times[0]);
    row.querySelector("line").setAttribute("x1", x);
    row.querySelector("line").setAttribute("x2", x);
  });
  viewer.set_dirty();
}
function play(on) {
  playing = on;
  before = null;
  button.textContent = on ? "pause" : "play";
}
function step(clockTime) {
  if (playing) {
    const passed = before === null ? 0 : (clockTime - before) / 1000 * element("speed").value;
    before = clockTime;
    show(now >= times[last] ? times[0] : now + passed);
  }
  requestAnimationFrame(step);
}
function asked() {
  const found = /^#t=(-?[0-9.eE+-]+)$/.exec(location.hash);
  if (!found || !isFinite(found[1])) return false;
  play(false);
  show(Number(found[1]));
  return true;
}
button.onclick = () => play(!playing);
slider.oninput = () => { play(false); show(Number(slider.value)); };
window.addEventListener("hashchange", asked);
show(times[0]);
if (!asked()) play(!matchMedia("(prefers-reduced-motion: reduce)").matches);
requestAnimationFrame(step);
})();
"""


_SCRIPT = re.compile(r'<script(?: type="module")?>(.*?)</script>', re.S)
_POLICY = (
    "default-src 'none'; script-src {digests}; style-src 'unsafe-inline'; img-src data: blob:; "
    "base-uri 'none'; form-action 'none'"
)


def page(title: str, legend: str, commands: Sequence[bytes], rest: str, style: str = "") -> str:
    """Put a page together; ``legend`` and ``rest`` are HTML, ``style`` is more CSS."""
    library = (files("meshcat") / "viewer" / "dist" / "main.min.js").read_text(encoding="utf-8")
    encoded = ",\n".join(f'"{base64.b64encode(command).decode()}"' for command in commands)
    name = html.escape(title)
    body = (
        f'<body><div id="meshcat-pane"></div>\n'
        f'<div id="legend"><h1>{name}</h1>\n{legend}</div>\n'
        f"<script>{library}</script>\n<script>{_DRAW % encoded}</script>\n{rest}</body></html>\n"
    )
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head><meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{_policy(body)}">\n'
        f"<title>{name}</title>\n<style>{_STYLE}{style}</style></head>\n{body}"
    )


def _policy(body: str) -> str:
    """What the browser may do with a page: run its own scripts, and show what is in it."""
    digests = (sha256(script.encode()).digest() for script in _SCRIPT.findall(body))
    known = " ".join(f"'sha256-{base64.b64encode(digest).decode()}'" for digest in digests)
    return _POLICY.format(digests=known)


def module_script(text: str) -> str:
    """A script that is a module. Raises ``ValueError`` for text that would end it early."""
    if "</script" in text.lower() or "<!--" in text:
        raise ValueError("this text cannot stand in a script of a page")
    return f'<script type="module">{text}</script>\n'


def json_in_script(data: Any) -> str:
    """JSON that may stand in a ``<script>``: no text in it can end or open one."""
    return json.dumps(data, separators=(",", ":")).replace("<", "\\u003c")


def labels(root: str, texts: Sequence[tuple[str, np.ndarray]]) -> str:
    """Texts at world positions (3,) [m]; ``root`` is Meshcat's path of the world's node."""
    if not texts:
        return ""
    rows = [[not _is_number(text), text, [float(x) for x in np.round(at, 6)]] for text, at in texts]
    path = [part for part in root.split("/") if part]
    script = _LABELS % (json_in_script(path), json_in_script(rows))
    return f'<div id="labels"></div>\n<script>{script}</script>\n'


def player(data: str, rows: str, times: np.ndarray) -> str:
    """Controls and read-outs of an animation."""
    first, last = float(times[0]), float(times[-1])
    speeds = "".join(
        f'<option value="{speed:g}"{" selected" if speed == 1 else ""}>× {speed:g}</option>'
        for speed in (0.1, 0.25, 0.5, 1, 2, 5)
    )
    table = f'<table id="readouts">\n{rows}</table>\n' if rows else ""
    return (
        f'{table}<div id="player"><button id="play">play</button>'
        f'<input id="time" type="range" aria-label="time" min="{first!r}" max="{last!r}" '
        f'step="any" value="{first!r}"><output id="clock"></output>'
        f'<select id="speed" aria-label="speed">{speeds}</select></div>\n'
        f'<script type="application/json" id="motion">{data}</script>\n'
        f"<script>{_PLAYER}</script>\n"
    )


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
