"""Figures for papers, one call each: matplotlib figures of one or two columns' width.

Every function returns a `matplotlib.figure.Figure` that no window and no global state knows of, so
it works on a machine without a screen. Lines differ by dash and by lightness as well as by colour.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pivident.figures.convergence import figure_of_convergence
    from pivident.figures.correlations import figure_of_correlations
    from pivident.figures.friction import figure_of_friction
    from pivident.figures.intervals import figure_of_intervals
    from pivident.figures.paper import FigureError, save_figure
    from pivident.figures.prefilter import figure_of_prefilters
    from pivident.figures.residual_spectra import figure_of_residual_spectra
    from pivident.figures.torques import figure_of_torques
    from pivident.figures.tracking import figure_of_tracking

#: Where each name lives.
_HOME = {
    "FigureError": "paper",
    "figure_of_convergence": "convergence",
    "figure_of_correlations": "correlations",
    "figure_of_friction": "friction",
    "figure_of_intervals": "intervals",
    "figure_of_prefilters": "prefilter",
    "figure_of_residual_spectra": "residual_spectra",
    "figure_of_torques": "torques",
    "figure_of_tracking": "tracking",
    "save_figure": "paper",
}

__all__ = [
    "FigureError",
    "figure_of_convergence",
    "figure_of_correlations",
    "figure_of_friction",
    "figure_of_intervals",
    "figure_of_prefilters",
    "figure_of_residual_spectra",
    "figure_of_torques",
    "figure_of_tracking",
    "save_figure",
]


def __getattr__(name: str) -> Any:
    """A figure, imported at first use: matplotlib is heavy."""
    if name not in _HOME:
        raise AttributeError(f"module 'pivident.figures' has no attribute {name!r}")
    return getattr(import_module(f"pivident.figures.{_HOME[name]}"), name)


def __dir__() -> list[str]:
    return sorted(__all__)
