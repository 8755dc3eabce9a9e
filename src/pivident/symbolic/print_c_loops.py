"""Newton's method for the passive positions of a closed mechanism, as C99.

Generated functions of such a mechanism have an argument ``posture``, where the loops were closed
last: it is where the next state is followed from, so that a controller pays for one or two steps.
"""

from __future__ import annotations

import textwrap
from collections.abc import Sequence

from pivident.symbolic.assignments import GAP, MAX_STEPS, MAX_WAY, STRIDE, LoopClosing
from pivident.text.identifiers import c_comment, identifiers

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
