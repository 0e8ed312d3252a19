"""Robots of example-robot-data by name."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError

import pytest

import closedchain as cc
from closedchain.robots import examples


def installed() -> bool:
    try:
        examples.example_files()
    except cc.DescriptionError:
        return False
    return True


needs_them = pytest.mark.skipif(not installed(), reason="example-robot-data is not installed")


@needs_them
def test_a_stock_robot_by_name() -> None:
    m = cc.load("example:panda")
    assert m.name == "panda"
    assert m.model.nv == 9
    with pytest.raises(
        cc.DescriptionError, match=r"unknown example 'pandda' \(did you mean 'panda'"
    ):
        cc.load("example:pandda")
    with pytest.raises(cc.DescriptionError, match="neither variants nor parameters"):
        cc.load("example:panda", variant="long")


def test_without_the_package_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(name: str) -> None:
        raise PackageNotFoundError(name)

    monkeypatch.setattr("importlib.metadata.distribution", missing)
    with pytest.raises(cc.DescriptionError, match=r"pip install 'closedchain\[examples\]'"):
        cc.load("example:panda")


def test_a_file_is_no_robot_of_the_catalogue() -> None:
    with pytest.raises(cc.DescriptionError, match=r"cc.load_file\('my/robot.xacro'\)"):
        cc.load("my/robot.xacro")
    with pytest.raises(cc.DescriptionError, match="unknown robot 'eclpse'"):
        cc.load("eclpse")
