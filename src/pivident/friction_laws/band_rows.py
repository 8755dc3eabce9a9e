"""Rows of one joint below the highest frequency of the motion, on which laws are judged.

Above it a logged torque is noise and ripple that no friction law explains, and they would hide
what laws differ by. Torque and columns pass the same low-pass without phase; the rows are those of
the last estimate, thinned out to what the band needs.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pivident.friction_laws.filtered_rows import KeptRows, LastPass, row_samples
from pivident.motion.motion import packed_stretch
from pivident.signals.bandpass import butterworth

#: Rows that are kept for each period of the highest frequency.
ROWS_PER_PERIOD = 4.0

#: Samples whose columns are computed at once.
BLOCK = 8192


class BandRows:
    """Low-passed columns of one joint; ``keep`` indexes ``columns_of(joint)``, band in [Hz]."""

    def __init__(self, last: LastPass, joint: int, keep: np.ndarray, band: float) -> None:
        self.last, self.joint, self.band = last, joint, band
        self.rows: list[KeptRows] = []
        self.steps: list[int] = []  # rows of the estimator for each row here
        self.samples: list[np.ndarray] = []  # sample of the recording of each row
        eq = last.equations
        own = slice(eq.regressor.offsets[joint], eq.regressor.offsets[joint + 1])
        for number, record in enumerate(eq.records):
            k, every = record.kinematics, row_samples(record)
            rate = k.recording.rate / max(float(np.median(np.diff(every))), 1.0)
            step = max(int(rate / (ROWS_PER_PERIOD * band)), 1)
            self.steps.append(step)
            self.samples.append(every[::step])
            used = record.used[joint][::step].astype(float)
            columns = np.empty((keep.size, k.q.shape[1]))
            for first in range(0, columns.shape[1], BLOCK):
                span = slice(first, min(first + BLOCK, columns.shape[1]))
                columns[:, span] = packed_stretch(eq.regressor, k, span)[own][keep]
            phi = self._passed(columns, number) * used
            tau = self._passed(k.tau[joint][None], number)[0] * used
            self.rows.append(KeptRows(phi, None, tau, used))

    def changed(self, columns: Sequence[np.ndarray]) -> list[np.ndarray]:
        """Further columns on all samples of each record, on these rows."""
        return [
            self._passed(own, number) * rows.used
            for number, (own, rows) in enumerate(zip(columns, self.rows, strict=True))
        ]

    def _passed(self, columns: np.ndarray, number: int) -> np.ndarray:
        rate = self.last.equations.records[number].kinematics.recording.rate
        low = butterworth(columns.T, rate, self.band)
        return np.ascontiguousarray(low[self.samples[number]].T)
