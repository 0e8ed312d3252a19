"""A mode by name or number: postures of the description, and what ``cc.postures`` finds."""

from __future__ import annotations

import re
from collections.abc import Iterable

import numpy as np

from closedchain.closure.chart import TILTS
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.modes.all_postures import postures
from closedchain.closure.modes.result import Postures
from closedchain.urdf.description import OUTPUTS
from closedchain.urdf.errors import ClosureError, known_names

_FOUND = re.compile(r"[+-]?\d+")
"""Names that ``cc.postures`` gives: a sign and a number. A number alone counts from 0."""


def mode_posture(mechanism: Mechanism, mode: str | int, *, working: bool = False) -> np.ndarray:
    """Posture (nq,) of a mode.

    Parameters
    ----------
    mode : str or int
        A named posture of the description; else the name or number that a mode has in
        ``cc.postures(m, inputs=m.input_values(m.home))``, which is asked then.
    working : bool
        Whether modes are the working modes at home's pose instead, ``cc.postures(m,
        pose=m.pose(m.home))``.

    Raises
    ------
    ClosureError
        There is none, or home, where modes are counted, is not closed.
    """
    named = mechanism.postures
    if isinstance(mode, str) and mode in named:
        return np.array(named[mode])
    text = str(mode)
    if isinstance(mode, bool) or not _FOUND.fullmatch(text):
        raise ClosureError(
            f"{known_names(text, 'mode', tuple(named))}; or a name or number of cc.postures, such "
            "as +1 or 0"
        )
    found = _modes(mechanism, working=working)
    if text in found.names and isinstance(mode, str):
        return np.array(found[text].q)
    if text.lstrip("-").isdigit() and 0 <= int(text) < len(found):
        return np.array(found.q[int(text)])
    what = "working modes at home's pose" if working else "assembly modes at home's inputs"
    raise ClosureError(
        f"there is no mode {text!r}; the {what} are {', '.join(found.names) or 'none'}, by number "
        f"0 to {len(found) - 1}"
    )


def by_pose(mechanism: Mechanism, names: Iterable[str]) -> bool:
    """Whether coordinates are the tip's, so that a mode to start from is a working mode."""
    return any(n in (*OUTPUTS, *TILTS) and n not in mechanism.inputs for n in names)


def _modes(mechanism: Mechanism, *, working: bool) -> Postures:
    """Modes at home, asked once."""
    key = "modes.at_home", working
    found: Postures | None = mechanism.known.get(key)
    if found is None:
        home = mechanism.closed_home()
        held = (
            {"pose": mechanism.pose(home)} if working else {"inputs": mechanism.input_values(home)}
        )
        found = mechanism.known.setdefault(key, postures(mechanism, **held))
    return found
