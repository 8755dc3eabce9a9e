"""Windows of time over which a covariance sums what a residual leaves: smooth and overlapping.

They are raised cosines that overlap by half and sum to one. Blocks with hard edges would not do:
where the residual's spectrum falls to zero at zero frequency, as that of twice differentiated
encoder noise does, the sum over a block is all edges, and standard errors come out several times
too large.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

#: Windows of a record. More would be too short to see where the residual has no low frequencies
#: (in the scenario *loop* 2σ cover 97.7 % with 52, 97.5 % with 36, 96.7 % with 30),
#: fewer make the standard errors themselves uncertain.
WINDOWS = 30

#: Fewest windows of each record where there are many.
FEWEST = 8

#: Correlation of neighbouring windows of the sandwich, squared and counted on both sides.
_NEIGHBOURS = 2.0 / 36.0

#: Σ of the squared windows at each sample, on average: 1/2 + 1/4.
OVERLAP = 0.75


@dataclass(frozen=True)
class Share:
    """Part of a stretch between the centres of two neighbouring windows."""

    part: slice  # samples of the stretch
    window: int  # the window that falls here; the next one rises
    rising: np.ndarray  # weight of the rising one, shape (samples of the part,)


@dataclass(frozen=True)
class Windows:
    """Raised cosines along one record."""

    samples: int  # length of the record
    count: int  # number of windows
    first: int = 0  # number of the first one among those of all records

    def shares(self, span: slice) -> Iterator[Share]:
        """How the samples of a stretch are shared out among the windows."""
        centres = np.linspace(0, self.samples, self.count).round().astype(int)
        for k in range(self.count - 1):
            start, stop = max(centres[k], span.start), min(centres[k + 1], span.stop)
            if start < stop:
                phase = (np.arange(start, stop) + 0.5 - centres[k]) / (centres[k + 1] - centres[k])
                part = slice(start - span.start, stop - span.start)
                yield Share(part, self.first + k, 0.5 - 0.5 * np.cos(np.pi * phase))


def windows_of(lengths: Sequence[int]) -> list[Windows]:
    """Windows of all records, numbered through."""
    made, first = [], 0
    for samples in lengths:
        count = int(np.clip(samples // 2, 2, max(FEWEST, WINDOWS // len(lengths))))
        made.append(Windows(samples, count, first))
        first += count
    return made


def degrees_of_freedom(lengths: Sequence[int]) -> float:
    """ν of a variance from the windows of records of these lengths, which overlap."""
    return float(freedom(np.array(sum(w.count for w in windows_of(lengths)), dtype=float)))


def freedom(windows: np.ndarray) -> np.ndarray:
    """ν of a variance from so many windows of equal weight, which overlap."""
    return windows / (1.0 + _NEIGHBOURS) - 1.0
