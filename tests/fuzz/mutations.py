"""Descriptions of our own, and what a careless or hostile hand may make of them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from hypothesis import strategies as st
from lxml import etree

_LIMIT = '<limit lower="-3" upper="3" effort="1" velocity="1"/>'

FOUR_BAR = f"""<robot name="four_bar">
  <link name="base"/><link name="crank"><inertial><origin xyz="0.1 0 0"/><mass value="2"/>
    <inertia ixx="1" ixy="0" ixz="0" iyy="2" iyz="0" izz="3"/></inertial>
    <visual><origin rpy="0 0 0.3"/><geometry><box size="0.4 0.1 0.1"/></geometry>
      <material name="red"><color rgba="1 0 0 1"/></material></visual></link>
  <link name="coupler"/><link name="rocker"/><link name="tip"/>
  <joint name="a" type="revolute"><parent link="base"/><child link="crank"/><axis xyz="0 0 1"/>
    {_LIMIT}</joint>
  <joint name="b" type="revolute"><origin xyz="0.4 0 0"/><parent link="crank"/>
    <child link="coupler"/><axis xyz="0 0 1"/>{_LIMIT}</joint>
  <joint name="d" type="continuous"><origin xyz="1 0 0"/><parent link="base"/>
    <child link="rocker"/><axis xyz="0 0 1"/><limit effort="1" velocity="1"/></joint>
  <joint name="t" type="fixed"><origin xyz="0.5 0.2 0"/><parent link="coupler"/>
    <child link="tip"/></joint>
  <constraint name="c" type="revolute"><parent link="coupler"/><parent_origin xyz="0.9 0 0"/>
    <parent_axis xyz="0 0 1"/><child link="rocker"/><child_origin xyz="0.7 0 0"/></constraint>
  <transmission name="q1"><joint name="a"/></transmission>
  <task base="base" tip="tip" outputs="x y rz"/>
  <group_state name="home"><joint name="a" value="1.2"/><joint name="b" value="-0.6"/>
    <joint name="d" value="1.9"/></group_state>
  <remark about="size">A Grashof linkage.</remark>
</robot>"""

DOOR = """<robot name="door"><link name="wall"/><link name="leaf"/>
  <joint name="hinge" type="continuous"><parent link="wall"/><child link="leaf"/>
    <axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
  <constraint name="upper" type="revolute"><parent link="wall"/><parent_axis xyz="0 0 1"/>
    <child link="leaf"/></constraint>
  <transmission name="angle"><joint name="hinge"/></transmission>
  <task base="wall" tip="leaf" outputs="rz"/></robot>"""

PLATFORM = f"""<robot name="platform">
  <link name="base"/><link name="plate"><inertial><mass value="1"/>
    <inertia ixx="1" ixy="0.1" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
  <link name="slide"/><link name="gear"/>
  <joint name="free" type="floating"><parent link="base"/><child link="plate"/></joint>
  <joint name="rail" type="prismatic"><origin xyz="0.3 0 0" rpy="0 0.1 0"/><parent link="base"/>
    <child link="slide"/><axis xyz="0 0 1"/>{_LIMIT}</joint>
  <joint name="wheel" type="revolute"><parent link="base"/><child link="gear"/>
    <axis xyz="0 1 0"/>{_LIMIT}<mimic joint="rail" multiplier="2" offset="0.1"/></joint>
  <constraint name="ball" type="spherical"><parent link="slide"/><child link="plate"/>
    <child_origin xyz="0.3 0 0"/></constraint>
  <constraint name="rod" type="distance" length="0.5"><parent link="base"/>
    <parent_origin xyz="-0.3 0 0"/><child link="plate"/><child_origin xyz="-0.1 0 0"/></constraint>
  <constraint name="foot" type="in_plane"><parent link="base"/><parent_axis xyz="0 0 1"/>
    <child link="plate"/><child_origin xyz="0 0.2 -0.3"/></constraint>
  <constraint name="cam" type="polynomial" polycoef="0 0.5 0.1"><follower joint="wheel"/>
    <leader joint="rail"/></constraint>
  <transmission name="lift"><joint name="rail"/></transmission>
  <task base="base" tip="plate" outputs="z" length="0.3"/>
  <group_state name="home"><joint name="rail" value="0.3"/>
    <joint name="free" value="0 0 0.3 0 0 0 1"/></group_state>
