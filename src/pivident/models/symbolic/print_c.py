"""Programs as C99 that depends on ``math.h`` only.

Each program becomes two functions: NAME for one set of inputs, and NAME_samples for many, which
processes ``TILE`` of them at a time so that compilers vectorise the loop. For that, sine, cosine
and arctangent are written without branches (see `pivident.dynamics.elementary`).

Newton's method for the passive positions of a closed mechanism, as C99.

Generated functions of such a mechanism have an argument ``posture``, where the loops were closed
last: it is where the next state is followed from, so that a controller pays for one or two steps.
"""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from importlib import resources

from pivident.dynamics.grouping.expressions import Call, Cosine, Expression, Sine, ordered
from pivident.dynamics.grouping.notation import C99, expression_texts
from pivident.foundation.text.identifiers import c_comment, identifiers
from pivident.models.symbolic.assignments import (
    GAP,
    MAX_STEPS,
    MAX_WAY,
    STRIDE,
    Assignments,
    Input,
    LoopClosing,
    Output,
    closings_of,
)
from pivident.models.symbolic.print_python import argument_names, scalar_names
from pivident.robot.friction_terms import friction_columns

#: C with the functions defined in the file.
_C = replace(C99, functions={**C99.functions, "atan": "arctangent"})
#: Samples per step of the generated loops: two vectors of four or one of eight.
TILE = 8
_TAKEN = (
    "samples",
    "start",
    "count",
    "s",
    "k",
    "TILE",
    "INLINE",
    "ROUND",
    "sine_and_cosine",
    "arctangent",
    "sign_of",
    "posture",
    "passive",
)
_CLOSE_LOOPS = """
static void @close(const double q[@given], double posture[@size], double passive[@found])
{
    double way[@given], part[@given], at[@given], gap[@found], step[@found];
    double farthest = 0.0;
    for (size_t k = 0; k < @given; ++k) {
        way[k] = q[k] - posture[k];
        farthest = fmax(farthest, fabs(way[k]));
    }
    for (size_t k = 0; k < @found; ++k)
        passive[k] = posture[@given + k];
    const size_t strides = 1 + (size_t)(fmin(farthest, @longest) / @stride);
    int closed = 1;
    for (size_t left = strides; left > 0 && closed; --left) {
        closed = 0;
        for (int n = 0; n <= @most && !closed; ++n) {
            const double rest = (double)(n == 0 ? left : left - 1) / (double)strides;
            for (size_t k = 0; k < @given; ++k) {
                at[k] = q[k] - rest * way[k];
                part[k] = n == 0 ? way[k] / (double)strides : 0.0;
            }
            @step(at, passive, part, gap, step);
            closed = n > 0;
            for (size_t k = 0; k < @found; ++k) {
                passive[k] += step[k];
                if (!(fabs(gap[k]) < @gap))
                    closed = 0;
            }
        }
    }
    for (size_t k = 0; k < @given && closed; ++k)
        posture[k] = q[k];
    for (size_t k = 0; k < @found; ++k) {
        if (closed)
            posture[@given + k] = passive[k];
        else
            passive[k] = NAN;
    }
}
"""


def closing_names(
    closings: Sequence[LoopClosing], prefix: str, taken: Sequence[str]
) -> dict[LoopClosing, tuple[str, str, str]]:
    """Names of the posture, the function of one step, and the one that closes the loops."""
    wanted = [f"{prefix}{text}" for text in ("closed_posture", "closing_step", "close_loops")]
    texts = identifiers(wanted * len(closings), taken)
    return {
        closing: (texts[3 * k], texts[3 * k + 1], texts[3 * k + 2])
        for k, closing in enumerate(closings)
    }


def posture_declaration(closing: LoopClosing, posture: str) -> str:
    """The line of the header that declares a posture."""
    (comment,) = c_comment([closing.posture_text])[1:-1]
    start = "Copy it before the first call, and hand over the copy, which moves along."
    return f"/*{comment[2:]} {start} */\nextern const double {posture}[{len(closing.posture)}];"


