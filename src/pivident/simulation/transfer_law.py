"""A control law given as transfer functions from the position error, and from the reference."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from pivident.errors import ExperimentError
from pivident.simulation.controllers import TAPS, SampledLaw
from pivident.simulation.linear_law import reference_derivatives


@dataclass(frozen=True, eq=False)
class TransferLaw:
    """u = [B/A + K_i h/(1 - z⁻¹)] (q_ref - q) + B_v/A_r dq_ref + B_a/A_r ddq_ref, in z⁻¹.

    It is sampled with the period of its fit.
    """

    numerator: np.ndarray  # B, coefficients of z⁰, z⁻¹, …, shape (joints, TAPS)
    denominator: np.ndarray  # A, monic, likewise; stable
    ki: np.ndarray  # integral gains [u per rad s or m s], shape (joints,)
    rate: float  # sampling rate that the coefficients belong to [Hz]
    # B_v, B_a and A_r, which may have a pole at one, shape (3, joints, TAPS); no joints: the
    # reference enters by the error only
    of_reference: np.ndarray = field(default_factory=lambda: np.zeros((3, 0, TAPS)))

    def check(self, joints: int) -> None:
        """Refuse a law of another number of joints."""
        if self.numerator.shape != (joints, TAPS):
            raise ExperimentError(
                f"the control law has {len(self.numerator)} joints, but the robot has {joints}"
            )

    def law(self, rate: float, q_ref: np.ndarray, dq_ref: np.ndarray | None) -> SampledLaw:
        """The law at its own rate."""
        from scipy.signal import lfilter

        if abs(rate - self.rate) > 1e-9 * rate:
            raise ExperimentError(
                f"the control law was identified at {self.rate:g} Hz and cannot run at {rate:g} "
                "Hz; identify a structured law, whose gains hold at any rate"
            )
        reference = np.empty_like(q_ref)
        for j in range(q_ref.shape[1]):
            reference[:, j] = settled(self.numerator[j], self.denominator[j], q_ref[:, j])
        for j in range(self.of_reference.shape[1]):
            dq = None if dq_ref is None else dq_ref[:, j]
            derivatives = reference_derivatives(q_ref[:, j], dq, 0.0, False, rate)
            *numerators, poles = self.of_reference[:, j]
            for numerator, derivative in zip(numerators, derivatives, strict=True):
                reference[:, j] += lfilter(numerator, poles, derivative)
        return SampledLaw(
            self.numerator, self.denominator, self.denominator.copy(), self.ki, reference,
            q_ref.copy(),
        )  # fmt: skip


def settled(numerator: np.ndarray, denominator: np.ndarray, x: np.ndarray) -> np.ndarray:
    """A signal behind B/A that had its first value for ever, as the loop's positions had theirs."""
    from scipy.signal import lfilter, lfilter_zi

    return lfilter(numerator, denominator, x, zi=lfilter_zi(numerator, denominator) * x[0])[0]


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
