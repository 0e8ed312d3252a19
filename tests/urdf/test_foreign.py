"""What belongs to other programs is read over with a sentence; slips of the pen are refused."""

from pathlib import Path

import pytest

from closedchain.urdf import DescriptionError, read

LIMIT = '<limit lower="-1" upper="1" effort="1" velocity="1"/>'


def arm(root: str = "", link: str = "", joint: str = "", limit: str = LIMIT) -> str:
    """Two links on hinges, a floating and a fixed joint, with more in root, link ``b``, joint j."""
    return f"""<robot name="arm">
  <link name="a"/><link name="b">{link}</link><link name="c"/><link name="d"/><link name="e"/>
  <joint name="j" type="revolute"><parent link="a"/><child link="b"/>{limit}{joint}</joint>
  <joint name="k" type="revolute"><parent link="b"/><child link="c"/>{LIMIT}</joint>
  <joint name="free" type="floating"><parent link="a"/><child link="d"/></joint>
  <joint name="rigid" type="fixed"><parent link="c"/><child link="e"/></joint>
  {root}
</robot>"""


def transmission(*joints: str, name: str = "t") -> str:
    listed = "".join(f'<joint name="{joint}"/>' for joint in joints)
    return f'<transmission name="{name}">{listed}</transmission>'


NOTED = {
    "element of the root": (arm("<custom><x>1</x></custom>"), "<custom> was not read"),
    "another namespace": (
        arm('<d:joint xmlns:d="urn:d" name="x"/>'), "<d:joint> was not read"),
    "element of a link": (
        arm(link="<velocity_decay/>"), "<velocity_decay> in <link 'b'> was not read"),
    "origin of a link": (arm(link='<origin xyz="0 0 0"/>'), "<origin> in <link 'b'>"),
    "element of a joint": (
        arm(joint='<joint_properties friction="0"/>'), "<joint_properties> in <joint 'j'>"),
    "numbered element": (arm(joint='<axis2 xyz="1 0 0"/>'), "<axis2> in <joint 'j'>"),
    "attribute": (
        arm(limit=LIMIT.replace("<limit", '<limit gear_velocity="1"')), "gear_velocity of <limit>"),
    "unknown shape": (
        arm(link="<visual><geometry><cone r='1'/></geometry></visual>"),
        "in <link 'b'> has no shape"),
    "no shape": (arm(link="<visual><geometry/></visual>"), "in <link 'b'> has no shape"),
    "transmission over two joints": (
        arm(transmission("j", "k")), "not taken as an input: it is over 2 joints, j, k"),
    "transmission on a fixed joint": (arm(transmission("rigid")), "the joint 'rigid' is fixed"),
    "transmission on a floating joint": (arm(transmission("free")), "the joint 'free' is floating"),
    "transmission on a follower": (
        arm(transmission("j"), joint='<mimic joint="k"/>'), "'j' follows 'k' (mimic)"),
    "second transmission": (
        arm(transmission("j") + transmission("j", name="u")),
        "<transmission 'u'> is not taken as an input: the joint 'j' is already driven"),
    "unknown leader": (
        arm(joint='<mimic joint="kk"/>'),
        "so the joint is free: unknown joint 'kk' (did you mean 'k'?)"),
    "transmission of ROS on a missing joint": (
        arm(transmission("l").replace("<joint", '<type>Simple</type><joint')),
        "there is no joint 'l'"),
    "transmission of ROS without a joint": (
        arm(transmission().replace("<transmission", '<transmission type="Simple"')),
        "it names no joint"),
    "floating leader": (arm(joint='<mimic joint="free"/>'), "the leader 'free' is floating"),
    "fixed follower": (
        arm().replace('<child link="e"/>', '<child link="e"/><mimic joint="j"/>'),
        "a fixed joint follows none"),
    "no bounds": (
        arm(limit='<limit effort="1" velocity="1"/>'), "was taken as one without bounds"),
}  # fmt: skip


@pytest.mark.parametrize("case", NOTED)
def test_noted(case: str) -> None:
    text, phrase = NOTED[case]
    plain = read(arm())
    found = read(text)
    assert any(phrase in note for note in found.notes), found.notes
    assert [j.name for j in found.joints] == [j.name for j in plain.joints]
    assert len(found.inputs) <= 1


@pytest.mark.parametrize("word", ["lmit", "limits", "limti", "linit"])
def test_slips_of_the_pen_are_refused(word: str) -> None:
    with pytest.raises(DescriptionError, match="did you mean 'limit'"):
        read(arm(joint=f"<{word}/>"))


@pytest.mark.parametrize("word", ["friction", "limit2", "lims", "dynamics_limit"])
def test_other_words_are_not_slips(word: str) -> None:
    assert f"<{word}>" in read(arm(joint=f"<{word}/>")).notes[0]


def test_exporters_files() -> None:
    """Tags of CAD exporters, transmissions of a wrist, and joints without bounds."""
    cases = Path(__file__).parents[1] / "formats" / "cases"
    tags = read((cases / "exporter_tags.urdf").read_text())
    assert len(tags.notes) == 2
    assert len(tags.joints) == 2
    wrist = read((cases / "transmissions.urdf").read_text())
    assert sum("is not taken as an input" in note for note in wrist.notes) == 2
    assert sum("a fixed joint follows none" in note for note in wrist.notes) == 1
    assert wrist.inputs == ()
    bare = read((cases / "no_bounds.urdf").read_text())
    assert len(bare.notes) == 1
    assert all(joint.upper == float("inf") for joint in bare.joints)


def test_equal_elements_make_one_sentence() -> None:
    text = arm("".join(f'<gazebo reference="{link}"/>' for link in "abc"))
    note, question = read(text).notes
    assert "are loops missing?" in question
    assert note.endswith("<gazebo> and 2 more of the kind were not read")


def test_joints_without_bounds_make_one_sentence() -> None:
    text = arm(limit='<limit effort="1" velocity="1"/>').replace(LIMIT, '<limit effort="1"/>')
    text = text.replace('<limit effort="1"/>', '<limit effort="1" velocity="1"/>')
    (note,) = (n for n in read(text).notes if "bounds" in n)
    assert "<limit> in <joint 'j'> and in 1 more have neither lower nor upper: each was" in note
