"""Output of a control law, and of the law that was identified from it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pivident.figures.joint_panels import draw_trace, joints_named, legend_above
from pivident.figures.paper_style import new_figure, paper_style, plain
from pivident.simulation.control_loop import FittedLaw
from pivident.text.numbers import percent

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def figure_of_control_law(law: FittedLaw, joint: str | int, *, columns: int = 1) -> Figure:
    """Recorded output of one joint's law, that of the identified law, and their difference.

    Args:
        law: what `identify_controller` or `identify_free_law` returns.
        joint: name, or number from 1.
        columns: width, 1 or 2 columns of a page.

    Returns:
        The figure; `save_figure` writes it.

    Raises:
        FigureError: there is no such joint.
    """
    (j,) = joints_named(law.joint_names, [joint])
    output, model = law.output[:, j], law.model[:, j]
    t = np.arange(len(output)) / law.rate
    known = np.isfinite(output) & np.isfinite(model)
    size = np.sqrt(np.mean(output[known] ** 2))
    left = np.sqrt(np.mean((output - model)[known] ** 2)) / size
    with paper_style():
        figure, (above, below) = new_figure(2, columns=columns, row_height=1.5, share_x=True)
        draw_trace(above, t, output, label="recorded", color="#0072B2", linewidth=1.4)
        draw_trace(
            above, t, model, label="identified law", color="#D55E00", linewidth=0.9,
            linestyle=(0, (4, 1.5)),
        )  # fmt: skip
        draw_trace(below, t, output - model, color="#000000", linewidth=0.7)
        name = plain(law.joint_names[j])
        above.set(ylabel="output [u]", title=f"{name}: {percent(100 * left)} left unexplained")
        below.set(ylabel="difference [u]", xlabel="time [s]", xlim=(0.0, float(t[-1])))
        legend_above(figure, above, 2)
    return figure
