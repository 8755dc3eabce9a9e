"""Whether the residual of one joint is white, in numbers and in one word."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pivident.errors import IdentificationError
from pivident.estimation.identification import FittedRecording, Identification
from pivident.signals.noise_models import LjungBox, autocorrelation, ljung_box

#: Lags tested beyond the order of the noise model.
EXTRA_LAGS = 40

#: Lags drawn, at least.
_FEWEST_LAGS = 100

#: With many samples tiny correlations are significant; below this they do not matter.
PRACTICAL = 0.05

#: A residual whose test has a smaller probability is not white. There are as many tests as
#: joints and recordings, so one in twenty would be too often a false alarm.
SIGNIFICANCE = 0.01

Verdict = Literal["white", "practically white", "correlated"]


@dataclass(frozen=True, eq=False)
class Whiteness:
    """Autocorrelation of one residual, and its test.

    Attributes:
        rho: autocorrelation at lags 1, 2, …
        band: 2/√n; 95 % of the autocorrelations of white noise lie within.
        test: Ljung and Box's test.
        rate: rate of the residual [Hz].
    """

    rho: np.ndarray
    band: float
    test: LjungBox
    rate: float

    @property
    def outside(self) -> float:
        """Share of the drawn autocorrelations outside the band, 0 to 1."""
        return float(np.mean(np.abs(self.rho) > self.band))

    @property
    def verdict(self) -> Verdict:
        """``practically white``: significantly correlated, but no correlation of any size."""
        if self.test.p_value >= SIGNIFICANCE:
            return "white"
        return "practically white" if self.test.largest < PRACTICAL else "correlated"


def whiteness(
    identification: Identification, recording: FittedRecording, joint: int
) -> Whiteness | None:
    """Test of one joint's residual in one recording; None where it is too short or constant.

    Args:
        identification: the result, for the order of the joint's noise model.
        recording: one of its recordings.
        joint: index of the joint.
    """
    residual = recording.whitened[:, joint]
    residual = residual[np.isfinite(residual)]
    order = identification.joints[joint].ar_order
    lags = max(order + EXTRA_LAGS, _FEWEST_LAGS)
    if residual.size <= 2 * lags:
        return None
    try:
        rho = autocorrelation(residual, lags)[1:]
    except IdentificationError:
        return None
    test = ljung_box(residual, order + EXTRA_LAGS, order)
    return Whiteness(rho, 2.0 / math.sqrt(residual.size), test, recording.whitened_rate)
