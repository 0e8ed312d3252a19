import contextlib
import math
import pickle
import sys
from pathlib import Path
from xml.sax.saxutils import quoteattr

import pytest
from hypothesis import given
from hypothesis import strategies as st
from lxml import etree

import closedchain.urdf
from closedchain.urdf import (
    CLOSURE_TYPES,
    Coupling,
    Description,
    DescriptionError,
    Input,
    JointRelation,
    LoopClosure,
    Origin,
    Remark,
    Task,
    constraint_xml,
    load_description,
    read,
    read_constraint,
)
from closedchain.urdf.constraint_element import SPELLINGS
from closedchain.urdf.writing import urdf_text

LIMIT = '<limit lower="-3" upper="3" effort="1" velocity="1"/>'
FOUR_BAR = f"""<robot name="four_bar" version="1.0">
  <!-- a crank, a coupler and a rocker -->
  <material name="grey"><color rgba=".5 .5 .5 1"/></material>
  <link name="base"/>
  <link name="crank">
    <inertial>
      <origin xyz="0.1 0 0"/><mass value="2"/>
      <inertia ixx="1" ixy="0" ixz="0" iyy="2" iyz="0" izz="3"/>
    </inertial>
    <visual><geometry><cylinder radius=".01" length=".2"/></geometry></visual>
    <visual><origin rpy="0 0 1"/><geometry><box size="1 2 3"/></geometry></visual>
    <collision><geometry><sphere radius="1"/></geometry></collision>
  </link>
  <link name="rod"/>
  <link name="rocker"/>
  <link name="plate"/>
  <link name="tool"/>
  <joint name="a" type="revolute">
    <parent link="base"/><child link="crank"/><axis xyz="0 0 2"/>{LIMIT}
  </joint>
  <joint name="b" type="revolute">
    <parent link="crank"/><child link="rod"/><origin xyz="1 0 0"/><axis xyz="0 3 4"/>{LIMIT}
  </joint>
  <joint name="c" type="continuous">
    <parent link="base"/><child link="rocker"/><axis xyz="0 0 1"/>
    <mimic joint="a" multiplier="-2" offset="0.5"/>
    <dynamics damping="0.1"/>
  </joint>
  <joint name="float" type="floating"><parent link="base"/><child link="plate"/></joint>
  <joint name="rigid" type="fixed">
    <parent link="plate"/><child link="tool"/><origin xyz="0 0 1" rpy="0 0 .5"/>
    <axis xyz="0 0 0"/>
  </joint>
  <constraint name="loop" type="revolute">
    <parent link="rod"/><parent_origin xyz="1 0 0"/><parent_axis xyz="0 0 3"/>
    <child link="rocker"/><child_origin xyz="0 1 0" rpy="0 0 1"/>
  </constraint>
  <constraint name="ball" type="spherical"><parent link="rod"/><child link="plate"/></constraint>
  <transmission name="q2"><joint name="b"/></transmission>
  <transmission name="q1">
    <type>SimpleTransmission</type>
    <joint name="a"><hardwareInterface>Position</hardwareInterface></joint>
    <actuator name="m"><mechanicalReduction>50</mechanicalReduction></actuator>
  </transmission>
  <task base="base" tip="tool" outputs="x y rz" length="0.5"/>
  <group_state name="home" group="all">
    <joint name="a" value="0.25"/>
    <joint name="float" value="1 2 3 0 0 0 1.0000001"/>
  </group_state>
  <group_state name="parked" group="all"><joint name="a" value="1"/></group_state>
  <remark about="mobility" source="somebody 1999">  The paper says
     one.  </remark>
  <gazebo reference="rod"><self_collide>true</self_collide></gazebo>
</robot>
"""


@pytest.fixture(scope="module")
def four_bar() -> Description:
    return read(FOUR_BAR)


def test_reads_the_tree(four_bar):
    assert four_bar.name == "four_bar"
    assert four_bar.root == "base"
    assert [link.name for link in four_bar.links] == [
        "base", "crank", "rod", "rocker", "plate", "tool",
    ]  # fmt: skip
    crank = four_bar.links[1]
    assert crank.visuals == 2
    assert crank.line == 5
    assert crank.inertial.mass == 2.0
    assert crank.inertial.izz == 3.0
    assert crank.inertial.origin == Origin((0.1, 0.0, 0.0))
    joints = {joint.name: joint for joint in four_bar.joints}
    assert joints["a"].axis == (0.0, 0.0, 1.0)
    assert (joints["a"].lower, joints["a"].upper) == (-3.0, 3.0)
    assert joints["b"].axis == pytest.approx((0, 0.6, 0.8))
    assert joints["c"].lower == -math.inf
    assert joints["float"].type == "floating"
    assert joints["rigid"].origin == Origin((0.0, 0.0, 1.0), (0.0, 0.0, 0.5))


