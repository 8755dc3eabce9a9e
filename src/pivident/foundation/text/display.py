"""What results of every layer share: that a notebook can show them."""

from __future__ import annotations

from typing import Any

#: The module `pivident.app.notebook.presentation`, set by `pivident`: its functions show results.
presentation: Any = None


class Displayed:
    """A result that notebooks show as HTML."""

    def _repr_html_(self) -> str:
        return str(presentation.html_of(self))
