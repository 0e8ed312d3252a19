"""Examples in docstrings of public names, and of what their fields hold, run as they say."""

import doctest
from functools import cache
from pydoc import locate

import numpy as np
import pytest

import closedchain as cc
from website.reference import parts

SLOW = ("Symbolic", "symbolic_singularities", "SingularitySet", "Comparison")
NAMES = [
    pytest.param(name, marks=pytest.mark.slow) if name.split(".")[-1].startswith(SLOW) else name
    for name in (*(f"closedchain.{name}" for name in cc.__all__), *parts())
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
    text = getattr(locate(name), "__doc__", None) or ""
    assert "\n    Examples\n    --------\n    >>> " in text, f"{name} has no example"
    example = doctest.DocTestParser().get_doctest(text, {"cc": cc, "np": np}, name, None, 0)
    told: list[str] = []
    failed, tried = doctest.DocTestRunner(verbose=False, optionflags=doctest.ELLIPSIS).run(
        example, out=told.append
    )
    assert tried
    assert not failed, "".join(told)
