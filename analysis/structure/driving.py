"""What inputs drive and outputs see of a mechanism at all, in every posture, in words."""

from __future__ import annotations

from closedchain.closure.generic import GenericRanks, generic_ranks
from closedchain.closure.mechanism import Mechanism
from closedchain.urdf.description import OUTPUTS


def driving(mechanism: Mechanism, outputs: tuple[str, ...] | None = None) -> tuple[str, ...]:
    """Sentences on what is wrong with, or noteworthy about, inputs and outputs in every posture.

    None for a mechanism whose inputs drive all its freedoms and whose outputs are independent.

    Parameters
    ----------
    outputs : tuple of str, optional
        Those of the task by default.
    """
    if outputs is None:
        outputs = mechanism.outputs() if mechanism.task is not None else ()
    generic = generic_ranks(mechanism, outputs)
    if not outputs:
        return _without_task(generic)
    found = []
    moving = generic.together.value
    if generic.architecturally_singular:
        found.append(
            f"Architecturally singular: its {generic.drives} inputs drive only "
            f"{generic.inputs.value} of the {moving} freedoms that move inputs or outputs, in "
            f"every posture; {_those(generic.undriven)} the outputs with all inputs locked."
        )
    elif generic.undriven:
        found.append(
            f"Under-driven: {_counted(generic.undriven)} of {generic.motions} "
            f"{_is(generic.undriven)} not driven by its {_inputs(generic.drives)}, and "
            f"{_moves(generic.undriven)} the outputs with all of them locked, in every posture."
        )
    if generic.idle:
        seen = generic_ranks(mechanism, OUTPUTS).together.value - moving
        found.append(
            f"{_counted(generic.idle).capitalize()} of {generic.motions} {_is(generic.idle)} idle: "
            f"{'it moves' if generic.idle == 1 else 'they move'} neither inputs nor outputs, as "
            "the spin of a rod between two ball joints, and no posture is singular for it."
            + f" {seen} of {generic.idle} {_moves(seen)} the tip, in ways that are no outputs."
            * (seen > 0)
        )
    if generic.outputs.value < len(outputs):
        found.append(dependence(generic, outputs))
    return tuple(found)


def dependence(generic: GenericRanks, outputs: tuple[str, ...]) -> str:
    """Sentence on outputs that do not change independently."""
    if not generic.outputs.value:
        return f"What it is asked for, {' '.join(outputs)}, changes in no posture."
    return (
        f"Of its {len(outputs)} outputs only {generic.outputs.value} can change independently, "
        "in any posture."
    )


def _without_task(generic: GenericRanks) -> tuple[str, ...]:
    still = generic.motions - generic.inputs.value
    if not generic.drives or not still:
        return ()
    return (
        f"{_counted(still).capitalize()} of {generic.motions} {_is(still)} not driven by its "
        f"{_inputs(generic.drives)}; without a task it is open whether that matters.",
    )


def _counted(number: int) -> str:
    return f"{number} freedom" + "s" * (number != 1)


def _inputs(number: int) -> str:
    return f"{number} input" + "s" * (number != 1)


def _those(number: int) -> str:
    return "the other one moves" if number == 1 else f"the other {number} move"


def _is(number: int) -> str:
    return "is" if number == 1 else "are"


def _moves(number: int) -> str:
    return "moves" if number == 1 else "move"
