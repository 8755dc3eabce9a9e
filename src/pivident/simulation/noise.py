"""Noise of simulated records: encoders (white, coloured, counted), (P-8), and torque sensors.

Every stream of random numbers has its own seed, (run, stream, study): a run's numbers depend on
nothing but that, whoever computes it and after whatever.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from pivident.errors import ExperimentError
from pivident.simulation.closed_loop import in_whole_counts

#: Streams of random numbers of a run.
ENCODER, TORQUE, COLOURED = 0, 1, 2

#: Which run, or which run of which study; a study of seed zero has the numbers of none.
Seed = int | tuple[int, int]

#: A standard deviation of all joints, or one for each.
Spread = float | tuple[float, ...]

#: Share of the start of an autoregressive noise that may be left when it is used.
SETTLED = 1e-9


@dataclass(frozen=True)
class Noise:
    """Noise of a simulated record."""

    #: Standard deviation of white position noise [rad or m].
    encoder: Spread = 3.5e-6 / np.sqrt(3.0)
    #: Standard deviation of the torque sensor, on the record only [N m or N].
    torque: Spread = 0.05
    coloured: Spread = 0.0  # standard deviation of further position noise, AR(2) [rad or m]
    frequency: float = 600.0  # at which its spectrum peaks [Hz]
    radius: float = 0.998  # of the poles of its AR(2) model, of modulus below one
    #: What the encoders count in, to which positions are rounded [rad or m]; zero: they are not.
    count: Spread = 0.0
    rate: float = 5000.0  # sampling rate of the encoder, that of the control law [Hz]
    #: ``loop``: the control law reads the position noise too; ``record``: it is on the record only,
    #: which another sensor has made.
    where: Literal["loop", "record"] = "loop"
    #: ``record``: positions are rounded after the loop has run; ``loop``: the control law reads
    #: rounded ones.
    rounding: Literal["record", "loop"] = "record"

    def __post_init__(self) -> None:
        if not 0.0 <= self.radius < 1.0:
            raise ExperimentError(f"radius must lie between 0 and 1, not {self.radius}")
        if not 0.0 < self.frequency < self.rate / 2:
            raise ExperimentError(
                f"frequency must lie below {self.rate / 2:g} Hz, not {self.frequency}"
            )

    @property
    def denominator(self) -> np.ndarray:
        """D(z⁻¹) = 1 - 2 r cos(2π f/rate) z⁻¹ + r² z⁻² of the coloured noise."""
        cosine = np.cos(2.0 * np.pi * self.frequency / self.rate)
        return np.array([1.0, -2.0 * self.radius * cosine, self.radius**2])

    @property
    def gain(self) -> float:
        """Standard deviation of 1/D driven by white noise of unit variance."""
        _, a1, a2 = self.denominator
        return float(np.sqrt((1.0 + a2) / ((1.0 - a2) * ((1.0 + a2) ** 2 - a1**2))))

    def in_loop(self, seed: Seed, shape: tuple[int, ...]) -> np.ndarray:
        """Position noise of a run [rad or m], wherever it is added.

        ``shape``: (samples, joints) at the control rate.
        """
        noise = np.asarray(self.encoder) * stream(seed, ENCODER).standard_normal(shape)
        if np.any(self.coloured):
            noise += np.asarray(self.coloured) * self._autoregressive(seed, shape)
        return noise

    def of_torque(self, seed: Seed, shape: tuple[int, ...]) -> np.ndarray:
        """Noise of the torque sensors [N m or N], shape (samples, joints) of the record."""
        return np.asarray(self.torque) * stream(seed, TORQUE).standard_normal(shape)

    def _autoregressive(self, seed: Seed, shape: tuple[int, ...]) -> np.ndarray:
        """AR(2) noise of unit variance, stationary from its first sample on."""
        from scipy.signal import lfilter

        settling = int(np.ceil(np.log(SETTLED) / np.log(self.radius))) if self.radius > 0 else 1
        white = stream(seed, COLOURED).standard_normal((settling + shape[0], *shape[1:]))
        return lfilter([1.0], self.denominator, white, axis=0)[settling:] / self.gain

    def quantised(self, q: np.ndarray) -> np.ndarray:
        """Positions as the encoders count them [rad or m], shape (samples, joints)."""
        return in_whole_counts(q, self.count)


def stream(seed: Seed, number: int) -> np.random.Generator:
    """One stream of random numbers of a run."""
    run, *study = seed if isinstance(seed, tuple) else (seed,)
    return np.random.default_rng((run, number, *study))
