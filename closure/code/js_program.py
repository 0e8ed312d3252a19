"""A mechanism as a module of JavaScript, for pages and for node."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from typing import Any

from closedchain.closure import nearness
from closedchain.closure.code.judging import Judging
from closedchain.closure.code.program import ENDINGS, FALL, Program
from closedchain.closure.code.resources import blocks, resource
from closedchain.closure.solve.control import ASKING, FRESH, STATE
from closedchain.closure.solve.step_tapes import StepTapes
from closedchain.closure.tape.expression import Tape
from closedchain.closure.tape.js_text import JAVASCRIPT
from closedchain.closure.tape.printing import as_numbers, indented, repeated, statements

CLASSIFYING = ("algebra.js", "nearest.js", "deciding.js")
"""Files of what `classify` needs, after the parts of every program."""

MOST_STEPS = 20_000
"""Steps of Newton's method that a call may take."""


@dataclass(frozen=True, eq=False)
class JsProgram:
    """JavaScript text of a program."""

    program: Program

    def module(self) -> str:
        """The module."""
        p = self.program
        parts = [self._head(), *self._constants(), self.function("check", p.closures.check_tape)]
        parts.append(self.function("allBodies", p.bodies))
        for way, tapes in p.ways:
            parts.append(self.loop(f"{way}_step", tapes.step_tape, tapes.states))
            parts += self._judge(way, tapes)
        if p.inverse is not None:
            parts.append(self.function("inverse_check", p.inverse.check_tape))
            parts.append(self.function("tipPose", p.inverse.place_tape))
        if p.measured:
            found = p.matrices
            parts.append(self.function("allMatrices", found.tape, found.places))
            parts.append(self.function("moved", p.moved))
            parts.append(self.function("closureValues", p.closure_values))
            parts.append(self.function("allSlopes", p.slopes))
        wanted = {"ALWAYS": True, "DIRECT": p.direct is not None}
        wanted |= {"INVERSE": p.inverse is not None, "MEASURE": p.measured}
        parts += [text for key, text in blocks("program.js") if wanted[key]]
        parts += [resource(name) for name in CLASSIFYING if p.measured]
        return "\n".join(parts)

    def _head(self) -> str:
        return """\
// Position problems of a closed-chain mechanism, solved along the branch of a guess.
// Written by closedchain. Lengths in m, angles in rad; `coordinates` names the numbers of q.
// Rows and pivots are chosen once, for postures like those around home; elsewhere a way may end as
// singular though the mechanism is not.
"""

    def _constants(self) -> list[str]:
        p, m = self.program, self.program.mechanism
        lower, upper = ([x if math.isfinite(x) else None for x in side] for side in m.limits)
        told: dict[str, Any] = {
            "name": m.name,
            "coordinates": [{"name": n, "unit": u} for n, u in p.coordinates],
            "inputs": [
                {"name": n, "unit": u, "at": int(i)}
                for n, u, i in zip(m.inputs, m.input_units, m.input_q, strict=True)
            ],
            "outputs": list(p.outputs),
            "limits": {"lower": lower, "upper": upper},
            "joints": list(m.model.names)[1:],
            "home": m.home.tolist(),
        }
        known: dict[str, Any] = {k: v for k, v in p.constants.items() if k != "INPUTS"}
        known |= {"POSE": 7, "BODIES": m.model.njoints - 1, "MOST_STEPS": MOST_STEPS}
        known |= {name.upper(): STATE.index(name) for name in ("reached", "status", "evaluations")}
        known |= {f"{way.upper()}_STATES": tapes.states for way, tapes in p.ways}
        known |= {"ASKING": ASKING, "FRESH": FRESH.tolist(), "CLOSED": p.precision.closed}
        known |= {"OPEN_ABOVE": 1e-6, "SMALLEST": p.precision.smallest, "RANK_LOST": 1e-9}
        known |= {"MATRIX_ROWS": p.matrix_rows, "FIRST_RATE": p.first_rate, "FALL": FALL}
        known |= {"EPSILON": 2.220446049250313e-16, "PASSIVE": m.passive_v.tolist()}
        known |= {"INPUT_Q": m.input_q.tolist(), "INPUT_V": m.input_v.tolist()}
        known |= {"INPUT_UNIT": m.column_scale[m.input_v].tolist()}
        known |= {"OUTPUT_UNIT": p.output_units.tolist()}
        known["NEARNESS"] = {k: v for k, v in vars(nearness).items() if k.isupper()}
        known["GENERIC"] = {
            "inputs": p.generic.inputs.value,
            "together": p.generic.together.value,
            "outputScale": p.generic.output_scale,
        }
        known["JOINTS"] = [
            {
                "q": joint.idx_q,
                "v": joint.idx_v,
                "scale": float(m.column_scale[joint.idx_v]),
                "floating": joint.nq > 1,
            }
            for joint in list(m.model.joints)[1:]
        ]
        known["ENDINGS"] = {
            e.name: {"code": e.code, "word": e.word, "sentence": e.sentence} for e in ENDINGS
        }
        lines = [f"export const {key} = {written(value)};\n" for key, value in told.items()]
        return lines + [f"const {key} = {written(value)};\n" for key, value in known.items()]

    def function(self, name: str, tape: Tape, places: tuple[int, ...] | None = None) -> str:
        """A tape as a function from x to y; its outputs stand at ``places`` of y."""
        lines, names = statements(tape, JAVASCRIPT, lambda k: f"x[{k}]")
        at = range(len(names)) if places is None else places
        texts = zip(at, as_numbers(tape, names), strict=True)
        lines += [f"y[{k}] = {text};" for k, text in texts]
        return f"function {name}(x, y) {{\n{indented(lines, 1)}}}\n"

    def loop(self, name: str, tape: Tape, states: int) -> str:
        """A tape that repeats itself on a state, as ``js_loop`` has it."""
        lines, numbers, running = repeated(tape, states, JAVASCRIPT)
        lines += [f"s[{k}] = {text};" for k, text in enumerate(numbers)]
        body = indented([*lines, f"if (!{running}) break;"], 2)
        begin = "    for (let tick = 0; tick < most; ++tick) {\n"
        return f"function {name}(s, p, most) {{\n{begin}{body}    }}\n}}\n"

    def _judge(self, way: str, tapes: StepTapes) -> list[str]:
        """The judgement of a trial."""
        judging = Judging(tapes)
        given = judging.source(("s", "p", "c"))
        first, names = statements(judging.first, JAVASCRIPT, given)
        first += [f"n[{k}] = {x};" for k, x in enumerate(as_numbers(judging.first, names))]
        last, names = statements(judging.last, JAVASCRIPT, given)
        last += [f"s[{k}] = {x};" for k, x in enumerate(as_numbers(judging.last, names))]
        call = [
            f"const n = new Float64Array({len(judging.first.outputs)});",
            f"const c = new Float64Array({judging.states});",
            f"{way}_factors(s, p, n);",
            f"{way}_column(c, n, {judging.size});",
            *last,
        ]
        return [
            f"function {way}_factors(s, p, n) {{\n{indented(first, 1)}}}\n",
            self.loop(f"{way}_column", judging.column, judging.states),
            f"function {way}_judge(s, p) {{\n{indented(call, 1)}}}\n",
        ]


def written(value: Any) -> str:
    """JSON that may stand in a script of a page: no text in it can end or open one."""
    return json.dumps(value).replace("<", "\\u003c")
