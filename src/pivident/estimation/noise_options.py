"""Recipes of noise models: autoregressive, from what repeats, with a moving average."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from pivident.motion.kinematics import MOTION_BAND
from pivident.options import Options, option
from pivident.recording.recording import Recording

#: Which covariance of an estimate is reported.
CovarianceKind = Literal["auto", "formula", "sandwich", "stationary"]


@dataclass(frozen=True)
class AutoRegressive(Options):
    """AR noise model by Burg, all orders at once.

    Attributes:
        p_max: largest order tried.
        criterion: ``aic``, ``aicc`` or ``bic``.
        on_unmasked: whether it is fitted on the rows in use only.
        motion_band: highest frequency of the motion [Hz]. Below it the residual may be mostly
            model error, and noise counts up to the level just above it (see
            ``continued_into_band``). ``auto``: 20 Hz or a quarter of the Nyquist frequency. None:
            no band.
    """

    p_max: int = option(150, "largest order of the AR model tried", at_least=1, at_most=5000)
    criterion: Literal["aic", "aicc", "bic"] = option("aic", '`"aic"`, `"aicc"` or `"bic"`')
    on_unmasked: bool = option(True, "fit it on valid samples only")
    motion_band: Literal["auto"] | float | None = option(
        "auto",
        "highest frequency of the motion, below which the noise is continued; 0: none",
        unit="Hz", kind='`"auto"` or number', at_least=0.0,
    )  # fmt: skip

    def band(self, recording: Recording) -> float:
        """Highest frequency of the motion of a recording [Hz], zero for none."""
        if self.motion_band == "auto":
            return min(MOTION_BAND, recording.rate / 8.0)
        return float(self.motion_band or 0.0)


@dataclass(frozen=True)
class Repetition(AutoRegressive):
    """AR noise model fitted to what does not repeat, for records in which the motion repeats.

    Standard errors that the paper's formula gives with it would describe repeatability alone; those
    of the sandwich contain the model error as it differs from one part of the record to the next.
    """

    #: None is needed: model error is gone from the residual.
    motion_band: Literal["auto"] | float | None = option(
        None,
        "highest frequency of the motion, below which the noise is continued; 0: none",
        unit="Hz", kind='`"auto"` or number', at_least=0.0,
    )  # fmt: skip
    period: int | None = option(
        None,
        "period of the motion, where `repetition` does not find it",
        unit="samples", shown="found", at_least=10,
    )  # fmt: skip


@dataclass(frozen=True)
class Arma(Options):
    """ARMA noise model by maximum likelihood (section 4.4 of the paper), of given orders.

    A moving average saves autoregressive terms where the noise's spectrum has a dip. Its whitener
    is recursive: zeros close to the unit circle make it remember for long.

    Attributes:
        ar_order: degree of the autoregressive part.
        ma_order: degree of the moving average.
        on_unmasked: whether it is fitted on the rows in use only.
        largest_root: zeros of the moving average are kept inside this radius, so that the
            whitener forgets within a few thousand samples.
    """

    ar_order: int = option(
        8, "degree of the AR part of an ARMA model; any of these three keys chooses ARMA",
        at_least=1, at_most=200,
    )  # fmt: skip
    ma_order: int = option(4, "degree of its moving average", at_least=1, at_most=50)
    on_unmasked: bool = option(True, "fit it on valid samples only")
    largest_root: float = option(
        0.99, "zeros of the moving average stay inside this radius", above=0.0, below=1.0
    )