def test_reads_closures_couplings_inputs_and_task(four_bar):
    loop, ball = four_bar.closures
    assert loop.parent_axis == loop.child_axis == (0.0, 0.0, 1.0)
    assert loop.parent_origin.xyz == (1.0, 0.0, 0.0)
    assert loop.child_origin == Origin((0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    assert (ball.type, ball.parent, ball.child) == ("spherical", "rod", "plate")
    line = FOUR_BAR[: FOUR_BAR.index("<mimic")].count("\n") + 1
    assert four_bar.couplings == (Coupling("c", "a", -2.0, 0.5, line=line),)
    assert [(item.name, item.joint) for item in four_bar.inputs] == [("q2", "b"), ("q1", "a")]
    assert isinstance(four_bar.inputs[0], Input)
    task = Task("base", "tool", ("x", "y", "rz"), 0.5, line=four_bar.task.line)
    assert four_bar.task == task
    assert four_bar.remarks == (Remark("mobility", "The paper says one.", "somebody 1999"),)


def test_home_is_normalised(four_bar):
    assert dict(four_bar.home) == {"a": (0.25,), "float": (1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 1.0)}


def test_what_is_not_read_is_noted(four_bar):
    notes = "\n".join(four_bar.notes)
    for word in ("<gazebo>", "<type>", "<hardwareInterface>"):
        assert word in notes
    assert "material" not in notes
    assert all(note.startswith("line ") for note in four_bar.notes)


def test_dynamics_and_reductions(four_bar):
    c = next(joint for joint in four_bar.joints if joint.name == "c")
    assert (c.damping, c.friction, c.armature) == (0.1, 0.0, 0.0)
    assert [item.reduction for item in four_bar.inputs] == [1.0, 50.0]
    assert any("dynamics" in note and "'c'" in note for note in four_bar.notes)
    again = read(urdf_text(four_bar))
    assert [j.damping for j in again.joints] == [j.damping for j in four_bar.joints]
    assert [item.reduction for item in again.inputs] == [1.0, 50.0]


def test_a_description_pickles(four_bar):
    assert pickle.loads(pickle.dumps(four_bar)) == four_bar


def test_keeps_text_and_parameters():
    description = read('<robot name="r"><link name="a"/></robot>', parameters={"n": 3})
    assert description.text == '<robot name="r"><link name="a"/></robot>'
    assert dict(description.parameters) == {"n": 3}


def test_bounds_of_a_continuous_joint_are_noted():
    text = FOUR_BAR.replace("<mimic", '<limit lower="-1" upper="1" effort="1" velocity="1"/><mimic')
    description = read(text)
    assert any("continuous joint has no bounds" in note for note in description.notes)
    assert description.joints[2].upper == math.inf


def test_bounds_left_out_are_zero_as_in_urdf():
    text = FOUR_BAR.replace('lower="-3" ', "").replace('value="0.25"', 'value="0"')
    assert read(text).joints[0].lower == 0.0


def test_other_namespaces_are_noted():
    text = FOUR_BAR.replace(
        '<robot name="four_bar"',
        '<robot xmlns:x="urn:x" xmlns:xsi="urn:xsi" xsi:where="there" name="four_bar"',
    ).replace('<link name="rod"/>', '<link name="rod" x:y="1"><x:colour name="c"/></link>')
    notes = "\n".join(read(text).notes)
    assert "attribute where of <robot>" in notes
    assert "attribute y of <link>" in notes
    assert "<x:colour> in <link 'rod'>" in notes


def test_attributes_of_other_programs_are_noted():
    text = FOUR_BAR.replace('name="a" type', 'name="a" dont_collapse="true" type', 1)
    assert any("dont_collapse of <joint>" in note for note in read(text).notes)


def test_a_default_namespace_does_no_harm(four_bar):
    text = FOUR_BAR.replace("<robot ", '<robot xmlns="http://drake.mit.edu" ')
    assert read(text).joints == four_bar.joints


def test_links_joints_and_constraints_may_share_a_name():
    text = FOUR_BAR.replace('name="loop"', 'name="crank"').replace('"b"', '"rod"')
    assert read(text).closures[0].name == "crank"


def test_an_encoding_declaration_is_harmless(four_bar):
    assert read('<?xml version="1.0" encoding="utf-8"?>\n' + FOUR_BAR).home == four_bar.home


def test_a_file_keeps_its_text(tmp_path):
    file = tmp_path / "four_bar.urdf"
    text = FOUR_BAR.replace("\n", "\r\n")
    file.write_bytes(text.encode())
    description = load_description(file)
    assert description.text == text
    assert description.links[1].line == 5


def test_a_constraint_is_read_by_itself():
    element = etree.fromstring(
        '<constraint name="u" type="universal"><parent link="a"/><parent_axis xyz="1 0 0"/>'
        '<child link="b"/><child_axis xyz="0 5 0"/></constraint>'
    )
    closure = read_constraint(element)
    assert (closure.parent_axis, closure.child_axis) == ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))


