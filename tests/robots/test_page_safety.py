"""Pages made from descriptions of strangers: text stays text, and nothing is loaded or told."""

import base64
import html
import re
import threading
from hashlib import sha256
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import numpy as np
import pytest
from browser import Browser
from page_reading import browse, drawn, scripts, transforms

import closedchain as cc
from closedchain.robots.viewer import (
    Animation,
    Overlay,
    Polyline,
    Readout,
    Trace,
    boxed,
    input_readouts,
    static_page,
)

NAMES = (
    "<!--<script>",
    "</script><script>document.title = 'taken'</script>",
    "\"'><img src=x onerror=\"document.title = 'taken'\">",
    "</title></style><body onload=\"document.title = 'taken'\">",
    "&lt;b&gt; %s {} \\u003c/script> \u2028 `$1`",
    "<object>",
    "a/b",
    "constructor",
)
CROSS = np.array([[0.0, 0, 0], [1, 1, 1]])


def crank(name: str, visual: str = "") -> str:
    """A crank that turns, everything in it named ``name``."""
    given = html.escape(name, quote=True)
    return f"""<robot name="{given}"><link name="base"/>
  <link name="{given}">{visual}</link><link name="tip {given}"/>
  <joint name="{given}" type="continuous"><parent link="base"/><child link="{given}"/>
    <axis xyz="0 0 1"/><limit effort="1" velocity="1"/></joint>
  <joint name="fixed {given}" type="fixed"><parent link="{given}"/><child link="tip {given}"/>
    <origin xyz="1 0 0"/></joint>
  <transmission name="{given}"><joint name="{given}"/></transmission>
  <task base="base" tip="tip {given}" outputs="rz"/></robot>"""


def named_page(name: str, visual: str = "") -> str:
    """A page on which ``name`` stands wherever a name can stand."""
    m = cc.load_urdf(crank(name, visual))
    q = np.linspace(0.0, 1.0, 5)[:, None]
    motion = Animation(
        q,
        q[:, 0],
        traces=[Trace(f"tip {name}", label=name, values=q[:, 0], unit=name)],
        readouts=[*input_readouts(m, q), Readout(name, q[:, 0], name)],
    )
    overlays: list[Overlay] = list(
        boxed([Polyline(CROSS, label=name)], (name,) * 3, (name,) * 3, beside=m, label=name)
    )
    return static_page(m, overlays=overlays, animation=motion)


@pytest.mark.parametrize("name", NAMES)
def test_names_beside_sliders_are_text(name: str) -> None:
    page = static_page(cc.load_urdf(crank(name)), controls=True)
    outside = re.sub(r"(<script[^>]*>)(.*?)</script>", r"\1</script>", page, flags=re.S)
    # drawing, library, scene, the robot's module with its instrument; data; what unpacks them
    assert outside.count("<script") == 6
    for mark in ("<!--", "<img", 'onerror="', 'onload="'):
        assert mark not in outside
    data = re.findall(r'<script type="application/json" id="instrument">(.*?)</script>', page, re.S)
    assert len(data) == 1
    assert "<" not in data[0]


@pytest.mark.parametrize("name", NAMES)
def test_names_are_text(name: str) -> None:
    page = named_page(name)
    # with our scripts taken out, no markup is left that we did not write
    outside = re.sub(r"(<script[^>]*>)(.*?)</script>", r"\1</script>", page, flags=re.S)
    # drawing, library, scene, labels, player; texts, motion; what unpacks them
    assert outside.count("<script") == 8
    for mark in ("<!--", "<img", 'onerror="', 'onload="'):
        assert mark not in outside
    for name_of in ("motion", "texts"):
        data = re.findall(rf'<script type="application/json" id="{name_of}">(.*?)</script>', page)
        assert len(data) == 1
        assert "<" not in data[0]


def test_the_policy_names_the_scripts_of_the_page_and_nothing_else() -> None:
    page = named_page("arm")
    found = re.search(r'<meta http-equiv="Content-Security-Policy" content="([^"]*)">', page)
    assert found is not None
    assert page.index(found[0]) < page.index("<script")
    rules = dict(rule.strip().split(" ", 1) for rule in found[1].split(";"))
    found_scripts = scripts(page)
    digests = [base64.b64encode(sha256(s.encode()).digest()).decode() for s in found_scripts]
    assert rules["script-src"].split() == [f"'sha256-{digest}'" for digest in digests]
    assert len(digests) == 5
    assert rules["default-src"] == "'none'"  # so also no connections, frames, fonts, objects
    assert rules["img-src"] == "data: blob:"
    assert "http" not in found[1]


DAE = """<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><contributor><author>an author</author></contributor><up_axis>Z_UP</up_axis></asset>
<library_images><image id="i"><init_from>IMAGE</init_from></image></library_images>
<library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="pa" count="9">0 0 0 1 0 0 0 1 0</float_array><technique_common>
<accessor source="#pa" count="3" stride="3"><param name="X" type="float"/>
<param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles count="1"><input semantic="VERTEX" source="#v" offset="0"/><p>0 1 2</p></triangles>
</mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"><node><instance_geometry url="#g"/></node>
</visual_scene></library_visual_scenes><scene><instance_visual_scene url="#s"/></scene></COLLADA>"""


