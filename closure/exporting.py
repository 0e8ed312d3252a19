"""``export``: a mechanism in the words of other programs."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import numpy as np

from closedchain.closure.mechanism import Mechanism
from closedchain.urdf.description import Description
from closedchain.urdf.errors import ClosureError, DescriptionError, known_names
from closedchain.urdf.formats.writers import WRITERS


def export(
    mechanism: Mechanism, form: str, out: str | os.PathLike[str] | None = None
) -> tuple[str, tuple[str, ...]]:
    """Write a mechanism in another format.

    Parameters
    ----------
    form : str
        "urdf", "mjcf", "sdf", "urdf+" or "robot.yaml".
    out : path, optional
        File to write. Beside a ``robot.yaml`` the URDF that belongs to it is written too, under
        the same name with the ending ``.urdf``.

    Returns
    -------
    text : str
    losses : tuple of str
        One sentence for each thing that the format cannot say, or says otherwise.

    Raises
    ------
    DescriptionError
        Unknown format, something in the mechanism that it cannot be given, or a URDF that is there
        already where one is to be written beside.
    ClosureError
        Home is open.

    Examples
    --------
    >>> m = cc.load("linear_delta")
    >>> text, losses = cc.export(m, "urdf+")
    >>> text.startswith("<"), "<loop" in text
    (True, True)
    """
    if form not in WRITERS:
        raise DescriptionError(known_names(str(form), "format", WRITERS))
    mechanism.closed_home()
    description, lost = _in_force(mechanism)
    written = WRITERS[form](description)
    if out is not None:
        path = Path(out)
        for name in written.beside:
            other = path.with_suffix(Path(name).suffix)
            if other.exists():  # it may be the file that the robot was loaded from
                raise DescriptionError(
                    f"{str(other)!r}, which is to be written beside {path.name!r}, is there "
                    "already: choose another name or folder"
                )
        path.write_text(written.text, encoding="utf-8")
        for name, text in written.beside.items():
            path.with_suffix(Path(name).suffix).write_text(text, encoding="utf-8")
    return written.text, (*written.losses, *lost)


def _in_force(mechanism: Mechanism) -> tuple[Description, tuple[str, ...]]:
    """Description with the closed home and the closed named postures; those that do not close."""
    states, lost = {}, []
    for name in mechanism.description.states:
        try:
            states[name] = _values(mechanism, mechanism.posture(name))
        except ClosureError:
            lost.append(f"the posture {name!r} does not close and is not written")
    home = _values(mechanism, mechanism.home)
    return replace(mechanism.description, home=home, states=states), tuple(lost)


def _values(mechanism: Mechanism, q: np.ndarray) -> dict[str, tuple[float, ...]]:
    """Values of all joints of the tree at a configuration, as a home states them."""
    model = mechanism.model
    return {
        name: tuple(float(x) for x in q[joint.idx_q : joint.idx_q + joint.nq])
        for name, joint in list(zip(model.names, model.joints, strict=True))[1:]
    }