coordinates = st.floats(-10, 10, allow_subnormal=False)
vectors = st.tuples(coordinates, coordinates, coordinates)
origins = st.builds(Origin, vectors, vectors)
names = st.text("abcXYZ_1<&\"'>é-", min_size=1, max_size=8)


@given(st.sampled_from(CLOSURE_TYPES), names, origins, origins, vectors, vectors)
def test_a_closure_survives_writing_and_reading(kind, name, parent, child, first, second):
    def unit(v):
        length = math.hypot(*v)
        return (0.0, 0.0, 1.0) if length < 1e-3 else tuple(x / length for x in v)

    spelling, axes = SPELLINGS[kind], {}
    first = unit(first)
    if spelling.parent_axis:
        axes["parent_axis"] = first
    if spelling.child_axis != "none":
        axes["child_axis"] = first if spelling.child_axis == "equal" else unit(second)
    sizes = tuple((size, 0.1) for size in spelling.sizes)
    closure = LoopClosure(name, kind, "a", "b", parent, child, **axes, sizes=sizes, line=1)
    assert read_constraint(etree.fromstring(constraint_xml(closure))) == closure


def test_macros_write_points_and_rods():
    found = load_description(
        """<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">
        <xacro:include filename="$(arg closedchain)/joints.xacro"/>
        <link name="base"/><link name="arm"/>
        <xacro:revolute name="a" parent="base" child="arm" axis="0 0 1"/>
        <xacro:line_closure name="slot" parent="base" child="arm" axis="1 0 0" xyz="0 1 0"/>
        <xacro:plane_closure name="table" parent="base" child="arm" normal="0 0 1"/>
        <xacro:rod_closure name="rod" parent="base" child="arm" length="${0.1 + 0.2}"/></robot>"""
    )
    assert [(c.name, c.type) for c in found.closures] == [
        ("slot", "point_on_line"),
        ("table", "in_plane"),
        ("rod", "distance"),
    ]
    slot, table, rod = found.closures
    assert (slot.parent_axis, slot.parent_origin.xyz) == ((1, 0, 0), (0, 1, 0))
    assert (table.parent_axis, table.parent_origin) == ((0, 0, 1), Origin())
    assert rod.sizes == (("length", 0.1 + 0.2),)


numbers = coordinates.filter(lambda x: x != 0.0)


@given(names, st.lists(numbers, min_size=2, max_size=4), coordinates)
def test_a_relation_survives_writing_and_reading(name, factors, offset):
    joints = tuple(f"j{i}<&" for i in range(len(factors)))
    linear = JointRelation(name, "linear", joints, tuple(factors), offset, line=1)
    assert read_constraint(etree.fromstring(constraint_xml(linear))) == linear
    cam = JointRelation(name, "polynomial", ("f", "g"), (offset, *factors), line=1)
    assert read_constraint(etree.fromstring(constraint_xml(cam))) == cam


