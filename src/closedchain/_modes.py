"""The assembly modes that a page offers: what a short search finds at the inputs of a posture."""

from __future__ import annotations

from typing import TYPE_CHECKING

from closedchain._terminal import remark
from closedchain.urdf.errors import ClosedChainError

if TYPE_CHECKING:
    import numpy as np

    from closedchain.closure import Mechanism

SECONDS = 30.0
"""Time after which the search for modes is given up."""


def searched_modes(mechanism: Mechanism, q: np.ndarray) -> dict[str, np.ndarray]:
    """Postures with the inputs of ``q`` (nq,) by name, searched but not counted.

    Empty where there is nothing to search, and where there is nothing but ``q`` itself.
    """
    import closedchain as cc

    if not mechanism.inputs or mechanism.home_open:
        return {}
    remark("searching the other assembly modes (--no-modes leaves them out) ...")
    inputs = mechanism.input_values(q)
    try:
        found = cc.postures(mechanism, inputs=inputs, count=False, seconds=SECONDS)
    except ClosedChainError as error:
        remark(f"no other modes: {error}")
        return {}
    return dict(zip(found.names, found.q, strict=True)) if found.count > 1 else {}
