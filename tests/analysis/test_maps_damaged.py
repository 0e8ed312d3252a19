"""The folder of a saved map is input: what is damaged or gone is never believed."""

from __future__ import annotations

import random
import shutil
from pathlib import Path

import pytest
import xarray as xr
from stored_maps import ask, whole

import closedchain as cc

HOW = ("truncated", "flipped", "emptied", "deleted")


def damage(path: Path, how: str, chance: random.Random) -> None:
    content = bytearray(path.read_bytes())
    if how == "deleted":
        path.unlink()
        return
    if how == "emptied":
        content = bytearray()
    elif how == "truncated":
        content = content[: chance.randrange(len(content))]
    else:
        content[chance.randrange(len(content))] ^= 1 << chance.randrange(8)
    path.write_bytes(content)


def refused_or_right(store: Path) -> bool:
    """Whether a store is refused by name; if not, the map is the right one."""
    try:
        found = ask(save=store).load()
    except cc.ClosureError as error:
        message = str(error)
    else:
        xr.testing.assert_equal(found, whole())
        return False
    assert str(store) in message
    assert "delete" in message or "another name" in message
    return True


@pytest.mark.slow
@pytest.mark.parametrize("how", HOW)
def test_a_damaged_store_is_never_believed(stopped: Path, tmp_path: Path, how: str) -> None:
    """A file of each kind: recomputed where that can be, else refused."""
    chance = random.Random(HOW.index(how))
    kinds = (
        *("zarr.json", "status/zarr.json", "journal/state.json", "journal/list.txt"),
        *("journal/branch-*/*.find", "journal/sums/status/*", "status/c/*/*", "q/c/*/*/*"),
    )
    refused = 0
    for i, kind in enumerate(kinds):
        name = chance.choice(sorted(stopped.glob(kind))).relative_to(stopped)
        store = Path(shutil.copytree(stopped, tmp_path / f"{i}.zarr"))
        damage(store / name, how, chance)
        refused += refused_or_right(store)
        shutil.rmtree(store)
    assert refused > len(kinds) / 2


@pytest.mark.parametrize("how", HOW)
def test_a_damaged_chunk_of_a_complete_map_is_refused(
    ready: Path, tmp_path: Path, how: str
) -> None:
    chance = random.Random(10 + HOW.index(how))
    chunks = sorted(
        p.relative_to(ready) for p in ready.rglob("*") if "c" in p.parts and p.is_file()
    )
    assert len(chunks) > 30
    store = Path(shutil.copytree(ready, tmp_path / "map.zarr"))
    for name in chance.sample(chunks, 8):
        damage(store / name, how, chance)
        assert refused_or_right(store), name
        shutil.copy(ready / name, store / name)
    xr.testing.assert_identical(ask(save=store).load(), whole())


@pytest.mark.parametrize("folder", ["status", "journal", "journal/sums", "journal/branch-1", "q"])
def test_folders_that_are_gone_are_missed(store: Path, folder: str) -> None:
    found = [p.name for p in (store / "journal").iterdir()]
    if not (store / folder).exists():
        (folder,) = (f"journal/{name}" for name in found if name.startswith("branch-"))
    shutil.rmtree(store / folder)
    assert refused_or_right(store)
