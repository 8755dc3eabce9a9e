"""How the iteration converged."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pivident.estimation.identification import Identification
from pivident.figures.paper_style import FigureError, line_style, new_figure, paper_style

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def figure_of_convergence(result: Identification, *, columns: int = 1) -> Figure:
    """Distance of all parameters from the estimate in σ, and the criteria, over the iterations.

    Args:
        result: an identification by an iterative method.
        columns: width, 1 or 2 columns of a page.

    Returns:
        The figure; `save_figure` writes it.

    Raises:
        FigureError: it was solved in one step.
    """
    from matplotlib.ticker import MaxNLocator

    history = result.history
    if len(history) < 2:
        raise FigureError(
            f"{result.method} solved its equations in one step; there is no iteration to draw"
        )
    fitted = result.simulation is not None
    steps = np.arange(1, len(history) + 1)
    theta = np.array([step.theta for step in history])
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = np.abs(theta - result.theta) / result.std
    distance[~(np.isfinite(distance) & (distance > 0.0))] = np.nan
    with paper_style():
        figure, (top, bottom) = new_figure(2, columns=columns, row_height=1.5, share_x=True)
        for p, line in zip(result.parameters, distance.T, strict=True):
            top.semilogy(steps, line, lw=0.7, **line_style(p.joint, marker=True) | {"ms": 2.2})
        top.axhline(1.0, color="#555555", lw=0.7, ls="--")
        top.set(ylabel="distance from estimate [σ]", title="parameters, one line each by joint")
        for k, (name, values) in enumerate(
            (
                ("largest relative change", [step.change for step in history]),
                (
                    f"weighted {'simulation' if fitted else 'torque'} error",
                    [step.residual for step in history],
                ),
            )
        ):
            values_percent = 100.0 * np.array(values, dtype=float)
            values_percent[~np.isfinite(values_percent)] = np.nan
            bottom.semilogy(steps, values_percent, label=name, **line_style(k, marker=True))
        bottom.set(xlabel="iteration", ylabel="criterion [%]")
        bottom.xaxis.set_major_locator(MaxNLocator(integer=True))
        bottom.legend()
    return figure
