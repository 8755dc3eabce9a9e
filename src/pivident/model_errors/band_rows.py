"""Signals of a record behind a low-pass without phase, at the few rows that its band needs.

A filter without phase is a gain by frequency. Of the spectrum of a record only what lies below half
the rate of the rows is kept, and turned back at that rate: filter and thinning in one. Signals that
hold nothing far above the band may come at a fraction of the rate. The record is taken for periodic
on the way, so rows near its ends are to be left out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pivident.signals.bandpass import bandpass_response

#: Size below which a number is zero; products of such would be denormal, and slow.
VANISHING = 1e-150


@dataclass(frozen=True)
class BandRows:
    """Every so many samples of a record, as far as they are not near its ends.

    Attributes:
        rate: of the samples [Hz].
        band: highest frequency that is kept [Hz].
        step: samples from one row to the next.
        count: rows of the whole record, its ends and a few beyond them included.
        kept: those that are used.
    """

    rate: float
    band: float
    step: int
    count: int
    kept: slice

    @classmethod
    def of(cls, samples: int, rate: float, band: float, step: int, span: slice) -> BandRows:
        """Rows of a record of so many samples; ``span``: samples at which rows may be."""
        from scipy.fft import next_fast_len

        count = next_fast_len(-(-samples // step), real=True)
        first, last = -(-span.start // step), -(-span.stop // step)
        return cls(rate, band, step, count, slice(first, max(first, last)))

    @property
    def at(self) -> np.ndarray:
        """Samples at which the rows are, shape (rows,)."""
        return np.arange(self.kept.start, self.kept.stop) * self.step

    @property
    def samples(self) -> int:
        """Samples that the rows of the whole record span."""
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

    def passed(
        self, signals: Sequence[np.ndarray] | np.ndarray, gain: np.ndarray, fraction: int = 1
    ) -> np.ndarray:
        """Rows of some signals behind a filter, shape (signals, rows).

        Args:
            signals: one sample for every ``fraction`` of the record's, shape (signals, samples).
            gain: of the filter.
            fraction: a divisor of ``step``.
        """
        from scipy.fft import irfft, rfft

        if not len(signals):
            return np.zeros((0, self.at.size))
        length = self.samples // fraction
        spectrum = rfft(np.asarray(signals)[:, :length], length, axis=1)[:, : gain.size]
        whole = irfft(spectrum * (gain * fraction / self.step), self.count, axis=1)
        rows = np.ascontiguousarray(whole[:, self.kept])
        rows[np.abs(rows) < VANISHING] = 0.0
        return rows
