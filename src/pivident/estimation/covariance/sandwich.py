"""Covariance that holds for residuals that are not white: a sandwich over smooth windows.

    P = Σ_k (θ₍ₖ₎ - θ)(θ₍ₖ₎ - θ)ᵀ / c,    θ₍ₖ₎ - θ = -(ZᵀΦ - Z_kᵀΦ)⁻¹ Z_kᵀε

θ₍ₖ₎ is the estimate without window k (a jackknife, in its linear form, which frees the residuals
of the share that the estimate itself took from them). Within a window any correlation and any
change of the variance is allowed; windows are longer than the correlation.

The windows are raised cosines that overlap by half and sum to one. Blocks with hard edges would
not do: where the residual's spectrum falls to zero at zero frequency, as that of twice
differentiated encoder noise does, the sum over a block is all edges, and deviations come out
several times too large.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from pivident.estimation.normal_equations import JointSums

#: Windows of a record. More would be too short to see where the residual has no low frequencies
#: (in the scenario *loop* 2σ cover 97.7 % with 52, 97.5 % with 36, 96.7 % with 30),
#: fewer make the deviations themselves uncertain.
WINDOWS = 30

#: Fewest windows of each record where there are many.
FEWEST = 8

#: Σ of the squared windows at each sample, on average: 1/2 + 1/4.
OVERLAP = 0.75


@dataclass(frozen=True)
class Share:
    """Part of a stretch between the centres of two neighbouring windows.

    Attributes:
        part: samples of the stretch.
        window: the window that falls here; the next one rises.
        rising: weight of the rising one, shape (samples of the part,).
    """

    part: slice
    window: int
    rising: np.ndarray


@dataclass(frozen=True)
class Windows:
    """Raised cosines along one record.

    Attributes:
        samples: length of the record.
        count: number of windows.
        first: number of the first one among those of all records.
    """

    samples: int
    count: int
    first: int = 0

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
    """Windows of all records, numbered through.

    Args:
        lengths: samples of each record.
    """
    made, first = [], 0
    for samples in lengths:
        count = int(np.clip(samples // 2, 2, max(FEWEST, WINDOWS // len(lengths))))
        made.append(Windows(samples, count, first))
        first += count
    return made


def sandwich(
    sums: Sequence[JointSums],
    theta: np.ndarray,
    variance: np.ndarray,
    weight_power: float = 1.0,
) -> np.ndarray:
    """Covariance of the estimate, shape (parameters, parameters).

    Args:
        sums: normal equations with their windows, one per joint.
        theta: parameters, shape (parameters,).
        variance: λ of each joint, shape (joints,).
        weight_power: power of λ in the weights, see ``solve``.
    """
    count, size = len(sums[0].window_zf), theta.size
    zf, scores = np.zeros((count, size, size)), np.zeros((count, size))
    for joint, lam in zip(sums, np.asarray(variance) ** weight_power, strict=True):
        own = joint.columns
        zf[:, own[:, None], own] += joint.window_zf / lam
        scores[:, own] += (joint.window_zt - joint.window_zf @ theta[own]) / lam
    total = zf.sum(axis=0)
    # columns of unit length: parameters differ by orders of magnitude
    scale = np.sqrt(np.maximum(np.abs(np.diag(total)), 1e-300))
    without = (total - zf) / np.outer(scale, scale)
    steps = np.linalg.solve(without, (scores / scale)[:, :, None])[:, :, 0] / scale
    return steps.T @ steps / OVERLAP
