"""From a xacro file to plain URDF text.

A xacro file is code: its ``${...}`` are Python expressions, it reads other files and environment
variables, and it can run for ever; strings given as parameters end up in those expressions too.
Expand only files that you trust. For text that is not trusted there is ``xacro=False``, which
evaluates nothing and refuses what would need it.

Relative includes are looked up from the including file; in text that is no file, from the current
working directory. A file may include the macros of closedchain with
``<xacro:include filename="$(arg closedchain)/legs.xacro"/>``.

xacro keeps its state in module globals, so expansions in several threads run one after another.
"""

from __future__ import annotations

import glob
import io
import logging
import os
import re
import threading
import xml.dom.minidom
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType, SimpleNamespace
from typing import Any

from closedchain.urdf._parameters import argument_text, check_like_default, value_in_force
from closedchain.urdf._scan import Scan, scan
from closedchain.urdf.description import ParameterValue
from closedchain.urdf.errors import DescriptionError, known_names

_MACROS = "closedchain"  # the argument that holds the folder of our own macros
_MACRO_FOLDER = str(Path(__file__).resolve().parent / "macros")
_LOCK = threading.Lock()
_LOG = logging.getLogger(__name__)
_NONE: Mapping[str, ParameterValue] = MappingProxyType({})


@dataclass(frozen=True)
class Expansion:
    """URDF text and the parameters that it was made with.

    Attributes
    ----------
    text : str
        URDF without xacro.
    parameters : mapping
        Every argument of the file and its value in force: a number where the value is one.
    """

    text: str
    parameters: Mapping[str, ParameterValue]


def expand(
    source: str | os.PathLike[str],
    parameters: Mapping[str, ParameterValue] = _NONE,
    *,
    xacro: bool = True,
) -> Expansion:
    """Text of a URDF or xacro file, without xacro.

    Text that does not declare the prefix ``xacro`` is kept byte for byte, so that line numbers
    are the file's own.

    Parameters
    ----------
    source : str or path
        A file, or the text itself (a string whose first visible character is ``<``).
    parameters : mapping
        Values for the file's ``<xacro:arg>``: numbers, bools, strings, or sequences of numbers
        (written "1 2 3"). Arguments with a default may be left out.
    xacro : bool
        False: evaluate nothing, refuse text that uses xacro.

    Raises
    ------
    DescriptionError
        Anything wrong with the file, the files it includes or the parameters.
    """
    text, file = read_source(source)
    found = scan(text, file)
    if found.use and not (found.declared and xacro):
        why = (
            'but does not declare xmlns:xacro="http://www.ros.org/wiki/xacro"'
            if xacro
            else "but xacro is switched off (xacro=False)"
        )
        raise DescriptionError(f"the text uses xacro, {found.use}, {why}", line=found.use_line)
    if not (found.declared and xacro):
        if parameters:
            raise DescriptionError(
                f"parameters given ({', '.join(map(str, parameters))}), but the text has no "
                "xacro arguments"
            )
        return Expansion(text, _NONE)
    given = {name: argument_text(name, value) for name, value in parameters.items()}
    known, complete = _declared_arguments(found, file)
    if complete:
        _refuse_unknown(given, known)
    values = {**given, _MACROS: _MACRO_FOLDER}
    with _LOCK:
        expanded, seen = _run(text, file, values)
    known = tuple(dict.fromkeys((*known, *seen)))
    _refuse_unknown(given, known)
    in_force = {
        name: value_in_force(parameters.get(name), values[name])
        for name in known
        if name in values and name != _MACROS
    }
    return Expansion(expanded, MappingProxyType(in_force))


