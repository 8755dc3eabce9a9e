"""How a simulation is fitted, and what comes out."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from pivident.estimation.covariance import rounded_away
from pivident.estimation.covariance.sandwich import Jackknife
from pivident.estimation.method import AutoRegressive, CovarianceKind
from pivident.estimation.output_error.thinning import POSITIONS, TORQUES

if TYPE_CHECKING:
    from pivident.estimation.output_error.loop_unknowns import Unknown
    from pivident.estimation.output_error.noise_weights import NoiseWeights
    from pivident.estimation.output_error.record_stretches import Stretch
    from pivident.estimation.output_error.simulated_errors import SimulatedErrors


@dataclass(frozen=True)
class FitOptions:
    """How a simulation is fitted.

    Attributes:
        channels: what is compared, some of `POSITIONS` and `TORQUES`.
        noise: recipe of the noise models; None: errors count as white.
        motion_band: highest frequency of the motion [Hz], see `AutoRegressive`.
        bandwidth: frequency up to which errors are compared [Hz].
        robust: Huber's loss in place of squares.
        undetermined: ``refuse`` unknowns that nothing determines, or ``hold`` them.
        tolerance: step in standard errors at which the iteration may end: no combination of
            unknowns moves by more.
        max_iterations: give up after so many passes.
        covariance: ``formula``, H⁻¹, for errors that are white behind their weights,
            ``stationary``, for stationary noise of any colour, ``sandwich``, from windows of time,
            or ``auto``: stationary where the windows agree with it, else sandwich.
    """

    channels: tuple[int, ...] = (POSITIONS, TORQUES)
    noise: AutoRegressive | None = field(default_factory=AutoRegressive)
    motion_band: float = 20.0
    bandwidth: float = 100.0
    robust: bool = False
    undetermined: str = "refuse"
    tolerance: float = 0.1
    max_iterations: int = 30
    covariance: CovarianceKind = "auto"


@dataclass(frozen=True, eq=False)
class FitPass:
    """One pass of the iteration, for its history."""

    values: np.ndarray  # unknowns after it, shape (unknowns,)
    change: float  # largest |δ| / max(|p|, 5σ)
    cost: float  # weighted errors per row, before the step
    refused: int  # steps that were taken back before it
    orders: tuple[int, ...]  # of the noise models


@dataclass(frozen=True, eq=False)
class SimulationFit:
    """What came out.

    Attributes:
        unknowns: what was sought.
        values: estimates, shape (unknowns,).
        covariance: of the kind that was asked for, shape (unknowns, unknowns); zero where held.
        robust_covariance: one that holds for errors that are not white, likewise.
        formula_covariance: H⁻¹, for errors that are white behind their weights, likewise.
        held: unknowns that nothing determines and that were held, shape (unknowns,).
        bound: unknowns at a bound, likewise: their interval has one side.
        converged: whether the iteration settled.
        history: its passes.
        condition: condition number of the scaled derivatives.
        weakest: names in the least determined direction.
        noise: noise models and variances.
        errors: of each stretch, thinned, shape (channels, joints, rows).
        white: the same of unit variance, NaN where not used.
        rates: rows per second of each stretch [Hz].
        rms: root mean square of the errors of positions and torques, not thinned, shape
            (2, joints) [rad or m; N m or N].
        stretches: with the loops of the estimate.
        windows: windows of time behind ``covariance``.
        channels: what was compared, see `FitOptions`.
        factors: measured samples for each thinned row, one for each stretch.
        made: errors and derivatives.
    """

    unknowns: tuple[Unknown, ...]
    values: np.ndarray
    covariance: np.ndarray
    robust_covariance: np.ndarray
    formula_covariance: np.ndarray
    held: np.ndarray
    bound: np.ndarray
    converged: bool
    history: tuple[FitPass, ...]
    condition: float
    weakest: tuple[str, ...]
    noise: NoiseWeights
    errors: tuple[np.ndarray, ...]
    white: tuple[np.ndarray, ...]
    rates: tuple[float, ...]
    rms: np.ndarray
    stretches: tuple[Stretch, ...]
    windows: Jackknife
    channels: tuple[int, ...]
    factors: tuple[int, ...]
    made: tuple[SimulatedErrors, ...]

    def __post_init__(self) -> None:
        for kind in ("covariance", "robust_covariance", "formula_covariance"):
            object.__setattr__(self, kind, rounded_away(getattr(self, kind)))

    @property
    def std(self) -> np.ndarray:
        """Standard errors, shape (unknowns,); zero where held."""
        return np.sqrt(np.diag(self.covariance))

    def value(self, name: str) -> float:
        """The estimate of one unknown."""
        return float(self.values[[u.name for u in self.unknowns].index(name)])
