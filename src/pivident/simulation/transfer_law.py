"""A control law given as a transfer function from the position error to the output."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pivident.errors import ExperimentError
from pivident.simulation.controllers import TAPS, SampledLaw


@dataclass(frozen=True, eq=False)
class TransferLaw:
    """u = [B(z⁻¹)/A(z⁻¹) + K_i h/(1 - z⁻¹)] (q_ref - q), sampled with the period of its fit."""

    numerator: np.ndarray  # B, coefficients of z⁰, z⁻¹, …, shape (joints, TAPS)
    denominator: np.ndarray  # A, monic, likewise; stable
    ki: np.ndarray  # integral gains [u per rad s or m s], shape (joints,)
    rate: float  # sampling rate that the coefficients belong to [Hz]

    def check(self, joints: int) -> None:
        """Refuse a law of another number of joints."""
        if self.numerator.shape != (joints, TAPS):
            raise ExperimentError(
                f"the control law has {len(self.numerator)} joints, but the robot has {joints}"
            )

    def law(self, rate: float, q_ref: np.ndarray, dq_ref: np.ndarray | None) -> SampledLaw:
        """The law at its own rate; the error is all it sees, so dq_ref is not used."""
        from scipy.signal import lfilter

        if abs(rate - self.rate) > 1e-9 * rate:
            raise ExperimentError(
                f"the control law was identified at {self.rate:g} Hz and cannot run at {rate:g} "
                "Hz; identify a structured law, whose gains hold at any rate"
            )
        reference = np.empty_like(q_ref)
        for j in range(q_ref.shape[1]):
            reference[:, j] = lfilter(self.numerator[j], self.denominator[j], q_ref[:, j])
        return SampledLaw(
            self.numerator, self.denominator, self.denominator.copy(), self.ki, reference,
            q_ref.copy(),
        )  # fmt: skip


def split_integrator(numerator: np.ndarray, denominator: np.ndarray) -> tuple[np.ndarray, float]:
    """B/((1 - z⁻¹) A) = B'/A + r/(1 - z⁻¹): B' and the residue r = B(1)/A(1).

    ``numerator``: B, coefficients of z⁰, z⁻¹, ….
    """
    residue = float(np.sum(numerator) / np.sum(denominator))
    size = max(len(numerator), len(denominator))
    remainder = np.zeros(size)
    remainder[: len(numerator)] += numerator
    remainder[: len(denominator)] -= residue * denominator
    # (1 - z⁻¹) divides what is left: its quotient is the running sum
    return np.cumsum(remainder)[: max(size - 1, 1)], residue
