"""What results of every layer share: that a notebook can show them."""

from __future__ import annotations

from typing import Any

#: The module `pivident.app.notebook.presentation`, set by `pivident`: its functions show results.
presentation: Any = None


class Summary(str):
    """The account of a result as text, which gives it as HTML and LaTeX too.

    Attributes:
        result: of which it is the account.
    """

    result: Any

    def __new__(cls, text: str, result: Any) -> Summary:
        """A text, and the result that it is about."""
        summary = super().__new__(cls, text)
        summary.result = result
        return summary

    def __getnewargs__(self) -> tuple[str, Any]:
        return str(self), self.result

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


class Displayed:
    """A result that notebooks show as HTML."""

    def _repr_html_(self) -> str:
        return str(presentation.html_of(self))
