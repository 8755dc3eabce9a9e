"""Signals of a record behind a low-pass without phase, at the few rows that its band needs.

A filter without phase is a gain by frequency. Of the spectrum of a record only what lies below half
the rate of the rows is kept, and turned back at that rate: filter and thinning in one. Signals that
hold nothing far above the band may come at a fraction of the rate. The record is taken for periodic
on the way, so rows near its ends are to be left out.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pivident.signals.bandpass import bandpass_response


@dataclass(frozen=True)
class BandRows:
    """Rows of a record: every ``step`` samples, ``count`` of them, the first at the first sample.

    ``rate`` is that of the samples, ``band`` the highest frequency that is kept [Hz].
    """

    rate: float
    band: float
    step: int
    count: int

    @classmethod
    def of(cls, samples: int, rate: float, band: float, step: int) -> BandRows:
        """Rows over so many samples, and a few beyond their end."""
        from scipy.fft import next_fast_len

        return cls(rate, band, step, next_fast_len(-(-samples // step), real=True))

    @property
    def samples(self) -> int:
        """Samples that the rows span."""
        return self.count * self.step

    @property
    def frequencies(self) -> np.ndarray:
        """Of the spectrum that is kept [Hz], shape (count // 2 + 1,)."""
        return np.fft.rfftfreq(self.count, self.step / self.rate)

    def gain(self, weight: np.ndarray | None) -> np.ndarray:
        """Gain of the low-pass at these frequencies.

        ``weight``: taps of a further filter, symmetric about the middle one; None: no filter.
        """
        gain = np.abs(bandpass_response(self.frequencies, self.rate, self.band))
        if weight is None:
            return gain
        circle = np.zeros(self.samples)
        half = weight.size // 2
        np.add.at(circle, np.arange(-half, half + 1) % self.samples, weight)
        return gain * np.fft.rfft(circle).real[: gain.size]

    def of_signals(self, signals: np.ndarray, gain: np.ndarray, fraction: int = 1) -> np.ndarray:
        """Rows of some signals, shape (signals, count).

        Args:
            signals: one sample for every ``fraction`` of the record's, shape (signals, samples).
            gain: of the filter.
            fraction: a divisor of ``step``.
        """
        from scipy.fft import irfft, rfft

        length = self.samples // fraction
        spectrum = rfft(signals[:, :length], length, axis=1)[:, : gain.size]
        scale = fraction / self.step
        return np.asarray(irfft(spectrum * (gain * scale), self.count, axis=1))