@pytest.mark.parametrize("image", ["../secret.png", "ABSOLUTE", "http://127.0.0.1:9/i.png"])
def test_of_a_mesh_file_only_its_triangles_are_in_the_page(tmp_path: Path, image: str) -> None:
    """Images that it names, wherever they lie, and its other words are not."""
    secret = tmp_path / "secret.png"
    secret.write_bytes(b"\x89PNG a secret in a picture")
    (tmp_path / "meshes").mkdir()
    mesh = tmp_path / "meshes" / "part.dae"
    mesh.write_text(DAE.replace("IMAGE", str(secret) if image == "ABSOLUTE" else image))
    visual = f'<visual><geometry><mesh filename="{mesh}" scale="2 3 4"/></geometry></visual>'
    page = static_page(cc.load_urdf(crank("arm", visual)))
    commands = drawn(page)
    (shape,) = (
        c for c in commands if c["type"] == "set_object" and c["path"].endswith("visuals/arm_0")
    )
    (geometry,) = shape["object"]["geometries"]
    assert geometry["type"] == "BufferGeometry"
    vertices = np.frombuffer(geometry["data"]["attributes"]["position"]["array"].data, np.float32)
    corners = vertices.reshape(-1, 3) @ transforms(page)[shape["path"]][:3, :3].T
    assert sorted(map(tuple, corners.tolist())) == [(0, 0, 0), (0, 3, 0), (2, 0, 0)]
    everything = repr(commands) + page
    for text in ("an author", "secret", base64.b64encode(secret.read_bytes()).decode()[:20]):
        assert text not in everything


def test_colours_that_are_none_are_left_out_of_the_legend() -> None:
    for rgba in ("1 0", "red", "1 0 nan 1", "", "1e999 0 0 1"):
        shape = '<visual><geometry><sphere radius="0.1"/></geometry>'
        visual = f'{shape}<material name="odd"><color rgba="{rgba}"/></material></visual>'
        assert "odd</p>" not in static_page(cc.load_urdf(crank("arm", visual)))
    visual = f'{shape}<material name="odd"><color rgba="7 0.5 -1 1"/></material></visual>'
    assert "rgb(255, 128, 0)" in static_page(cc.load_urdf(crank("arm", visual)))


@pytest.mark.slow
@pytest.mark.parametrize("name", [NAMES[0], NAMES[1], " ".join(NAMES)])
def test_a_browser_plays_a_page_of_such_names(name: str, tmp_path: Path) -> None:
    file = tmp_path / "page.html"
    file.write_text(named_page(name), encoding="utf-8")
    with Browser(tmp_path) as browser:
        drawn = "document.querySelectorAll('.name[style*=left]').length >= 3"
        told = "document.body.innerText.includes('0.250 s')"
        browser.open(file.as_uri() + "#t=0.25", f"{drawn} && {told}")
        text = str(browser.run("document.documentElement.outerHTML"))
    assert ">0.250 s</output>" in text  # the player has started
    assert text.count("<output>0.2500</output>") == 2
    shown = html.escape(name, quote=False)
    assert re.search(r'<span class="name" style="left: [\d.]+px; top: [\d.]+px;">', text)
    assert text.count(f">{shown} [{shown}]</span>") == 3  # and so have the labels
    assert f"<title>{shown}</title>" in text


@pytest.mark.slow
def test_a_browser_is_kept_from_what_a_page_does_not_hold(tmp_path: Path) -> None:
    """Were markup to slip in all the same, nothing would run and nothing would be loaded."""
    asked: list[str] = []

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            asked.append(self.path)
            self.send_response(200)
            self.end_headers()

        def log_message(self, format: str, *args: object) -> None:
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    address = f"http://127.0.0.1:{server.server_port}"
    slipped = (
        f'<img src="{address}/image"><script src="{address}/script"></script>'
        f'<link rel="stylesheet" href="{address}/style"><iframe src="{address}/frame"></iframe>'
        f"<script>document.title = 'taken'; fetch('{address}/fetch')</script>"
        f'<b onclick="document.title = \'taken\'" id="b"></b>'
    )
    page = named_page("arm")
    free = re.sub(r'<meta http-equiv="Content-Security-Policy"[^>]*>', "", page)
    try:
        for folder, text in (("kept", page), ("free", free)):
            (tmp_path / folder).mkdir()
            asked.clear()
            seen = browse(
                text.replace("</body>", slipped + "</body>"), tmp_path / folder, "--dump-dom"
            )
            if folder == "kept":
                assert "<title>arm</title>" in seen
                assert asked == []
            else:  # so the test would notice
                assert "<title>taken</title>" in seen
                assert {"/image", "/script", "/style", "/frame", "/fetch"} <= set(asked)
    finally:
        server.shutdown()
        thread.join()
        server.server_close()