def closing_source(closing: LoopClosing, posture: str, step: str, close: str) -> list[str]:
    """Lines of the posture and of the function that closes the loops."""
    size, found = len(closing.posture), len(closing.unknown)
    numbers = textwrap.wrap(", ".join(map(repr, closing.posture)), 88)
    text = _CLOSE_LOOPS.strip("\n")
    values = {
        "@close": close, "@step": step, "@given": size - found, "@size": size, "@found": found,
        "@longest": MAX_WAY, "@stride": STRIDE, "@most": MAX_STEPS, "@gap": GAP,
    }  # fmt: skip
    for word, value in values.items():
        text = text.replace(word, str(value))
    names = ", ".join(s.name for s in closing.unknown.symbols)
    about = (
        f"{names} that close the loops at q. Newton's method follows the mechanism from posture, "
        "which receives the new one. Where they do not close, they are NaN and it stays."
    )
    return [
        posture_declaration(closing, posture),
        f"const double {posture}[{size}] = {{",
        *(f"    {line}" for line in numbers),
        "};",
        "",
        *c_comment(textwrap.wrap(about, 94)),
        *text.splitlines(),
    ]


def one_after_the_other(signature: str, name: str, arguments: Sequence[str]) -> list[str]:
    """The function of many samples that calls the one of one sample for each in turn."""
    return [
        "/* The same for many samples, one row for each; every one starts from the one before. */",
        signature,
        "{",
        "    for (size_t s = 0; s < samples; ++s)",
        f"        {name}({', '.join(arguments)});",
        "}",
    ]


def c_source(programs: Sequence[Assignments], prefix: str = "", many: bool = True) -> str:
    """Text of a C99 file; ``many``: with functions for many samples too."""
    names = identifiers(f"{prefix}{program.name}" for program in programs)
    closings = closing_names(closings_of(programs), prefix, names)
    lines = ["/* Generated by pivident. C99, compile with -O3 -march=native. */", ""]
    steps = [closing.step for closing in closings]
    lines += ["#include <math.h>", "#include <stddef.h>", "", *_helpers([*programs, *steps]), ""]
    for closing, (posture, step, close) in closings.items():
        lines += [*c_comment(closing.step.header), *_single(closing.step, step, static=True), ""]
        lines += [*closing_source(closing, posture, step, close), ""]
    for program, name in zip(programs, names, strict=True):
        close = closings[program.closing][2] if program.closing else ""
        lines += [*c_comment(program.header), *_single(program, name, close), ""]
        if many and program.closing:
            lines += [*_in_turn(program, name), ""]
        elif many:
            lines += [*_many(program, name), ""]
    return "\n".join(lines)


def c_header(programs: Sequence[Assignments], prefix: str = "", many: bool = True) -> str:
    """Text of the header file of `c_source`."""
    names = identifiers(f"{prefix}{program.name}" for program in programs)
    guard = f"PIVIDENT_{identifiers([prefix + 'model'])[0].upper()}_H"
    lines = ["/* Generated by pivident. */", f"#ifndef {guard}", f"#define {guard}", ""]
    lines += ["#include <stddef.h>", "", "#ifdef __cplusplus", 'extern "C" {', "#endif", ""]
    for closing, (posture, _, _) in closing_names(closings_of(programs), prefix, names).items():
        lines += [posture_declaration(closing, posture), ""]
    for program, name in zip(programs, names, strict=True):
        lines += [*c_comment(program.header), f"{_signature(program, name)};"]
        if many:
            lines.append(f"{_many_signature(program, name)};")
        lines.append("")
    lines += ["#ifdef __cplusplus", "}", "#endif", "", "#endif", ""]
    return "\n".join(lines)


def _arguments(program: Assignments) -> list[tuple[str, Input]]:
    """Arguments that have elements, with their identifiers; the parameters come last."""
    texts, _ = argument_names(program, _TAKEN)
    both = zip(texts, (*program.inputs, program.parameters), strict=True)
    return [(text, argument) for text, argument in both if argument.symbols]


def _results(program: Assignments) -> list[tuple[str, Output]]:
    _, texts = argument_names(program, _TAKEN)
    return list(zip(texts, program.outputs, strict=True))


def _signature(program: Assignments, name: str) -> str:
    given = [f"const double {text}[{len(a)}]" for text, a in _arguments(program)]
    results = [f"double {text}[{max(o.elements.size, 1)}]" for text, o in _results(program)]
    given += _posture(program)
    return f"void {name}({', '.join(given + results)})"


