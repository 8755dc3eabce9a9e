"""A logged speed against the derivative of the position: factor, lag and what remains."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pivident.data.logs.log import Log
from pivident.foundation.text.finding import Finding, FindingKind, Quantity, Severity, Topic
from pivident.foundation.text.repair import NotRead, Repair
from pivident.judgement.audit.standstill import STILL
from pivident.judgement.audit.timing import Timing, at_equal_intervals
from pivident.signals.bandpass import butterworth, central_difference
from pivident.signals.cubic_spline import cubic_spline
from pivident.signals.filters import convolution
from pivident.signals.instants import slope_at_instants
from pivident.signals.random_walk import half_power_frequencies

DERIVATIVE = FindingKind(
    Topic("speed", "Logged speeds"), "derivative", ("recording", "columns", "dq_ref")
)

#: Factors further from 1 than this get a warning, or are wrong.
WARNING, ERROR = 0.02, 0.2

#: A speed that lags by more samples than this was filtered; a measured one may, up to so many.
LAG, LATE = 1.0, 3.0

#: Longest lag that is searched [s], and lowest upper end of the band that is compared [Hz].
MAX_LAG, MIN_BAND = 0.4, 1.0

#: Share of a logged derivative that may be something else.
UNEXPLAINED = 0.3

PAIRS = (("dq", "q"), ("dq_ref", "q_ref"), ("ddq_ref", "dq_ref"))


def check_speeds(log: Log, timing: Timing) -> Iterator[Finding]:
    """Compare every logged derivative with the derivative of the channel it belongs to."""
    for derivative, channel in PAIRS:
        if derivative not in log.channels or channel not in log.channels or not timing.rate:
            continue
        x, dx = log.channels[channel], log.channels[derivative]
        if x.shape != dx.shape or len(x) < 200:
            continue
        x, dx = np.split(at_equal_intervals(np.hstack([x, dx]), log.clock, timing), 2, axis=1)
        for j, name in enumerate(log.joint_names):
            if np.ptp(x[:, j]) > STILL:
                compared = compare(x[:, j], dx[:, j], timing.rate)
                if compared is not None:
                    yield _finding(f"{derivative} of {name}", channel, compared, timing)


def compare(x: np.ndarray, dx: np.ndarray, rate: float) -> tuple[float, float, float] | None:
    """Factor, lag [s] and relative remainder of dx(t) = a·ẋ(t - s); x (samples,), rate [Hz].

    Both are compared where x is motion and no noise: above its half-power frequency, a derivative
    of counts is noise, which the logged speed need not have.
    """
    noise_free = float(half_power_frequencies(x[:, None], rate)[0])
    band = min(0.1 * rate, max(noise_free, MIN_BAND))
    slope = butterworth(slope_at_instants(central_difference(x, rate)), rate, band)
    logged = butterworth(dx, rate, band)
    reach = int(min(MAX_LAG * rate, len(x) // 10))
    power = float(np.sum(slope[reach : len(x) - reach] ** 2))
    if power == 0 or not np.any(logged):
        return None
    lag, square, product = _best_lag(logged, slope, reach)
    factor = product / power
    return factor, lag / rate, float(np.sqrt(max(1.0 - factor * product / square, 0.0)))


def _best_lag(logged: np.ndarray, slope: np.ndarray, reach: int) -> tuple[float, float, float]:
    """Lag s [samples] that makes m(k) = logged(k + s) most like the slope; |m|² and m·ẋ there.

    The relative remainder is smallest where (m·ẋ)²/|m|² is largest. Whole lags are all compared in
    one correlation. Between two of them the cubic spline is m(k + u) = Σ_i c_i(k) uⁱ, so that m·ẋ
    and |m|² are polynomials of u, and the largest ratio is at a root of its derivative.
    """
    compared = slope[reach : len(slope) - reach]
    products = convolution(logged, compared[::-1])[len(compared) - 1 : len(logged)]  # of all lags
    energy = np.concatenate([[0.0], np.cumsum(logged**2)])
    squares = energy[len(compared) :] - energy[: 2 * reach + 1]
    likeness = products**2 / np.maximum(squares, np.finfo(float).tiny)
    whole = int(np.argmax(likeness))
    best = (likeness[whole], whole - reach, squares[whole], products[whole])
    spline = cubic_spline(np.arange(len(logged)), logged)
    for first in (whole - 1, whole):
        if not 0 <= first < 2 * reach:
            continue
        pieces = spline.c[:, first : first + len(compared)]  # highest power first
        product, gram = np.poly1d(pieces @ compared), pieces @ pieces.T
        square = np.poly1d([np.trace(gram[:, ::-1], 3 - power) for power in range(7)])
        slopes = 2 * product.deriv() * square - product * square.deriv()
        for u in slopes.roots[np.abs(slopes.roots.imag) < 1e-9].real:
            if 0.0 < u < 1.0 and product(u) ** 2 / square(u) > best[0]:
                likeness_there = product(u) ** 2 / square(u)
                best = (likeness_there, first - reach + u, square(u), product(u))
    return float(best[1]), float(best[2]), float(best[3])


def _finding(
    name: str, channel: str, compared: tuple[float, float, float], timing: Timing
) -> Finding:
    factor, lag, error = compared
    assert timing.rate is not None
    samples = lag * timing.rate
    severity: Severity = "ok"
    step = ""
    if abs(factor - 1.0) > ERROR:
        severity, step = "error", f"Check the units of {name.partition(' ')[0]} and {channel}."
    elif abs(samples) > LAG or factor < 1.0 - WARNING:
        # A measured speed is not used, and the drives' own filter is none of the user's.
        mild = name.startswith("dq of ") and abs(samples) < LATE and factor > 1.0 - WARNING
        severity = "note" if mild else "warning"
        step = "It was filtered before it was logged; use the derivative of the position instead."
    elif factor > 1.0 + WARNING or error > UNEXPLAINED:
        severity = "warning"
        step = "Check its column; use the derivative of the position instead."
    text = (
        f"{name} is {factor:.4g} times the derivative of {channel}, {1e3 * lag:.3g} ms "
        f"({samples:.3g} samples) later; {100 * error:.3g} % of it is not explained."
    )
    evidence = {"factor": Quantity(factor, bound=1 + WARNING)}
    derivative = name.partition(" ")[0]
    is_left_out = severity != "ok" and derivative in ("dq", "dq_ref")
    repairs = [Repair((NotRead(channel=derivative),))] if is_left_out else []
    return DERIVATIVE.finding(
        severity, text, name, step, evidence, repairs=repairs,
        place=("recording", "columns", derivative),
    )  # fmt: skip
