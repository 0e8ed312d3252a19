"""Pages whose sliders move the robot: in a browser, beside Python's own solutions."""

from __future__ import annotations

import html
import json
import re
import urllib.request
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from page_reading import SLIDER, browse, transforms, with_probe

import closedchain as cc
from closedchain.robots.viewer import (
    PALETTE,
    Animation,
    Controls,
    Plane,
    PostureSeries,
    serve,
    static_page,
)

PROBE = """<pre id="told"></pre><script>
const element = (id) => document.getElementById(id);
addEventListener("error", (event) => { element("told").textContent += event.message; });
addEventListener("unhandledrejection", (event) => { element("told").textContent += event.reason; });
addEventListener("load", async () => {
  // a browser without a window need not make frames
  const shown = () => new Promise((done) => setTimeout(done, 150));
  const text = (id) => element(id).hidden ? "" : element(id).textContent;
  const set = async (id, value, event) => {
    const field = element(id);
    field.value = value;
    field.dispatchEvent(new Event(event));
    await shown();
  };
  const parts = (path) => path.split("/").filter((x) => x);
  const place = (path) => viewer.scene_tree.find(parts(path)).object.matrixWorld;
  const told = {};
  BODY
  element("told").textContent = JSON.stringify(told);
});
</script>"""


def told(page: str, folder: Path, body: str) -> Any:
    """What a script in the page found out."""
    probe = PROBE.replace("BODY", body)
    shown = browse(with_probe(page, probe), folder, "--dump-dom")
    (found,) = re.findall(r'<pre id="told">(.*?)</pre>', shown, re.S)
    return json.loads(html.unescape(found))


@pytest.fixture(scope="module")
def delta() -> cc.Mechanism:
    return cc.load("linear_delta")


def test_sliders_and_numbers_move_what_python_would_move(
    delta: cc.Mechanism, tmp_path: Path
) -> None:
    page = static_page(delta, controls=True)
    found = told(
        page,
        tmp_path,
        """
        await set("slider-0", -0.3, "input");
        told.dragged = instrument.posture();
        told.legs = [0, 1, 2].map((i) => element(`number-${i}`).valueAsNumber);
        told.place = text("tip-place");
        await set("number-3", 0.04, "change");
        told.typed = instrument.posture();
        told.sigma = text("sigma-inverse");
        told.kinds = text("kinds");
        told.residual = text("residual");
        told.joint = text("q-0");
        told.stop = text("stop");
        """,
    )
    values = delta.input_values(delta.home)
    values[0] = -0.3
    first = cc.direct(delta, values).raise_if_failed()
    assert np.abs(np.array(found["dragged"]) - first.q).max() < 1e-12
    assert found["legs"][0] == -0.3
    assert np.allclose([float(x) for x in found["place"].split()], delta.pose(first.q).translation,
                       atol=6e-6)  # fmt: skip
    pose = delta.pose(first.q)
    pose = pin.SE3(pose.rotation, np.array([0.04, *pose.translation[1:]]))
    second = cc.inverse(delta, pose, first.q).raise_if_failed()
    assert np.abs(np.array(found["typed"]) - second.q).max() < 1e-12
    known = cc.classify(delta, second.q)
    assert float(found["sigma"]) == pytest.approx(known.sigma_inverse, rel=1e-3)
    assert found["kinds"] == "regular"
    assert float(found["residual"]) < 1e-12
    assert found["joint"] == f"{second.q[0]:.5f} m"
    assert found["stop"] == ""


def test_the_picture_is_that_of_the_posture(d1: cc.Mechanism, tmp_path: Path) -> None:
    """Nodes stand where a page that was drawn at that posture has them."""
    inputs = d1.input_values(d1.home) + np.array([0.02, -0.01, 0.03, 0.0, 0.02, -0.02])
    moved = cc.direct(d1, inputs).raise_if_failed().q
    expected = {p: m for p, m in transforms(static_page(d1, moved)).items() if "/bodies/" in p}
    assert len(expected) > 10
    body = f"""
        instrument.toInputs({inputs.tolist()});
        viewer.scene.updateMatrixWorld(true);
        const base = place("/meshcat/robot").clone().invert();
        told.q = instrument.posture();
        told.places = {{}};
        for (const path of {json.dumps(sorted(expected))})
          told.places[path] = base.clone().multiply(place(path)).toArray();
        """
    found = told(static_page(d1, controls=True), tmp_path, body)
    assert np.abs(np.array(found["q"]) - moved).max() < 1e-12
    for path, matrix in expected.items():
        assert np.allclose(np.reshape(found["places"][path], (4, 4)).T, matrix, atol=1e-6), path


