"""The folder of a saved map is input: links in it, and files that somebody else wrote."""

from __future__ import annotations

import json
import os
import shutil
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from stored_maps import ask

import closedchain as cc
from closedchain.analysis.singularity.maps.folder import read_whole, write_whole


@pytest.mark.parametrize("inner", ["journal", "status", "journal/sums", "status/c", "q/zarr.json"])
def test_links_are_refused_and_not_followed(store: Path, inner: str) -> None:
    """As they stand in the store, or with what they replace moved out of it."""
    outside = store.parent / "outside"
    for folder in (outside, outside / "precious"):
        folder.mkdir()
    (outside / "precious" / "letter.txt").write_text("dear")
    moved = store.parent / "moved"
    for target in (outside, moved):
        place = store / inner
        if target == moved:
            place.unlink()
            moved.symlink_to(store.parent / "kept")
        place.rename(store.parent / "kept") if target == outside else None
        place.symlink_to(target)
        before = sorted(store.rglob("*"))
        with pytest.raises(cc.ClosureError, match=f"{inner} is a link, and a saved map holds none"):
            ask(save=store)
        assert sorted(p for p in store.rglob("*") if p.name != "lock") == [
            p for p in before if p.name != "lock"
        ]
    assert [p.name for p in outside.rglob("*")] == ["precious", "letter.txt"]
    assert (outside / "precious" / "letter.txt").read_text() == "dear"


def test_links_in_a_complete_store_are_refused(ready: Path, tmp_path: Path) -> None:
    store = Path(shutil.copytree(ready, tmp_path / "map.zarr"))
    chunk = next((store / "status" / "c").rglob("0"))
    chunk.rename(tmp_path / "elsewhere")
    chunk.symlink_to(tmp_path / "elsewhere")
    with pytest.raises(cc.ClosureError, match="is a link"):
        ask(save=store)
    chunk.unlink()
    os.mkfifo(chunk)
    with pytest.raises(cc.ClosureError, match="is neither a file nor a folder"):
        ask(save=store)


def test_a_lock_that_is_a_link_is_not_written_through(store: Path) -> None:
    (store / "lock").unlink(missing_ok=True)
    target = store.parent / "letter.txt"
    target.write_text("dear")
    (store / "lock").symlink_to(target)
    with pytest.raises(cc.ClosureError, match="cannot be saved in"):
        ask(save=store)
    assert target.read_text() == "dear"


@pytest.mark.parametrize(
    "forged",
    [
        {"stage": "../../evil"},
        {"stage": "/evil"},
        {"stage": "nowhere"},
        {"round": -1},
        {"round": "../1"},
        {"round": 1.5},
        {"seen": True},
        {"seen": None},
        {"active": [["../../evil", 0]]},
        {"active": [[0, 99]]},
        {"active": [[-1, 0]]},
        {"active": [[0]]},
        {"active": 3},
        {"listed": "all"},
    ],
    ids=str,
)
def test_forged_states_are_refused(store: Path, forged: dict[str, Any]) -> None:
    """With a checksum that is right."""
    path = store / "journal" / "state.json"
    content = read_whole(path)
    assert content is not None
    write_whole(path, json.dumps(json.loads(content) | forged).encode())
    before = sorted(store.parent.rglob("*"))
    with pytest.raises(cc.ClosureError, match=r"state\.json is damaged; delete"):
        ask(save=store)
    assert [p for p in sorted(store.parent.rglob("*")) if p.name != "lock"] == [
        p for p in before if p.name != "lock"
    ]


@pytest.mark.parametrize("forged", [{"held": 3}, {"held": {"q3": "x"}}, {"start": ["a"] * 12}, []])
def test_forged_requests_are_refused(store: Path, forged: Any) -> None:
    path = store / "zarr.json"
    kept = json.loads(path.read_text())
    request = kept["attributes"]["request"]
    kept["attributes"]["request"] = request | forged if isinstance(forged, dict) else forged
    path.write_text(json.dumps(kept))
    with pytest.raises(cc.ClosureError, match=r"holds another map: .* differs|holds no map"):
        ask(save=store)


def test_forged_lists_are_refused(store: Path) -> None:
    path = store / "journal" / "list.txt"
    for name in ("../../evil/0_0.find", "branch-0/../../evil", "aside/walls-branch-x-0_0.find"):
        kept = path.read_text()
        path.write_text(kept + f"{name} {zlib.crc32(name.encode()):08x}\n")
        with pytest.raises(cc.ClosureError, match=r"list\.txt is damaged; delete"):
            ask(save=store)
        path.write_text(kept)


def test_names_that_are_no_names_for_a_file_are_refused(tmp_path: Path) -> None:
    for name in ("../own", "a/b", ".hidden", "journal", "checksums", "__own"):
        with pytest.raises(cc.ClosureError, match=f"{name!r} is no name for a file"):
            ask(save=tmp_path / "map.zarr", measures={name: np.sum})
    assert list(tmp_path.iterdir()) == []
