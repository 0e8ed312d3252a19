"""A transmission over a grid of joint positions, as an xarray Dataset and as CSV."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from closedchain.analysis.forces.motor_limits import TOGGLE, effort_limits, speed_limits, toggle
from closedchain.analysis.forces.motor_map import Transmission
from closedchain.closure.given import range_of, whole_number
from closedchain.urdf.errors import ClosureError, known_names
from closedchain.urdf.extras import require

if TYPE_CHECKING:
    import xarray as xr

SPAN = 0.5
"""Half width of a range around home where a joint has no limits [rad or characteristic lengths]."""
POINTS = {1: 201, 2: 41}
MOST = 2_000_000


def transmission_table(
    of: Transmission,
    ranges: Mapping[str, tuple[float, float]] | None = None,
    points: int | Mapping[str, int] | None = None,
    efforts: np.ndarray | None = None,
    speeds: np.ndarray | None = None,
) -> xr.Dataset:
    """Tabulate a transmission over its joints.

    Parameters
    ----------
    ranges : mapping of joint name to (lower, upper), optional
        [m or rad]; the joint's limits by default, or around home where it has none.
    points : int or mapping of joint name to int, optional
        201 for one joint, 41 each for two, 15 for more by default.
    efforts : (m,) or (2, m) array, optional
        Limits of the motors' efforts [N, N m].
    speeds : (m,) array, optional
        Limits of their speeds [m/s, rad/s].

    Returns
    -------
    xarray.Dataset
        Over the joints by name: ``reached``, ``within`` (motors within their limits), ``motor``,
        ``jacobian``, ``toggle``, ``reflected_inertia``; with as many motors as joints
        ``same_side`` (det J has the sign it has at home, else a toggle lies between); with limits
        given ``effort_limits`` and ``effort_corners``, ``speed_limits``. What does not exist at a
        position is missing there (NaN).

    Raises
    ------
    ClosureError
        Unknown joints, ranges that do not rise, too many points.

    Examples
    --------
    >>> m = cc.load("d1")
    >>> t = cc.transmission(m, ["leg1_R", "leg2_R", "leg3_R"])
    >>> ranges = {name: (x - 0.01, x + 0.01) for name, x in zip(t.joint_names, t.home)}
    >>> table = cc.transmission_table(t, ranges, points=3)
    >>> table["motor"].dims, bool(table["reached"].any())
    (('leg1_R', 'leg2_R', 'leg3_R', 'motors'), True)
    """
    require("a table is an xarray dataset", "maps")
    import xarray as xr

    axes = _axes(of, ranges or {}, points)
    grid = np.stack(np.meshgrid(*axes.values(), indexing="ij"), axis=-1).reshape(-1, len(axes))
    shape = tuple(axis.size for axis in axes.values())
    found = of.solutions(grid)
    rates, good = of.rates(found.q)
    good &= found.converged
    rates = np.where(good[:, None, None], rates, np.nan)
    motors = np.where(found.converged[:, None], of.motor_positions(found.q), np.nan)
    over = tuple(of.joint_names)
    data = {
        "reached": (over, found.converged.reshape(shape)),
        "within": (over, of.within(motors).reshape(shape)),
        "motor": ((*over, "motors"), motors.reshape(*shape, -1)),
        "jacobian": ((*over, "motors", "joints"), rates.reshape(*shape, *rates.shape[1:])),
    }
    _add_measures(of, data, rates, shape, (efforts, speeds))
    units = dict(zip(of.joint_names, of.joint_units, strict=True))
    coordinates = {n: (n, axis, {"units": units[n]}) for n, axis in axes.items()}
    names = {"motors": list(of.motor_names), "joints": list(of.joint_names)}
    return xr.Dataset(
        data,
        {**coordinates, **names},
        {"mechanism": of.mechanism.name, "motor_units": list(of.motor_units)},
    )


def _add_measures(
    of: Transmission,
    data: dict[str, tuple[tuple[str, ...], np.ndarray]],
    rates: np.ndarray,
    shape: tuple[int, ...],
    limits: tuple[np.ndarray | None, np.ndarray | None],
) -> None:
    """Toggle, inertia and limits where J exists; missing elsewhere."""
    over = tuple(of.joint_names)
    k = len(over)
    there = np.isfinite(rates).all(axis=(1, 2))
    near = np.full(len(rates), np.nan)
    near[there] = toggle(rates[there] / of.units)
    data["toggle"] = (over, near.reshape(shape))
    if rates.shape[1] == k:
        side = np.linalg.det(np.nan_to_num(rates)) * np.linalg.det(of.jacobian(of.home)) > 0.0
        data["same_side"] = (over, side.reshape(shape))
    inertia = np.einsum("nmi,m,nmj->nij", rates, of.rotor_inertias, rates)
    data["reflected_inertia"] = ((*over, "joints", "joints_2"), inertia.reshape(*shape, k, k))
    efforts, speeds = limits
    regular = np.nan_to_num(near) > TOGGLE
    if efforts is not None:
        found = np.full((len(rates), 2, k), np.nan)
        found[regular] = effort_limits(rates[regular], of.low_high(efforts))
        data["effort_limits"] = ((*over, "side", "joints"), found.reshape(*shape, 2, k))
        corners = np.einsum("nmk,cm->nck", rates, of.corners(efforts))
        data["effort_corners"] = ((*over, "corner", "joints"), corners.reshape(*shape, -1, k))
    if speeds is not None:
        slow = np.full((len(rates), k), np.nan)
        slow[regular] = speed_limits(rates[regular], of.top_speeds(speeds))
        data["speed_limits"] = ((*over, "joints"), slow.reshape(*shape, k))


def csv_text(found: xr.Dataset) -> str:
    """The table as CSV: a line for each position that is reached, a column for each number."""
    joints = [str(name) for name in found["joints"].values]
    motors = [str(name) for name in found["motors"].values]
    grid = np.stack(np.meshgrid(*(found[n].values for n in joints), indexing="ij"), axis=-1)
    columns = {name: grid[..., i] for i, name in enumerate(joints)}
    columns |= {f"motor {n}": found["motor"].values[..., i] for i, n in enumerate(motors)}
    for i, motor in enumerate(motors):
        for j, joint in enumerate(joints):
            columns[f"d {motor} / d {joint}"] = found["jacobian"].values[..., i, j]
    columns["toggle"] = found["toggle"].values
    for i, joint in enumerate(joints):
        if "effort_limits" in found:
            low, high = (found["effort_limits"].values[..., side, i] for side in (0, 1))
            columns |= {f"least effort {joint}": low, f"largest effort {joint}": high}
        if "speed_limits" in found:
            columns[f"largest speed {joint}"] = found["speed_limits"].values[..., i]
    rows = np.stack(list(columns.values()), axis=-1).reshape(-1, len(columns))
    rows = rows[found["reached"].values.reshape(-1)]
    lines = [",".join("" if np.isnan(x) else f"{x:.15g}" for x in row) for row in rows]
    return "\n".join([",".join(columns), *lines]) + "\n"


def _axes(
    of: Transmission,
    ranges: Mapping[str, tuple[float, float]],
    points: int | Mapping[str, int] | None,
) -> dict[str, np.ndarray]:
    counts = points if isinstance(points, Mapping) else {}
    for name in (*ranges, *counts):
        if name not in of.joint_names:
            raise ClosureError(known_names(name, "joint", of.joint_names))
    standard = POINTS.get(len(of.joint_names), 15)
    given = points is None or isinstance(points, Mapping)
    every = standard if given else whole_number(points, "points", 1)
    axes = {}
    for name, (low, high) in of.joint_ranges(SPAN).items():
        low, high = range_of(ranges.get(name, (low, high)), name)
        if not low < high:
            raise ClosureError(f"the range of {name}, {low:g} to {high:g}, does not rise")
        count = whole_number(counts.get(name, every), f"points along {name}", 1)
        axes[name] = np.linspace(low, high, count)
    if (size := int(np.prod([axis.size for axis in axes.values()]))) > MOST or size == 0:
        raise ClosureError(f"a table of {size} positions; between 1 and {MOST} are possible")
    return axes
