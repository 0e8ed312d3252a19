"""The command ``closedchain resets``: random closed states into a file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from closedchain import _arguments as arguments
from closedchain._destinations import results_file, results_folder
from closedchain._options import Json, NoXacro, Robot, Settings, Variant, Workers
from closedchain._terminal import print_json, say, tell
from closedchain.urdf.extras import require


def resets(
    robot: Robot,
    out: Annotated[Path, typer.Option(metavar="FILE.npz|.zarr|.nc", help="File to write.")],
    n: Annotated[int, typer.Option("-n", min=1, help="Number of states.")] = 1000,
    seed: Annotated[int, typer.Option(min=0, help="The same seed gives the same states.")] = 0,
    over: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME[=LO:HI]",
            help="A coordinate that is drawn [m or rad]: an input, a joint, or x y z rx ry rz of "
            "the tip; all inputs by default.",
        ),
    ] = None,
    mode: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME",
            help="Posture of the description whose branch is meant (several may be given); home "
            "by default.",
        ),
    ] = None,
    speed: Annotated[
        float, typer.Option(help="Standard deviation of joint rates [rad/s, lengths/s].")
    ] = 1.0,
    qpos: Annotated[
        str | None,
        typer.Option(
            metavar='"JOINT JOINT ..."|all|FILE.xml',
            help="Add qpos and qvel in MuJoCo's conventions, joints in this order, or in that of "
            "an MJCF file.",
        ),
    ] = None,
    workers: Workers = None,
    settings: Settings = None,
    variant: Variant = None,
    no_xacro: NoXacro = False,
    json: Json = False,
) -> None:
    """Draw closed states at random, for simulators.

    They are within limits, with velocities that the loops allow.
    """
    import numpy as np

    import closedchain as cc
    from closedchain.analysis.forces.arranging import arranged_names

    if out.suffix not in (".npz", ".zarr", ".nc"):
        raise arguments.BadArgumentError(f"--out {out}: the name must end in .npz, .zarr or .nc")
    require("states are written as a dataset of xarray", "maps")
    mechanism = arguments.load_robot(robot, settings or (), variant, xacro=not no_xacro)
    starts = np.array([arguments.start_posture(mechanism, name) for name in mode]) if mode else None
    wanted = _ranges(over) if over else None
    joints = None if qpos is None else _order(qpos)
    columns = None if qpos is None else arranged_names(mechanism, joints)
    if out.suffix == ".zarr":  # a folder
        results_folder(out)
    else:
        results_folder(out.absolute().parent)
        results_file(out)
    found = cc.resets(mechanism, n, seed, over=wanted, start=starts, speed=speed, workers=workers)
    data = found.to_dataset()
    if columns is not None:
        positions, velocities = found.arranged(joints)
        data["qpos"] = (("state", "qpos_column"), positions)
        data["qvel"] = (("state", "qvel_column"), velocities)
        data = data.assign_coords(qpos_column=columns[0], qvel_column=columns[1])
    if out.suffix == ".npz":
        arrays: Any = {str(name): values.to_numpy() for name, values in data.variables.items()}
        np.savez(out, **arrays)
    elif out.suffix == ".nc":
        data.to_netcdf(out, engine="h5netcdf")
    else:
        data.to_zarr(out, mode="w", consolidated=False, zarr_format=2)
    if json:
        facts = {"states": len(found), "accepted": found.accepted, "residual": found.residual}
        print_json({"robot": mechanism.name, **facts, "drawn": found.names, "file": str(out)})
        return
    tell(found.text)
    say(str(out))


def _order(words: str) -> list[str] | None:
    """Joints in the order wanted; None for all."""
    if words == "all":
        return None
    if words.endswith(".xml"):
        from closedchain.urdf.formats.mjcf.joint_order import joint_order

        return list(joint_order(words))
    return words.replace(",", " ").split()


def _ranges(words: list[str]) -> dict[str, tuple[float, float] | None]:
    found: dict[str, tuple[float, float] | None] = {}
    for word in words:
        name, equals, text = word.partition("=")
        if name in found:
            raise arguments.BadArgumentError(f"--over {name} is given twice")
        parts = text.split(":")
        if equals and len(parts) != 2:
            raise arguments.BadArgumentError(f"--over {word}: expected {name}=lo:hi")
        ends = [arguments.number(part, f"--over {name}") for part in parts] if equals else []
        found[name] = (ends[0], ends[1]) if ends else None
    return found
