"""The mechanism: a spanning tree in Pinocchio, its loop closures, inputs, task and home posture."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from closedchain.closure.closures import Closure, Coupling, lengths_among, slices_of
from closedchain.closure.configurations import Layout, layout_of
from closedchain.closure.coordinates import (
    bodies_of,
    joints_of_inputs,
    limits_of,
    required_inputs,
    translations_of,
    units_of_inputs,
)
from closedchain.closure.given import LARGEST_NUMBER, finite_rows, finite_vector, vector_by_name
from closedchain.closure.rigid_constraints import rigid_constraints
from closedchain.closure.showing import registered
from closedchain.closure.solve.control import CLOSED
from closedchain.closure.task_frame import TaskFrame, chosen_outputs, required_task
from closedchain.closure.workspace import Workspace
from closedchain.urdf.description import Description, ParameterValue
from closedchain.urdf.errors import ClosureError, known_names

if TYPE_CHECKING:
    from closedchain.closure.rounding.report import Rounding


@dataclass(frozen=True, eq=False)
class Mechanism:
    """A closed-chain mechanism. Immutable; functions of ``(mechanism, q)`` do the work.

    Attributes
    ----------
    name : str
    model : pin.Model
        Spanning tree; ``q`` (nq,) is its configuration, ``v`` (nv,) the tangent.
    closures : tuple of Closure and Coupling
        In the order of the rows of the residual.
    inputs : tuple of str
        Names of the actuated joints, in order.
    task : TaskFrame or None
    home : (nq,) array
        Closed to 1e-12, but for ``open_by``.
    parameters : mapping
        Parameters of the description and their values in force.
    length : float
        Characteristic length [m] that makes lengths dimensionless.
    description : Description
        What the mechanism was built from.
    named : callable, optional
        Gives the closed postures by name of a mechanism; only "home" without.
    assumed : tuple of str
        What loading assumed: rounded numbers, another home than the stated one.
    rounding : Rounding or None
        What the numbers of the description miss, if they are rounded.
    open_by : float
        Largest closure row at home [m, rad] where no closed home was found; else 0.

    Examples
    --------
    >>> m = cc.load("linear_delta")
    >>> m.inputs, m.task.outputs
    (('q1', 'q2', 'q3'), ('x', 'y', 'z'))
    >>> print(m.point(m.home, "P"))  # where the tip is at home [m]
    [ 0.   0.  -0.6]
    >>> "+--" in m.postures  # postures of the description by name
    True
    """

    name: str
    model: pin.Model
    closures: tuple[Closure | Coupling, ...]
    inputs: tuple[str, ...]
    task: TaskFrame | None
    home: np.ndarray
    parameters: Mapping[str, ParameterValue]
    length: float
    description: Description = field(repr=False)
    named: Callable[[Mechanism], Mapping[str, np.ndarray]] | None = field(default=None, repr=False)
    assumed: tuple[str, ...] = ()
    rounding: Rounding | None = None
    open_by: float = 0.0

    def __post_init__(self) -> None:
        """Write-protect the home posture and the parameters."""
        home = np.array(self.home, dtype=float)
        home.setflags(write=False)
        object.__setattr__(self, "home", home)
        object.__setattr__(self, "parameters", MappingProxyType(dict(self.parameters)))

    def __getstate__(self) -> dict[str, Any]:
        """Pickle the fields only: Pinocchio's constraint data do not pickle and are rebuilt."""
        state = {name: getattr(self, name) for name in self.__dataclass_fields__}
        return {**state, "parameters": dict(self.parameters)}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Restore the fields."""
        for name, value in state.items():
            object.__setattr__(self, name, value)
        self.__post_init__()

    def __copy__(self) -> Mechanism:
        """Share nothing mutable: nothing here is mutable, so a copy is the mechanism itself."""
        return self

    def __repr__(self) -> str:
        """One line: name, freedoms of the tree, closures, inputs."""
        return (
            f"Mechanism({self.name!r}: nq {self.model.nq}, nv {self.model.nv}, "
            f"{len(self.closures)} closures with {self.rows} rows, inputs {' '.join(self.inputs)})"
        )

    # -- sizes, columns and scales ----------------------------------------------------------------

    @cached_property
    def rows(self) -> int:
        """Number of closure rows."""
        return sum(closure.rows for closure in self.closures)

    @cached_property
    def row_slices(self) -> tuple[slice, ...]:
        """Rows of each closure in the residual."""
        return slices_of(self.closures)

    @cached_property
    def _input_joints(self) -> tuple[int, ...]:
        return joints_of_inputs(self.model, self.description, self.inputs)

    @cached_property
    def input_q(self) -> np.ndarray:
        """Index of each input in ``q``, shape (n_inputs,)."""
        return np.array([self.model.idx_qs[j] for j in self._input_joints], dtype=int)

    @cached_property
    def input_v(self) -> np.ndarray:
        """Index of each input in ``v``, shape (n_inputs,)."""
        return np.array([self.model.idx_vs[j] for j in self._input_joints], dtype=int)

    @cached_property
    def input_units(self) -> tuple[str, ...]:
        """Unit of each input, "m" or "rad"."""
        return units_of_inputs(self.description, self.inputs)

    @cached_property
    def passive_v(self) -> np.ndarray:
        """Indices in ``v`` of everything that is no input, shape (nv - n_inputs,)."""
        return np.setdiff1d(np.arange(self.model.nv), self.input_v)

    @cached_property
    def translational(self) -> np.ndarray:
        """Which tangent coordinates are translations [m], (nv,) of bool; the others are angles."""
        return translations_of(self.model, self.description)

    @cached_property
    def column_scale(self) -> np.ndarray:
        """Unit of each tangent coordinate, (nv,): ``length`` for translations, 1 for rotations."""
        return np.where(self.translational, self.length, 1.0)

    @cached_property
    def row_scale(self) -> np.ndarray:
        """Unit of each closure row, (rows,): ``length`` for lengths, 1 for angles."""
        return np.where(lengths_among(self.closures), self.length, 1.0)

    @cached_property
    def passive_scaling(self) -> np.ndarray:
        """Factors (rows, passive) that make K in the passive columns dimensionless."""
        return np.asfortranarray(self.column_scale[self.passive_v] / self.row_scale[:, None])

    @cached_property
    def limits(self) -> tuple[np.ndarray, np.ndarray]:
        """Lower and upper limits of ``q``, (nq,) each; infinite for floating joints."""
        return limits_of(self.model)

    @property
    def notes(self) -> tuple[str, ...]:
        """What was read over in the description or assumed about it, one sentence each."""
        return (*self.description.notes, *self.assumed)

    @property
    def misfit(self) -> float:
        """What rounded numbers miss [m, rad]: redundant rows with the others closed; else 0."""
        return 0.0 if self.rounding is None else self.rounding.misfit

    @cached_property
    def known(self) -> dict[Any, Any]:
        """What was made from this mechanism once and for all, such as machine code; not pickled."""
        return {}

    # -- home -------------------------------------------------------------------------------------

    @property
    def home_open(self) -> bool:
        """Whether no closed home was found: ``home`` is there to be looked at, and to start from.

        ``cc.close`` takes other guesses; ``with_closed_home`` makes a closed posture home.
        """
        return self.open_by > 0.0

    def closed_home(self) -> np.ndarray:
        """Home (nq,), or ``ClosureError`` where it is open."""
        if self.home_open:
            raise ClosureError(
                f"this needs a closed home, and that of {self.name!r} is open by "
                f"{self.open_by:.3g}: load it with home={{joint: value, ...}} (--home) near a "
                "closed posture, or find one with cc.close(m, guess) and m.with_closed_home(q)"
            )
        return self.home

    def with_closed_home(self, q: ArrayLike) -> Mechanism:
        """Return the same mechanism with a closed posture (nq,) as home.

        Raises
        ------
        ClosureError
            Malformed ``q``, or loops that are open there.
        """
        q = self.configuration(q)
        gap = float(np.abs(self.workspace.residual(q)).max(initial=0.0))
        if gap >= CLOSED:
            raise ClosureError(f"the loops are open there by {gap:.3g}: use cc.close(m, q).q")
        return self.with_home(q, self.length)

    def with_home(self, home: np.ndarray, length: float) -> Mechanism:
        """Return the same mechanism with another home posture (nq,) and characteristic length [m].

        Both share Pinocchio's scratch space, whose size grows with the cube of the freedoms.
        """
        other = replace(self, home=home, length=length, open_by=0.0)
        other.__dict__["_local"] = self._local
        return other

    # -- named postures ---------------------------------------------------------------------------

    @cached_property
    def postures(self) -> Mapping[str, np.ndarray]:
        """Closed posture (nq,) of each name, "home" first; closed when first asked for."""
        return {"home": self.home} if self.named is None else self.named(self)

    def posture(self, name: str) -> np.ndarray:
        """Closed posture (nq,) of that name, write-protected: "home" or another of the description.

        Raises
        ------
        ClosureError
            Unknown name (lists the known ones), or loops that do not close as it states.
        """
        if name not in self.postures:
            raise ClosureError(known_names(str(name), "posture", self.postures))
        return self.postures[name]

    # -- checks of what is given ------------------------------------------------------------------

    def configuration(self, q: ArrayLike) -> np.ndarray:
        """Check a configuration: (nq,) finite numbers with unit quaternions, or what has such a q.

        Raises
        ------
        ClosureError
            Wrong shape, NaN or infinite entries, or a quaternion that is not normalised.
        """
        q = getattr(q, "q", q)  # of a solution
        return self._layout.one(q)

    def configurations(self, q: ArrayLike) -> np.ndarray:
        """Check one configuration (nq,) or many (n, nq). Raises ``ClosureError``."""
        q = getattr(q, "q", q)
        return self._layout.many(q) if np.ndim(q) == 2 else self._layout.one(q)

    def tangent(self, v: ArrayLike) -> np.ndarray:
        """Check a velocity: (nv,) finite numbers. Raises ``ClosureError``."""
        return finite_vector(v, self.model.nv, "velocity v", "nv")

    def input_vector(
        self,
        values: ArrayLike | Mapping[str, float],
        what: str,
        largest: float = LARGEST_NUMBER,
    ) -> np.ndarray:
        """Check one number per input, given in order or by name. Raises ``ClosureError``."""
        return vector_by_name(values, self.inputs, what, largest)

    def input_rows(self, values: ArrayLike, what: str) -> np.ndarray:
        """Check (n, n_inputs) finite numbers. Raises ``ClosureError``."""
        return finite_rows(values, self.inputs, what)

    @cached_property
    def _layout(self) -> Layout:
        return layout_of(self.model)

    # -- reading a posture ------------------------------------------------------------------------

    def input_values(self, q: ArrayLike) -> np.ndarray:
        """Values of the inputs (n_inputs,) [m or rad] at configuration ``q`` (nq,)."""
        return self.configuration(q)[self.input_q]

    @cached_property
    def frame_ids(self) -> dict[str, int]:
        """Pinocchio frame of every link and named point."""
        return bodies_of(self.model)

    def frame_id(self, name: str) -> int:
        """Pinocchio frame id of a link or named point. Raises ``ClosureError`` if unknown."""
        try:
            return self.frame_ids[name]
        except KeyError:
            raise ClosureError(known_names(str(name), "frame", self.frame_ids)) from None

    def pose(self, q: ArrayLike, frame: str | None = None) -> pin.SE3:
        """Pose of a frame in the world at ``q`` (nq,); the tip's where none is named.

        Raises
        ------
        ClosureError
            Bad ``q``, unknown frame, or no frame named and the mechanism has no task.
        """
        frame_id = self.frame_id(frame if frame is not None else self.required_task().tip)
        q = self.configuration(q)
        workspace = self.workspace
        pin.forwardKinematics(self.model, workspace.data, q)
        f = self.model.frames[frame_id]
        return workspace.data.oMi[f.parentJoint] * f.placement

    def point(self, q: ArrayLike, frame: str) -> np.ndarray:
        """World position (3,) [m] of the origin of a named frame at ``q`` (nq,)."""
        return np.array(self.pose(q, frame).translation)

    # -- task and inputs --------------------------------------------------------------------------

    def required_task(self) -> TaskFrame:
        """Return the task, or raise ``ClosureError`` where the description states none."""
        return required_task(self.task, self.name)

    def required_inputs(self) -> tuple[str, ...]:
        """Return the inputs, or raise ``ClosureError`` where the description states none."""
        return required_inputs(self.inputs, self.name)

    def outputs(self, outputs: str | tuple[str, ...] | list[str] | None = None) -> tuple[str, ...]:
        """Outputs of a task: those of the description, or a choice such as "x y z rx rz".

        Raises
        ------
        ClosureError
            No task, an unknown or repeated output, or none at all.
        """
        if outputs is None:
            return self.required_task().outputs
        names = chosen_outputs(outputs)
        self.required_task()
        return names

    # -- in Pinocchio's words ---------------------------------------------------------------------

    def pinocchio_constraints(self) -> tuple[pin.RigidConstraintModel, ...]:
        """Closures as rigid constraint models of Pinocchio, for its constrained dynamics.

        A ball is one of type 3D, a weld one of type 6D, a hinge two of type 3D on its axis.

        Raises
        ------
        ClosureError
            Closures of other kinds and couplings of joints, which Pinocchio's models cannot say.
        """
        return rigid_constraints(self.model, self.closures)

    # -- drawing ----------------------------------------------------------------------------------

    def show(self, q: ArrayLike | None = None, **options: Any) -> Any:
        """Page of the mechanism for a notebook: sliders move it, its loops stay closed.

        Parameters
        ----------
        q : (nq,) array, optional
            Posture to begin with; home by default.
        **options
            ``height`` [pixels], ``up``, ``overlays``, ``controls``, ``title``, ``animation``, as
            ``closedchain.robots.embedding.show``.

        Returns
        -------
        Embedded
            A notebook shows it where it is the last value of a cell; it needs no network.

        Raises
        ------
        ClosureError
            Malformed posture or options.
        """
        return registered()(self, q, **options)

    # -- Pinocchio's scratch space, one per thread ------------------------------------------------

    @cached_property
    def _local(self) -> threading.local:
        return threading.local()

    @property
    def workspace(self) -> Workspace:
        """Scratch data of this thread."""
        try:
            return self._local.workspace
        except AttributeError:
            self._local.workspace = Workspace(self.model, self.closures)
            return self._local.workspace
