import re
import urllib.error
import urllib.request
from pathlib import Path

import numpy as np
import pytest
from browser import printed
from page_reading import commands
from page_reading import drawn as unpacked

import closedchain as cc
from closedchain.robots import robot
from closedchain.robots.viewer import Animation, Markers, serve, static_page

STICKS = """<robot name="&lt;two bars&gt;">
  <link name="base"/><link name="one"/><link name="two"/>
  <joint name="a" type="revolute"><parent link="base"/><child link="one"/>
    <axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
  <joint name="b" type="revolute"><parent link="one"/><child link="two"/><origin xyz="1 0 0"/>
    <axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
  <constraint name="ground" type="revolute">
    <parent link="base"/><parent_origin xyz="1.5 0 0"/><parent_axis xyz="0 0 1"/>
    <child link="two"/><child_origin xyz="1 0 0"/><child_axis xyz="0 0 1"/></constraint>
  <group_state name="home"><joint name="a" value="0.7"/><joint name="b" value="-1.6"/></group_state>
</robot>"""


def drawn(page: str) -> str:
    return b"\n".join(commands(page)).decode("latin-1")


@pytest.fixture(scope="module")
def page(d1: cc.Mechanism) -> str:
    return static_page(d1, up="y")


def test_page_is_one_file_that_loads_nothing(page: str) -> None:
    assert page.startswith("<!DOCTYPE html>")
    assert not re.search(r"""(?:src|href)\s*=\s*["']?\s*(?:https?:)?//""", page[:100_000])
    outside = re.sub(r"<script>.*?</script>", "", page, flags=re.S)
    assert "http" not in outside.replace("http-equiv", "")
    assert "url(" not in outside
    assert "ws://" not in outside


def test_page_holds_every_visual_of_the_robot(d1: cc.Mechanism, page: str) -> None:
    text = drawn(page)
    for link in d1.description.links:
        for i in range(link.visuals):
            assert f"/bodies/visuals/{link.name}_{i}" in text
    assert {"active", "passive", "platform", "tool", "base"} <= set(
        re.findall(r"</i>(\w+)</p>", page)
    )


def test_page_shows_name_inputs_and_tip(page: str) -> None:
    assert "<h1>d1</h1>" in page
    assert "q1 0.522 m" in page
    assert "tip T at (0, -1, 0) m" in page


def test_mechanism_without_visuals_is_drawn_as_sticks() -> None:
    mechanism = cc.load_urdf(STICKS)
    page = static_page(mechanism)
    text = drawn(page)
    assert text.count("CylinderGeometry") == 3  # one bar each, the base among them
    assert text.count("SphereGeometry") == 4
    assert "no visuals" in page
    assert "<h1>&lt;two bars&gt;</h1>" in page


def test_a_rod_is_drawn_though_it_is_no_body() -> None:
    """Also between bodies that have visuals of their own."""
    rod = STICKS.replace('"ground" type="revolute"', '"ground" type="distance" length="0.6"')
    rod = re.sub(r"<(parent|child)_axis [^>]*>", "", rod)
    assert drawn(static_page(cc.load_urdf(rod))).count("CylinderGeometry") == 4
    shape = '<visual><geometry><sphere radius="0.1"/></geometry></visual>'
    for link in ("one", "two"):
        rod = rod.replace(f'<link name="{link}"/>', f'<link name="{link}">{shape}</link>')
    assert drawn(static_page(cc.load_urdf(rod))).count("CylinderGeometry") == 2  # rod and base


def test_visuals_that_cannot_be_read_fall_back_to_sticks(d1: cc.Mechanism) -> None:
    mesh = '<visual><geometry><mesh filename="none.stl"/></geometry></visual>'
    mechanism = cc.load_urdf(
        STICKS.replace('<link name="one"/>', f'<link name="one">{mesh}</link>')
    )
    page = static_page(mechanism)
    assert "drawn as sticks" in page
    assert "CylinderGeometry" in drawn(page)


def test_bodies_without_visuals_are_sticks_among_the_others(
    capfd: pytest.CaptureFixture[str],
) -> None:
    shape = '<visual><geometry><capsule radius="0.1" length="1"/></geometry></visual>'
    text = STICKS.replace('<link name="one"/>', f'<link name="one">{shape}</link>')
    drawing = drawn(static_page(cc.load_urdf(text)))
    assert "/bodies/visuals/one_0" in drawing
    assert drawing.count("CylinderGeometry") == 3  # the capsule, and sticks for two and the base
    assert "SphereGeometry" not in drawing
    assert capfd.readouterr() == ("", "")


def test_sticks_of_a_base_with_shapes_are_no_rods() -> None:
    """The ankle has two rods; what joins its base's shapes to the joints is paler than these."""
    page = static_page(cc.load("ankle"))
    sticks = [
        c["object"]["materials"][0]["color"]
        for c in unpacked(page)
        if c["type"] == "set_object" and "/sticks/" in c["path"]
    ]
    rod, ground = 0x5A5E66, 0xB9C0CA
    assert sticks.count(rod) == 2
    assert sticks.count(ground) == len(sticks) - 2 > 0


def test_posture_moves_the_drawing(d1: cc.Mechanism, page: str) -> None:
    q = cc.direct(d1, d1.input_values(d1.home) + 0.01).raise_if_failed().q
    assert commands(static_page(d1, q, up="y")) != commands(page)
    with pytest.raises(cc.ClosureError, match="shape"):
        static_page(d1, np.zeros(3))


