"""The errors of closedchain: one root, so that a caller can catch all of them at once.

A numerical failure (out of reach, singular) is no error: it is a field of a ``Solution``.
"""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches


class ClosedChainError(Exception):
    """Root of every error that closedchain raises on purpose.

    Examples
    --------
    >>> try:
    ...     cc.load("dleta")
    ... except cc.ClosedChainError as error:
    ...     print(type(error).__name__)
    DescriptionError
    """


class DescriptionError(ClosedChainError):
    """A mechanism is written down wrongly: bad XML, unknown names, impossible parameters.

    Attributes
    ----------
    line : int or None
        Line of the offending element in the URDF text (after xacro expansion, if any).
    element : str or None
        Tag of the offending element, for instance ``joint``.
    name : str or None
        Its ``name`` attribute.

    Examples
    --------
    >>> try:
    ...     cc.load_urdf("<robot name='r'><link name='a'/><joint name='j' type='hinge'/></robot>")
    ... except cc.DescriptionError as error:
    ...     print(error.element, error.name)
    joint j
    """

    def __init__(
        self,
        message: str,
        *,
        line: int | None = None,
        element: str | None = None,
        name: str | None = None,
    ) -> None:
        where = f"line {line}: " if line is not None else ""
        what = f"<{element}>" if element else ""
        if element and name:
            what = f"<{element} name={name!r}>"
        super().__init__(f"{where}{what}{': ' if what else ''}{message}")
        self.line = line
        self.element = element
        self.name = name


class ClosureError(ClosedChainError):
    """A question to a mechanism that it cannot answer: unknown name, wrong shape, not closed.

    Examples
    --------
    >>> m = cc.load("linear_delta")
    >>> try:
    ...     cc.direct(m, {"q1": -0.1, "q2": -0.1})
    ... except cc.ClosureError as error:
    ...     print(error)
    input values: no value for input q3
    """


def known_names(wanted: str, kind: str, known: Iterable[str], *, most: int | None = None) -> str:
    """Sentence that says ``wanted`` is unknown, guesses what was meant and lists what exists.

    ``most`` is how many names are listed; all of them by default.
    """
    names = list(known)
    close = get_close_matches(str(wanted), names, n=1)
    hint = f" (did you mean {close[0]!r}?)" if close else ""
    listed = ", ".join(names[:most]) if names else "none"
    if most is not None and len(names) > most:
        listed += f" and {len(names) - most} others"
    return f"unknown {kind} {wanted!r}{hint}; known: {listed}"
