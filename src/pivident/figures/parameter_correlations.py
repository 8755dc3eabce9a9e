"""Correlations between the errors of the parameters."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pivident.estimation.identification import Identification
from pivident.figures.paper_style import FigureError, new_figure, paper_style, plain

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Parameters whose names can be read at the side of a figure of one and of two columns.
_READABLE = {1: 30, 2: 62}


def figure_of_correlations(result: Identification, *, columns: int = 1) -> Figure:
    """Correlation of every pair of estimates, -1 to 1.

    Positive ones are red, negative blue; in grey both are dark, so the sign of strong ones (beyond
    0.5) is written into the cell where there is room.

    Args:
        result: the identification.
        columns: width, 1 or 2 columns of a page.

    Returns:
        The figure; `save_figure` writes it.

    Raises:
        FigureError: its covariance is not finite.
    """
    std = result.std
    if not (np.isfinite(std).all() and (std > 0.0).all()):
        raise FigureError("the covariance is not finite or has zeros; there are no correlations")
    correlation = result.covariance / np.outer(std, std)
    n = len(result.names)
    with paper_style():
        height = 3.0 if columns == 1 else 6.0
        figure, (ax,) = new_figure(1, columns=columns, row_height=height)
        image = ax.imshow(correlation, cmap="RdBu_r", vmin=-1.0, vmax=1.0, interpolation="nearest")
        ax.grid(visible=False)
        step = -(-n // _READABLE.get(columns, 30))
        places = np.arange(0, n, step)
        size = float(np.clip(200.0 * columns * step / n, 4.5, 7.0))
        names = [plain(result.names[k]) for k in places]
        ax.set_xticks(places, names, rotation=90, fontsize=size)
        ax.set_yticks(places, names, fontsize=size)
        for a, b in zip(*np.nonzero(np.abs(correlation) > 0.5), strict=True):
            if a != b and n <= _READABLE.get(columns, 30):
                sign = "+" if correlation[a, b] > 0 else "−"
                ax.text(b, a, sign, ha="center", va="center", color="white", fontsize=size)
        figure.colorbar(image, ax=ax, shrink=0.85, label="correlation")
    return figure