def _posture(program: Assignments) -> list[str]:
    """The argument that says where Newton's method starts, and receives where it has ended."""
    return [f"double posture[{len(program.closing.posture)}]"] if program.closing else []


def _many_signature(program: Assignments, name: str) -> str:
    given = [f"const double *{text}" for text, _ in _arguments(program)]
    results = [f"double *{text}" for text, _ in _results(program)]
    given += _posture(program)
    return f"void {name}_samples(size_t samples, {', '.join(given + results)})"


def _single(program: Assignments, name: str, close: str = "", static: bool = False) -> list[str]:
    """The function for one state; ``close`` is the one that finds its passive positions."""
    names = scalar_names(program, _TAKEN)
    signature = f"{'static ' * static}{_signature(program, name)}"
    lines = [signature, "{", *_unused(program)]
    for text, argument in _arguments(program):
        lines += _unpacked(program, argument, names, lambda k, text=text: f"{text}[{k}]")
    if program.closing:
        unknown = program.closing.unknown
        lines += [f"    double passive[{len(unknown)}];", f"    {close}(q, posture, passive);"]
        lines += _unpacked(program, unknown, names, lambda k: f"passive[{k}]")
    lines += [f"    {line}" for line in _assignments(program, names)]
    for text, output in _results(program):
        values = _element_texts(output, names)
        lines += [f"    {text}[{k}] = {value};" for k, value in enumerate(values)]
    return [*lines, "}"]


def _many(program: Assignments, name: str) -> list[str]:
    """A loop over tiles: inputs are transposed to time last, results back."""
    names = scalar_names(program, _TAKEN)
    rows = [(t, a) for t, a in _arguments(program) if a is not program.parameters]
    signals = [(t, a) for t, a in rows if program.used.intersection(a.symbols)]
    lines = [
        f"/* The same for many samples: {', '.join(t for t, _ in rows)} and the results hold",
        "   one row for each of them. */",
        _many_signature(program, name),
        "{",
        *_unused(program),
    ]
    for text, argument in _arguments(program):
        if argument is program.parameters:
            lines += _unpacked(program, argument, names, lambda k, text=text: f"{text}[{k}]")
    lines += [
        f"    double {text}_tile[{len(argument)}][TILE] = {{{{0.0}}}};"
        for text, argument in signals
    ]
    for text, output in _results(program):
        lines += _result_tile(text, output)
    lines += [
        "    for (size_t start = 0; start < samples; start += TILE) {",
        "        const size_t count = samples - start < TILE ? samples - start : TILE;",
        "        for (size_t s = 0; s < count; ++s) {",
    ]
    for text, argument in signals:
        n = len(argument)
        lines += [
            f"            for (size_t k = 0; k < {n}; ++k)",
            f"                {text}_tile[k][s] = {text}[(start + s) * {n} + k];",
        ]
    lines += ["        }", "        for (size_t s = 0; s < TILE; ++s) {"]
    for text, argument in signals:
        unpacked = _unpacked(program, argument, names, lambda k, text=text: f"{text}_tile[{k}][s]")
        lines += [f"        {line}" for line in unpacked]
    lines += [f"            {line}" for line in _assignments(program, names)]
    for text, output in _results(program):
        values = _element_texts(output, names)
        lines += [
            f"            {text}_tile[{row}][s] = {values[k]};"
            for row, k in enumerate(_filled(output))
        ]
    lines += ["        }", "        for (size_t s = 0; s < count; ++s) {"]
    for text, output in _results(program):
        lines += _result_rows(text, output)
    return [*lines, "        }", "    }", "}"]


def _in_turn(program: Assignments, name: str) -> list[str]:
    """Samples one after the other: each follows the mechanism from the one before."""
    rows = [t if a is program.parameters else f"{t} + {len(a)} * s" for t, a in _arguments(program)]
    results = [f"{t} + {o.elements.size} * s" for t, o in _results(program)]
    return one_after_the_other(_many_signature(program, name), name, [*rows, "posture", *results])


def _filled(output: Output) -> list[int]:
    """Elements of a result that are not identically zero."""
    return [k for k, e in enumerate(output.elements.ravel()) if not e.is_zero]


