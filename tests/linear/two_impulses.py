"""The discrete-time benchmark of Taylor et al. (2007), with known truth.

    y = 2/(1 - 0.8 z⁻¹) u + e/(1 - 1.2 z⁻¹ + 0.8 z⁻²),    std of e 0.02

with gain 10 and a time constant of 4.48 samples, driven by two unit impulses at samples 10 and 61
of 112. Least squares is biased on it, SRIV is not, and RIV reaches the Cramér-Rao bound.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from tests.linear.published_systems import BenchmarkRecord

#: Samples of noise before the record, so that it begins stationary.
_WARM_UP = 200


@dataclass(frozen=True)
class DiscreteBenchmark:
    """A discrete-time system of one pole and one coefficient above it, (C.3)."""

    name: str
    pole: float
    numerator: float  # b0
    noise_ar: tuple[float, ...]  # D of the noise e/D
    noise_std: float  # standard deviation of e
    impulses: tuple[int, ...]  # samples at which the input is one
    samples: int  # length of the record
    dt: float = 1.0
    delay: int = 0
    orders: tuple[int, int] = (0, 1)

    @property
    def theta(self) -> np.ndarray:
        """True parameters (a1, b0)."""
        return np.array([-self.pole, self.numerator])

    def record(self, seed: int) -> BenchmarkRecord:
        """One record with the noise of this seed."""
        u = np.zeros(self.samples)
        u[list(self.impulses)] = 1.0
        x = lfilter([self.numerator], [1.0, -self.pole], u)
        e = np.random.default_rng(seed).standard_normal(self.samples + _WARM_UP)
        noise = lfilter([self.noise_std], self.noise_ar, e)[_WARM_UP:]
        return BenchmarkRecord(u, x, x + noise, None)

    def bound(self) -> np.ndarray:
        """Cramér-Rao bound of the standard errors, from sensitivities of the whitened output.

        The noise before the record is unknown; its first samples carry no signal.
        """
        u = self.record(0).u
        pole = [1.0, -self.pole]
        slopes = np.array(
            [
                lfilter([0.0, -self.numerator], np.convolve(pole, pole), u),
                lfilter([1.0], pole, u),
            ]
        )
        white = lfilter(self.noise_ar, [1.0], slopes) / self.noise_std
        return np.sqrt(np.diag(np.linalg.inv(white @ white.T)))


TWO_IMPULSES = DiscreteBenchmark(
    name="DT",
    pole=0.8,
    numerator=2.0,
    noise_ar=(1.0, -1.2, 0.8),
    noise_std=0.02,
    impulses=(10, 61),
    samples=112,
)
