"""Kalman filters on positions, speeds and parameters: extended, unscented, central differences."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from pivident.estimation.literature.filters.extended import ExtendedSteps
from pivident.estimation.literature.filters.filter_state import FilterRun
from pivident.estimation.literature.filters.sigma_points import sigma_samples
from pivident.estimation.literature.filters.state_filter import KalmanMethod
from pivident.estimation.method import Cost
from pivident.foundation.options import option


@dataclass(frozen=True, kw_only=True)
class ExtendedKalman(ExtendedSteps, KalmanMethod):
    """Kalman filter with the exact tangent of each step."""

    label: ClassVar[str] = "EKF"
    summary: ClassVar[str] = "extended Kalman filter"
    cost: ClassVar[Cost] = Cost(0.1, 7e-7)


@dataclass(frozen=True, kw_only=True)
class UnscentedKalman(KalmanMethod):
    """Kalman filter with the sigma points of Julier and Uhlmann.

    Attributes:
        alpha: spread of the points.
        beta: weight of the middle point in the covariance, 2 for normal distributions.
        kappa: added to the number of states; their sum is positive.
        square_root: whether factors of the covariance are carried, by QR and Cholesky updates.
    """

    alpha: float = option(0.1, "spread of the sigma points", above=0.0)
    beta: float = option(2.0, "weight of the middle point in the covariance")
    kappa: float = option(0.0, "added to the number of states")
    square_root: bool = option(False, "carry factors of the covariance")  # type: ignore[misc]

    label: ClassVar[str] = "UKF"
    summary: ClassVar[str] = "unscented Kalman filter"
    cost: ClassVar[Cost] = Cost(0.1, 3e-6)
    needs_points: ClassVar[bool] = True

    def advance(self, run: FilterRun) -> tuple[int, int, int]:
        """Take samples; status, joint and sample at which it ended."""
        scale = self.alpha * float(np.sqrt(run.state.x.size + self.kappa))
        return sigma_samples(
            *run,
            scale, False, self.alpha, self.beta, self.square_root,
        )  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class CentralDifferenceKalman(KalmanMethod):
    """Kalman filter with the central differences of Nørgaard, Poulsen and Ravn.

    Attributes:
        step: half width of the differences, in standard deviations; √3 fits normal distributions.
        square_root: whether factors of the covariance are carried, by QR.
    """

    step: float = option(3.0**0.5, "half width of the differences", unit="σ", at_least=1.0)
    square_root: bool = option(False, "carry factors of the covariance")  # type: ignore[misc]

    label: ClassVar[str] = "CDKF"
    summary: ClassVar[str] = "central difference Kalman filter"
    cost: ClassVar[Cost] = Cost(0.1, 3e-6)
    needs_points: ClassVar[bool] = True

    def advance(self, run: FilterRun) -> tuple[int, int, int]:
        """Take samples; status, joint and sample at which it ended."""
        return sigma_samples(
            *run,
            self.step, True, 1.0, 2.0, self.square_root,
        )  # fmt: skip
