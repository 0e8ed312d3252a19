"""One four-bar, its loop in the words of other programs, has the same postures."""

import math

import numpy as np
import pytest
from conftest import assert_close

import closedchain as cc
from closedchain.urdf import DescriptionError, read

BASE, CRANK, COUPLER, ROCKER = 0.4, 0.15, 0.35, 0.3
FREE = '<axis xyz="0 0 1"/>'


def four_bar(loop: str, *, links: str = "", attributes: str = "", extra: str = "") -> str:
    """Crank on A, coupler on B, rocker on D; zero is closed only by ``loop``'s own means."""
    return f"""<robot name="four_bar" {attributes}>
  <link name="base"/><link name="crank"/><link name="rod"/><link name="rocker"/>{links}
  <joint name="A" type="continuous" independent="true"><parent link="base"/><child link="crank"/>
    <origin rpy="0 0 1.0"/>{FREE}</joint>
  <joint name="B" type="continuous"><parent link="crank"/><child link="rod"/>
    <origin xyz="{CRANK} 0 0" rpy="0 0 {angles(1.0)[0] - 1.0!r}"/>{FREE}</joint>
  <joint name="D" type="continuous"><parent link="base"/><child link="rocker"/>
    <origin xyz="{BASE} 0 0" rpy="0 0 {angles(1.0)[1]!r}"/>{FREE}</joint>
  {loop}{extra}
</robot>"""


def angles(crank: float) -> tuple[float, float]:
    """Angles of coupler and rocker against the base, from where two circles meet."""
    bx, by = CRANK * math.cos(crank), CRANK * math.sin(crank)
    far = math.hypot(BASE - bx, -by)
    along = (COUPLER**2 - ROCKER**2 + far**2) / (2.0 * far)
    across = math.sqrt(COUPLER**2 - along**2)
    ux, uy = (BASE - bx) / far, -by / far
    px, py = bx + along * ux - across * uy, by + along * uy + across * ux
    return math.atan2(py - by, px - bx), math.atan2(py, px - BASE)


FRAMES = "".join(
    f'<link name="closing_P_{k}"/><joint name="f{k}" type="fixed"><parent link="{link}"/>'
    f'<child link="closing_P_{k}"/><origin xyz="{length} 0 0"/></joint>'
    for k, link, length in ((1, "rod", COUPLER), (2, "rocker", ROCKER))
)
ENDS = (("rod", COUPLER), ("rocker", ROCKER))
DIALECTS = {
    "closing frames": (four_bar("", links=FRAMES), "spherical"),
    "loop joint": (
        four_bar(
            '<loop_joint name="P" type="revolute">'
            + "".join(
                f'<link{k} link="{link}" xyz="{length} 0 0" rpy="0 -1.5707963267948966 0"/>'
                for k, (link, length) in enumerate(ENDS, 1)
            )
            + "</loop_joint>"
        ),
        "revolute",
    ),
    "loop joint with link1 twice": (
        four_bar(
            '<loop_joint name="P" type="spherical">'
            + "".join(f'<link1 link="{link}" xyz="{length} 0 0"/>' for link, length in ENDS)
            + "</loop_joint>"
        ),
        "spherical",
    ),
    "gazebo": (
        four_bar(
            '<gazebo><joint name="P" type="revolute"><parent>rod</parent><child>rocker</child>'
            f"<pose>{ROCKER} 0 0 0 0 0</pose><axis><xyz>0 0 1</xyz></axis></joint></gazebo>"
        ),
        "revolute",
    ),
    "gazebo, axis in the model": (
        four_bar(
            '<gazebo><joint name="P" type="hinge"><parent>rod</parent><child>rocker</child>'
            f"<pose>{ROCKER} 0 0 0.3 0.4 0.5</pose><axis><xyz>0 0 2</xyz>"
            "<use_parent_model_frame>1</use_parent_model_frame></axis></joint></gazebo>"
        ),
        "revolute",
    ),
    "drake": (
        four_bar(
            "<drake:ball_constraint>"
            '<drake:ball_constraint_body_A name="rod"/>'
            '<drake:ball_constraint_body_B name="rocker"/>'
            f'<drake:ball_constraint_p_AP value="{COUPLER} 0 0"/>'
            f'<drake:ball_constraint_p_BQ value="{ROCKER} 0 0"/></drake:ball_constraint>',
            attributes='xmlns:drake="http://drake.mit.edu"',
        ),
        "spherical",
    ),
    "urdf+": (
        four_bar(
            '<loop name="P" type="revolute"><predecessor link="rod">'
            f'<origin xyz="{COUPLER} 0 0"/></predecessor><successor link="rocker">'
            f'<origin xyz="{ROCKER} 0 0"/></successor><axis xyz="0 0 1"/></loop>'
        ),
        "revolute",
    ),
}


@pytest.mark.parametrize("dialect", DIALECTS)
def test_a_loop_in_every_dialect(dialect: str) -> None:
    text, kind = DIALECTS[dialect]
    m = cc.load_urdf(text)
    assert [closure.kind for closure in m.closures] == [kind]
    assert m.closures[0].name == ("ball" if dialect == "drake" else "P")
    assert m.inputs == ("A",)  # independent="true"
    assert cc.mobility(m).mobility == 1
    s = cc.direct(m, {"A": 0.4}).raise_if_failed()
    coupler, rocker = angles(1.4)
    at_home = angles(1.0)
    expected = [0.4, coupler - 1.4 - (at_home[0] - 1.0), rocker - at_home[1]]
    assert_close(s.q, expected, 1e-12)
    assert any("independent" in note for note in m.notes)
    if dialect == "closing frames" or "gazebo" in dialect:
        assert any("'rod'" in note or "closing_P_1" in note for note in m.notes)


