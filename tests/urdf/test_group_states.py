"""Named postures in the text: every <group_state> is read, and refused as home is."""

from __future__ import annotations

import pickle
from typing import Any

import pytest

from closedchain.urdf import Description, DescriptionError, read

LIMIT = '<limit lower="-1" upper="1" effort="1" velocity="1"/>'
TEXT = f"""<robot name="r">
  <link name="base"/><link name="arm"/><link name="plate"/><link name="tool"/>
  <joint name="j" type="revolute"><parent link="base"/><child link="arm"/>{LIMIT}</joint>
  <joint name="pose" type="floating"><parent link="base"/><child link="plate"/></joint>
  <joint name="weld" type="fixed"><parent link="plate"/><child link="tool"/></joint>
  <group_state name="down/+"><joint name="j" value="-0.5"/></group_state>
  <group_state name="home" group="all"><joint name="j" value="0.5"/></group_state>
  <group_state name="++-" group="all">
    <joint name="j" value="0.25"/>
    <joint name="pose" value="1 2 3 0 0 0 1.0000001"/>
  </group_state>
  <group_state name="as home"/>
</robot>
"""


@pytest.fixture(scope="module")
def description() -> Description:
    return read(TEXT)


def test_every_state_is_read_in_document_order(description: Description) -> None:
    assert dict(description.home) == {"j": (0.5,)}
    assert list(description.states) == ["down/+", "++-", "as home"]
    assert dict(description.states["down/+"]) == {"j": (-0.5,)}
    assert dict(description.states["as home"]) == {}
    assert all("are loops missing?" in note for note in description.notes)


def test_quaternions_are_normalised(description: Description) -> None:
    assert description.states["++-"]["pose"] == (1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 1.0)


def test_states_are_read_only_and_pickle(description: Description) -> None:
    states: Any = description.states
    with pytest.raises(TypeError):
        states["new"] = {}
    with pytest.raises(TypeError):
        states["++-"]["j"] = (0.0,)
    copy = pickle.loads(pickle.dumps(description))
    assert copy == description
    assert list(copy.states) == list(states)


def test_a_text_without_states_has_none() -> None:
    found = read('<robot name="r"><link name="a"/></robot>')
    assert (dict(found.home), dict(found.states)) == ({}, {})


STATE = TEXT.count("\n", 0, TEXT.index('<group_state name="++-"')) + 1
CASES = {
    "twice": ('name="down/+"', 'name="++-"', STATE, "group_state", "++-",
              "there are two ++- postures; the first is at line 6"),
    "no name": (' name="++-"', "", STATE, "group_state", None, "name is missing"),
    "attribute": ('name="++-" group', 'name="++-" gruop', STATE, "group_state", "++-",
                  "did you mean 'group'?"),
    "element": ('<joint name="j" value="0.25"/>', '<jiont name="j"/>', STATE + 1, "jiont", "j",
                "did you mean 'joint'?"),
    "unknown joint": ('name="j" value="0.25"', 'name="k" value="0"', STATE + 1, "joint", "k",
                      "known: j, pose, weld"),
    "joint twice": ('value="0.25"/>', 'value="0"/><joint name="j" value="0"/>', STATE + 1,
                    "joint", "j", "listed twice"),
    "fixed joint": ('name="j" value="0.25"', 'name="weld" value="0"', STATE + 1, "joint", "weld",
                    "a fixed joint has no value"),
    "beyond": ('value="0.25"', 'value="1.5"', STATE + 1, "joint", "j",
               "outside the limits [-1, 1]"),
    "count": ("1 2 3 0 0 0", "1 2 3 0 0", STATE + 2, "joint", "pose",
              "has 6 numbers; expected 7"),
    "quaternion": ("1.0000001", "1.1", STATE + 2, "joint", "pose", "length 1.1"),
    "no value": (' value="0.25"', "", STATE + 1, "joint", "j", "value is missing"),
    "no number": ('value="0.25"', 'value="nan"', STATE + 1, "joint", "j", "not finite"),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_a_wrong_state_is_refused_with_line_and_element(case: str) -> None:
    old, new, line, element, name, phrase = CASES[case]
    assert TEXT.count(old) == 1
    with pytest.raises(DescriptionError) as caught:
        read(TEXT.replace(old, new))
    assert phrase in str(caught.value)
    assert (caught.value.line, caught.value.element, caught.value.name) == (line, element, name)
