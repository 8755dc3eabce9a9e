"""Held-out errors of a result in few numbers, as they are stored with it.

The logarithm of a relative error ℓ = ln(‖e‖/‖τ‖) scatters over blocks of the motion; each is left
out in turn (jackknife, Efron and Tibshirani 1993, section 11):

    σ² = (B - 1)/B Σ_b (ℓ_b - mean ℓ_b)².
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import numpy as np

from pivident.foundation.text.display import Displayed
from pivident.foundation.text.plain_values import LATER, Known
from pivident.judgement.validation.held_out.prediction import PredictionError, pooled

if TYPE_CHECKING:
    from pivident.judgement.validation.held_out.cross_validation import CrossValidation

#: Name under which the error of all joints stands beside those of each.
ALL_JOINTS = "all joints"


@dataclass(frozen=True)
class LogError:
    """A relative torque error with its scatter over blocks.

    Attributes:
        value: the error [%].
        spread: standard deviation of its logarithm; NaN where it is not known.
        blocks: that it comes from.
    """

    value: float
    spread: Known = math.nan
    blocks: int = 0


def log_errors(
    joints: Sequence[str], values: np.ndarray, spreads: np.ndarray, blocks: int
) -> dict[str, LogError]:
    """Errors by name, those of all joints first; values and spreads, shape (1 + joints,)."""
    return {
        name: LogError(float(x), float(s), blocks)
        for name, x, s in zip((ALL_JOINTS, *joints), values, spreads, strict=True)
    }


def jackknife_spread(left_out: np.ndarray) -> np.ndarray:
    """Standard deviation of the logarithm of values with each block left out, blocks first."""
    return np.sqrt((len(left_out) - 1) * np.log(np.maximum(left_out, 1e-300)).var(axis=0))


def moving_errors(parts: list[PredictionError]) -> dict[str, LogError]:
    """Errors in motion of each joint and of all together, with their scatter over stretches."""

    def values(errors: list[PredictionError]) -> np.ndarray:
        whole = pooled(errors)
        return np.array([whole.total_moving_in_band, *whole.moving_in_band])

    every, count = values(parts), len(parts)
    spread = np.full(every.shape, np.nan)
    if count > 1:
        spread = jackknife_spread(
            np.array([values(parts[:k] + parts[k + 1 :]) for k in range(count)])
        )
    return log_errors(parts[0].joint_names, every, spread, count)


@dataclass(frozen=True)
class HeldOutErrors(Displayed):
    """Torque errors below ``band`` on motion that was not fitted."""

    passes_over_others: ClassVar[bool] = True
    method: str  # name of the method
    where: str  # what was held out, in words
    band: float  # highest frequency of the motion [Hz]
    total: float  # over all joints [%]
    fitted: float  # on the fitted motion [%]
    joints: Mapping[str, float]  # of each joint [%]
    rms: Mapping[str, float]  # rms error of each joint [N m or N]
    units: Mapping[str, str]  # its unit
    loop: Annotated[str, LATER] = ""  # closed or open: what was simulated; empty where nothing was
    #: Rms errors of positions, their units, and errors without standstill, of all joints too.
    positions: Annotated[Mapping[str, float], LATER] = field(default_factory=dict)
    position_units: Annotated[Mapping[str, str], LATER] = field(default_factory=dict)
    moving: Annotated[Mapping[str, LogError], LATER] = field(default_factory=dict)

    @classmethod
    def of(cls, judged: CrossValidation) -> HeldOutErrors:
        """Those of a cross-validation."""
        error, simulation = judged.prediction, judged.simulation

        def by_joint(values: Any) -> dict[str, Any]:
            return dict(zip(error.joint_names, np.asarray(values).tolist(), strict=True))

        return cls(
            judged.method,
            judged.where,
            error.band,
            error.total_in_band,
            judged.training.total_in_band,
            by_joint(error.relative_in_band),
            by_joint(error.rms_in_band),
            by_joint(error.units),
            "" if simulation is None else simulation.loop,
            {} if simulation is None else by_joint(simulation.position),
            {} if simulation is None else by_joint(simulation.units),
            moving_errors([h.prediction for h in judged.held_out if h.prediction is not None]),
        )

    @property
    def worst(self) -> str:
        """The joint with the largest error."""
        return max(self.joints, key=self.joints.__getitem__)
