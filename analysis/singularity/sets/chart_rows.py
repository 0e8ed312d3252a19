"""Rows that tie postures to the coordinates of a chart, and their derivatives by both."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from closedchain.analysis.singularity.sets.postures_at import Kinematics
from closedchain.closure.chart import Chart
from closedchain.urdf.description import OUTPUTS

TURN = 1e-6  # rad or m/length: central difference of the target pose along a coordinate

Rows = tuple[np.ndarray, np.ndarray, np.ndarray]


def chart_rows(chart: Chart, q: np.ndarray, c: np.ndarray, at: Kinematics) -> Rows:
    """Values (rows,) of the chart's rows, their derivatives by q (rows, nv) and by c (rows, k).

    Dimensionless: pinned joints, then components of the tip's pose as ``closure.task`` has them.

    Parameters
    ----------
    q, c : (nq,) and (k,) arrays, or (n, nq) and (n, k)
    at : Kinematics
        At q, with the tip where the chart prescribes outputs.
    """
    if q.ndim == 1:
        some = (at.residual, at.closures, at.tip, at.place, at.attitude)
        residual, closures, tip, place, attitude = (v[None] for v in some)
        one = Kinematics(residual, closures, tip, place, attitude)
        values, by_q, by_c = chart_rows(chart, q[None], c[None], one)
        return values[0], by_q[0], by_c[0]
    mechanism, (n, k) = chart.mechanism, c.shape
    offsets = TURN * np.diag(chart.scale)
    # the coordinates themselves, then each of them ahead, then behind
    shifts = np.concatenate([np.zeros((1, k)), offsets, -offsets])
    found = chart.prescribed((shifts[:, None] + c).reshape(-1, k))
    pins, turns, places = (v.reshape(1 + 2 * k, n, *v.shape[1:]) for v in found)
    ahead, behind = slice(1, 1 + k), slice(1 + k, None)
    unit = mechanism.column_scale[chart.pinned_v]
    values = (q[:, chart.pinned_q] - pins[0]) / unit
    by_q = np.broadcast_to(
        np.eye(mechanism.model.nv)[chart.pinned_v], (n, unit.size, mechanism.model.nv)
    )
    by_c = np.moveaxis(pins[behind] - pins[ahead], 0, -1) / unit[:, None] / (2.0 * TURN)
    if not chart.outputs:
        return values, by_q, by_c
    goal, by_twist = _goal_rows(at, turns[0], places[0], chart.outputs)
    # a twist of the target is the opposite twist of the tip
    target = np.empty((n, 6, k))
    target[:, :3] = np.moveaxis(places[ahead] - places[behind], 0, -1)
    small = turns[ahead] @ turns[behind].swapaxes(-1, -2)  # turns so small are their skew parts
    for i, (a, b) in enumerate(((2, 1), (0, 2), (1, 0))):
        target[:, 3 + i] = 0.5 * (small[..., a, b] - small[..., b, a]).T
    goal_unit = np.array([mechanism.length if name in "xyz" else 1.0 for name in chart.outputs])
    by_twist = by_twist / goal_unit[:, None]
    return (
        np.concatenate([values, goal / goal_unit], axis=1),
        np.concatenate([by_q, by_twist @ (at.tip * mechanism.column_scale)], axis=1),
        np.concatenate([by_c, by_twist @ target / (-2.0 * TURN)], axis=1),
    )


def _goal_rows(
    at: Kinematics, turn: np.ndarray, place: np.ndarray, outputs: Sequence[str]
) -> tuple[np.ndarray, np.ndarray]:
    """Rows (n, d) of a tip goal, and their derivative (n, d, 6) by the tip's twist."""
    linear = [OUTPUTS.index(name) for name in outputs if name in "xyz"]
    angular = [OUTPUTS.index(name) - 3 for name in outputs if name in OUTPUTS[3:]]
    by_twist = np.zeros((len(place), len(outputs), 6))
    by_twist[:, range(len(linear)), linear] = 1.0
    values = [(at.place - place)[:, linear]]
    first = len(linear)
    if len(angular) in (1, 3):
        relative = turn.swapaxes(1, 2) @ at.attitude
        values.append(np.array([pin.log3(one) for one in relative])[:, angular])
        derivative = np.array([pin.Jlog3(one) for one in relative]) @ at.attitude.swapaxes(1, 2)
        by_twist[:, first:, 3:] = derivative[:, angular]
    elif len(angular) == 2:
        (third,) = {0, 1, 2} - set(angular)
        axis, wanted = at.attitude[:, :, third], turn[:, :, angular].swapaxes(1, 2)
        values.append((wanted @ axis[..., None])[..., 0])
        by_twist[:, first:, 3:] = np.cross(axis[:, None], wanted)
    return np.concatenate(values, axis=1), by_twist
