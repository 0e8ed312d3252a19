"""A first look at an XML text, before any other parser sees it.

Refuses what no mechanism needs and attackers do (DOCTYPE, and with it every entity), and says
whether the text uses xacro, which arguments it declares and which files it includes.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import NoReturn
from xml.parsers import expat

from closedchain.urdf.errors import DescriptionError

_SUBSTITUTION = re.compile(r"(?<!\$)\$[({]")


@dataclass(frozen=True)
class Scan:
    """What a text says about xacro.

    Attributes
    ----------
    declared : bool
        The text declares the namespace prefix ``xacro``.
    use : str
        The first use of xacro (an element, an attribute with ``${...}`` or ``$(...)``), else "".
    use_line : int or None
        Its line.
    arguments : tuple of str
        Names of the ``<xacro:arg>`` elements.
    includes : tuple of str
        File names of the ``<xacro:include>`` elements, as written.
    """

    declared: bool
    use: str
    use_line: int | None
    arguments: tuple[str, ...]
    includes: tuple[str, ...]


def scan(text: str, file: str | None = None) -> Scan:
    """Look through ``text`` once.

    Parameters
    ----------
    text : str
        A whole XML document.
    file : str, optional
        Where it comes from, for the messages.

    Raises
    ------
    DescriptionError
        Not well-formed, or with a DOCTYPE.
    """
    where = f" (in {file})" if file else ""
    arguments: list[str] = []
    includes: list[str] = []
    declared = False
    use: tuple[str, int] | None = None
    parser = expat.ParserCreate("utf-8")

    def doctype(*_: object) -> NoReturn:
        raise DescriptionError(
            f"DOCTYPE and entity declarations are not accepted{where}; remove them, or write "
            "repeated text as a xacro property",
            line=parser.CurrentLineNumber,
            element="!DOCTYPE",
        )

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal declared, use
        line = parser.CurrentLineNumber
        for key, value in attributes.items():
            if key == "xmlns:xacro":
                declared = True
            elif key.startswith("xmlns") and "ros.org/" in value and "xacro" in value:
                raise DescriptionError(
                    f"xacro's namespace must have the prefix xacro, not {key[6:] or 'none'!r}"
                    f"{where}; write xmlns:xacro={value!r}",
                    line=line,
                    element=tag,
                    name=attributes.get("name"),
                )
            elif use is None and (key.startswith("xacro:") or _SUBSTITUTION.search(value)):
                use = f"{key}={value!r} in <{tag}>", line
        if tag.startswith("xacro:") and use is None:
            use = f"<{tag}>", line
        if tag == "xacro:arg" and "name" in attributes:
            arguments.append(attributes["name"])
        elif tag == "xacro:include" and "filename" in attributes:
            includes.append(attributes["filename"])

    parser.StartDoctypeDeclHandler = doctype
    parser.StartElementHandler = start
    try:
        parser.Parse(text.encode("utf-8"), True)
    except UnicodeEncodeError as error:
        line = text.count("\n", 0, error.start) + 1
        raise DescriptionError(
            f"character {text[error.start]!r} is not allowed in XML{where}", line=line
        ) from None
    except expat.ExpatError as error:
        raise DescriptionError(
            f"not well-formed XML: {expat.ErrorString(error.code)}{where}", line=error.lineno
        ) from None
    return Scan(
        declared=declared,
        use=use[0] if use else "",
        use_line=use[1] if use else None,
        arguments=tuple(arguments),
        includes=tuple(includes),
    )