def test_reads_points_rods_and_relations():
    found = load_description(
        """<robot name="r"><link name="a"/><link name="b"/><link name="c"/>
        <joint name="x" type="prismatic"><parent link="a"/><child link="b"/>
          <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
        <joint name="y" type="continuous"><parent link="a"/><child link="c"/></joint>
        <constraint name="slot" type="point_on_line">
          <parent link="b"/><parent_axis xyz="2 0 0"/><child link="c"/></constraint>
        <constraint name="sum" type="linear" offset="0.25">
          <joint name="x"/><joint name="y" multiplier="-2"/></constraint>
        <constraint name="plane" type="in_plane">
          <parent link="b"/><parent_axis xyz="0 0 -1"/><child link="c"/></constraint>
        <constraint name="rod" type="distance" length="0.3">
          <parent link="b"/><child link="c"/><child_origin xyz="0 0 1"/></constraint>
        <constraint name="cam" type="polynomial" polycoef="0.5 0 2">
          <follower joint="x"/><leader joint="y"/></constraint></robot>"""
    )
    slot, plane, rod = found.closures
    assert (slot.type, slot.parent_axis, slot.child_axis) == ("point_on_line", (1, 0, 0), (0, 0, 1))
    assert (plane.type, plane.parent_axis, plane.sizes) == ("in_plane", (0, 0, -1), ())
    assert (rod.type, rod.sizes, rod.child_origin.xyz) == (
        "distance", (("length", 0.3),), (0, 0, 1)
    )  # fmt: skip
    assert found.relations == (
        JointRelation("sum", "linear", ("x", "y"), (1.0, -2.0), 0.25, line=7),
        JointRelation("cam", "polynomial", ("x", "y"), (0.5, 0.0, 2.0), line=13),
    )
    assert pickle.loads(pickle.dumps(found)) == found


def test_names_with_special_characters_are_written_safely():
    closure = LoopClosure("<&\"'", "spherical", "a", "b")
    assert quoteattr(closure.name) in constraint_xml(closure)


pieces = st.sampled_from(
    ["<", ">", '"', "/", "&", "\x00", "\ud800", "\n", "nan", "1e999", "0", "-", "²", "<?x y?>",
     "<!--", "]]>", "<!DOCTYPE a>", "&amp;", "&#0;", "<a:b/>", "robot", "joint", "${1}", " "]
)  # fmt: skip
edits = st.lists(
    st.tuples(st.integers(0, len(FOUR_BAR)), st.integers(0, 12), st.one_of(pieces, st.text())),
    min_size=1,
    max_size=6,
)


def assert_read_or_refused(text: str) -> None:
    with contextlib.suppress(DescriptionError):  # any other error fails the test
        assert isinstance(read(text), Description)


@given(edits, st.integers(0, len(FOUR_BAR)), st.booleans())
def test_damaged_text_is_read_or_refused(changes, end, cut):
    text = FOUR_BAR[:end] if cut else FOUR_BAR
    for start, length, piece in changes:
        text = text[:start] + piece + text[start + length :]
    assert_read_or_refused(text)


@given(st.data())
def test_exchanged_elements_and_attributes_are_read_or_refused(data):
    root = etree.fromstring(FOUR_BAR)
    elements = [element for element in root.iter() if isinstance(element.tag, str)]
    one, two = (data.draw(st.sampled_from(elements)) for _ in range(2))
    action = data.draw(st.sampled_from(["drop", "tag", "attribute", "copy"]))
    if action == "drop" and one is not root:
        one.getparent().remove(one)
    elif action == "tag":
        one.tag = two.tag
    elif action == "attribute" and two.attrib:
        key = data.draw(st.sampled_from(sorted(two.attrib)))
        one.set(key, two.get(key))
    elif action == "copy" and not any(above is two for above in one.iterancestors()):
        one.append(etree.fromstring(etree.tostring(two, with_tail=False)))
    assert_read_or_refused(etree.tostring(root).decode())


def test_deep_nesting_is_refused():
    deep = "<gazebo>" * 100_000 + "</gazebo>" * 100_000
    with pytest.raises(DescriptionError, match="not well-formed"):
        read(f'<robot name="r"><link name="a"/>{deep}</robot>')


def test_a_long_chain_is_read():
    count = 3 * sys.getrecursionlimit()
    links = "".join(f'<link name="l{i}"/>' for i in range(count))
    joints = "".join(
        f'<joint name="j{i}" type="fixed"><parent link="l{i}"/><child link="l{i + 1}"/></joint>'
        for i in range(count - 1)
    )
    assert read(f'<robot name="r">{links}{joints}</robot>').root == "l0"


def test_the_folder_is_not_a_package_of_its_own():
    source = closedchain.urdf.__file__
    with pytest.raises(ImportError, match=r"import closedchain\.urdf"):
        exec(compile(Path(source).read_text(), source, "exec"), {"__name__": "urdf"})
