"""Residuals that were made white: their autocorrelations, and their spectra before and after."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from pivident.estimation.identification import Identification
from pivident.judgement.validation.residuals.autocorrelation import (
    COUNTED_LAGS,
    autocorrelation,
    joint_residuals,
)
from pivident.judgement.validation.residuals.residual_spectrum import residual_spectra
from pivident.studies.figures.paper_style import (
    FigureError,
    chosen_joints,
    chosen_recording,
    chosen_signals,
    joint_panels,
    legend_above,
    line_style,
    new_figure,
    paper_style,
    plain,
)

if TYPE_CHECKING:
    from pivident.studies.figures.paper_style import Figure, Panels


def figure_of_autocorrelations(
    results: Identification | Sequence[Identification],
    joints: Sequence[str | int] | None = None,
    *,
    lags: int = COUNTED_LAGS,
    columns: int = 2,
    ax: Panels = None,
) -> Figure:
    """Autocorrelations of each joint's residual, one row for each joint, and ±2/√n around zero.

    The residual is that of the equation which was solved: decimated, or prefiltered. Results stand
    side by side. Of white noise 95 % lie within the band.

    Args:
        results: identifications with their signals.
        joints: names or numbers from 1; None: all.
        lags: number of lags.
        columns: width, 1 or 2 columns of a page.
        ax: axes to draw into, one for each panel in order of reading; None: a new figure.

    Returns:
        The figure; `save_figure` writes it.

    Raises:
        FigureError: there are no signals, or no such joint.
    """
    made = [results] if isinstance(results, Identification) else list(results)
    if not made:
        raise FigureError("there is no result to draw", advice="give at least one")
    chosen = chosen_joints(made[0], joints)
    with paper_style(ax):
        figure, axes = new_figure(len(chosen), len(made), columns=columns, ax=ax, row_height=1.3)
        for k, result in enumerate(made):
            chosen_recording(result, 0)
            residuals = joint_residuals(result)
            for panel, j in zip(axes[k :: len(made)], chosen, strict=True):
                found = autocorrelation(residuals[j], lags)
                lag = np.arange(1, lags + 1)
                panel.plot(
                    lag, found.rho, "o", color="#D55E00", markersize=2.2, label="autocorrelation"
                )
                for side in (1.0, -1.0):
                    panel.plot(lag, side * found.band, color="#0072B2", linewidth=0.9,
                            label="±2/√n" if side > 0 else None)  # fmt: skip
                panel.set_ylabel(plain(result.robot.joint_names[j]) if k == 0 else "")
                panel.set_xlim(0, lags + 1)
            axes[k].set_title(plain(result.method))
            axes[-len(made) + k].set_xlabel("lag [samples]")
        legend_above(figure, axes[0], 2, ax)
    return figure


def figure_of_residual_spectra(
    result: Identification,
    joints: Sequence[str | int] | None = None,
    *,
    columns: int = 2,
    ax: Panels = None,
) -> Figure:
    """Spectrum of each joint's whitened residual, with the band that 95 % of white noise keeps to.

    The spectrum is Welch's in twelfths of octaves, over all recordings, see
    `residual_spectrum`; white noise of unit variance has 1 everywhere.

    Args:
        result: an identification with its signals.
        joints: names or numbers from 1; None: all.
        columns: width, 1 or 2 columns of a page.
        ax: axes to draw into, one for each panel in order of reading; None: a new figure.

    Returns:
        The figure; `save_figure` writes it.

    Raises:
        FigureError: there are no signals, too few samples, or no such joint.
    """
    chosen, *_ = chosen_signals(result, joints)
    spectra = residual_spectra(result)
    with paper_style(ax):
        figure, axes = joint_panels(
            len(chosen), columns=columns, ax=ax, row_height=1.4, xlabel="frequency [Hz]"
        )
        for panel, j in zip(axes, chosen, strict=True):
            name, found = result.robot.joint_names[j], spectra[j]
            if found is None:
                raise FigureError(
                    f"the residual of {name} has too few samples without a gap for a spectrum",
                    advice="leave this joint out, or take a longer record",
                )
            frequency, power = found.white.frequency, found.white.density / found.white_level
            low, high = found.white.band(1.0)
            panel.fill_between(
                frequency, low, high, color="#000000", alpha=0.12, linewidth=0, step="mid",
                label="95 % of white",
            )  # fmt: skip
            panel.loglog(frequency, power, label="residual", **line_style(1) | {"linestyle": "-"})
            panel.set(ylabel="power / white", title=plain(name))
            panel.set_ylim(min(0.1, 0.8 * float(power.min())), max(10.0, 1.2 * float(power.max())))
        legend_above(figure, axes[0], 2, ax)
    return figure
