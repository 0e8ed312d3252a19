"""Whatever a description says, it is loaded and answers, or it is refused by name.

The same tests are the target of ``make fuzz``, which goes on for as long as it is let.
"""

from __future__ import annotations

import contextlib
import math

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from mutations import DOOR, FOUR_BAR, mutated

import closedchain as cc
from closedchain.robots.viewer import static_page


def quick(examples: int) -> settings:
    """The same examples in every run of the suite; ``make fuzz`` looks for others."""
    slow = [HealthCheck.too_slow]
    return settings(
        max_examples=examples, deadline=None, derandomize=True, suppress_health_check=slow
    )


LAST = [""]
"""The description that was looked at last, for whoever looks for long."""


def loaded(text: str) -> cc.Mechanism | None:
    """The mechanism, or None where it was refused as it should be."""
    LAST[0] = text
    try:
        return cc.load_urdf(text, xacro=False)
    except cc.ClosedChainError as error:
        refused = error
    assert len(str(refused)) > 20
    if isinstance(refused, cc.DescriptionError):
        # where: by the line of an element, or by the name of the robot that does not close
        assert refused.line is not None or refused.name or "home posture of" in str(refused)
    return None


@quick(60)
@given(mutated())
@example(DOOR)
@example(DOOR.replace('xyz="0 0 1"', 'xyz="0 0 1e300"'))
@example(FOUR_BAR.replace('ixx="1"', 'ixx="1.7e308"').replace('ixz="0"', 'ixz="-1e308"'))
def test_a_description_is_loaded_or_refused_by_name(text: str) -> None:
    m = loaded(text)
    if m is None:
        return
    assert np.isfinite(m.home).all()
    gap = np.abs(cc.residual(m, m.home)).max(initial=0.0)
    if m.home_open:  # and it says so
        assert any("home is open" in note for note in m.notes)
        return
    assert gap <= max(1e-12, m.misfit)
    assert cc.mobility(m).mobility >= 0
    assert cc.loops(m).name == m.name


@quick(8)
@given(mutated())
@example(FOUR_BAR)
@example(FOUR_BAR.replace('xyz="0.9 0 0"', 'xyz="-0.0 0 0"'))  # q1 is held by the loops
def test_what_is_loaded_answers_questions(text: str) -> None:
    m = loaded(text)
    if m is None:
        return
    for question in (_kinds, _page, _forward):
        with contextlib.suppress(cc.ClosedChainError):  # any other error fails the test
            question(m)


def _kinds(m: cc.Mechanism) -> None:
    found = cc.classify(m, m.home)
    assert not math.isnan(found.sigma_direct)
    assert not math.isnan(found.sigma_inverse)


def _page(m: cc.Mechanism) -> None:
    page = static_page(m)
    assert page.count("<script") == 4
    assert page.count("</script>") == 4


def _forward(m: cc.Mechanism) -> None:
    if m.inputs:
        found = cc.direct(m, m.input_values(m.home) + 0.01)
        assert np.isfinite(found.q).all()
        assert found.converged == (found.residual <= max(1e-12, m.misfit))


@pytest.mark.parametrize("text", [DOOR, FOUR_BAR])
def test_the_originals_load(text: str) -> None:
    assert loaded(text) is not None
