"""Transmission error of a gear: lines in the deflection that repeat with the motor's angle.

A gear with ratio N turns the link by q_m + Σ a_i cos(o_i N q_m) + b_i sin(o_i N q_m), with o_i the
order, cycles per revolution of the motor. Orders need not be integers: the teeth of a cycloidal
gear repeat with fractions of a revolution.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pivident.flexibility.measured import Measured

#: Smallest number of periods of a line over the travel; fewer are indistinguishable from the load.
MIN_PERIODS = 8

#: Power of a line over the median of its neighbours. A χ² of two degrees of freedom exceeds this
#: with a probability of 2^-16.
LEAST_POWER = 16.0

#: Half width of the neighbourhood, in orders of one period over the travel.
NEIGHBOURS = 25

#: Smallest distance of two lines, in periods over the travel: a line whose amplitude changes with
#: the load has sidebands, which are not separate lines.
SEPARATION = 6

#: Maximum number of lines.
MAX_LINES = 6


@dataclass(frozen=True)
class TransmissionLine:
    """One periodic part of the transmission error."""

    order: float  # cycles per revolution of the motor
    amplitude: Measured  # of the deflection [rad]


def line_columns(angle: np.ndarray, orders: Sequence[float]) -> np.ndarray:
    """Cosine and sine of each order, shape (samples, 2·orders)."""
    columns = [f(order * angle) for order in orders for f in (np.cos, np.sin)]
    return np.column_stack(columns) if columns else np.empty((len(angle), 0))


def largest_order(angle: np.ndarray, rate: float) -> float:
    """Order whose frequency reaches 80 % of half the sampling rate at the highest speed."""
    fastest = float(np.abs(np.gradient(angle)).max()) * rate
    return 0.8 * math.pi * rate / max(fastest, 1e-12)


def find_orders(residual: np.ndarray, angle: np.ndarray, highest: float) -> list[float]:
    """Orders of the lines in a residual, strongest first.

    One line at a time is found in the spectrum over the motor's angle and subtracted together with
    all earlier ones.
    """
    period = 2 * math.pi / max(float(np.ptp(angle)), 1e-12)
    lowest, step = MIN_PERIODS * period, 0.5 * period
    if highest <= lowest + 2 * NEIGHBOURS * step:
        return []
    grid = np.arange(lowest, highest, step)
    orders: list[float] = []
    left = residual - residual.mean()
    for _ in range(MAX_LINES):
        power = _power(left, angle, grid)
        background = _running_median(power, 2 * NEIGHBOURS)
        for order in orders:
            power[np.abs(grid - order) < SEPARATION * period] = 0.0
        best = int(np.argmax(power / background))
        if power[best] < LEAST_POWER * background[best]:
            break
        fine = grid[best] + step * np.linspace(-1, 1, 41)
        orders.append(float(fine[np.argmax(_power(left, angle, fine))]))
        columns = line_columns(angle, orders)
        left = residual - residual.mean()
        left = left - columns @ np.linalg.lstsq(columns, left, rcond=None)[0]
    return orders


def _power(x: np.ndarray, angle: np.ndarray, orders: np.ndarray) -> np.ndarray:
    """|Σ x exp(-i o angle)|² of each order; a raised cosine over the travel keeps lines narrow."""
    low, travel = float(angle.min()), float(np.ptp(angle))
    weighted = x * (0.5 - 0.5 * np.cos(2 * np.pi * (angle - low) / travel))
    power = np.empty(len(orders))
    for k, order in enumerate(orders):
        phase = order * angle
        power[k] = (weighted @ np.cos(phase)) ** 2 + (weighted @ np.sin(phase)) ** 2
    return power


def _running_median(x: np.ndarray, half: int) -> np.ndarray:
    """Median of each value's neighbourhood."""
    padded = np.pad(x, half, mode="reflect")
    return np.median(np.lib.stride_tricks.sliding_window_view(padded, 2 * half + 1), axis=1)
