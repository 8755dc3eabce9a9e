"""Spectra of the whitened residuals, against what white noise may have."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from pivident.estimation.identification import Identification
from pivident.figures.joint_panels import chosen_signals, joint_panels, legend_above
from pivident.figures.paper_style import FigureError, line_style, paper_style, plain
from pivident.validation.residuals.residual_spectrum import residual_spectra

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def figure_of_residual_spectra(
    result: Identification, joints: Sequence[str | int] | None = None, *, columns: int = 2
) -> Figure:
    """Spectrum of each joint's whitened residual, with the band that 95 % of white noise keeps to.

    The spectrum is Welch's in twelfths of octaves, over all recordings, see
    `residual_spectrum`; white noise of unit variance has 1 everywhere.

    Args:
        result: an identification with its signals.
        joints: names or numbers from 1; None: all.
        columns: width, 1 or 2 columns of a page.

    Returns:
        The figure; `save_figure` writes it.

    Raises:
        FigureError: there are no signals, too few samples, or no such joint.
    """
    chosen, *_ = chosen_signals(result, joints)
    spectra = residual_spectra(result)
    with paper_style():
        figure, axes = joint_panels(
            len(chosen), columns=columns, row_height=1.4, xlabel="frequency [Hz]"
        )
        for ax, j in zip(axes, chosen, strict=True):
            name, found = result.robot.joint_names[j], spectra[j]
            if found is None:
                raise FigureError(
                    f"the residual of {name} has too few samples without a gap for a spectrum; "
                    "leave this joint out, or take a longer record"
                )
            frequency, power = found.white.frequency, found.white.density / found.white_level
            low, high = found.white.band(1.0)
            ax.fill_between(
                frequency, low, high, color="#000000", alpha=0.12, linewidth=0, step="mid",
                label="95 % of white",
            )  # fmt: skip
            ax.loglog(frequency, power, label="residual", **line_style(1) | {"linestyle": "-"})
            ax.set(ylabel="power / white", title=plain(name))
            ax.set_ylim(min(0.1, 0.8 * float(power.min())), max(10.0, 1.2 * float(power.max())))
        legend_above(figure, axes[0], 2)
    return figure
