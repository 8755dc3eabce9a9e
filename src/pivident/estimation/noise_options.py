"""Recipes of noise models: autoregressive, from what repeats, with a moving average."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from pivident.errors import ExperimentError
from pivident.motion.kinematics import MOTION_BAND
from pivident.recording.recording import Recording

#: Which covariance of an estimate is reported.
CovarianceKind = Literal["auto", "formula", "sandwich", "stationary"]


@dataclass(frozen=True)
class AutoRegressive:
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

    p_max: int = 150
    criterion: Literal["aic", "aicc", "bic"] = "aic"
    on_unmasked: bool = True
    motion_band: Literal["auto"] | float | None = "auto"

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
    motion_band: Literal["auto"] | float | None = None
    period: int | None = None  # samples of a period of the reference; None: found from it


@dataclass(frozen=True)
class Arma:
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

    ar_order: int = 8
    ma_order: int = 4
    on_unmasked: bool = True
    largest_root: float = 0.99

    def __post_init__(self) -> None:
        if self.ar_order < 1 or self.ma_order < 1:
            raise ExperimentError(
                f"ARMA noise needs orders of at least one, not ({self.ar_order}, {self.ma_order}); "
                "without a moving average use the AR model"
            )
        if not 0.0 < self.largest_root < 1.0:
            raise ExperimentError(f"largest_root must lie between 0 and 1, not {self.largest_root}")
