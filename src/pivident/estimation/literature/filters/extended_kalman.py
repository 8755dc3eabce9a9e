"""Extended Kalman filter on positions, speeds and parameters."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from pivident.estimation.literature.filters.extended import ExtendedSteps
from pivident.estimation.literature.filters.state_filter import KalmanMethod
from pivident.estimation.method import Cost


@dataclass(frozen=True, kw_only=True)
class ExtendedKalman(ExtendedSteps, KalmanMethod):
    """Kalman filter with the exact tangent of each step."""

    label: ClassVar[str] = "EKF"
    summary: ClassVar[str] = "extended Kalman filter"
    cost: ClassVar[Cost] = Cost(0.1, 7e-7)