def read_source(source: str | os.PathLike[str]) -> tuple[str, str | None]:
    """Text and absolute file name (None when the source is the text itself).

    Raises
    ------
    DescriptionError
        A file that cannot be read, is empty or no UTF-8 text.
    """
    if isinstance(source, str) and source.lstrip("\ufeff \t\r\n").startswith("<"):
        return source.lstrip("\ufeff"), None
    name = os.fsdecode(source)
    if not name.strip():
        raise DescriptionError("the text is empty; expected a file name, or XML text")
    shown = repr(name if len(name) <= 200 else name[:200] + "...")
    try:
        file = os.path.abspath(name)
        return _file_text(file), file
    except (OSError, ValueError) as error:
        why = getattr(error, "strerror", None) or error
        raise DescriptionError(
            f"cannot read {shown}: {why} (text instead of a file name must begin with '<')"
        ) from None


def _file_text(file: str) -> str:
    """Text of a file as it is, line ends included."""
    if os.path.exists(file) and not os.path.isfile(file):
        raise DescriptionError(f"cannot read {file!r}: it is not a file")
    data = Path(file).read_bytes()
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise DescriptionError(f"{file!r} is not UTF-8 text", line=line) from None
    if not text.strip():
        raise DescriptionError(f"{file!r} is empty")
    return text


def _declared_arguments(found: Scan, file: str | None) -> tuple[tuple[str, ...], bool]:
    """Arguments declared here and in included files; False when some includes are computed."""
    names: list[str] = []
    complete = True
    waiting = [(found, os.path.dirname(file) if file else os.curdir)]
    visited: set[str] = set()
    while waiting:
        here, folder = waiting.pop()
        names += here.arguments
        for include in here.includes:
            pattern = include.replace(f"$(arg {_MACROS})", _MACRO_FOLDER)
            if "$" in pattern:
                complete = False
                continue
            pattern = os.path.join(folder, pattern)
            for path in sorted(glob.glob(pattern)) if re.search(r"[*?[]", pattern) else [pattern]:
                if (real := os.path.realpath(path)) in visited:
                    continue
                visited.add(real)
                try:
                    waiting.append((scan(_file_text(path)), os.path.dirname(path)))
                except (OSError, ValueError, DescriptionError):
                    continue  # it may never be included; if it is, the expansion reports it
    return tuple(name for name in dict.fromkeys(names) if name != _MACROS), complete


def _refuse_unknown(given: Mapping[str, str], known: tuple[str, ...]) -> None:
    for name in given:
        if name == _MACROS or name not in known:
            raise DescriptionError(known_names(name, "parameter", known))


def _run(text: str, file: str | None, values: dict[str, str]) -> tuple[str, tuple[str, ...]]:
    """Expand with xacro; ``values`` receives the defaults. The lock must be held."""
    import xacro

    seen: dict[str, bool] = {}  # argument -> has a default
    given = dict(values)  # before xacro adds the defaults

    def parse(inp: object, filename: str) -> xml.dom.minidom.Document:
        """Read an included file: xacro's own ``parse`` with our refusals."""
        chain = [name for name in xacro.filestack[:-1] if name]
        real = os.path.realpath(filename)
        if any(os.path.realpath(name) == real for name in chain):
            raise DescriptionError(f"a file includes itself: {' -> '.join([*chain, filename])}")
        try:
            content = _file_text(filename)
        except OSError as error:
            xacro.filestack.pop()  # as xacro does: the missing file is not where the error is
            raise xacro.XacroException(
                f"cannot read the included file {filename!r}:", exc=error
            ) from None
        return _document(content, filename, seen, given)

    def warning(*words: object, **_: object) -> None:
        message = " ".join(map(str, words))
        if "unknown attribute" in message or "matched no files" in message:
            raise DescriptionError(f"{message}{_place(xacro)}")
        _LOG.info("%s", message)

    with _xacro_state(xacro, file, parse, warning):
        try:
            document = _document(text, file, seen, given)
            xacro.process_doc(document, mappings=values, verbosity=0)
            return str(document.toprettyxml(indent="  ")), tuple(seen)
        except DescriptionError:
            raise
        except Exception as error:
            raise DescriptionError(_message(error, seen) + _place(xacro)) from None


