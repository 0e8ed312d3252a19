"""Pinocchio's scratch space for one mechanism in one thread, guarded against its crashes.

Pinocchio segfaults on joint ids out of range, so ids are checked before any anchor is made; its
constraint data hold results of the last call, so one workspace must not be shared by threads.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from closedchain.closure.closures import Closure, Coupling
from closedchain.closure.rows import (
    by_columns,
    cut_drift,
    cut_rows,
    cut_values,
    fixed_drift,
    least_sense,
)
from closedchain.urdf.errors import ClosureError


class Workspace:
    """Data, anchors and row layout of a mechanism; owns every array that Pinocchio writes."""

    def __init__(self, model: pin.Model, closures: Sequence[Closure | Coupling]) -> None:
        """Create the data and the anchor models.

        Raises
        ------
        ClosureError
            A closure names a joint that the model does not have.
        """
        self.model = model
        self.data = model.createData()
        self.rows = sum(closure.rows for closure in closures)
        self.zero_v = np.zeros(model.nv)
        self.points: list[tuple[slice, pin.PointAnchorConstraintModel, Any]] = []
        self.frames: list[tuple[slice, pin.FrameAnchorConstraintModel, Any]] = []
        self.cuts: list[tuple[slice, Closure, pin.FrameAnchorConstraintModel, Any]] = []
        self.couplings: list[tuple[slice, Coupling]] = []
        start = 0
        for closure in closures:
            where = slice(start, start + closure.rows)
            start += closure.rows
            if isinstance(closure, Coupling):
                self.couplings.append((where, closure))
                continue
            self._check_joints(closure)
            if closure.kind == "spherical":
                anchor = _anchor(pin.PointAnchorConstraintModel, model, closure)
                self.points.append((where, anchor, anchor.createData()))
            elif closure.kind == "fixed":
                anchor = _anchor(pin.FrameAnchorConstraintModel, model, closure)
                self.frames.append((where, anchor, anchor.createData()))
            else:
                anchor = _anchor(pin.FrameAnchorConstraintModel, model, closure)
                self.cuts.append((where, closure, anchor, anchor.createData()))
        self.point_models = pin.StdVec_ConstraintModel()
        self.point_data = pin.StdVec_ConstraintData()
        for _, anchor, _ in self.points:
            self.point_models.append(pin.ConstraintModel(anchor))
        for wrapped in self.point_models:
            self.point_data.append(wrapped.createData())
        # the extracted views cost less per call than the wrappers they look into
        self.point_views = [
            (where, model_.extract(), data_.extract())
            for (where, _, _), model_, data_ in zip(
                self.points, self.point_models, self.point_data, strict=True
            )
        ]
        # views of the gaps that ``calc`` writes; their memory is that of ``point_data``
        self.point_gaps = [data_.constraint_position_error for _, _, data_ in self.point_views]
        self.only_points = bool(self.points) and len(self.points) == len(closures)
        self.point_rows = _as_index(
            np.concatenate(
                [np.arange(0), *(np.arange(where.start, where.stop) for where, _, _ in self.points)]
            ).astype(int)
        )

    def _check_joints(self, closure: Closure) -> None:
        for joint in (closure.joint1, closure.joint2):
            if not 0 <= joint < self.model.njoints:
                raise ClosureError(
                    f"closure {closure.describe()} names joint id {joint}; "
                    f"the model has joints 0 to {self.model.njoints - 1}"
                )

    # -- position level --------------------------------------------------------------------------

    def residual(self, q: np.ndarray) -> np.ndarray:
        """Closure residual (rows,) at ``q`` (nq,), unchecked."""
        model, data = self.model, self.data
        pin.forwardKinematics(model, data, q)
        out = self._point_residuals()
        if self.only_points:
            return out
        for where, anchor, anchor_data in self.frames:
            anchor.calc(model, data, anchor_data)
            out[where] = anchor_data.constraint_position_error
        for where, closure, anchor, anchor_data in self.cuts:
            anchor.calc(model, data, anchor_data)
            out[where] = cut_values(closure, anchor_data.c1Mc2)
        for where, coupling in self.couplings:
            out[where] = coupling.value(q)
        return out

    def evaluate(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Residual (rows,) and its exact Jacobian (rows, nv) at ``q`` (nq,), unchecked."""
        model, data = self.model, self.data
        pin.computeJointJacobians(model, data, q)
        out = self._point_residuals()
        if self.only_points:
            return out, self._point_jacobian()
        jacobian = np.zeros((self.rows, model.nv))
        if self.point_views:
            jacobian[self.point_rows] = self._point_jacobian()
        for where, anchor, anchor_data in self.frames:
            anchor.calc(model, data, anchor_data)
            out[where] = anchor_data.constraint_position_error
            gap = anchor_data.c1Mc2
            # the anchor's Jacobian is a relative twist in frame 1; the residual is log6(gap)
            to_log = pin.Jlog6(gap) @ gap.inverse().action
            jacobian[where] = to_log @ _relative(anchor, anchor_data, model, data)
        for where, closure, anchor, anchor_data in self.cuts:
            anchor.calc(model, data, anchor_data)
            out[where], wrenches = cut_rows(closure, anchor_data.c1Mc2)
            jacobian[where] = wrenches @ _relative(anchor, anchor_data, model, data)
        for where, coupling in self.couplings:
            out[where] = coupling.value(q)
            for column, slope in coupling.gradient(q):
                jacobian[where, column] += slope
        return out, jacobian

    def _point_jacobian(self) -> np.ndarray:
        """Jacobian of the rows of the spherical closures."""
        model, data = self.model, self.data
        found = pin.getConstraintsJacobian(model, data, self.point_models, self.point_data)
        return by_columns(found)

    def _point_residuals(self) -> np.ndarray:
        """Residual (rows,) with the rows of the spherical closures filled in."""
        model, data = self.model, self.data
        for _, anchor, anchor_data in self.point_views:
            anchor.calc(model, data, anchor_data)
        if self.only_points:
            return np.concatenate(self.point_gaps)
        out = np.empty(self.rows)
        if self.point_gaps:
            out[self.point_rows] = np.concatenate(self.point_gaps)
        return out

    # -- second order ----------------------------------------------------------------------------

    def drift(self, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Kdot v (rows,): second time derivative of the residual at zero acceleration."""
        model, data = self.model, self.data
        pin.forwardKinematics(model, data, q, v, self.zero_v)
        pin.computeJointJacobians(model, data, q)
        out = np.zeros(self.rows)
        for where, anchor, anchor_data in self.point_views:
            anchor.calc(model, data, anchor_data)
            out[where] = anchor_data.constraint_acceleration_error
        for where, anchor, anchor_data in self.frames:
            anchor.calc(model, data, anchor_data)
            out[where] = fixed_drift(model, data, anchor, anchor_data, v)
        for where, closure, anchor, anchor_data in self.cuts:
            anchor.calc(model, data, anchor_data)
            twist = _relative(anchor, anchor_data, model, data) @ v
            rate = anchor_data.constraint_acceleration_error
            out[where] = cut_drift(closure, anchor_data.c1Mc2, twist, rate)
        for where, coupling in self.couplings:
            out[where] = sum(bend * v[column] ** 2 for column, bend in coupling.curvature(q))
        return out

    def flipped(self, q: np.ndarray) -> list[str]:
        """Closures whose axes are opposed at ``q``: closed rows, yet the joint is mirrored."""
        pin.forwardKinematics(self.model, self.data, q)
        found = []
        for _, closure, anchor, anchor_data in self.cuts:
            anchor.calc(self.model, self.data, anchor_data)
            if least_sense(closure, anchor_data.c1Mc2) < 0.0:
                found.append(closure.describe())
        return found


def _as_index(rows: np.ndarray) -> np.ndarray | slice:
    """Return the rows as a slice where they are contiguous: assignment then makes no copy."""
    if rows.size and np.array_equal(rows, np.arange(rows[0], rows[0] + rows.size)):
        return slice(int(rows[0]), int(rows[0]) + rows.size)
    return rows


def _anchor(kind: type, model: pin.Model, closure: Closure) -> Any:
    return kind(model, closure.joint1, closure.placement1, closure.joint2, closure.placement2)


def _relative(
    anchor: pin.FrameAnchorConstraintModel, anchor_data: Any, model: pin.Model, data: pin.Data
) -> np.ndarray:
    """Jacobian (6, nv) of the twist of frame 2 against frame 1, along the axes of frame 1."""
    return by_columns(anchor.jacobian(model, data, anchor_data))