@pytest.mark.parametrize("dialect", DIALECTS)
def test_written_as_urdf_the_rest_of_the_file_is_kept(dialect: str) -> None:
    """Each loop is said once, as <constraint>; elements of other programs stay."""
    text = DIALECTS[dialect][0].replace("</robot>", '<gazebo reference="rod"/><camera/></robot>')
    m = cc.load_urdf(text)
    written, _ = cc.export(m, "urdf")
    again = cc.load_urdf(written)
    assert written.count("<constraint") == 1
    assert '<gazebo reference="rod"/>' in written
    assert "<camera/>" in written
    for word in ("loop_joint", "<loop ", "ball_constraint_body", "independent"):
        assert word not in written
    assert [(c.name, c.kind) for c in again.closures] == [(c.name, c.kind) for c in m.closures]
    assert again.inputs == m.inputs
    assert_close(again.home, m.home, 1e-12)


def test_lines_of_a_loop_are_those_of_its_own_element() -> None:
    text = four_bar('\n\n<loop_joint name="P" type="spherical"><link1 link="rod"/>'
                    '<link2 link="rokcer"/></loop_joint>')  # fmt: skip
    line = text[: text.index("<loop_joint")].count("\n") + 1
    with pytest.raises(DescriptionError, match="did you mean 'rocker'") as caught:
        read(text)
    assert caught.value.line == line


REFUSED = {
    "one link": ('<loop_joint name="P" type="revolute"><link1 link="rod"/></loop_joint>',
                 "needs two links"),
    "loop joint type": ('<loop_joint type="hinge"><link1 link="rod"/><link2 link="rocker"/>'
                        "</loop_joint>", "unknown type of a loop joint 'hinge'"),
    "gazebo type": ('<gazebo><joint name="P" type="gearbox"/></gazebo>', "of a loop joint"),
    "gazebo link": ('<gazebo><joint name="P" type="ball"><parent>rod</parent><child>rokcer</child>'
                    "</joint></gazebo>", "did you mean 'rocker'"),
    "gazebo axis": ('<gazebo><joint name="P" type="revolute"><parent>rod</parent>'
                    "<child>rocker</child></joint></gazebo>", "the axis is missing"),
    "loop without end": ('<loop name="P" type="revolute"><predecessor link="rod"/></loop>',
                         "<successor> is missing"),
    "coupling of a link and itself": (
        '<coupling name="c"><predecessor link="rod"/><successor link="rod"/><ratio value="2"/>'
        "</coupling>", "it ties 0 joints"),
    "ratio of zero": (
        '<coupling name="c"><predecessor link="rod"/><successor link="rocker"/><ratio value="0"/>'
        "</coupling>", "would hold the successor still"),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_a_loop_that_cannot_be_read_is_refused(case: str) -> None:
    loop, phrase = REFUSED[case]
    with pytest.raises(DescriptionError, match=phrase):
        read(four_bar(loop))


def test_a_frame_without_partner_is_noted() -> None:
    text = four_bar("", links=FRAMES.replace("closing_P_2", "closing_Q_2"))
    assert sum("has no partner" in note for note in read(text).notes) == 2


def test_a_bushing_is_noted() -> None:
    text = four_bar("<drake:linear_bushing_rpy/>", attributes='xmlns:drake="http://drake.mit.edu"')
    assert any("a bushing is a spring" in note for note in read(text).notes)


def test_couplings_sum_along_both_ways() -> None:
    """Ratio times (A + B), the way to the rod, is the rocker's angle."""
    text = four_bar(
        '<coupling name="belt"><predecessor link="rod"/><successor link="rocker"/>'
        '<ratio value="-0.5"/></coupling>'
    )
    m = cc.load_urdf(text)
    (belt,) = m.closures
    assert (belt.kind, belt.name, {belt.follower, *belt.leaders}) == (
        "linear", "belt", {"A", "B", "D"},
    )  # fmt: skip
    q = np.array([0.3, 0.5, -0.4])
    assert_close(cc.residual(m, q), [0.0], 1e-15)


JOINTS = {  # of several freedoms: their rows when cut, and the freedoms that they leave
    "planar": 3,
    "ball": 3,
    "spherical": 3,
    "universal": 2,
    "cylindrical": 2,
    "screw": 1,
}


@pytest.mark.parametrize("kind", JOINTS)
def test_joints_of_several_freedoms_in_the_tree(kind: str) -> None:
    inner = '<screw_thread_pitch value="0.01"/>' if kind == "screw" else ""
    m = cc.load_urdf(
        f'<robot name="r"><link name="a"/><link name="b"/><joint name="j" type="{kind}">'
        f'<parent link="a"/><child link="b"/><origin xyz="1 2 3"/><axis xyz="0 0 2"/>{inner}'
        "</joint></robot>"
    )
    assert cc.mobility(m).mobility == JOINTS[kind]
    assert_close(m.point(m.home, "b"), [1.0, 2.0, 3.0], 1e-15)
    assert any("'j'" in note for note in m.notes)
    if kind == "screw":
        turned = cc.close(m, fixed={"j_turn": math.pi}).raise_if_failed().q
        assert_close(m.point(turned, "b"), [1.0, 2.0, 3.005], 1e-12)


def test_missing_loops_are_asked_for() -> None:
    assert any("are loops missing?" in note for note in cc.load_urdf(four_bar("")).notes)
    mimic = four_bar("").replace("</joint>", '<mimic joint="D"/></joint>', 1)
    assert any("do they stand for loops" in note for note in cc.load_urdf(mimic).notes)
    closed = cc.load_urdf(DIALECTS["urdf+"][0])
    assert not any("missing" in note for note in closed.notes)