</robot>"""

ORIGINALS = (FOUR_BAR, DOOR, PLATFORM)

_NUMBERS = st.one_of(
    st.sampled_from(
        (
            *("0", "-0", "1", "-1", "2", "0.5", "1.5707963267948966", "3.14159"),
            *("1e-9", "1e-12", "1e-16", "1e-300", "1e6", "1e9", "-1e9", "1e10", "1e308", "-1e308"),
            *("nan", "inf", "-inf", "1e999", "1,5", "0x10", "one"),
        )
    ),
    st.floats(-10.0, 10.0).map(repr),
    st.floats().map(repr),
)
_WORDS = st.one_of(
    st.sampled_from(
        (
            *("", " ", "universe", "q", "x", "rz", "status", "home", "base", "nan", "-", "a/b"),
            *("<!--<script>", "</script>", "../../etc/passwd", "$(find x)", "${1}", "%s{}"),
            *("\u2028", "\u202e", "name" * 40, "\U0001f916", "joint_mimic"),
        )
    ),
    st.text(st.characters(exclude_categories=("Cs", "Cc")), max_size=8),
)
_TYPES = st.sampled_from(
    (
        *("revolute", "continuous", "prismatic", "floating", "fixed", "planar", "spherical"),
        *("universal", "cylindrical", "distance", "in_plane", "point_on_line", "linear"),
        *("polynomial", "screw"),
    )
)


def _set_number(root: Any, draw: Callable[..., Any]) -> None:
    """One number of one attribute becomes another."""
    places = [
        (element, key, i)
        for element in root.iter()
        for key, value in element.attrib.items()
        for i, word in enumerate(value.split())
        if _is_number(word)
    ]
    if places:
        element, key, i = draw(st.sampled_from(places))
        words = element.get(key).split()
        words[i] = draw(_NUMBERS)
        element.set(key, " ".join(words))


def _set_word(root: Any, draw: Callable[..., Any]) -> None:
    """A word (a name, a reference, a type) becomes one of the same file, a type, or any other."""
    places = [(e, key) for e in root.iter() for key in e.attrib if not _is_number(e.get(key)[:2])]
    used = sorted({e.get(key) for e, key in places})
    if places:
        element, key = draw(st.sampled_from(places))
        element.set(key, draw(st.one_of(st.sampled_from(used), _TYPES, _WORDS)))


def _rename(root: Any, draw: Callable[..., Any]) -> None:
    """A name becomes another one everywhere, so that the description may still be whole."""
    names = sorted({e.get("name") for e in root.iter() if e.get("name")})
    if names:
        old, new = draw(st.sampled_from(names)), draw(_WORDS)
        for element in root.iter():
            for key, value in element.attrib.items():
                if value == old:
                    element.set(key, new)


def _move(root: Any, draw: Callable[..., Any]) -> None:
    """An element goes, is there twice, or stands elsewhere; an attribute goes."""
    elements = list(root.iter())
    one, two = draw(st.sampled_from(elements)), draw(st.sampled_from(elements))
    how = draw(st.sampled_from(("drop", "copy", "attribute", "lend")))
    if how == "drop" and one is not root:
        one.getparent().remove(one)
    elif how == "copy":
        two.append(etree.fromstring(etree.tostring(one, with_tail=False)))
    elif how == "attribute" and one.attrib:
        del one.attrib[draw(st.sampled_from(sorted(one.attrib)))]
    elif how == "lend" and two.attrib:
        key = draw(st.sampled_from(sorted(two.attrib)))
        one.set(key, two.get(key))


_CHANGES = (_set_number, _set_number, _set_word, _rename, _move)


@st.composite
def mutated(draw: Callable[..., Any], originals: tuple[str, ...] = ORIGINALS) -> str:
    """Text of a description with one to four changes."""
    root = etree.fromstring(draw(st.sampled_from(originals)))
    for _ in range(draw(st.integers(1, 4))):
        draw(st.sampled_from(_CHANGES))(root, draw)
    return etree.tostring(root, encoding="unicode")


def _is_number(word: str) -> bool:
    return word[:1].lstrip("-+.").isdigit() or word[1:2].isdigit()
