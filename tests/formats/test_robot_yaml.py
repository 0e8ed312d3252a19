"""``robot.yaml`` beside a URDF."""

from pathlib import Path

import pytest
from conftest import assert_close

import closedchain as cc
from closedchain.urdf import DescriptionError
from closedchain.urdf.formats.robot_yaml import read_sidecar

FIVE_BAR = """<robot name="five_bar">
  <link name="base"/><link name="l1"/><link name="l2"/><link name="r1"/><link name="r2"/>
  <link name="loop_A"/><link name="loop_B"/>
  <joint name="La" type="continuous"><parent link="base"/><child link="l1"/>
    <origin rpy="0 0 2"/><axis xyz="0 0 1"/></joint>
  <joint name="Lb" type="continuous"><parent link="l1"/><child link="l2"/>
    <origin xyz="0.15 0 0" rpy="0 0 -1.2"/><axis xyz="0 0 1"/></joint>
  <joint name="Ra" type="continuous"><parent link="base"/><child link="r1"/>
    <origin xyz="0.2 0 0" rpy="0 0 1.1415926535897931"/><axis xyz="0 0 1"/></joint>
  <joint name="Rb" type="continuous"><parent link="r1"/><child link="r2"/>
    <origin xyz="0.15 0 0" rpy="0 0 1.2"/><axis xyz="0 0 1"/></joint>
  <joint name="A" type="fixed"><parent link="l2"/><child link="loop_A"/>
    <origin xyz="0.25 0 0"/></joint>
  <joint name="B" type="{kind}"><parent link="r2"/><child link="loop_B"/>
    <origin xyz="0.25 0 0"/><axis xyz="0 0 1"/></joint>
  <transmission name="spare"><joint name="Rb"/></transmission>
</robot>
"""
YAML = """closed_loop: [['loop_A', 'loop_B']]
type: ['{loop}']
name_mot: ['La', 'Ra']
joint_name: []
joint_type: []
"""


def files(folder: Path, kind: str, loop: str, **changes: str) -> Path:
    urdf, yaml = FIVE_BAR.format(kind=kind), YAML.format(loop=loop)
    for old, new in changes.items():
        yaml = yaml.replace(old, new)
    (folder / "robot.urdf").write_text(urdf)
    (folder / "robot.yaml").write_text(yaml)
    return folder / "robot.yaml"


@pytest.mark.parametrize(("kind", "loop", "closure"), [
    ("fixed", "3d", "spherical"),
    ("continuous", "6d", "revolute"),  # a weld behind an empty link on a hinge
])  # fmt: skip
def test_a_five_bar(tmp_path: Path, kind: str, loop: str, closure: str) -> None:
    m = cc.load_file(files(tmp_path, kind, loop))
    assert m.inputs == ("La", "Ra")
    assert [(c.name, c.kind) for c in m.closures] == [("loop", closure)]
    assert m.model.nv == 4
    assert cc.mobility(m).mobility == 2
    assert any("'spare' drives no motor" in note.replace(">", "") for note in m.notes)
    # both arms alike: the tip stays midway
    s = cc.direct(m, {"La": 0.2, "Ra": -0.2}).raise_if_failed()
    assert_close(m.point(s.q, "loop_A")[0], 0.1, 1e-12)
    if closure == "revolute":
        assert any("was read as the closure 'loop' of type revolute" in n for n in m.notes)


def test_types_of_joints(tmp_path: Path) -> None:
    changes = {"joint_name: []": "joint_name: ['Lb', 'Rb', 'Ra']",
               "joint_type: []": "joint_type: ['SPHERICAL', 'UJOINT_YZ', 'FIXED']",
               "['La', 'Ra']": "['La']"}  # fmt: skip
    m = cc.load_file(files(tmp_path, "fixed", "3d", **changes))
    kinds = {joint.name: joint.type for joint in m.description.joints}
    assert kinds["Lb"] == "floating"
    assert kinds["Rb_1"] == kinds["Rb_2"] == "continuous"
    assert kinds["Ra"] == "fixed"
    axes = {joint.name: joint.axis for joint in m.description.joints}
    assert (axes["Rb_1"], axes["Rb_2"]) == ((0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    assert cc.mobility(m).mobility == 1 + 3 + 2 - 3


def test_a_urdf_says_that_a_yaml_lies_beside_it(tmp_path: Path) -> None:
    files(tmp_path, "fixed", "3d")
    m = cc.load_file(tmp_path / "robot.urdf")
    assert any("robot.yaml beside this file says loops" in note for note in m.notes)


def test_a_joint_that_is_not_there_is_noted(tmp_path: Path) -> None:
    changes = {"joint_name: []": "joint_name: ['Lc']", "joint_type: []": "joint_type: [UJOINT_ZY]"}
    m = cc.load_file(files(tmp_path, "fixed", "3d", **changes))
    assert any("the joint_type UJOINT_ZY was not read: unknown joint 'Lc'" in n for n in m.notes)


def test_words_are_words(tmp_path: Path) -> None:
    """Lists in lists, as an attack may nest them by references, are not written out."""
    bomb = "a: &a [x, x]\nb: &b [*a, *a]\nname_mot: [*b, *b]\nclosed_loop: []\ntype: []\n"
    with pytest.raises(DescriptionError, match="name_mot must hold words only"):
        read_sidecar(bomb)


@pytest.mark.parametrize(("old", "new", "phrase"), [
    ("'loop_A'", "'loop_C'", "unknown frame 'loop_C'"),
    ("'La'", "'Lo'", "unknown joint 'Lo'"),
    ("['3d']", "['5d']", "unknown type of a loop '5d'"),
    ("['3d']", "[]", "closed_loop has 1 pairs and type 0 words"),
    ("[['loop_A', 'loop_B']]", "[['loop_A']]", "no pair of frames"),
    ("joint_type: []", "joint_type: ['HINGE']", "joint_name has 0 words"),
    ("closed_loop: [", "closed_loop: ]", "not well-formed YAML"),
])  # fmt: skip
def test_refused(tmp_path: Path, old: str, new: str, phrase: str) -> None:
    with pytest.raises(DescriptionError, match=phrase):
        cc.load_file(files(tmp_path, "fixed", "3d", **{old: new}))


def test_joint_types_are_known() -> None:
    with pytest.raises(DescriptionError, match="known: SPHERICAL, FIXED, UJOINT_XY"):
        read_sidecar("joint_name: [a]\njoint_type: [HINGE]")


def test_other_contents_are_refused(tmp_path: Path) -> None:
    with pytest.raises(DescriptionError, match="given as a file"):
        cc.load_file("closed_loop: [['a', 'b']]\ntype: ['3d']")
    (tmp_path / "alone.yaml").write_text("closed_loop: []")
    with pytest.raises(DescriptionError, match=r"no alone\.urdf and no robot\.urdf"):
        cc.load_file(tmp_path / "alone.yaml")
    for text in ("root:x:0:0:root\n", "services: [a]\n"):  # neither a robot, whatever its keys
        (tmp_path / "other").write_text(text)
        with pytest.raises(
            DescriptionError, match=r"other: this is no XML, and no robot.*<mujoco>"
        ):
            cc.load_file(tmp_path / "other")
    with pytest.raises(DescriptionError, match="<html>; known: <robot>"):
        cc.load_file("<html/>")