def test_a_singularity_stops_it_and_is_named(d1: cc.Mechanism, tmp_path: Path) -> None:
    home = d1.input_values(d1.home)
    far = home + np.array([0.1, -0.05, 0.15, 0.3, -0.3, 0.1])
    body = f"""
        const answer = instrument.toInputs({far.tolist()});
        told.reached = answer.reached;
        told.stop = text("stop");
        told.q = instrument.posture();
        element("across").click();
        told.across = instrument.posture();
        told.quiet = text("stop") + text("across");
        instrument.toPosture(told.q);
        instrument.toInputs({home.tolist()});
        told.after = text("stop");
        told.home = instrument.posture();
        await set("number-6", 0.1, "change");
        told.singular = text("stop");
        told.kinds = text("kinds");
        """
    found = told(static_page(d1, controls=True), tmp_path, body)
    assert 0.0 < found["reached"] < 1.0
    assert "A direct singularity is met" in found["stop"]
    assert np.abs(cc.residual(d1, np.array(found["q"]))).max() < 1e-9
    other = np.array(found["across"])
    assert np.abs(cc.residual(d1, other)).max() < 1e-12
    both = (cc.classify(d1, q).det_direct for q in (np.array(found["q"]), other))
    assert np.prod(list(both)) < 0.0
    assert found["quiet"] == ""
    assert found["after"] == ""
    assert np.abs(np.array(found["home"]) - d1.home).max() < 1e-9
    assert "inverse singularity" in found["singular"]
    assert found["kinds"] == "inverse singularity"


def test_efforts_and_names_are_told_on_demand(delta: cc.Mechanism, tmp_path: Path) -> None:
    there = cc.direct(delta, [-0.2, -0.1, -0.15]).raise_if_failed().q
    page = static_page(delta, controls=Controls(places={"there <b>": there}))
    found = told(
        page,
        tmp_path,
        """
        const chooser = element("postures");
        told.places = [...chooser.options].map((o) => o.textContent);
        chooser.selectedIndex = chooser.options.length - 1;
        chooser.dispatchEvent(new Event("change"));
        told.q = instrument.posture();
        await set("force-0", 4, "input");
        await set("force-2", -10, "input");
        told.efforts = [0, 1, 2].map((i) => text(`effort-${i}`));
        told.before = element("signs").hidden;
        element("names").click();
        viewer.render();
        told.after = element("signs").hidden;
        told.signs = [...document.querySelectorAll("#signs span")].map((s) => s.textContent);
        told.driven = [...document.querySelectorAll("#signs .driven")].map((s) => s.textContent);
        """,
    )
    assert found["places"] == ["go to", *delta.postures, "there <b>"]
    assert found["q"] == there.tolist()
    known = cc.statics(delta, there, [4, 0, -10, 0, 0, 0]).inputs
    assert np.allclose([float(x) for x in found["efforts"]], known, atol=6e-6)
    assert found["before"] is True
    assert found["after"] is False
    assert {*(c.name for c in delta.closures), "leg1_B"} <= set(found["signs"])
    assert found["driven"] == [f"leg{k}_P (q{k})" for k in (1, 2, 3)]


def test_a_series_is_gone_through_by_slider_and_by_click(
    delta: cc.Mechanism, tmp_path: Path
) -> None:
    values = [[-0.2, -0.1, x] for x in (-0.3, -0.2, -0.1)]
    q = np.array([cc.direct(delta, one).raise_if_failed().q for one in values])
    tips = np.array([delta.pose(one).translation for one in q])
    page = static_page(delta, controls=Controls(series=[PostureSeries(q, tips, "heights <i>")]))
    found = told(
        page,
        tmp_path,
        f"""
        await set("series-0", 2, "input");
        told.slid = instrument.posture();
        const [x, y] = instrument.onScreen({tips[1].tolist()});
        const canvas = viewer.renderer.domElement;
        const press = (kind, dx) =>
          canvas.dispatchEvent(new PointerEvent(kind, {{clientX: x + dx, clientY: y}}));
        press("pointerdown", 0);
        press("pointerup", 80);
        told.dragged = instrument.posture();
        press("pointerdown", 3);
        press("pointerup", 3);
        told.clicked = instrument.posture();
        told.slider = element("series-0").valueAsNumber;
        told.label = document.querySelector(".series label").textContent;
        """,
    )
    assert found["slid"] == found["dragged"] == q[2].tolist()
    assert found["clicked"] == q[1].tolist()
    assert found["slider"] == 1
    assert found["label"] == "heights <i>"
    with pytest.raises(cc.ClosureError, match="one posture for each of 3 points"):
        PostureSeries(q[:2], tips, "too few")


