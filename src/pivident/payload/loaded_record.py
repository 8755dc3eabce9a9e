"""Equations of the loaded records, recomputed for each estimate.

The same three estimators as without load, at the full sampling rate: least squares; instruments
from the loop simulated with the loaded arm; the same after prefilters from the identified noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from pivident.estimation.auxiliary_model import AuxiliaryModel
from pivident.estimation.covariance.stationary_noise import score_variance
from pivident.estimation.equation_record import accumulate
from pivident.estimation.full_rate import (
    FullRateRecord,
    filtered,
    records_with_instruments,
    records_without_instruments,
)
from pivident.estimation.kinematics import estimate_kinematics
from pivident.estimation.noise_identification import Prefilters, Whitening
from pivident.estimation.normal_equations import JointSums
from pivident.estimation.problem import Problem
from pivident.motion.kinematics import torque_of
from pivident.motion.motion import with_inner
from pivident.signals.prefilter import Prefilter


class LoadedRecords:
    """The loaded recordings of a problem with their instruments and prefilters."""

    def __init__(self, problem: Problem, method: Any) -> None:
        self.problem, self.method = problem, method
        self.kinematics = [estimate_kinematics(r, method.signals) for r in problem.recordings]
        self.limits = [problem.speed_limits(r) for r in problem.recordings]
        self.whitening: Whitening | None = None
        self.prefilters = Prefilters.none(problem)
        if method.whitens:
            self.whitening = Whitening.of(problem, method, self.kinematics)
            self.prefilters = self.whitening.initial()
        self.auxiliary: AuxiliaryModel | None = None
        if method.has_instruments:
            self.auxiliary = AuxiliaryModel(problem, differences=True, kinematics=self.kinematics)
        self.records: list[FullRateRecord] = []

    @property
    def filters(self) -> Sequence[Prefilter]:
        """Prefilter of each joint."""
        return self.prefilters.filters

    def least_squares(self, theta: np.ndarray) -> list[JointSums]:
        """Normal equations with Z = Φ: those of least squares, and the start of the others."""
        known = [with_inner(self.problem.regressor, k, theta) for k in self.kinematics]
        self.records = records_without_instruments(known, self.limits)
        return accumulate(self.problem.regressor, self.records, self.filters)

    def with_instruments(
        self, number: int, last: np.ndarray, theta: np.ndarray
    ) -> tuple[list[JointSums], np.ndarray]:
        """Normal equations with instruments from the simulated loop, and the parameters simulated.

        ``last`` are the parameters of the previous estimate, which could be simulated.
        """
        assert self.auxiliary is not None
        regressor = self.problem.regressor
        if self.whitening is not None:
            self.prefilters = self.whitening.fitted(self.prefilters, number, theta, self.records)
        motions, theta, _ = self.auxiliary.simulate_or_halve(last, theta)
        moved = [with_inner(regressor, k, theta) for k in self.kinematics]
        self.records = records_with_instruments(
            moved, [with_inner(regressor, m, theta) for m in motions], self.limits
        )
        self.prefilters.exclude(self.records)
        return accumulate(regressor, self.records, self.filters), theta

    def residuals(self, theta: np.ndarray) -> list[np.ndarray]:
        """τ - Φθ of each recording [N m or N], shape (joints, samples)."""
        regressor = self.problem.regressor
        return [r.kinematics.tau - torque_of(regressor, r.kinematics, theta) for r in self.records]

    def errors(self, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """‖τ - Φθ‖/‖τ‖ and the rms of τ - Φθ [N m or N] of each joint over the samples in use."""
        left, total, rows = np.zeros((3, self.problem.robot.size))
        for record, residual in zip(self.records, self.residuals(theta), strict=True):
            left += np.sum(np.where(record.used, residual, 0.0) ** 2, axis=1)
            total += np.sum(np.where(record.used, record.kinematics.tau, 0.0) ** 2, axis=1)
            rows += record.used.sum(axis=1)
        return np.sqrt(left / np.maximum(total, 1e-300)), np.sqrt(left / np.maximum(rows, 1.0))

    def score_variance(
        self, theta: np.ndarray, sums: Sequence[JointSums], variance: np.ndarray, metric: np.ndarray
    ) -> np.ndarray:
        """V = Var Σ Zᵀε/λ for a residual that is stationary noise of any colour.

        ``metric``, the covariance of θ_loaded by the weights, gives the share of the noise that the
        estimate absorbed.
        """
        filters, root = self.filters, np.sqrt(variance)[:, None]
        residuals = zip(self.records, self.residuals(theta), strict=True)
        white = [filtered(residual, filters, r.seen) / root for r, residual in residuals]
        return score_variance(
            self.problem.regressor, self.records, filters, sums, variance, white, metric
        )
