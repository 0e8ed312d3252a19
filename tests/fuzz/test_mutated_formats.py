"""Whatever SDF, MJCF or URDF+ says, it is loaded, or it is refused by name."""

from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, settings
from mutations import DOOR, FOUR_BAR, PLATFORM, mutated

import closedchain as cc

FORMATS = ("sdf", "mjcf", "urdf+")


def written(kind: str) -> tuple[str, ...]:
    """Descriptions of ours in another format."""
    if kind == "mjcf":
        pytest.importorskip("mujoco")
    return tuple(cc.export(cc.load_urdf(text), kind)[0] for text in (FOUR_BAR, PLATFORM, DOOR))


@pytest.mark.parametrize("kind", FORMATS)
def test_a_file_is_loaded_or_refused(kind: str) -> None:
    originals = written(kind)

    @settings(
        max_examples=15,
        deadline=None,
        phases=[Phase.generate],
        derandomize=True,
        database=None,
        suppress_health_check=[HealthCheck.too_slow],
    )
    @given(mutated(originals))
    def one(text: str) -> None:
        try:
            m = cc.load_file(text, xacro=False)
        except cc.ClosedChainError as error:
            refused = str(error)
        else:
            assert np.isfinite(m.home).all()
            if not m.home_open:
                assert cc.mobility(m).mobility >= 0
            return
        assert len(refused) > 20

    one()


@pytest.mark.parametrize("kind", FORMATS)
@pytest.mark.parametrize("number", ["1e300", "-1e12", "nan"])
def test_huge_numbers_are_refused_whatever_the_format(kind: str, number: str) -> None:
    """In the place of the length of the crank."""
    changed, count = re.subn(r"(?<![\d.])0\.4(?=[ <\"])", number, written(kind)[0])
    assert count
    with pytest.raises(cc.DescriptionError, match=r"large|finite|[nN]a[nN]"):
        cc.load_file(changed)


def test_inputs_and_tasks_of_what_is_not_there_are_refused() -> None:
    text = written("sdf")[0]
    for old, new, words in (
        ('joint="a"', 'joint="door"', "unknown joint 'door'"),
        ('tip="tip"', 'tip="top"', "unknown link 'top'"),
    ):
        assert old in text
        with pytest.raises(cc.DescriptionError, match=words):
            cc.load_file(text.replace(old, new))
