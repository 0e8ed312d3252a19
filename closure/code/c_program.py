"""A mechanism as C99: a header, a source that needs nothing but <math.h>, and a self-test."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from closedchain.closure.code.cases import Case
from closedchain.closure.code.judging import Judging
from closedchain.closure.code.program import ENDINGS, FALL, Program
from closedchain.closure.code.resources import blocks, resource
from closedchain.closure.solve.control import ASKING, FRESH, STATE
from closedchain.closure.solve.outcome import Ending
from closedchain.closure.solve.step_tapes import StepTapes
from closedchain.closure.tape.c_text import C
from closedchain.closure.tape.expression import Tape
from closedchain.closure.tape.printing import Language, as_numbers, indented, repeated, statements

MOST_STEPS = 20_000
"""Steps of Newton's method that a call may take, unless the user compiles another bound in."""

LINE = 100
UNUSED = "(void)s, (void)p, (void)n;"


@dataclass(frozen=True)
class Real:
    """A kind of number in C: its type, and what is appended to constants and functions.

    Attributes
    ----------
    least : float
        The smallest constant that is written; smaller ones would be zero to a compiler.
    epsilon, largest, rank_lost, passes : float
        Distance of 1 to the next number; what still counts as finite; share at which a rank counts
        as lost; largest difference of numbers that a self-test lets pass.
    """

    type: str
    suffix: str
    least: float
    epsilon: float
    largest: float
    rank_lost: float
    passes: float

    def literal(self, value: float) -> str:
        """Text of a constant that is not negative."""
        return f"{max(value, self.least) if value else value!r}{self.suffix}"

    @property
    def language(self) -> Language:
        """C with these numbers."""
        functions = {op: name + self.suffix for op, name in C.functions.items()}
        return replace(C, number=f"const {self.type}", functions=functions, literal=self.literal)

    def signed(self, value: float) -> str:
        """Text of any constant."""
        return self.language.constant(float(value))


DOUBLE = Real("double", "", 1e-300, 2.220446049250313e-16, 1e100, 1e-9, 1e-10)
FLOAT = Real("float", "f", 1e-30, 1.1920929e-07, 1e18, 1e-4, 2e-3)


