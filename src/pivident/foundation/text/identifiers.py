"""Names as identifiers of C and Python, as LaTeX, and texts as comments of generated code.

Names and messages without effect on the terminal, page or file they are written to.
"""

from __future__ import annotations

import keyword
import re
import unicodedata
from collections.abc import Iterable

_C_WORDS = """
auto break case char const continue default do double else enum extern float for goto if inline int
long register restrict return short signed sizeof static struct switch typedef union unsigned void
volatile while asm fortran bool true false NULL near far
sin cos tan sqrt fabs abs exp atan atan2 tanh pow fmax fmin sign_of sincos log floor ceil round
j0 j1 jn y0 y1 yn gamma erf signgam main size_t restrict M_PI INFINITY NAN I
""".split()
_PYTHON_WORDS = ("np", "numpy", "print", "math", "sum", "abs", "max", "min", "pow", "len", "range")

#: Words that are reserved in generated code, in C or in Python.
RESERVED = frozenset([*_C_WORDS, *_PYTHON_WORDS, *keyword.kwlist, *keyword.softkwlist])

_GREEK = (
    "alpha beta gamma delta epsilon zeta eta theta iota kappa lambda mu nu xi pi rho sigma tau "
    "phi chi psi omega"
).split()


def identifier(name: str) -> str:
    """A valid identifier that resembles the name: ``zz[left elbow]`` becomes ``zz_left_elbow``.

    Letters lose their accents, other characters become underscores, keywords and names that
    generated code needs get a trailing underscore.
    """
    plain = unicodedata.normalize("NFKD", name).encode("ascii", "ignore").decode()
    # Characters without an ASCII equivalent become their numbers, so that names stay distinct.
    if not re.search(r"[A-Za-z0-9]", plain) and name:
        plain = "_".join(f"u{ord(c):x}" for c in name)
    text = re.sub(r"[^A-Za-z0-9]+", "_", plain).strip("_") or "x"
    if text[0].isdigit():
        text = f"x{text}"
    return f"{text}_" if text in RESERVED else text


def identifiers(names: Iterable[str], taken: Iterable[str] = ()) -> list[str]:
    """Distinct identifiers for different names, none of them ``taken``; numbered where equal."""
    used = set(taken)
    result = []
    for name in names:
        text = stem = identifier(name)
        k = 2
        while text in used:
            text, k = f"{stem}_{k}", k + 1
        used.add(text)
        result.append(text)
    return result


def one_line(text: str) -> str:
    """A text without line ends and other control characters, for a comment."""
    return " ".join("".join(c if c.isprintable() else " " for c in text).split())


def c_comment(lines: Iterable[str]) -> list[str]:
    """Lines of a C comment; what would end it, nest in it or be a trigraph is separated."""
    safe = [line.replace("*/", "* /").replace("/*", "/ *") for line in map(_indented, lines)]
    safe = [re.sub(r"\?(?=\?)", "? ", line) for line in safe]
    return ["/*", *(f" * {line}".rstrip() for line in safe), " */"]


def _indented(text: str) -> str:
    """One line that keeps the spaces before it."""
    return " " * (len(text) - len(text.lstrip(" "))) + one_line(text)


def latex_text(text: str) -> str:
    """Any text, escaped for LaTeX's text mode."""
    special = {
        "\\": r"\textbackslash{}", "{": r"\{", "}": r"\}", "$": r"\$", "&": r"\&", "#": r"\#",
        "%": r"\%", "_": r"\_", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}",
        "±": r"$\pm$", "σ": r"$\sigma$", "θ": r"$\theta$",
    }  # fmt: skip
    return "".join(special.get(c, c) for c in text)


def latex_name(name: str) -> str:
    r"""A name for LaTeX's math mode: ``zz1r`` becomes ``\mathit{zz}_{1r}``, ``q2`` ``q_{2}``."""
    if name.startswith("minus_"):
        return rf"\left(-{latex_name(name.removeprefix('minus_'))}\right)"
    match = re.fullmatch(r"([A-Za-z]+)[_\[]?([^\]]*)\]?", name)
    stem, index = match.groups() if match else (name, "")
    if stem in _GREEK:
        head = rf"\{stem}"
    elif re.fullmatch(r"d+q", stem):
        head = {"dq": r"\dot{q}", "ddq": r"\ddot{q}"}.get(stem, rf"\mathit{{{stem}}}")
    elif len(stem) == 1:
        head = stem if stem.isalpha() else rf"\text{{{latex_text(stem)}}}"
    elif re.fullmatch(r"[A-Za-z]+", stem):
        head = rf"\mathit{{{stem}}}"
    else:
        head = rf"\text{{{latex_text(stem)}}}"
    if not index:
        return head
    inside = index if re.fullmatch(r"[0-9]+[a-z]?", index) else rf"\text{{{latex_text(index)}}}"
    return f"{head}_{{{inside}}}"


#: Control characters, line separators, and marks that change the direction of writing.
_ACTIVE = "\\x00-\\x1f\\x7f-\\x9f\\u200e\\u200f\\u2028\\u2029\\u202a-\\u202e\\u2066-\\u2069"

#: Longest message, in characters.
MAX_TEXT = 2000

_IN_NAMES = re.compile(f"[{_ACTIVE}]")
_IN_TEXTS = re.compile(f"(?![\\n\\t])[{_ACTIVE}]")


def is_printable(name: str) -> bool:
    """Whether a name has no characters that control a terminal or break a line."""
    return _IN_NAMES.search(name) is None


def shortened(text: str) -> str:
    """The text, or its beginning and end where it is longer than ``MAX_TEXT``."""
    return text if len(text) <= MAX_TEXT else f"{text[: MAX_TEXT - 300]} … {text[-300:]}"


def sheet_text(text: str) -> str:
    """A cell of text that a spreadsheet does not interpret as a formula."""
    return f"'{text}" if text[:1] in ("=", "+", "-", "@", "\t", "\r") else text


def escaped(text: str) -> str:
    r"""The text with such characters escaped (``\x1b``), except line ends and tabs."""
    return _IN_TEXTS.sub(lambda found: ascii(found.group())[1:-1], text)
