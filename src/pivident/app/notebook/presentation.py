"""How results are shown: as HTML in notebooks, as text by ``print``, as files by ``save``.

What results call for this is `pivident.foundation.text.display.presentation`, which `pivident` sets
to this module: results of every room can be shown, and none needs what it takes to show them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pivident.estimation.identification import Identification
    from pivident.studies.excitation.design import Design


def html_of(result: Any) -> str:
    """A result as HTML for a notebook."""
    from pivident.app.notebook.displays import html_of

    return html_of(result)


def text_of(result: Any) -> str:
    """A result as text: its one line, and a table of what it holds."""
    from pivident.app.notebook.displays import contents

    table = contents(result)
    of_fields = table.name == type(result).__name__  # which its one line repeats
    headline = table.name if of_fields else repr(result).strip("<>")
    return f"{headline}\n\n{table.text()}"


def identification_text(result: Identification) -> str:
    """An identification as a table."""
    from pivident.estimation.summary import identification_table

    return identification_table(result)


def latex_of(result: Any) -> str:
    """The estimates of a result as a table for LaTeX, with its headline above as a comment."""
    return str(result.parameter_table().to_latex(repr(result).strip("<>")))


def headline_of(result: Identification) -> str:
    """An identification on one line."""
    from pivident.estimation.summary import headline

    return headline(result)


def save(result: Identification, folder: Any) -> None:
    """Write an identification as files into a folder."""
    from pivident.estimation.identification_file import save_identification

    save_identification(result, folder)


def own_estimate(problem: Any, theta: Any, covariance: Any, **options: Any) -> Identification:
    """The result that parameters are, whoever found them."""
    from pivident.estimation.own_estimate import own_estimate

    return own_estimate(problem, theta, covariance, **options)


def design_text(design: Design) -> str:
    """A designed motion in words."""
    from pivident.studies.excitation.account import design_text

    return design_text(design)