@dataclass(frozen=True, eq=False)
class CProgram:
    """C text of a program under a name."""

    program: Program
    name: str
    real: Real

    def files(self, cases: Sequence[Case]) -> dict[str, str]:
        """Texts by file name."""
        parts = {
            f"{self.name}.h": self.header(),
            f"{self.name}.c": self.source(),
            f"{self.name}_test.c": self.test(cases),
        }
        return {name: self._named(text) for name, text in parts.items()}

    def _named(self, text: str) -> str:
        """Text with the program's own name in the place of ``name_`` and ``NAME_``."""
        text = re.sub(r"\bname_", f"{self.name}_", text)
        return re.sub(r"\bNAME_", f"{self.name.upper()}_", text)

    # -- header ------------------------------------------------------------------------------------

    def header(self) -> str:
        """What a user of the program reads and includes."""
        m = self.program.mechanism
        sizes = {k: self.program.constants[k] for k in ("Q", "INPUTS", "OUTPUTS")}
        coordinates = [f"{plain(name)} [{unit}]" for name, unit in self.program.coordinates]
        inputs = [f"{plain(n)} [{u}]" for n, u in zip(m.inputs, m.input_units, strict=True)]
        endings = [f"NAME_{macro(e)} = {e.code}, /* {e.sentence} */" for e in ENDINGS]
        return "\n".join(
            [
                f"/* {plain(m.name)}: its position problems, solved along the branch of a guess.",
                "   Written by closedchain. Lengths in m, angles in rad.",
                "",
                "   q are the coordinates of all joints of the tree:",
                *numbered(coordinates),
                *(["   inputs:", *numbered(inputs)] if inputs else []),
                *self._task(),
                "   Nothing is allocated, nothing recurses, nothing is kept between calls; calls",
                "   may run at the same time. Rows and pivots are chosen once, for postures like",
                "   those around home; elsewhere a way may end as SINGULAR or RANK though the",
                "   mechanism is not singular. */",
                "#ifndef NAME_H",
                "#define NAME_H",
                "#ifdef __cplusplus",
                'extern "C" {',
                "#endif",
                "",
                f"typedef {self.real.type} name_real;",
                "",
                "/* Most steps of Newton's method in a call; another may be defined. */",
                "#ifndef NAME_MOST_STEPS",
                f"#define NAME_MOST_STEPS {MOST_STEPS}",
                "#endif",
                "",
                "enum {",
                *(f"    NAME_{key} = {value}," for key, value in sizes.items()),
                "    NAME_POSE = 7 /* x y z [m], then a unit quaternion x y z w */",
                "};",
                "",
                "/* What functions return: how they ended. */",
                "enum {",
                *(f"    {line}" for line in endings),
                "    NAME_ENDINGS",
                "};",
                "",
                *self._declarations(),
                "#ifdef __cplusplus",
                "}",
                "#endif",
                "#endif",
                "",
            ]
        )

    def _task(self) -> list[str]:
        task = self.program.mechanism.task
        if not self.program.outputs or task is None:
            return []
        return [f"   outputs of the tip {plain(task.tip)}: {' '.join(self.program.outputs)}"]

    def _declarations(self) -> list[str]:
        wanted = {"ALWAYS": True, "DIRECT": self.program.direct is not None}
        wanted |= {"INVERSE": self.program.inverse is not None}
        wanted |= {"MEASURE": self.program.measured}
        return [text for key, text in blocks("header.h") if wanted[key]]

    # -- source ------------------------------------------------------------------------------------

    def source(self) -> str:
        """The program."""
        program = self.program
        parts = [f'#include "{self.name}.h"\n\n#include <math.h>\n', self._constants()]
        parts.append(self.function("static void name_check", program.closures.check_tape))
        for way, tapes in program.ways:
            parts += [
                self.loop(f"name_{way}_step", tapes.step_tape, tapes.states),
                *self._judge(f"name_{way}", tapes),
            ]
        parts.append(resource("follow.c").replace("/* SENTENCES */\n", self._sentences()))
        if program.direct is not None:
            parts.append(resource("direct.c"))
        if program.inverse is not None:
            check = program.inverse.check_tape
            parts.append(self.function("static void name_inverse_check", check))
            parts.append(self.function("void name_tip", program.inverse.place_tape))
            parts.append(resource("inverse.c"))
        if self.program.measured:
            parts += [self._matrices(), self._work(), resource("measures.c")]
        return "\n".join(parts)

    def _constants(self) -> str:
        program, r, m = self.program, self.real, self.program.mechanism
        integers = {k: v for k, v in program.constants.items() if k not in HEADED}
        integers |= {"STATE": len(STATE), "P": program.first_rate}
        integers |= {name.upper(): STATE.index(name) for name in ("reached", "status")}
        integers["EVALUATIONS"] = STATE.index("evaluations")
        integers |= {f"{way.upper()}_STATES": tapes.states for way, tapes in program.ways}
        precision = program.precision
        numbers = {
            "ASKING": ASKING,
            "CLOSED": precision.closed,
            "OPEN_ABOVE": 1e6 * precision.closed if r is DOUBLE else 10.0 * precision.closed,
            "SMALLEST": precision.smallest,
            "EPSILON": r.epsilon,
            "LARGEST": r.largest,
            "RANK_LOST": r.rank_lost,
            "FALL": FALL,
        }
        lines = [f"#define NAME_{key} {value}" for key, value in integers.items()]
        lines += [f"#define NAME_{key} {r.signed(value)}" for key, value in numbers.items()]
        lines += [f"#define name_{op} {C.functions[op]}{r.suffix}" for op in ("sqrt", "abs")]
        home = self._array("name_home", m.home)
        home[0] = "const name_real name_home[NAME_Q] = {"
        lines += ["", *home, *self._array("name_fresh", FRESH)]
        if program.direct is not None:
            lines += self._array("name_input_q", m.input_q)
        if self.program.measured:
            lines += self._array("name_input_v", m.input_v)
            lines += self._array("name_input_unit", m.column_scale[m.input_v])
            lines += self._array("name_output_unit", program.output_units)
            if program.has_det_direct and not program.redundant:
                lines += self._array("name_passive", m.passive_v)
        return "\n".join(lines) + "\n"

    def _array(self, name: str, values: np.ndarray) -> list[str]:
        whole = values.dtype.kind == "i"
        texts = [str(int(x)) if whole else self.real.signed(x) for x in values]
        kind = "int" if whole else "name_real"
        texts = texts or ["0"]  # C has no empty arrays
        return [f"static const {kind} {name}[] = {{", *wrapped(texts), "};"]

    def _sentences(self) -> str:
        return "".join(f'    case NAME_{macro(e)}: return "{e.sentence}";\n' for e in ENDINGS)

    def function(self, head: str, tape: Tape) -> str:
        """A tape as a function from x to y; it reads all of x before it writes y."""
        lines, names = statements(tape, self.real.language, lambda k: f"q[{k}]")
        lines += [f"y[{k}] = {text};" for k, text in enumerate(as_numbers(tape, names))]
        return (
            f"{head}(const name_real *q, name_real *y)\n{{\n{indented(['(void)q;', *lines], 1)}}}\n"
        )

    def loop(self, name: str, tape: Tape, states: int) -> str:
        """A tape that repeats itself on a state, as ``c_loop`` has it."""
        lines, numbers, running = repeated(tape, states, self.real.language)
        lines += [f"s[{k}] = {text};" for k, text in enumerate(numbers)]
        head = f"static void {name}(name_real *s, const name_real *p, int most)\n{{\n"
        begin = indented(["(void)p;", "for (int tick = 0; tick < most; ++tick) {"], 1)
        body = indented([*lines, f"if (!{running}) break;"], 2)
        return f"{head}{begin}{body}    }}\n}}\n"

    def _judge(self, name: str, tapes: StepTapes) -> list[str]:
        """The judgement of a trial."""
        judging = Judging(tapes)
        numbers, sums = len(judging.first.outputs), judging.states
        given = judging.source(("s", "p", "c"))
        first, names = statements(judging.first, self.real.language, given)
        first += [f"n[{k}] = {x};" for k, x in enumerate(as_numbers(judging.first, names))]
        last, names = statements(judging.last, self.real.language, given)
        last += [f"s[{k}] = {x};" for k, x in enumerate(as_numbers(judging.last, names))]
        ways = "(const name_real *s, const name_real *p, name_real *n)"
        call = [
            f"name_real n[{max(1, numbers)}], c[{sums}] = {{0}};",
            f"{name}_factors(s, p, n);",
            f"{name}_column(c, n, {judging.size});",
            "(void)most;",
            *last,
        ]
        head = f"static void {name}_judge(name_real *s, const name_real *p, int most)\n{{\n"
        return [
            f"static void {name}_factors{ways}\n{{\n{indented([UNUSED, *first], 1)}}}\n",
            self.loop(f"{name}_column", judging.column, sums),
            f"{head}{indented(call, 1)}}}\n",
        ]

    def _matrices(self) -> str:
        """Matrices of a posture, row by row."""
        found = self.program.matrices
        size = f"{self.program.matrix_rows} * NAME_V"
        lines, names = statements(found.tape, self.real.language, lambda k: f"q[{k}]")
        lines += [f"for (int i = 0; i < {size}; ++i) y[i] = 0;"]
        texts = as_numbers(found.tape, names)
        lines += [f"y[{place}] = {text};" for place, text in zip(found.places, texts, strict=True)]
        head = "static void name_matrices(const name_real *q, name_real *y)\n{\n"
        return f"{head}{indented(['(void)q;', *lines], 1)}}}\n"

    def _work(self) -> str:
        """Memory of ``name_measure``, on the stack."""
        c = self.program.constants
        most = c["MOST_MOTIONS"]
        sizes = {
            "k": self.program.matrix_rows * c["V"],
            "lu": c["ROWS"] * c["V"],
            "square": max(c["V"], c["K_RANK"]) ** 2,
            "n": most * c["V"],
            "y": most * max(c["RATES"], c["V"]),
            "a": most * c["INPUTS"],
            "t": most * c["OUTPUTS"],
            "b": most * c["OUTPUTS"],
        }
        fields = [f"name_real {name}[{max(1, size)}];" for name, size in sizes.items()]
        fields += [f"int columns[{c['V']}];", "int rank, count, driven;"]
        return f"typedef struct {{\n{indented(fields, 1)}}} name_work;\n"

    # -- test --------------------------------------------------------------------------------------

    def test(self, cases: Sequence[Case]) -> str:
        """Source of a program that compares with numbers known from Python."""
        lines = [
            f'#include "{self.name}.h"',
            "",
            "#include <math.h>",
            "#include <stdio.h>",
            "",
            "static double worst = 0;",
            "",
            "static void compare(const name_real *a, const name_real *b, int count)",
            "{",
            "    for (int i = 0; i < count; ++i) {",
            "        const double gap = fabs((double)a[i] - (double)b[i]);",
            "        if (!(gap <= worst)) worst = gap;",
            "    }",
            "}",
            "",
        ]
        calls: list[str] = []
        for i, case in enumerate(cases):
            lines += self._array(f"given_{i}", case.given) + self._array(f"known_{i}", case.q)
            lines += self._array(f"guess_{i}", case.guess)
            call = f"name_{case.way}(given_{i}, guess_{i}, q)"
            calls.append(f"failed += {call} != NAME_ARRIVED;")
            calls.append(f"compare(q, known_{i}, NAME_Q);")
        body = [
            "name_real q[NAME_Q] = {0};",
            "int failed = 0;",
            *calls,
            'printf("NAME_: %d failed, largest difference %g\\n", failed, worst);'.replace(
                "NAME_", self.name
            ),
            f"return failed || !(worst < {self.real.passes!r});",
        ]
        return "\n".join([*lines, "int main(void)", "{", indented(body, 1) + "}", ""])


HEADED = ("Q", "INPUTS", "OUTPUTS")


def macro(ending: Ending) -> str:
    """Name of an ending in C."""
    return ending.name


def plain(text: str) -> str:
    """Text that may stand in a comment of C, whatever a description calls things."""
    return re.sub(r"[^A-Za-z0-9_ .,+()=-]", "_", text)


def numbered(texts: Sequence[str]) -> list[str]:
    """Lines of a comment that number their entries."""
    return [f"     {i:3d}  {text}" for i, text in enumerate(texts)]


def wrapped(texts: Sequence[str]) -> list[str]:
    """Lines of entries."""
    lines = [""]
    for text in texts:
        if lines[-1] and len(lines[-1]) + len(text) > LINE - 8:
            lines.append("")
        lines[-1] += f"{text}, "
    return [f"    {line.rstrip()}" for line in lines]
