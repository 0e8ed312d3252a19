"""Shared fixtures and the one table of tolerances."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import closedchain as cc

if TYPE_CHECKING:
    from browser import Browser


Reference = Callable[[str], dict[str, Any]]
"""Reads a file of reference values by name."""


@dataclass(frozen=True)
class Tolerances:
    """What counts as equal, and why."""

    closure: float = 1e-12  # residual of a converged posture [m, rad]
    reference: float = 1e-9  # poses and points against the reference files [m, rad]
    finite_difference: float = 1e-7  # Jacobians against central differences, relative
    algebra: float = 1e-10  # two exact ways to the same number, relative
    singular: float = 1e-8  # scaled singular value that counts as zero


@pytest.fixture(scope="session")
def tol() -> Tolerances:
    return Tolerances()


@pytest.fixture(scope="session")
def d1() -> cc.Mechanism:
    return cc.load("d1")


@pytest.fixture(scope="session")
def delta() -> cc.Mechanism:
    return cc.load("linear_delta")


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    from browser import Browser

    with Browser(tmp_path_factory.mktemp("browser")) as one:
        yield one


# -- folders of saved maps, to be copied ---------------------------------------------------------


@pytest.fixture(scope="module")
def stopped(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A map's store that is not complete."""
    from stored_maps import stopped_in

    return stopped_in(tmp_path_factory.mktemp("stopped"))


@pytest.fixture(scope="module")
def ready(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A map's complete store."""
    from stored_maps import complete_in

    return complete_in(tmp_path_factory.mktemp("ready"))


@pytest.fixture
def store(stopped: Path, tmp_path: Path) -> Path:
    """A store of a test's own that is not complete."""
    return Path(shutil.copytree(stopped, tmp_path / "map.zarr"))


@pytest.fixture(scope="session")
def reference() -> Reference:
    def read(name: str) -> dict[str, Any]:
        path = Path(__file__).parent / "reference" / f"{name}.json"
        return json.loads(path.read_text())

    return read


def assert_close(actual: Any, expected: Any, atol: float, what: str = "") -> None:
    """Equal within ``atol`` everywhere, of equal shape, and finite."""
    actual, expected = np.asarray(actual, dtype=float), np.asarray(expected, dtype=float)
    assert actual.shape == expected.shape, f"{what}: shapes {actual.shape} and {expected.shape}"
    assert np.isfinite(actual).all(), f"{what}: not finite: {actual}"
    worst = float(np.abs(actual - expected).max(initial=0.0))
    assert worst <= atol, f"{what}: off by {worst:.3g}, allowed {atol:.3g}"
