"""Weights of simulation errors: noise models of each channel and joint, and its variance.

As in IDIM-PIV an AR model of the error whitens it, (P-29), L = λ^(-1/2) A(z⁻¹): errors and their
derivatives pass the same filter. A controller need not be inverted: thinned rows are so few that
a model of moderate order resolves the motion's band.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pivident.estimation.covariance.windows import windows_of
from pivident.estimation.method import AutoRegressive
from pivident.estimation.normal_equations import JointSums
from pivident.estimation.output_error.simulated_errors import SimulatedErrors
from pivident.estimation.output_error.thinning import passed_power
from pivident.foundation.threads import run_in_threads
from pivident.signals.noise_models import (
    continued_into_band,
    excess_in_band,
    fit_ar,
    highest_order,
    unmasked_stretches,
)
from pivident.signals.prefilter import Prefilter

#: Standard deviations k beyond which Huber's loss grows linearly: 95 % as efficient as least
#: squares where the noise is normal.
HUBER = 1.345

#: E[min(x², k |x|)] = erf(k/√2) of the standard normal distribution.
HUBER_MEAN = math.erf(HUBER / math.sqrt(2.0))


@dataclass(frozen=True, eq=False)
class NoiseWeights:
    """L of each channel and joint, their λ apart."""

    filters: tuple[tuple[Prefilter, ...], ...]  # [channel][joint], of unit gain
    variance: np.ndarray  # λ, shape (channels, joints)
    #: Level of the error in the motion's band over that just beyond it, likewise; NaN without a
    #: noise model.
    excess: np.ndarray
    at_bound: bool = False  # whether an order is the largest allowed

    @classmethod
    def white(cls, channels: int, joints: int) -> NoiseWeights:
        """L = 1, before there are errors that only consist of noise."""
        filters = tuple((Prefilter(),) * joints for _ in range(channels))
        return cls(filters, np.ones((channels, joints)), np.full((channels, joints), np.nan))

    @property
    def orders(self) -> tuple[int, ...]:
        """Orders of the noise models, channel by channel; empty without any."""
        orders = tuple(len(f.fir) - 1 for own in self.filters for f in own)
        return orders if np.isfinite(self.excess).any() else ()


def fitted_noise(
    errors: Sequence[np.ndarray],
    used: Sequence[np.ndarray],
    rate: float,
    factor: int,
    recipe: AutoRegressive,
    band: float,
) -> NoiseWeights:
    """Noise models of errors, (P-29).

    ``errors``: of each stretch, shape (channels, joints, rows), rows at ``rate`` [Hz] of
    ``factor`` samples each; ``band``: highest frequency of the motion [Hz], in which noise counts
    up to the level just beyond it.
    """
    channels, joints = errors[0].shape[:2]
    filters = [[Prefilter()] * joints for _ in range(channels)]
    variance, excess = np.ones((2, channels, joints))
    at_bound = np.zeros((channels, joints), bool)

    def passed(frequency: np.ndarray) -> np.ndarray:
        return passed_power(factor, frequency / rate)

    def work(place: tuple[int, int]) -> None:
        c, j = place
        pieces = [np.append(own[c, j], 0.0) for own in errors]
        left_out = [np.append(~part[c, j], True) for part in used]
        whole = np.concatenate(pieces)
        mask = np.concatenate(left_out)
        size = float(np.sqrt(np.mean(whole[~mask] ** 2))) if (~mask).any() else 0.0
        if size == 0.0:
            return
        if not highest_order(unmasked_stretches(mask)):  # too short for a model: taken for white
            variance[c, j] = size**2
            return
        model = fit_ar(whole / size, recipe.p_max, recipe.criterion, mask=mask)
        changed = continued_into_band(model, rate, band, passed)
        filters[c][j] = Prefilter(fir=changed.coefficients)
        variance[c, j] = changed.innovation_variance * size**2
        excess[c, j] = excess_in_band(model, rate, band, passed)
        at_bound[c, j] = model.at_bound

    run_in_threads(work, [(c, j) for c in range(channels) for j in range(joints)])
    return NoiseWeights(tuple(map(tuple, filters)), variance, excess, bool(at_bound.any()))


def whitened_errors(made: SimulatedErrors, noise: NoiseWeights) -> np.ndarray:
    """A e of one stretch, shape (channels, joints, rows); zero on rows that are not used."""
    out = np.empty_like(made.errors)
    for c, own in enumerate(noise.filters):
        for j, prefilter in enumerate(own):
            used = made.used[c, j]
            white = prefilter.stream(1, threads=1).process(made.errors[c, j : j + 1], seen=used)
            out[c, j] = white[0] * used
    return out


def whitened_rows(
    made: SimulatedErrors, noise: NoiseWeights, channel: int, joint: int, robust: bool
) -> Iterator[tuple[slice, np.ndarray]]:
    """A J and A e of one stretch, block by block: which rows, and shape (columns + 1, rows).

    ``robust``: times the roots of Huber's weights, min(1, k √λ/|A e|).
    """
    errors, used = made.errors[channel, joint], made.used[channel, joint]
    stream = noise.filters[channel][joint].stream(made.columns.count + 1, threads=1)
    for rows, columns in made.columns.blocks(channel, joint):
        stack = np.vstack([columns, errors[rows]])
        stack = stream.process(stack, out=stack, seen=used[rows])
        if robust:
            size = np.abs(stack[-1]) / np.sqrt(noise.variance[channel, joint])
            stack *= np.sqrt(np.minimum(1.0, HUBER / np.maximum(size, 1e-300)))
        yield rows, stack


def whitened_sums(
    stretches: Sequence[SimulatedErrors], noise: NoiseWeights, robust: bool
) -> list[list[list[JointSums]]]:
    """Sums Jᵀ Aᵀ A J, Jᵀ Aᵀ A e of each stretch, channel and joint, and of each window of time.

    ``robust``: with Huber's weights.
    """
    windows = windows_of([own.errors.shape[2] for own in stretches])
    channels, joints = stretches[0].errors.shape[:2]
    sums = [
        [
            [
                JointSums.empty(f"joint {j + 1}", np.arange(made.columns.count), own.count)
                for j in range(joints)
            ]
            for _ in range(channels)
        ]
        for made, own in zip(stretches, windows, strict=True)
    ]

    def work(place: tuple[int, int, int]) -> None:
        s, c, j = place
        made, own = stretches[s], windows[s]
        for rows, stack in whitened_rows(made, noise, c, j, robust):
            shares = [replace(share, window=share.window - own.first) for share in own.shares(rows)]
            sums[s][c][j].add_stack(stack, made.used[c, j, rows], shares)

    run_in_threads(
        work,
        [(s, c, j) for s in range(len(stretches)) for c in range(channels) for j in range(joints)],
    )
    return sums


def loss(white: np.ndarray, variance: np.ndarray, robust: bool) -> float:
    """Σ ρ(A e/√λ): squares, or Huber's loss, x² up to k and 2 k |x| - k² beyond.

    ``white``: A e, shape (channels, joints, rows); ``variance``: λ, shape (channels, joints).
    """
    total = 0.0
    for c, j in np.ndindex(*variance.shape):
        size = np.abs(white[c, j]) / np.sqrt(variance[c, j])
        if robust:
            total += float(np.where(size > HUBER, HUBER * (2.0 * size - HUBER), size**2).sum())
        else:
            total += float(size @ size)
    return total
