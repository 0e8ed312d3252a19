"""The site's parts before they are built: links, the menu, the reference, notebooks."""

import base64
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import closedchain as cc
from closedchain.robots.viewer import static_page
from website import gallery, moving_picture, navigation, notebooks, pages, reference
from website.offline import fetched

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """All pages but the gallery's, whose commands take a while."""
    folder = tmp_path_factory.mktemp("site")
    for write in (pages.gather, notebooks.write, reference.write):
        write(ROOT, folder)
    (folder / "gallery.md").write_text("# Gallery\n")
    return folder


def entries(menu: Any) -> list[str]:
    if isinstance(menu, str):
        return [menu]
    values = menu.values() if isinstance(menu, dict) else menu
    return [name for value in values for name in entries(value)]


def test_links_of_gathered_pages_lead_to_gathered_files(source: Path) -> None:
    count = 0
    for page in source.rglob("*.md"):
        text = re.sub(r"^```.*?^```", "", page.read_text(), flags=re.M | re.S)
        for target in re.findall(r"\]\((?![a-z]+:|#)([^)\s#]+)", text):
            assert (page.parent / target).exists(), f"{page.relative_to(source)}: {target}"
            count += 1
    assert count > 200
    assert (source / "files" / "examples" / "ros2" / "closed_joints.py").exists()
    assert "(contributing.md#a-joint-kind)" in (source / "tape.md").read_text()


def test_every_page_stands_in_the_menu_once(source: Path) -> None:
    there = sorted(p.relative_to(source).as_posix() for p in source.rglob("*.md"))
    assert sorted(entries(navigation.navigation(source))) == there


def test_a_new_page_is_a_guide_until_it_has_a_place(source: Path) -> None:
    new = source / "quite_new.md"
    new.write_text("# Something new\n")
    try:
        menu = navigation.navigation(source)
    finally:
        new.unlink()
    (guides,) = (entry["Guides"] for entry in menu if "Guides" in entry)
    assert "quite_new.md" in dict(kv for guide in guides for kv in guide.items())[navigation.REST]


def test_every_public_name_is_in_the_reference_once(source: Path) -> None:
    text = "".join(page.read_text() for page in (source / "reference").glob("*.md"))
    listed = re.findall(r"^::: ([\w.]+)$", text, re.M)
    public = [reference.path(name) for name in cc.__all__]
    assert sorted(listed) == sorted([*public, *reference.parts()])
    assert reference.path("robots") == "closedchain.robots.catalogue.robots"  # not the folder
    assert "closedchain.closure.ranks.Rank" in reference.parts()
    overview = (source / "reference.md").read_text()
    for name, full in zip(cc.__all__, public, strict=True):
        assert f"[`cc.{name}`](reference/{reference.topic(name)}.md#{full}) | " in overview


def test_every_command_is_in_the_reference(source: Path) -> None:
    text = (source / "reference" / "commands.md").read_text()
    named = re.findall(r"^## closedchain ([\w-]+)$", text, re.M)
    assert {"list", "info", "direct", "view", "joints", "closed-forms"} <= set(named)
    for name in named:
        assert f"Usage: closedchain {name} " in text
    readme = (ROOT / "README.md").read_text()
    assert set(re.findall(r"`closedchain ([a-z][\w-]*)", readme)) <= set(named)


def test_a_notebook_keeps_its_text_code_and_pictures(tmp_path: Path) -> None:
    (tmp_path / "notebooks").mkdir()
    data = {"image/png": [base64.b64encode(b"png").decode()], "text/plain": ["<Image object>"]}
    picture = {"data": data, "metadata": {"image/png": {"alt": "A map of q1 [m]\nand q2"}}}
    page = {"data": {"text/html": "<div><iframe srcdoc='&lt;p&gt;'></iframe></div>"}}
    warning = {"name": "stderr", "text": "a warning"}
    cells = [
        {"cell_type": "markdown", "source": ["# A title\n", "and words"]},
        {"cell_type": "code", "source": "print(1)", "outputs": [{"text": ["1\n"]}, picture]},
        {"cell_type": "code", "source": "show()", "outputs": [page, warning]},
    ]
    (tmp_path / "notebooks" / "one.ipynb").write_text(json.dumps({"cells": cells}))
    notebooks.write(tmp_path, tmp_path / "out")
    text = (tmp_path / "out" / "notebooks" / "one.md").read_text()
    assert text.startswith("# A title\nand words\n\n```python\nprint(1)\n```\n\n```text\n1\n```")
    assert "![A map of q1 (m) and q2](one_1.png)" in text
    assert (tmp_path / "out" / "notebooks" / "one_1.png").read_bytes() == b"png"
    assert '<iframe class="robot" src="one_2.html"' in text
    assert "srcdoc" in (tmp_path / "out" / "notebooks" / "one_2.html").read_text()
    assert "a warning" not in text


def test_exhibits_are_robots_and_commands_that_there_are() -> None:
    for one in gallery.EXHIBITS:
        assert one.words[1] in cc.robots()
        assert one.page.endswith(".html")


@pytest.mark.parametrize(
    ("html", "count"),
    [
        ('<script src="https://cdn.example/x.js"></script>', 1),
        ('<link rel="stylesheet" href="//fonts.example/a.css">', 1),
        ('<pre class="mermaid">flowchart</pre>', 1),
        ('<img src="images/a.png"><a href="https://www.sympy.org">sympy</a>', 0),
        ('<script src="assets/x.js"></script><link rel="stylesheet" href="site.css">', 0),
    ],
)
def test_what_would_be_fetched_is_noticed(html: str, count: int) -> None:
    assert len(fetched(html)) == count


@pytest.mark.slow
def test_the_robot_of_the_moving_picture_is_photographed_sharply() -> None:
    """Two postures give two pictures, and neighbouring pixels that are no copies."""
    m = cc.load("delta")
    moved = dict(zip(m.inputs, m.input_values(m.home), strict=True)) | {"q1": 0.75}
    far = cc.direct(m, moved).raise_if_failed().q
    page = static_page(m, controls=True)
    one, two = (np.asarray(p) for p in moving_picture.photographed(page, np.array([m.home, far])))
    assert one.shape == two.shape == (moving_picture.SIDE, moving_picture.SIDE, 3)
    assert (one != two).any(axis=2).mean() > 0.01
    edges = np.abs(np.diff(one.astype(float).mean(axis=2), axis=1))
    assert edges.max() > 60.0  # a picture blown up from half the size has none as steep
