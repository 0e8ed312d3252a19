"""Results that cannot be written are refused before the work, in a sentence."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, NoReturn

import pytest
from typer.testing import CliRunner

import closedchain as cc
from closedchain.analysis.survey import surveying
from closedchain.cli import app

FOLDERS = {
    "singularities": "singularities five_bar --out",
    "follow": "follow d1 --task drill --out",
    "simulate": "simulate linear_delta --out",
    "transmission": "transmission ankle --joints pitch --joints roll --out",
    "export": "export five_bar --c",
    "resets": "resets five_bar --out",
}
FILES = {
    "view": "view five_bar --html",
    "postures, page": "postures five_bar --html",
    "postures, proof": "postures five_bar --certificate",
    "export": "export five_bar --format mjcf --out",
    "resets": "resets five_bar --out",
}


@pytest.fixture(autouse=True)
def _no_work(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever takes time fails the test."""

    def worked(*args: Any, **more: Any) -> NoReturn:
        raise AssertionError("refused after the work only")

    for name in ("follow", "simulate", "transmission_table", "resets", "postures", "export_code"):
        monkeypatch.setattr(cc, name, worked)
    monkeypatch.setattr(surveying, "survey", worked)
    monkeypatch.setattr("closedchain._modes.searched_modes", worked)
    monkeypatch.setattr(cc, "export", worked)


def refused(words: str, place: Path) -> str:
    done = CliRunner().invoke(app, [*words.split(), str(place)], catch_exceptions=False)
    assert done.exit_code == 1
    assert done.stdout == ""
    (line,) = done.stderr.splitlines()
    return line


@pytest.mark.parametrize("what", FOLDERS)
def test_a_file_where_a_folder_is_wanted(what: str, tmp_path: Path) -> None:
    ending = ".zarr" if what == "resets" else ".txt"
    file = tmp_path / f"taken{ending}"
    file.write_text("mine")
    for place in (file, file / f"inner{ending}"):
        assert f"{file} is a file; results need a folder there" in refused(FOLDERS[what], place)
    assert file.read_text() == "mine"


@pytest.mark.parametrize("what", FILES)
def test_a_folder_where_a_file_is_wanted(what: str, tmp_path: Path) -> None:
    ending = ".npz" if what == "resets" else ".html"
    folder = tmp_path / f"taken{ending}"
    folder.mkdir()
    assert f"{folder} is a folder; expected the name of a file" in refused(FILES[what], folder)
    (tmp_path / "file").write_text("mine")
    inner = tmp_path / "file" / f"page{ending}"
    said = refused(FILES[what], inner)
    assert str(tmp_path / "file") in said
    assert "is a file" in said or "is no folder" in said
    if what != "resets":  # which makes the folder
        said = refused(FILES[what], tmp_path / "none" / "page.html")
        assert f"{tmp_path / 'none'} is not there: make that folder first" in said


def test_what_the_system_refuses(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Not even root can write here: the system's own words, with the name."""

    def refuse(name: str) -> Callable[..., NoReturn]:
        def mkdir(self: Path, *args: Any, **more: Any) -> NoReturn:
            raise PermissionError(13, "Permission denied", str(self))

        return mkdir

    monkeypatch.setattr(Path, "mkdir", refuse("mkdir"))
    place = tmp_path / "new"
    assert refused(FOLDERS["follow"], place) == f"closedchain: {place}: Permission denied"


def test_a_read_only_file_stays(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    page = tmp_path / "page.html"
    page.write_text("mine")
    monkeypatch.setattr("os.access", lambda path, mode, **more: mode != os.W_OK)
    assert f"{page} is there, and must not be written" in refused(FILES["view"], page)
    assert page.read_text() == "mine"
