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


def identification_text(result: Identification) -> str:
    """An identification as a table."""
    from pivident.estimation.summary import identification_table

    return identification_table(result)


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
