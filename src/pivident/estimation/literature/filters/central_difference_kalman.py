"""Central-difference Kalman filter on positions, speeds and parameters."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from pivident.estimation.literature.filters.filter_state import FilterRun
from pivident.estimation.literature.filters.sigma_points import sigma_samples
from pivident.estimation.literature.filters.state_filter import KalmanMethod
from pivident.estimation.method import Cost
from pivident.foundation.options import option


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
