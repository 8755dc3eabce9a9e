"""Docstrings as they are written for reading in the source: formulas are indented, bars are bars.

reStructuredText takes an indented formula for a quotation and ``|θ|`` for a substitution. Before
the sections of a docstring are read, indented paragraphs become literal blocks and bars are
escaped.
"""

from __future__ import annotations


def literal_formulas(lines: list[str]) -> list[str]:
    """The docstring's lines with formulas as literal blocks and bars escaped."""
    found: list[str] = []
    inside = False
    for number, line in enumerate(lines):
        indented = line.startswith("    ")
        if line.strip() and not indented:
            inside = False
        elif indented and not inside and number and not lines[number - 1].strip():
            above = next((text for text in reversed(lines[:number]) if text.strip()), "")
            if above and not above.startswith(" "):
                found += ["::", ""]
                inside = True
        found.append(line if inside else line.replace("|", "\\|"))
    return found


def process(app, what, name, obj, options, lines: list[str]) -> None:
    """Rewrite a docstring before its sections are read."""
    lines[:] = literal_formulas(lines)


def setup(app) -> dict:
    """Come before napoleon, which reads the sections."""
    app.connect("autodoc-process-docstring", process, priority=400)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