def _result_tile(text: str, output: Output) -> list[str]:
    """The tile of a result, and the places of its elements if some are left out."""
    filled, n = _filled(output), output.elements.size
    if not filled:
        return []
    lines = [f"    double {text}_tile[{len(filled)}][TILE];"]
    if len(filled) < n:
        numbers = ", ".join(map(str, filled))
        lines += [
            f"    static const unsigned short {text}_place[{len(filled)}] = {{",
            *(f"        {line}" for line in textwrap.wrap(numbers, 88)),
            "    };",
        ]
    return lines


def _result_rows(text: str, output: Output) -> list[str]:
    """Copy a tile's elements to the rows of a result."""
    filled, n = _filled(output), output.elements.size
    row = f"{text}[(start + s) * {n} + "
    if len(filled) == n:
        return [
            f"            for (size_t k = 0; k < {n}; ++k)",
            f"                {row}k] = {text}_tile[k][s];",
        ]
    lines = [f"            for (size_t k = 0; k < {n}; ++k)", f"                {row}k] = 0.0;"]
    if filled:
        lines += [
            f"            for (size_t k = 0; k < {len(filled)}; ++k)",
            f"                {row}{text}_place[k]] = {text}_tile[k][s];",
        ]
    return lines


def _unused(program: Assignments) -> list[str]:
    """Arguments that no result depends on, named so that compilers do not warn."""
    return [
        f"    (void){text};"
        for text, argument in _arguments(program)
        if not program.used.intersection(argument.symbols)
    ]


def _unpacked(program: Assignments, argument: Input, names: Mapping, place) -> list[str]:
    """Elements of an argument that are used, as local constants."""
    return [
        f"    const double {names[s]} = {place(k)};"
        for k, s in enumerate(argument.symbols)
        if s in program.used
    ]


def _assignments(program: Assignments, names: Mapping[Expression, str]) -> Iterator[str]:
    """Statements for the variables; sine and cosine of one angle are computed together."""
    paired: set[Expression] = set()
    circular = {(type(v), v.operands[0]): v for v in program.variables if _is_circular(v)}
    texts = expression_texts(program.variables, _C, names)
    for variable, text in zip(program.variables, texts, strict=True):
        if variable in paired:
            continue
        if not _is_circular(variable):
            yield f"const double {names[variable]} = {text};"
            continue
        angle = variable.operands[0]
        both = [circular.get((kind, angle)) for kind in (Sine, Cosine)]
        paired.update(v for v in both if v is not None)
        places = [names[v] if v is not None else f"{names[variable]}_other" for v in both]
        argument = expression_texts([angle], _C, names)[0] if angle.operands else names[angle]
        argument = names.get(angle, argument)
        yield from [
            f"double {places[0]}, {places[1]};",
            f"sine_and_cosine({argument}, &{places[0]}, &{places[1]});",
        ]


def _is_circular(node: Expression) -> bool:
    return isinstance(node, (Sine, Cosine))


def _element_texts(output: Output, names: Mapping[Expression, str]) -> list[str]:
    return [names.get(e) or expression_texts([e], _C, names)[0] for e in output.elements.ravel()]


def _helpers(programs: Iterable[Assignments]) -> list[str]:
    """Functions that the programs call besides those of ``math.h``."""
    nodes = ordered(e for program in programs for e in program.expressions)
    wanted = {"sine_and_cosine": any(map(_is_circular, nodes))}
    calls = {node.function for node in nodes if isinstance(node, Call)}
    wanted["arctangent"], wanted["sign_of"] = "atan" in calls, "sign" in calls
    text = resources.files("pivident.models.symbolic").joinpath("elementary.c").read_text("utf-8")
    blocks = text.split("\n\n")
    kept = [f"#define TILE {TILE}", "", blocks[0]]
    for block in blocks[1:]:
        if any(f" {name}(" in block and used for name, used in wanted.items()):
            kept += ["", block.rstrip()]
    for name in sorted(calls - {*C99.functions, "divide"}):
        source = friction_columns()[name].c_source
        kept += ["", re.sub(rf"(?<!static )\bdouble(?=\s+{name}\s*\()", "static double", source)]
    return kept
