"""The example in the docstring of every public name runs and prints what it says."""

import doctest
from functools import cache

import numpy as np
import pytest

import closedchain as cc

SLOW = {"SymbolicSingularities", "symbolic_singularities", "SingularitySet", "Comparison"}
NAMES = [
    pytest.param(name, marks=pytest.mark.slow) if name in SLOW else name for name in cc.__all__
]


@pytest.fixture(scope="module", autouse=True)
def _loaded_once() -> object:
    """Mechanisms are immutable, so examples may share them, and what takes long."""
    with pytest.MonkeyPatch.context() as patch:
        for name in ("load", "symbolic_singularities"):
            patch.setattr(cc, name, cache(getattr(cc, name)))
        yield


@pytest.mark.parametrize("name", NAMES)
def test_example_of(name: str) -> None:
    """Examples know ``cc`` and ``np``, and nothing else that they do not say."""
    text = getattr(cc, name).__doc__
    assert "\n    Examples\n    --------\n    >>> " in text, f"{name} has no example"
    example = doctest.DocTestParser().get_doctest(text, {"cc": cc, "np": np}, name, None, 0)
    told: list[str] = []
    failed, tried = doctest.DocTestRunner(verbose=False).run(example, out=told.append)
    assert tried
    assert not failed, "".join(told)
