"""Every wrong description is refused with the line, the culprit and what would be accepted."""

import pytest

from closedchain.urdf import DescriptionError, load_description

LIMIT = '<limit lower="-1" upper="1" effort="1" velocity="1"/>'
GOOD = f"""<robot name="r">
  <link name="base"/>
  <link name="arm"/>
  <link name="hand"/>
  <link name="tip"/>
  <joint name="j1" type="revolute">
    <origin xyz="0 0 1"/>
    <axis xyz="0 0 1"/>
    <parent link="base"/>
    <child link="arm"/>
    {LIMIT}
  </joint>
  <joint name="j2" type="floating">
    <parent link="base"/>
    <child link="hand"/>
  </joint>
  <joint name="j3" type="fixed">
    <parent link="hand"/>
    <child link="tip"/>
  </joint>
  <constraint name="c1" type="revolute">
    <parent link="arm"/>
    <parent_origin xyz="0 0 1"/>
    <parent_axis xyz="0 0 1"/>
    <child link="hand"/>
    <child_axis xyz="0 1 0"/>
  </constraint>
  <transmission name="q1">
    <joint name="j1"/>
  </transmission>
  <task base="base" tip="tip" outputs="x y rz" length="2"/>
  <group_state name="home">
    <joint name="j1" value="0.5"/>
    <joint name="j2" value="0 0 0 0 0 0 1"/>
  </group_state>
  <remark about="mobility">One.</remark>
</robot>
"""


def insert(line: int, text: str) -> str:
    """GOOD with ``text`` put in front of the line end of that line."""
    lines = GOOD.split("\n")
    lines[line - 1] += text
    return "\n".join(lines)


def swap(line: int, old: str, new: str) -> str:
    """GOOD with ``old`` replaced in that line."""
    lines = GOOD.split("\n")
    assert old in lines[line - 1], lines[line - 1]
    lines[line - 1] = lines[line - 1].replace(old, new)
    return "\n".join(lines)


def follower(mimic: str, kind: str = "revolute", name: str = "f") -> str:
    """Link and joint that follow, to be put in one line."""
    return (
        f'<link name="{name}"/><joint name="{name}" type="{kind}"><parent link="tip"/>'
        f'<child link="{name}"/>{LIMIT}{mimic}</joint>'
    )


def rod(length: str) -> str:
    """Rod from arm to hand."""
    return (
        f'<constraint name="rod" type="distance" {length}><parent link="arm"/>'
        '<child link="hand"/></constraint>'
    )


def linear(joints: str) -> str:
    """Linear relation of joints."""
    return f'<constraint name="sum" type="linear">{joints}</constraint>'


def cam(coefficients: str) -> str:
    """Polynomial relation of j1 to j3."""
    return (
        f'<constraint name="cam" type="polynomial" {coefficients}><follower joint="j1"/>'
        '<leader joint="j3"/></constraint>'
    )