def test_a_plane_shows_where_it_is_and_leads_elsewhere(delta: cc.Mechanism, tmp_path: Path) -> None:
    curve = np.array([[-0.5, -0.5], [0.0, 0.5]])
    inputs = Plane(("q1", "q2"), [(-0.4, 0.0), (-0.3, 0.1)], [("direct", curve)])
    tip = Plane(("x", "z"), [(-0.2, 0.2), (-0.8, -0.4)], [("inverse", curve)])
    page = static_page(delta, controls=Controls(planes=[inputs, tip]))
    found = told(
        page,
        tmp_path,
        """
        const hit = (i, u, v) => {
          const {left, top, width, height} = element(`plane-${i}`).getBoundingClientRect();
          const at = {clientX: left + u * width, clientY: top + (1 - v) * height};
          element(`plane-${i}`).dispatchEvent(new MouseEvent("click", at));
        };
        const mark = (i) => ["cx", "cy"].map((k) => Number(element(`mark-${i}`).getAttribute(k)));
        told.before = [mark(0), mark(1), text("other-0")];
        hit(0, 0.25, 0.5);
        told.first = [instrument.posture(), mark(0), text("other-0")];
        hit(1, 0.75, 0.5);
        told.second = [instrument.posture(), mark(1), text("other-0"), text("other-1")];
        """,
    )
    q1, q2, q3 = delta.input_values(delta.home)
    assert found["before"][2] == ""
    assert np.allclose(found["before"][0], [500 * (q1 + 0.4), 200 - 500 * (q2 + 0.3)], atol=1e-9)
    assert np.allclose(found["before"][1], [100.0, 100.0], atol=1e-9)
    first = cc.direct(delta, [-0.3, -0.1, q3]).raise_if_failed().q
    reached = delta.input_values(np.array(found["first"][0]))
    assert np.abs(reached - delta.input_values(first)).max() < 1.1e-3  # half a pixel
    assert np.allclose(found["first"][1], [50.0, 100.0], atol=0.6)
    assert found["first"][2] == ""
    place = delta.pose(np.array(found["second"][0])).translation
    assert np.allclose(place, [0.1, delta.pose(first).translation[1], -0.6], atol=2e-3)
    assert np.allclose(found["second"][1], [150.0, 100.0], atol=0.6)
    assert "the curves are of before" in found["second"][2]  # the third leg moved
    assert "the curves are of before" in found["second"][3]  # y is not what it was
    for name, dash in (("direct", "none"), ("inverse", "7 3")):
        assert re.search(rf'<polyline[^>]*stroke="{PALETTE[name]}"[^>]*dasharray="{dash}"', page)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Plane(("q1", "q2"), [(0.0, 0.0), (0.0, 1.0)]), "rising pairs"),
        (lambda: Plane(("q1", "q2"), [(0, 1), (0, 1)], [("odd", np.zeros((2, 2)))]), "'odd'"),
        (lambda: Plane(("q1", "q2"), [(0, 1), (0, 1)], [("direct", np.zeros(2))]), "must be"),
    ],
)
def test_planes_that_make_no_sense(make: Any, message: str) -> None:
    with pytest.raises(cc.ClosureError, match=message):
        make()


def test_a_plane_over_what_nothing_moves_is_refused(delta: cc.Mechanism) -> None:
    for over in (("q1", "x"), ("leg1_B", "leg2_B"), ("x", "rx")):
        plane = Plane(over, [(0.0, 1.0), (0.0, 1.0)])
        with pytest.raises(cc.ClosureError, match="over two inputs"):
            static_page(delta, controls=Controls(planes=[plane]))


def test_limits_are_told(tmp_path: Path) -> None:
    m = cc.load_urdf(SLIDER.replace("<group_state", '<transmission name="a"><joint name="a"/>'
                                    "</transmission><group_state"), xacro=False)  # fmt: skip
    found = told(
        static_page(m, controls=True),
        tmp_path,
        "instrument.toInputs([-0.5]); told.some = text('limits');"
        "instrument.toInputs([4.5]); told.limits = text('limits'); told.q = instrument.posture();",
    )
    assert "a by 0.50000 rad" in found["limits"]


def test_pages_without_anything_to_move_say_so() -> None:
    m = cc.load_urdf(SLIDER, xacro=False)
    page = static_page(m, controls=True)
    assert "nothing can be moved here: there are no inputs and no task" in page
    assert "globalThis.instrument" not in page
    motion = Animation(np.zeros((2, 2)), [0.0, 1.0])
    with pytest.raises(cc.ClosureError, match="not both"):
        static_page(m, animation=motion, controls=True)


def test_it_is_served_at_a_port_of_its_own(delta: cc.Mechanism) -> None:
    with serve(delta, controls=True) as first:
        port = int(first.url.rstrip("/").rpartition(":")[2])
        assert first.url.startswith("http://127.0.0.1:")
        with pytest.raises(OSError, match="in use"):
            serve(delta, controls=True, port=port)
    with serve(delta, controls=True, port=port) as second:
        assert second.url == first.url
        with urllib.request.urlopen(second.url, timeout=10) as answer:
            assert b"globalThis.instrument" in answer.read()


def test_pages_are_whole_files(delta: cc.Mechanism) -> None:
    page = static_page(delta, controls=True)
    assert not re.findall(r"<(?:link|img|script)[^>]* (?:src|href)=", page)
    assert "import(" not in page.split('<script type="module">')[1]
