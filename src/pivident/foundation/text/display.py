"""What results of every layer share: that a notebook can show them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import fields
from typing import Any

#: The module `pivident.app.notebook.presentation`, set by `pivident`: its functions show results.
presentation: Any = None


class Summary(str):
    """The account of a result as text, which gives it as HTML and LaTeX too.

    Attributes:
        result: of which it is the account.
    """

    result: Any

    def __new__(cls, text: str, result: Any = None) -> Summary:
        """A text, and the result that it is about."""
        summary = super().__new__(cls, text)
        summary.result = result
        return summary

    def as_text(self) -> str:
        """The text."""
        return str(self)

    def as_html(self) -> str:
        """The result as HTML that stands by itself."""
        return str(presentation.html_of(self.result))

    def as_latex(self) -> str:
        """Estimates with their intervals as a table for LaTeX (booktabs)."""
        return str(presentation.latex_of(self.result))

    _repr_html_ = as_html

    def __repr__(self) -> str:
        return str(self)  # what an interpreter shows is the account, not a quoted string


#: Longest text of a result on one line, and of one of its values.
MAX_LINE, MAX_VALUE = 200, 60


class Displayed:
    """A result that fits on one line as ``repr`` and that notebooks show as HTML.

    Dataclasses that derive from it have this ``repr`` instead of the one with all of their arrays,
    unless they define one.
    """

    def __init_subclass__(cls, **arguments: Any) -> None:
        super().__init_subclass__(**arguments)
        if "__repr__" not in vars(cls):  # or `dataclass` would write one of all fields
            cls.__repr__ = cls.__repr__  # type: ignore[method-assign]

    def __repr__(self) -> str:
        return in_one_line(self)

    def _repr_html_(self) -> str:
        return str(presentation.html_of(self))


class Printed(Displayed):
    """A result that `print` shows in full: one line, and a table of what it holds."""

    def __str__(self) -> str:
        return str(presentation.text_of(self))


def in_one_line(result: Any) -> str:
    """Class and fields of a result, of at most `MAX_LINE` characters."""
    text = f"<{type(result).__name__}"
    for number, (name, value) in enumerate(fields_in_words(result)):
        more = f"{', ' if number else ': '}{name} {value}"
        if len(text) + len(more) > MAX_LINE - 4:
            return f"{text}, …>" if number else f"{text}>"
        text += more
    return f"{text}>"


def fields_in_words(result: Any, most: int = MAX_VALUE) -> Iterator[tuple[str, str]]:
    """The fields that a result shows, each with its value in at most so many characters."""
    for field in fields(result):
        value = getattr(result, field.name, None)
        empty = value is None or (isinstance(value, str | tuple | list | dict) and not value)
        if field.repr and not empty:
            yield field.name, in_few_words(value, most)


def in_few_words(value: Any, most: int = MAX_VALUE) -> str:
    """A value in at most so many characters: small ones written out, large ones described."""
    if hasattr(value, "shape") and hasattr(value, "tolist"):
        if value.size > _MAX_WRITTEN or value.dtype.kind not in "fiub":
            return f"of shape {value.shape}"
        value = value.tolist()
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, Mapping):
        text, described = ", ".join(map(str, value)), f"{len(value)} entries"
    elif isinstance(value, list | tuple):
        kinds = {type(own).__name__ for own in value}
        described = f"{len(value)} {kinds.pop() if len(kinds) == 1 else 'values'}"
        text = f"[{', '.join(map(in_few_words, value[: _MAX_WRITTEN + 1]))}]"
        text = text if len(value) <= _MAX_WRITTEN else described
    else:
        text, described = repr(value), type(value).__name__
        described = f"{text[: most - 1]}…" if isinstance(value, str) else described
    return text if len(text) <= most and "\n" not in text else described


#: Entries of a sequence that are written out, at most.
_MAX_WRITTEN = 7