CASES : dict[str, tuple[str, int, str | None, str | None, str]] = {
    # the document
    "truncated": (GOOD[:200], 9, None, None, "not well-formed"),
    "mismatched tag": (swap(9, "/>", ">"), 12, None, None, "mismatched tag"),
    "duplicate attribute": (swap(2, 'name="base"', 'name="a" name="b"'), 2, None, None,
                            "duplicate attribute"),
    "undefined entity": (swap(2, "base", "&base;"), 2, None, None, "undefined entity"),
    "two documents": (GOOD + "<robot/>", 38, None, None, "junk after document element"),
    "undeclared prefix": (insert(2, "<a:b/>"), 2, None, None, "prefix a"),
    "doctype": ("<!DOCTYPE robot>" + GOOD, 1, "!DOCTYPE", None, "DOCTYPE"),
    "processing instruction": (insert(3, "<?php 1?>"), 3, None, None, "<?php?> is not accepted"),
    "leading instruction": ("<?php 1?>" + GOOD, 1, None, None, "<?php?> is not accepted"),
    "other root": ("<sdf/>", 1, "sdf", None, "must be <robot>"),
    "robot without name": (swap(1, ' name="r"', ""), 1, "robot", None, "name is missing"),
    "robot attribute": (swap(1, "name", 'nmae="x" name'), 1, "robot", "r",
                        "unknown attribute 'nmae' (did you mean 'name'?)"),
    "empty robot": ('<robot name="r"/>', 1, "robot", "r", "there is no <link>"),
    "unknown root element": (insert(2, '<lnik name="x"/>'), 2, "lnik", "x",
                             "did you mean 'link'?"),
    "stray text": (insert(2, "hello"), 2, "robot", "r", "'hello' (after <link>)"),
    "stray text in a joint": (insert(8, "hello"), 8, "joint", "j1", "where only elements"),
    "xacro left": (insert(2, '<x:if xmlns:x="urn:xacro"/>'), 2, "x:if", None, "not expanded"),
    # links
    "link without name": (swap(3, ' name="arm"', ""), 3, "link", None, "name is missing"),
    "link with empty name": (swap(3, "arm", " "), 3, "link", " ", "name is empty"),
    "blanks around a name": (swap(3, "arm", "arm "), 3, "link", "arm ", "blanks around it"),
    "duplicate link": (insert(5, '<link name="arm"/>'), 5, "link", "arm",
                       "used twice (first at line 3)"),
    "reserved name": (insert(5, '<link name="universe"/>'), 5, "link", "universe", "taken"),
    "link child": (insert(2, '<link name="x"><vizual/></link>'), 2, "link", "x",
                   "did you mean 'visual'?"),
    "negative radius": (
        insert(2, '<link name="x"><visual><geometry><sphere radius="-1"/></geometry></visual>'
                  '</link>'), 2, "link", "x", "greater than zero"),
    "flat box": (
        insert(2, '<link name="x"><collision><geometry><box size="1 0 1"/></geometry>'
                  '</collision></link>'), 2, "link", "x", "greater than zero"),
    "no mass": (insert(2, '<link name="x"><inertial/></link>'), 2, "link", "x",
                "<mass> is missing"),
    "negative mass": (
        insert(2, '<link name="x"><inertial><mass value="-1"/><inertia ixx="1" ixy="0" ixz="0" '
                  'iyy="1" iyz="0" izz="1"/></inertial></link>'), 2, "link", "x", "negative"),
    # joints
    "unknown joint type": (swap(6, "revolute", "revolut"), 6, "joint", "j1",
                           "known: revolute, continuous, prismatic, floating, fixed"),
    "joint without type": (swap(6, ' type="revolute"', ""), 6, "joint", "j1", "type is missing"),
    "misspelt origin": (swap(7, "origin", "orgin"), 7, "joint", "j1", "did you mean 'origin'?"),
    "misspelt xyz": (swap(7, "xyz", "xzy"), 7, "joint", "j1", "did you mean 'xyz'?"),
    "quaternion": (swap(7, "xyz", 'quat_xyzw="0 0 0 1" xyz'), 7, "joint", "j1", "as rpy"),
    "two numbers": (swap(7, "0 0 1", "0 1"), 7, "joint", "j1", "has 2 numbers; expected 3"),
    "decimal comma": (swap(7, "0 0 1", "0 0 1,5"), 7, "joint", "j1", "decimal point"),
    "not a number": (swap(7, "0 0 1", "0 0 one"), 7, "joint", "j1", "'one' is not a number"),
    "nan": (swap(7, "0 0 1", "0 0 nan"), 7, "joint", "j1", "not finite"),
    "overflow": (swap(7, "0 0 1", "0 0 1e999"), 7, "joint", "j1", "not finite"),
    "underscore": (swap(7, "0 0 1", "0 0 1_0"), 7, "joint", "j1", "not a number"),
    "unexpanded": (swap(7, "0 0 1", "0 0 $x"), 7, "joint", "j1", "run through xacro?"),
    "zero axis": (swap(8, "0 0 1", "0 0 0"), 8, "joint", "j1", "zero length"),
    "huge axis": (swap(8, "0 0 1", "0 1e308 1.7e308"), 8, "joint", "j1", "too large"),
    "axis without xyz": (swap(8, ' xyz="0 0 1"', ""), 8, "joint", "j1", "xyz is missing"),
    "two axes": (insert(8, '<axis xyz="1 0 0"/>'), 8, "joint", "j1", "only one <axis>"),
    "no parent": (swap(9, '<parent link="base"/>', ""), 6, "joint", "j1", "<parent> is missing"),
    "parent without link": (swap(9, "link", "lnik"), 9, "joint", "j1", "did you mean 'link'?"),
    "unknown parent": (swap(9, "base", "bsae"), 6, "joint", "j1", "did you mean 'base'?"),
    "unknown child": (swap(10, "arm", "leg"), 6, "joint", "j1", "child: unknown link 'leg'"),
    "itself": (swap(10, "arm", "base"), 6, "joint", "j1", "'base' with itself"),
    "no limit": (swap(11, LIMIT, ""), 6, "joint", "j1", "needs <limit"),
    "no effort": (swap(11, ' effort="1"', ""), 11, "joint", "j1", "effort is missing"),
    "negative velocity": (swap(11, 'velocity="1"', 'velocity="-1"'), 11, "joint", "j1",
                          "must not be negative"),
    "limits in the wrong order": (swap(11, "-1", "2"), 11, "joint", "j1",
                                  "lower=2 is greater than upper=1"),
    "duplicate joint": (swap(17, "j3", "j1"), 17, "joint", "j1", "first at line 6"),
    # couplings
    "leader itself": (insert(5, follower('<mimic joint="f"/>')), 5, "joint", "f",
                      "follows itself"),
    "leader missing": (insert(5, follower("<mimic/>")), 5, "joint", "f", "joint is missing"),
    "circle": (insert(5, follower('<mimic joint="g"/>') + follower('<mimic joint="f"/>', name="g")),
               5, "joint", "f", "f -> g -> f"),
    "mimic attribute": (insert(5, follower('<mimic joint="j1" mulitplier="2"/>')), 5, "joint", "f",
                        "did you mean 'multiplier'?"),
    # the tree
    "two parents": (swap(19, "tip", "arm"), 17, "joint", "j3", "cut one of the joints"),
    "no root": (insert(5, '<joint name="j4" type="fixed"><parent link="tip"/><child link="base"/>'
                          "</joint>"), 1, "robot", "r", "there is no root"),
    "several roots": (insert(5, '<link name="lost"/>'), 5, "link", "lost",
                      "2 roots: base, lost"),
    "cycle apart": (
        insert(5, '<link name="u"/><link name="v"/><joint name="uv" type="fixed"><parent '
                  'link="u"/><child link="v"/></joint><joint name="vu" type="fixed"><parent '
                  'link="v"/><child link="u"/></joint>'), 5, "link", "u", "u, v form a cycle"),
    # constraints
    "constraint type": (swap(21, "revolute", "hinge"), 21, "constraint", "c1",
                        "known: fixed, revolute, prismatic"),
    "constraint without name": (swap(21, ' name="c1"', ""), 21, "constraint", None,
                                "name is missing"),
    "constraint attribute": (swap(21, "type", 'stiff="1" type'), 21, "constraint", "c1",
                             "unknown attribute 'stiff'"),
    "constraint child": (swap(23, "parent_origin", "parent_orign"), 23, "constraint", "c1",
                         "did you mean 'parent_origin'?"),
    "constraint without end": (swap(25, '<child link="hand"/>', ""), 21, "constraint", "c1",
                               "<child> is missing"),
    "constraint to nowhere": (swap(25, "hand", "foot"), 21, "constraint", "c1",
                              "child: unknown link 'foot'"),
    "constraint to itself": (swap(25, "hand", "arm"), 21, "constraint", "c1", "with itself"),
    "rigid ends": (swap(22, "arm", "tip"), 21, "constraint", "c1", "rigidly connected"),
    "no axis": (swap(24, '<parent_axis xyz="0 0 1"/>', ""), 21, "constraint", "c1",
                "needs <parent_axis>"),
    "axis of a sphere": (swap(21, "revolute", "spherical"), 24, "constraint", "c1",
                         "has no axis; remove <parent_axis>"),
    "axis of a weld": (swap(21, "revolute", "fixed"), 24, "constraint", "c1", "has no axis"),
    "prismatic axes": (swap(21, "revolute", "prismatic"), 26, "constraint", "c1",
                       "must be equal"),
    "universal axis": (swap(26, '<child_axis xyz="0 1 0"/>', "").replace(
        'c1" type="revolute', 'c1" type="universal'), 21, "constraint", "c1", "second hinge"),
    "zero constraint axis": (swap(26, "0 1 0", "0 0 0"), 26, "constraint", "c1", "zero length"),
    "duplicate constraint": (
        insert(5, '<constraint name="c1" type="fixed"><parent link="arm"/><child link="hand"/>'
                  "</constraint>"), 21, "constraint", "c1", "first at line 5"),
    "axis of a point": (swap(21, "revolute", "point_on_line"), 26, "constraint", "c1",
                        "has no axis on the child's side; remove <child_axis>"),
    "plane without normal": (
        insert(5, rod("").replace("distance", "in_plane")), 5, "constraint", "rod",
        "an in_plane constraint needs <parent_axis>"),
    "axis of a rod": (
        swap(21, 'type="revolute"', 'type="distance" length="1"'), 24, "constraint", "c1",
                           "has no axis; remove <parent_axis>"),
    "length of a hinge": (swap(21, "type", 'length="1" type'), 21, "constraint", "c1",
                          "unknown attribute 'length'; known: name, type"),
    "rod with no length": (insert(5, rod("")), 5, "constraint", "rod",
                           'a distance constraint needs its length [m]: length="..."'),
    "rod of length zero": (insert(5, rod('length="0"')), 5, "constraint", "rod",
                           "length=0 must be greater than zero"),
    "rod of bad length": (insert(5, rod('length="1 m"')), 5, "constraint", "rod",
                          "'m' is not a number"),
    "rod to nowhere": (insert(5, rod('length="1"').replace("hand", "hnad")), 5, "constraint",
                       "rod", "did you mean 'hand'?"),
    # relations of joint values
    "linear of one joint": (
        insert(5, linear('<joint name="j1"/>')), 5, "constraint", "sum",
        "ties two joints or more, <joint name= multiplier=>; it has 1"),
    "linear with a link": (insert(5, linear('<parent link="arm"/>')), 5, "constraint", "sum",
                           "unknown element 'parent'; known: joint"),
    "linear joint twice": (
        insert(5, linear('<joint name="j1"/><joint name="j1"/>')), 5, "joint", "j1",
        "listed twice"),
    "linear without a multiplier": (
        insert(5, linear('<joint name="j1"/><joint name="j2" multiplier="0"/>')), 5, "joint", "j2",
        "multiplier=0 leaves the joint 'j2' out"),
    "linear unknown joint": (
        insert(5, linear('<joint name="j1"/><joint name="j9"/>')), 5, "constraint", "sum",
        "unknown joint 'j9'; known: j1, j2, j3"),
    "linear floating joint": (
        insert(5, linear('<joint name="j1"/><joint name="j2"/>')), 5, "constraint", "sum",
        "the joint 'j2' is floating; a joint of a linear constraint is one of: revolute, "
        "continuous, prismatic"),
    "linear with coefficients": (
        insert(5, linear("").replace("linear", 'linear" polycoef="1')), 5, "constraint", "sum",
        "unknown attribute 'polycoef'; known: name, type, offset"),
    "polynomial without coefficients": (insert(5, cam("")), 5, "constraint", "cam",
                                        "polycoef is missing"),
    "polynomial of one number": (insert(5, cam('polycoef="1"')), 5, "constraint", "cam",
                                 "has 1 numbers; expected 2"),
    "constant polynomial": (insert(5, cam('polycoef="1 0 0"')), 5, "constraint", "cam",
                            "is constant: the follower would stand still"),
    "polynomial of itself": (insert(5, cam('polycoef="0 1"').replace("j3", "j1")), 5,
                             "constraint", "cam", "the joint 'j1' follows itself"),
    "polynomial without leader": (
        insert(5, cam('polycoef="0 1"').replace('<leader joint="j3"/>', "")), 5, "constraint",
        "cam", "the element <leader> is missing"),
    "polynomial of a fixed joint": (insert(5, cam('polycoef="0 1"')), 5, "constraint", "cam",
                                    "the joint 'j3' is fixed; a joint of a polynomial"),
    "a relation of a closure's name": (
        insert(5, cam('polycoef="0 1"').replace("cam", "c1")), 21, "constraint", "c1",
        "used twice (first at line 5)"),
    # inputs
    "input without joint": (swap(29, '<joint name="j1"/>', ""), 28, "transmission", "q1",
                            "<joint> is missing"),
    "input unknown": (swap(29, "j1", "j7"), 29, "joint", "j7", "known: j1, j2, j3"),
    "input name twice": (
        insert(5, follower("")).replace(
            "  <task", '<transmission name="q1"><joint name="f"/></transmission>\n  <task'),
        31, "transmission", "q1", "used twice"),
    "input child": (insert(29, '<jiont name="x"/>'), 29, "jiont", "x", "did you mean 'joint'?"),
    # the task
    "task tip": (swap(31, 'tip="tip"', 'tip="tpi"'), 31, "task", None, "did you mean 'tip'?"),
    "task ends": (swap(31, 'tip="tip"', 'tip="base"'), 31, "task", None, "the same link"),
    "task output": (swap(31, "rz", "rw"), 31, "task", None, "known: x, y, z, rx, ry, rz"),
    "task output twice": (swap(31, "y rz", "x"), 31, "task", None, "'x' appears twice"),
    "task without outputs": (swap(31, ' outputs="x y rz"', ""), 31, "task", None,
                             "outputs is missing; some of: x y z"),
    "task with empty outputs": (swap(31, "x y rz", ""), 31, "task", None, "outputs is empty"),
    "task length": (swap(31, 'length="2"', 'length="0"'), 31, "task", None, "greater than zero"),
    "two tasks": (insert(30, '<task base="base" tip="tip" outputs="x"/>'), 31, "task", None,
                  "only one <task>"),
    # the home posture
    "two homes": (insert(31, '<group_state name="home"/>'), 32, "group_state", "home",
                  "two home postures; the first is at line 31"),
    "home joint": (swap(33, "j1", "j8"), 33, "joint", "j8", "unknown joint 'j8'"),
    "home fixed": (swap(33, "j1", "j3"), 33, "joint", "j3", "a fixed joint has no value"),
    "home twice": (insert(33, '<joint name="j1" value="0"/>'), 33, "joint", "j1", "listed twice"),
    "home outside": (swap(33, "0.5", "1.5"), 33, "joint", "j1", "outside the limits [-1, 1]"),
    "home count": (swap(33, "0.5", "0 0"), 33, "joint", "j1", "has 2 numbers; expected 1 number"),
    "home pose": (swap(34, "0 0 1", "0 1"), 34, "joint", "j2", "has 6 numbers; expected 7"),
    "home quaternion": (swap(34, "0 0 1", "0 0 1.1"), 34, "joint", "j2", "length 1.1"),
    "home without value": (swap(33, ' value="0.5"', ""), 33, "joint", "j1", "value is missing"),
    # remarks
    "empty remark": (swap(36, "One.", " "), 36, "remark", None, "'mobility' is empty"),
    "remark about nothing": (swap(36, ' about="mobility"', ""), 36, "remark", None,
                             "about is missing"),
    "remark with an element": (swap(36, "One.", "One <b/>"), 36, "remark", None,
                               "unknown element 'b'"),
}  # fmt: skip


def test_the_text_that_the_cases_spoil_is_good():
    assert load_description(GOOD).task.length == 2.0


@pytest.mark.parametrize("case", CASES)
def test_refused(case):
    text, line, element, name, phrase = CASES[case]
    with pytest.raises(DescriptionError) as caught:
        load_description(text)
    error = caught.value
    assert phrase in str(error)
    assert (error.line, error.element, error.name) == (line, element, name)
    if name and name.strip():
        assert repr(name) in str(error)
    assert str(error).startswith(f"line {line}: ")