def _document(
    text: str, file: str | None, seen: dict[str, bool], given: Mapping[str, str]
) -> xml.dom.minidom.Document:
    """Parse one file, note its arguments and check the values given for them."""
    scan(text, file)
    try:
        document = xml.dom.minidom.parseString(text)
    except xml.parsers.expat.ExpatError as error:
        reason = xml.parsers.expat.ErrorString(error.code)
        where = f" (in {file})" if file else ""
        raise DescriptionError(f"not well-formed XML: {reason}{where}", line=error.lineno) from None
    for argument in document.getElementsByTagName("xacro:arg"):
        name = argument.getAttribute("name")
        has_default = argument.hasAttribute("default")
        if has_default and name in given:
            check_like_default(name, given[name], argument.getAttribute("default"))
        if name and name != _MACROS:
            seen[name] = seen.get(name, False) or has_default
        if name and not has_default:
            # xacro would take "" for the missing value; this makes it say "undefined" instead
            argument.setAttribute("default", f"$(arg {name})")
    return document


@contextmanager
def _xacro_state(
    xacro: Any,
    file: str | None,
    parse: Callable[..., xml.dom.minidom.Document],
    warning: Callable[..., None],
) -> Iterator[None]:
    """Put our hooks into xacro and, whatever happens, its globals back as they were."""
    from xacro import color

    sink = io.StringIO()
    quiet = SimpleNamespace(stdout=sink, stderr=sink)  # sys itself belongs to the other threads
    names = ("parse", "warning", "sys", "filestack", "macrostack", "verbosity")
    before = {name: getattr(xacro, name) for name in names}
    includes = len(xacro.all_includes)
    try:
        xacro.parse, xacro.warning, xacro.sys, color.sys = parse, warning, quiet, quiet
        xacro.init_stacks(file)
        yield
    finally:
        color.sys = before["sys"]
        for name, value in before.items():
            setattr(xacro, name, value)
        xacro.substitution_args_context["arg"] = {}
        del xacro.all_includes[includes:]
        if chatter := sink.getvalue().strip():
            _LOG.info("%s", chatter)


def _message(error: Exception, seen: Mapping[str, bool]) -> str:
    """One line that says what xacro found wrong."""
    inner = getattr(error, "exc", None)
    if type(inner).__name__ == "ArgException":
        name = str(inner)
        known = ", ".join(seen) or "none"
        if name not in seen:
            return f"$(arg {name}) is used, but no <xacro:arg> declares it; known: {known}"
        if seen[name]:
            return f"$(arg {name}) is used before its <xacro:arg>, which holds the default"
        return f"parameter {name!r} has no default and no value was given"
    if isinstance(inner, OSError) and inner.strerror:
        return f"xacro: {str(error.args[0] or 'cannot read').rstrip(':')}: {inner.strerror}" + (
            f": {inner.filename!r}" if not error.args[0] else ""
        )
    if isinstance(inner, ImportError):
        return f"xacro: {inner}; $(find ...) needs ROS, write a path relative to the file instead"
    if isinstance(error, RecursionError) or isinstance(inner, RecursionError):
        return "xacro: nested too deeply; does a macro call itself without end?"
    text = " ".join(str(error).split())
    text = text.split(" when evaluating expression 'xacro.fatal(", 1)[0]  # the file's own words
    kind = type(error).__name__
    return f"xacro: {text}" if kind == "XacroException" else f"xacro: {kind}: {text}"


def _place(xacro: Any) -> str:
    """Where xacro was: the macros and included files on its stacks, innermost first."""
    macros = [repr(m.body.getAttribute("name")) for m in reversed(xacro.macrostack or [])]
    files = [name or "the text" for name in reversed(xacro.filestack or [])]
    words = [f"in macro {', called by '.join(macros[:4])}"] if macros else []
    if any(name != "the text" for name in files):
        words.append(f"in {', included from '.join(files[:6])}")
    return f" ({'; '.join(words)})" if words else ""
