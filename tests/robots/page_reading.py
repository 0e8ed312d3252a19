"""Reading the viewer's pages: Meshcat's commands, the motion, and what a browser shows."""

import base64
import gzip
import hashlib
import json
import re
import struct
from pathlib import Path
from typing import Any

import numpy as np
import umsgpack
from browser import printed

SLIDER = """<robot name="slider">
  <link name="base"/><link name="carriage"/><link name="arm"/><link name="end"/>
  <joint name="s" type="prismatic"><parent link="base"/><child link="carriage"/>
    <axis xyz="1 0 0"/><limit lower="0" upper="3" effort="1" velocity="1"/></joint>
  <joint name="a" type="revolute"><parent link="carriage"/><child link="arm"/>
    <axis xyz="0 0 1"/><limit lower="-4" upper="4" effort="1" velocity="1"/></joint>
  <joint name="f" type="fixed"><parent link="arm"/><child link="end"/><origin xyz="0 1 0"/></joint>
  <constraint name="guide" type="planar">
    <parent link="base"/><parent_origin xyz="0 0 0"/><parent_axis xyz="0 0 1"/>
    <child link="end"/><child_origin xyz="0 0 0"/><child_axis xyz="0 0 1"/></constraint>
  <group_state name="home"><joint name="s" value="0"/><joint name="a" value="0"/></group_state>
</robot>"""
SQUARE = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
HALVES = np.array([[0, 1, 2], [0, 2, 3]])


def unpacked(page: str, kind: str) -> list[bytes]:
    """What is gzipped in a page: its data, or its scripts in their order."""
    found = re.findall(rf'<script [^>]*data-packed="{kind}"[^>]*>([A-Za-z0-9+/=]+)</script>', page)
    return [gzip.decompress(base64.b64decode(text)) for text in found]


def scripts(page: str) -> list[str]:
    """Every script that a page runs: the packed ones, and the one that unpacks them."""
    (loader,) = re.findall(r"<script>(.*?)</script>", page, re.S)
    return [loader, *(text.decode() for text in unpacked(page, "script"))]


def commands(page: str) -> list[bytes]:
    """Meshcat's commands inside a page, packed."""
    (data,) = unpacked(page, "data")
    found, at = [], 0
    while at < len(data):
        (size,) = struct.unpack_from("<I", data, at)
        found.append(data[at + 4 : at + 4 + size])
        at += 4 + size
    return found


def drawn(page: str) -> list[dict[str, Any]]:
    """Meshcat's commands inside a page."""
    return [umsgpack.unpackb(command) for command in commands(page)]


def transforms(page: str) -> dict[str, np.ndarray]:
    """Placements of Meshcat's nodes, (4, 4) by path."""
    moves = (c for c in drawn(page) if c["type"] == "set_transform")
    return {c["path"]: np.reshape(c["matrix"], (4, 4)).T for c in moves}


def geometry(page: str, number: int) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Material and arrays (n, k) of an overlay."""
    (command,) = (
        c
        for c in drawn(page)
        if c["type"] == "set_object" and c["path"] == f"/meshcat/robot/overlays/{number}"
    )
    data = command["object"]["geometries"][0]["data"]
    packed = dict(data["attributes"])
    if "index" in data:
        packed["index"] = data["index"]
    arrays = {}
    for name, item in packed.items():
        kind = np.uint32 if name == "index" else np.float32
        arrays[name] = np.frombuffer(item["array"].data, kind).reshape(-1, item["itemSize"])
    return command["object"]["materials"][0], arrays


def motion(page: str) -> dict[str, Any]:
    found = re.search(r'<script type="application/json" id="motion">(.*?)</script>', page, re.S)
    assert found is not None
    data = json.loads(found[1])
    poses = np.frombuffer(base64.b64decode(data["poses"]), "<f4")
    data["poses"] = poses.reshape(len(data["times"]), data["bodies"], 7)
    return data


def with_probe(page: str, probe: str) -> str:
    """A page with HTML of a test's own at its end, whose script its policy is made to allow."""
    (script,) = re.findall("<script>(.*?)</script>", probe, re.S)
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    allowed = page.replace("script-src ", f"script-src 'sha256-{digest}' ", 1)
    assert allowed != page
    return allowed.replace("</body>", probe + "</body>")


def browse(page: str, folder: Path, *options: str, mark: str = "") -> str:
    """What headless Chromium prints for a page."""
    (folder / "page.html").write_text(page)
    return printed(folder / "page.html", *options, mark=mark)
