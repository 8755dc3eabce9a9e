"""Zero-phase Butterworth filtering, central differences and outlier removal.

The classical recipe of IDIM: a low-pass filter run forwards and backwards on the positions, two
central differences, and later the decimation of both sides of the equation (see
:mod:`pivident.signals.decimation`). Forwards and backwards the gain is |H(f)|², with no phase;
the low-pass and the differentiators together are the band-pass of the recipe's name.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from pivident.foundation.errors import RecordingError, RecordingTooShort
from pivident.foundation.text.display import Displayed
from pivident.signals.filters import butterworth_sections, forwards_and_backwards, sections_response
from pivident.signals.instants import slope_at_instants

#: Minimum number of samples at each end that a regression should skip.
EDGE = 50


@dataclass(frozen=True, eq=False)
class BandpassedSignal(Displayed):
    """A filtered record with its derivatives, each of the shape of the input.

    Attributes:
        q: filtered position [rad or m].
        dq: its central difference [rad/s or m/s].
        ddq: the central difference of dq [rad/s² or m/s²].
        edge: samples to skip at each end, where filter and differences know only one side.
    """

    q: np.ndarray
    dq: np.ndarray
    ddq: np.ndarray
    edge: int  # samples to skip at each end, where filter and differences are one-sided


def bandpass(
    q: np.ndarray,
    rate: float,
    cutoff: float | np.ndarray = 50.0,
    order: int = 4,
    *,
    median: int = 1,
    padlen: int | None = None,
    at_instants: bool = False,
) -> BandpassedSignal:
    """Median filter, zero-phase Butterworth low-pass and two central differences.

    Args:
        q: positions [rad or m], shape (samples, joints).
        rate: sampling rate [Hz].
        cutoff: frequency of -3 dB in one run, -6 dB after both, for all joints or for each [Hz].
        order: order of one run.
        median: samples of the median filter; 1: none.
        padlen: samples of odd extension at each end, see `butterworth`.
        at_instants: whether each difference is corrected by its own second difference, which
            leaves an error of order h⁴ for one of order h², see `pivident.signals.instants`.

    Returns:
        Positions, speeds and accelerations, each of the shape of ``q``.
    """
    q, cutoff = median_filter(q, median), np.atleast_1d(cutoff)
    if (cutoff == cutoff[0]).all():
        smooth = butterworth(q, rate, float(cutoff[0]), order, padlen=padlen)
    else:
        pairs = zip(q.T, cutoff, strict=True)
        smooth = np.stack([butterworth(x, rate, c, order, padlen=padlen) for x, c in pairs], axis=1)
    dq = central_difference(smooth, rate)
    dq = slope_at_instants(dq) if at_instants else dq
    ddq = central_difference(dq, rate)
    ddq = slope_at_instants(ddq) if at_instants else ddq
    return BandpassedSignal(smooth, dq, ddq, max(EDGE, math.ceil(rate / cutoff.min())))


def butterworth(
    x: np.ndarray, rate: float, cutoff: float, order: int = 4, *, padlen: int | None = None
) -> np.ndarray:
    """Low-pass x forwards and backwards along axis 0, by second-order sections.

    Args:
        x: samples along axis 0, in any unit.
        rate: sampling rate [Hz].
        cutoff: cut-off frequency [Hz].
        order: order of one run.
        padlen: samples of odd extension at each end; None: three times the order, as MATLAB's
            ``filtfilt`` has it.

    Returns:
        The filtered samples, shape as of ``x``.

    Raises:
        RecordingError: the cut-off is not below half the rate.
        RecordingTooShort: fewer samples than the filter extends the record by.
    """
    padlen = 3 * order if padlen is None else padlen
    if not 0 < cutoff < rate / 2:
        raise RecordingError(
            f"cut-off frequency {cutoff:g} Hz at a rate of {rate:g} Hz",
            advice="it must lie between zero "
            f"and half the rate, {rate / 2:g} Hz: lower it, or check the unit of the time stamps "
            '(units = {t = "ms"} if they are milliseconds)',
        )
    if len(x) <= padlen:
        raise RecordingTooShort(len(x), padlen + 1)
    return forwards_and_backwards(butterworth_sections(order, cutoff, rate), x, padlen)


def central_difference(x: np.ndarray, rate: float) -> np.ndarray:
    """(x_{k+1} - x_{k-1}) · rate/2 along axis 0, one-sided at the two end samples."""
    return np.gradient(x, 1 / rate, axis=0)


def bandpass_response(
    frequency: np.ndarray, rate: float, cutoff: float, order: int = 4, derivative: int = 0
) -> np.ndarray:
    """Complex frequency response [1/sⁿ] from the position to its n-th filtered derivative.

    With H of one run of the Butterworth filter, and a central difference n times,

        |H(f)|² (j rate sin(2π f/rate))ⁿ,     n = 0, 1, 2

    away from the ends, so q̂ has no phase, dq̂ leads by 90° and ddq̂ by 180°, as derivatives do.
    """
    omega = 2.0 * np.pi * np.asarray(frequency, dtype=float) / rate
    once = sections_response(butterworth_sections(order, cutoff, rate), omega)
    difference = 1j * rate * np.sin(2.0 * np.pi * np.asarray(frequency) / rate)
    return np.abs(once) ** 2 * difference**derivative


def median_filter(x: np.ndarray, length: int = 3) -> np.ndarray:
    """Moving median of odd length along axis 0 (3 removes single outliers), ends repeated."""
    if length < 1 or length % 2 == 0:
        raise RecordingError(f"median filter of length {length}", advice="expected an odd number")
    if length == 1:
        return np.asarray(x)
    x = np.asarray(x)
    ends = np.repeat(x[:1], length // 2, axis=0), np.repeat(x[-1:], length // 2, axis=0)
    windows = sliding_window_view(np.concatenate((ends[0], x, ends[1])), length, axis=0)
    return np.partition(windows, length // 2)[..., length // 2]
