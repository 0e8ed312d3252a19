"""Numbers too large or too small to calculate with are refused where they stand."""

import re

import pytest

import closedchain as cc

TEXT = """<robot name="all numbers">
  <link name="base"/>
  <link name="arm">
    <inertial><origin xyz="0.1 0.2 0.3" rpy="0.4 0.5 0.6"/><mass value="2"/>
      <inertia ixx="1" ixy="0.1" ixz="0.2" iyy="1.1" iyz="0.3" izz="1.2"/></inertial>
    <visual><origin xyz="0.1 0.2 0.3" rpy="0.4 0.5 0.6"/>
      <geometry><box size="0.1 0.2 0.3"/></geometry></visual>
    <visual><geometry><cylinder radius="0.1" length="0.2"/></geometry></visual>
    <visual><geometry><capsule radius="0.1" length="0.2"/></geometry></visual>
    <visual><geometry><sphere radius="0.1"/></geometry></visual>
    <collision><geometry><mesh filename="a.stl" scale="2 3 4"/></geometry></collision>
  </link>
  <link name="slide"/>
  <link name="body"/>
  <link name="follower"/>
  <joint name="hinge" type="revolute"><origin xyz="0.1 0.2 0.3" rpy="0.4 0.5 0.6"/>
    <parent link="base"/><child link="arm"/><axis xyz="0.6 0.8 0.1"/>
    <limit lower="-3" upper="3" effort="7" velocity="8"/></joint>
  <joint name="rail" type="prismatic"><parent link="base"/><child link="slide"/>
    <axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="7" velocity="8"/></joint>
  <joint name="free" type="floating"><parent link="base"/><child link="body"/></joint>
  <joint name="gear" type="continuous"><parent link="base"/><child link="follower"/>
    <axis xyz="0 1 0"/><limit effort="7" velocity="8"/>
    <mimic joint="hinge" multiplier="2" offset="0.5"/></joint>
  <constraint name="rod" type="distance" length="0.7">
    <parent link="arm"/><parent_origin xyz="0.1 0.2 0.3" rpy="0.4 0.5 0.6"/>
    <child link="body"/><child_origin xyz="0.1 0.2 0.3" rpy="0.4 0.5 0.6"/></constraint>
  <constraint name="pin" type="universal">
    <parent link="slide"/><parent_axis xyz="0.6 0.8 0.1"/>
    <child link="body"/><child_axis xyz="0.1 0.8 0.6"/></constraint>
  <constraint name="tie" type="linear" offset="0.4">
    <joint name="hinge" multiplier="0.9"/><joint name="rail" multiplier="-2"/></constraint>
  <constraint name="cam" type="polynomial" polycoef="0.2 0.3 0.1">
    <follower joint="rail"/><leader joint="hinge"/></constraint>
  <transmission name="q"><joint name="hinge"/></transmission>
  <task base="base" tip="body" outputs="x y" length="2.5"/>
  <group_state name="home"><joint name="hinge" value="0.5"/><joint name="rail" value="0.6"/>
    <joint name="free" value="0.1 0.2 0.3 0 0 0 1"/></group_state>
  <group_state name="other"><joint name="gear" value="0.7"/></group_state>
</robot>
"""
UNLIMITED = ("lower", "upper", "effort", "velocity")  # words for "none", however large
NUMBERS = [
    (attribute, place)
    for attribute in re.finditer(r'(\w+)="([-0-9. ]+)"', TEXT)
    for place in re.finditer(r"[-0-9.]+", attribute[2])
    if attribute[1] not in UNLIMITED
]


def put(attribute: re.Match[str], place: re.Match[str], number: str) -> str:
    """TEXT with another number at a place in an attribute."""
    start = attribute.start(2)
    return TEXT[: start + place.start()] + number + TEXT[start + place.end() :]


def test_as_it_stands_it_is_read() -> None:
    description = cc.urdf.load_description(TEXT)
    assert len(description.joints) == 4
    assert len(NUMBERS) == 83


@pytest.mark.parametrize("number", ["1e308", "-1e308", "2e9", "-2e9"])
def test_every_huge_number_is_refused_with_its_line(number: str) -> None:
    for attribute, place in NUMBERS:
        line = TEXT.count("\n", 0, attribute.start()) + 1
        with pytest.raises(cc.DescriptionError, match="too large") as refused:
            cc.urdf.load_description(put(attribute, place, number))
        error = refused.value
        assert error.name is not None or error.element == "task"  # which has none
        assert f"{attribute[1]}={number!r}" in str(error)
        assert "at most 1e+0" in str(error)  # 1e9, or 1e6 for an angle
        assert error.line is not None
        assert line - 4 <= error.line <= line  # its element's, which may begin some lines above


def test_lengths_that_are_next_to_nothing_are_refused() -> None:
    for attribute, place in NUMBERS:
        if attribute[1] in ("length", "radius", "size", "scale"):
            with pytest.raises(cc.DescriptionError, match="or more") as refused:
                cc.urdf.load_description(put(attribute, place, "1e-300"))
            assert refused.value.line is not None


def test_bounds_so_large_that_they_are_none() -> None:
    """As simulators write them."""
    text = TEXT.replace('lower="-3"', 'lower="-1e16"', 1).replace('upper="3"', 'upper="1e308"', 1)
    description = cc.urdf.load_description(text)
    hinge = next(joint for joint in description.joints if joint.name == "hinge")
    assert (hinge.lower, hinge.upper) == (float("-inf"), float("inf"))
    assert [note for note in description.notes if "was read as no bound" in note] == [
        "line 18: lower=-1e+16 of <limit> was read as no bound",
        "line 18: upper=1e+308 of <limit> was read as no bound",
    ]
    for wrong in ('lower="2e9" upper="3e9"', 'lower="-3e9" upper="-2e9"'):
        with pytest.raises(cc.DescriptionError, match="leaves no value"):
            cc.urdf.load_description(TEXT.replace('lower="-3" upper="3"', wrong, 1))


def test_efforts_without_end_are_allowed() -> None:
    cc.urdf.load_description(TEXT.replace('effort="7"', 'effort="1.7e308"'))


def test_an_inertia_of_no_body_is_refused_with_its_line() -> None:
    with pytest.raises(cc.DescriptionError, match="no inertia of a body") as refused:
        cc.load_urdf(TEXT.replace('ixy="0.1"', 'ixy="5"'))
    assert (refused.value.line, refused.value.name) == (3, "arm")


def test_masses_and_inertias_at_the_ends_of_the_range_load() -> None:
    joint = """<joint name="j" type="floating"><parent link="w"/><child link="p"/></joint>"""
    for size in ("1e9", "1e-30"):
        body = f"""<link name="p"><inertial><origin xyz="{size} 0 0" rpy="0.3 0.2 0.1"/>
          <mass value="{size}"/><inertia ixx="{size}" ixy="0" ixz="0" iyy="{size}" iyz="0"
          izz="{size}"/></inertial></link>"""
        m = cc.load_urdf(f'<robot name="r"><link name="w"/>{body}{joint}</robot>')
        assert m.model.inertias[1].mass == float(size)
