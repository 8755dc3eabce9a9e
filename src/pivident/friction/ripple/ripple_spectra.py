"""Spectra of a joint's residual over all its angles: orders, lag, most significant order."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pivident.friction.ripple.order_spectrum import (
    HIGHEST_FREQUENCY,
    MIN_SHARE,
    OrderSpectrum,
    order_grid,
    order_spectrum,
)
from pivident.friction.ripple.ripple_lines import DISTINGUISHABLE
from pivident.friction.ripple.ripple_measures import PER_MOTOR_REVOLUTION
from pivident.friction.ripple.ripple_orders import Angle
from pivident.friction.ripple.ripple_series import (
    ResidualSeries,
    WaveFit,
    delayed,
    fit_waves,
    white_rows,
)
from pivident.robot.description import Robot

#: Trial lags of the torque behind the positions [samples]; the best one is refined.
LAGS = (0.0, 1.0, -1.0, 2.0)

#: Trials that each further lag adds: its spectrum is similar to that without lag.
LAG_TRIALS = 0.5

#: Neighbourhood of a line in which its lag is refined, as a share of its order.
NEAR = 0.03


def highest_order(
    robot: Robot, series: Sequence[ResidualSeries], joint: int, angle: Angle, highest: float | None
) -> float:
    """Largest order to try: requested or the gear's, and at most what the sampling resolves."""
    steps = np.concatenate([np.abs(s.dq @ angle.coefficients)[s.used[:, joint]] for s in series])
    if not steps.size or not np.any(steps > 0):
        return 0.0
    slow = max(float(np.quantile(steps, MIN_SHARE)), 1e-3 * float(steps.max()))
    shown = HIGHEST_FREQUENCY * math.pi * series[0].rate / slow
    if highest is not None:
        return min(highest, shown)
    # a coupled motor has an angle of its own, but its gear sits on the joint
    largest = float(np.abs(robot.transmission.reduction[:, joint]).max())
    return shown if largest == 1.0 else min((PER_MOTOR_REVOLUTION + 0.5) * largest, shown)


def visited_grid(
    series: Sequence[ResidualSeries], joint: int, angle: Angle, highest: float
) -> np.ndarray:
    """Orders of an angle, from one cycle over the visited positions on."""
    visited = np.concatenate([(s.q @ angle.coefficients)[s.used[:, joint]] for s in series])
    return order_grid(visited, highest) if visited.size else np.empty(0)


def best_lag(
    series: Sequence[ResidualSeries],
    joint: int,
    angles: Sequence[Angle],
    grids: Sequence[np.ndarray],
    cycles: float,
    level: float,
) -> float:
    """Delay of the torque relative to the positions, estimated from the strongest line [s].

    A torque logged 4 ms late lags 40 degrees at 30 Hz and 140 degrees at 100 Hz, so the line over
    positions of the same instant is smeared. A lag is used only if it is clearly likelier.
    """
    fit = fit_waves(series, joint, [])
    rate = series[0].rate
    found = []
    for samples in LAGS:
        moved = [delayed(s, samples / rate) for s in series]
        spectra = joint_spectra(moved, joint, angles, grids, fit, cycles, len(LAGS))
        best = most_significant(spectra)
        if best is not None:
            which, k, chance = best
            found.append((spectra[which].significance(k), samples, which, k, chance))
    if not found:
        return 0.0
    none = next((significance for significance, samples, *_ in found if samples == 0), 0.0)
    significance, samples, which, k, chance = max(found)
    if chance > level or significance < none + DISTINGUISHABLE:
        return 0.0
    near = grids[which][np.abs(grids[which] - grids[which][k]) < NEAR * grids[which][k]]
    finer = []
    for tried in samples + np.linspace(-1.0, 1.0, 17):
        moved = [delayed(s, tried / rate) for s in series]
        rows = white_rows(moved, joint, angles[which].coefficients, fit)
        finer.append((float(order_spectrum(rows, near, 0.0).gain.max()), tried))
    return float(max(finer)[1]) / rate


def joint_spectra(
    series: Sequence[ResidualSeries],
    joint: int,
    angles: Sequence[Angle],
    grids: Sequence[np.ndarray],
    fit: WaveFit,
    cycles: float,
    lags: int,
) -> tuple[OrderSpectrum, ...]:
    """Spectrum over each angle; the trials of all angles and lags count in each."""
    found = [
        order_spectrum(white_rows(series, joint, angle.coefficients, fit), grid, cycles)
        for angle, grid in zip(angles, grids, strict=True)
    ]
    trials = (1.0 + LAG_TRIALS * (lags - 1)) * sum(spectrum.trials for spectrum in found)
    return tuple(replace(spectrum, trials=trials) for spectrum in found)


def most_significant(spectra: Sequence[OrderSpectrum]) -> tuple[int, int, float] | None:
    """Angle, index and false-alarm probability of the most significant order; None without any."""
    candidates = [
        (s.significance(k), a, k) for a, s in enumerate(spectra) if (k := s.best()) is not None
    ]
    if not candidates:
        return None
    _, which, k = max(candidates)
    return which, k, spectra[which].false_alarm(k)