def test_served_page_is_the_same_and_the_address_dies_with_close(
    d1: cc.Mechanism, page: str
) -> None:
    with serve(d1, up="y") as served:
        url = served.url
        assert url.startswith("http://127.0.0.1:")
        with urllib.request.urlopen(url, timeout=5) as answer:
            assert answer.read().decode() == page
        with pytest.raises(urllib.error.HTTPError) as missing:
            urllib.request.urlopen(url + "etc/passwd", timeout=5)
        missing.value.close()
    with pytest.raises(urllib.error.URLError):
        urllib.request.urlopen(url, timeout=5)


def test_served_page_takes_what_a_static_one_takes(d1: cc.Mechanism) -> None:
    overlays = [Markers(np.zeros((1, 3)), "inverse", label="origin")]
    motion = Animation(np.array([d1.home, d1.home]), np.array([0.0, 1.0]))
    with (
        serve(d1, overlays=overlays, animation=motion, title="two") as served,
        urllib.request.urlopen(served.url, timeout=5) as answer,
    ):
        text = answer.read().decode()
    assert text == static_page(d1, overlays=overlays, animation=motion, title="two")
    assert "<h1>two</h1>" in text
    assert "origin</p>" in text
    assert 'id="player"' in text


def test_no_process_is_left_over(d1: cc.Mechanism) -> None:
    def children() -> set[str]:
        return set(Path("/proc/self/task").glob("*/children")) and {
            pid
            for path in Path("/proc/self/task").glob("*/children")
            for pid in path.read_text().split()
        }

    if not Path("/proc/self/task").is_dir():
        pytest.skip("needs /proc")
    before = children()
    static_page(d1)
    with pytest.raises(cc.ClosureError), serve(d1):
        raise cc.ClosureError("a failure while serving")
    assert children() <= before


def test_units_of_inputs(d1: cc.Mechanism) -> None:
    assert d1.input_units == ("m",) * 6


@pytest.mark.slow
@pytest.mark.parametrize("name", ["d1", "sticks"])
def test_browser_renders_the_page(name: str, tmp_path: Path) -> None:
    from PIL import Image

    mechanism = cc.load_urdf(STICKS) if name == "sticks" else cc.load(name)
    up = "z" if name == "sticks" else robot(name).up
    (tmp_path / "page.html").write_text(static_page(mechanism, up=up))
    picture = tmp_path / "page.png"
    printed(tmp_path / "page.html", f"--screenshot={picture}")
    with Image.open(picture) as image:
        pixels = np.asarray(image.convert("RGB")).astype(int)
    pixels[:150, :340] = 255  # the legend
    coloured = np.ptp(pixels, axis=2) > 60  # neither background nor grey
    rows, columns = np.nonzero(coloured)
    assert coloured.sum() > 150
    assert rows.min() > 0
    assert rows.max() < 599
    assert columns.min() > 0
    assert columns.max() < 799
    assert np.ptp(columns) > 60


# -- meshes --------------------------------------------------------------------------------

TRIANGLE = b"triangle".ljust(80) + (1).to_bytes(4, "little") + np.array(
    [0, 0, 1, 0, 0, 0, 0.1, 0, 0, 0, 0.1, 0], dtype="<f4"
).tobytes() + b"\0\0"  # fmt: skip
SHAPES = """<robot name="shapes">
  <link name="a"><visual><geometry><mesh filename="MESH"/></geometry></visual></link>
  <link name="b"><visual><geometry><box size="0.1 0.1 0.1"/></geometry></visual></link>
  <joint name="j" type="continuous"><parent link="a"/><child link="b"/><origin xyz="0.2 0 0"/>
  </joint>
</robot>"""


def shapes_in(folder: Path, mesh: str) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / "shapes.urdf"
    file.write_text(SHAPES.replace("MESH", mesh))
    return file


def test_meshes_beside_the_file_are_drawn(tmp_path: Path) -> None:
    file = shapes_in(tmp_path, "meshes/part.stl")
    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes" / "part.stl").write_bytes(TRIANGLE)
    m = cc.load_urdf(file)
    assert m.notes == ()
    drawing = drawn(static_page(m))
    assert "/bodies/visuals/a_0" in drawing
    assert "/bodies/visuals/b_0" in drawing


def test_meshes_of_packages_are_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "ws" / "arm_description" / "meshes").mkdir(parents=True)
    (tmp_path / "ws" / "arm_description" / "meshes" / "part.stl").write_bytes(TRIANGLE)
    mesh = "package://arm_description/meshes/part.stl"
    elsewhere = shapes_in(tmp_path / "elsewhere", mesh)
    assert "was not found (name its folder" in cc.load_urdf(elsewhere).notes[0]
    assert cc.load_urdf(elsewhere, package_dirs=[tmp_path / "ws"]).notes == ()
    assert cc.load_urdf(elsewhere, package_dirs=[tmp_path / "ws" / "arm_description"]).notes == ()
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(tmp_path / "ws"))
    assert cc.load_urdf(elsewhere).notes == ()
    monkeypatch.delenv("ROS_PACKAGE_PATH")
    # as packages lie: the file in urdf/, the mesh in meshes/ beside it
    inside = shapes_in(tmp_path / "ws" / "arm_description" / "urdf", mesh)
    assert cc.load_urdf(inside).notes == ()


def test_a_missing_mesh_is_missed_alone(tmp_path: Path) -> None:
    m = cc.load_urdf(shapes_in(tmp_path, "part.stl"))
    assert m.notes == ("mesh 'part.stl' of link 'a' was not found: the link is drawn without it",)
    page = static_page(m)
    assert "/bodies/visuals/b_0" in drawn(page)
    assert "mesh &#x27;part.stl&#x27; of link &#x27;a&#x27; was not found" in page
