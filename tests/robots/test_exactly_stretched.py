"""Sizes with which a leg just reaches at home: a singular posture, however they round."""

import numpy as np
import pytest

import closedchain as cc


@pytest.mark.parametrize("name", ["eclipse", "eclipse2"])
def test_links_that_just_span_the_gap(name: str) -> None:
    """In binary, 0.4 - 0.1 is more than 0.3 by 6e-17."""
    assert 0.4 - 0.1 > 0.3
    m = cc.load(name, r_g=0.4, a=0.1, r=0.3)
    assert np.abs(cc.residual(m, m.home)).max() < 1e-12
    assert {"direct", "inverse"} <= cc.classify(m, m.home).kinds
    with pytest.raises(cc.DescriptionError, match=r"out of reach.*must be at least \|r_g - a\|"):
        cc.load(name, r_g=0.4, a=0.1, r=0.3 - 1e-9)


def test_rods_that_lie_level() -> None:
    m = cc.load("linear_delta", a=0.4, c=0.1, b=0.3, home="0 0 -0.4")
    assert np.abs(cc.residual(m, m.home)).max() < 1e-12
    assert {"direct", "inverse"} & cc.classify(m, m.home).kinds
    with pytest.raises(cc.DescriptionError, match=r"would need rods b of at least 0\.3 m"):
        cc.load("linear_delta", a=0.4, c=0.1, b=0.3 - 1e-9, home="0 0 -0.4")
