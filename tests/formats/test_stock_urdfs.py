"""The URDF files of example-robot-data: all load, but for those that Pinocchio refuses too."""

from pathlib import Path

import pinocchio as pin
import pytest

import closedchain as cc


def stock() -> list[Path]:
    """All of them; none where the package is not installed."""
    for place in pin.__path__:
        for parent in Path(place).parents:
            folder = parent / "share" / "example-robot-data" / "robots"
            if folder.is_dir():
                return sorted(folder.rglob("*.urdf"))
    return []


FILES = stock()


@pytest.mark.skipif(not FILES, reason="example-robot-data is not installed")
@pytest.mark.slow
def test_stock_urdfs_load() -> None:
    """As many freedoms as in Pinocchio, whose mimic and continuous joints count otherwise."""
    refused = []
    for file in FILES:
        try:
            m = cc.load_file(file)
        except cc.DescriptionError:
            refused.append(file)
            continue
        assert not m.home_open, file
        moving = [j for j in m.description.joints if j.type != "fixed"]
        assert m.model.njoints == 1 + len(moving)
        if not m.description.couplings:
            stock_model = pin.buildModelFromUrdf(str(file))
            assert stock_model.njoints == m.model.njoints, file
            assert stock_model.nv == m.model.nv, file
        assert all("\n" not in note for note in m.notes)
    for file in refused:
        with pytest.raises(ValueError, match="does not contain a valid URDF"):
            pin.buildModelFromUrdf(str(file))
    assert len(FILES) - len(refused) >= 60


@pytest.mark.skipif(not FILES, reason="example-robot-data is not installed")
def test_cassie_as_an_sdf_graph() -> None:
    """Each leg closes two loops by rods with balls at their ends; springs are taken as joints."""
    folder = next(f for f in FILES[0].parents if f.name == "robots")
    m = cc.load_file(folder / "cassie_description" / "robots" / "cassie_v2.sdf")
    assert sorted(c.kind for c in m.closures) == ["spherical"] * 4
    assert cc.mobility(m).mobility == 12
    assert not m.home_open
