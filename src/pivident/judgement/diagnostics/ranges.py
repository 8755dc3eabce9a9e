"""Ranges of estimates over motion and friction laws, which stand beside their intervals.

An interval describes what noise does to an estimate of a right model. Where the model is wrong, the
estimate also depends on the motion that it is fitted to. Held-out validation has left one block of
the motion, or one recording, out in turn; the n estimates θ₍₋ᵢ₎ and their mean θ̄ give the
delete-one jackknife (Efron and Tibshirani 1993)

    σ_J² = (n - 1)/n Σᵢ (θ₍₋ᵢ₎ - θ̄)²

and the range θ ± 2σ_J. With five blocks it has four degrees of freedom: σ_J itself is uncertain by
a third. Noise models, weights and instruments are those of the whole record in all n estimates.

Where one block alone shows a parameter, noise makes the range wider than the interval: without it
the estimate is poor. An estimate with the variance V₍₋ᵢ₎ then differs from the one of the whole
record by V₍₋ᵢ₎ - V (Hausman 1978), and σ_J² is expected to be (n - 1)/n Σᵢ (V₍₋ᵢ₎ - V).

Where the record does not distinguish between friction laws, the range of the estimates by all of
them, from the least to the largest, says how much of a value is the choice of the law.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from pivident.estimation.identification import Identification
from pivident.estimation.parameter_rows import ParameterRange
from pivident.foundation.distributions import chi_square
from pivident.judgement.model_errors.named_causes import ModelErrors
from pivident.judgement.validation.held_out.cross_validation import CrossValidation

#: Fewest blocks whose scatter is a range.
MIN_BLOCKS = 3
#: Width of a range over that of the interval from which on it is much wider …
MUCH_WIDER = 2.0
#: … unless noise alone reaches it, all parameters together, with this probability.
CHANCE = 0.01


def jackknife_std(estimates: np.ndarray) -> np.ndarray:
    """Standard errors by the delete-one jackknife.

    Args:
        estimates: without one part of the data each, shape (parts, parameters).

    Returns:
        √((n - 1)/n Σ (θ₍₋ᵢ₎ - θ̄)²) of n parts, shape (parameters,).
    """
    return np.asarray(np.sqrt((len(estimates) - 1.0) * np.var(estimates, axis=0)))


def block_ranges(validation: CrossValidation) -> tuple[ParameterRange, ...]:
    """Range of each parameter from block to block, or from recording to recording.

    Args:
        validation: of one method, on held-out blocks.

    Returns:
        θ ± 2σ_J; none where fewer than `MIN_BLOCKS` estimates were made without a block.
    """
    whole, stretches = validation.identification, validation.held_out
    made = [(s.recording, s.identification) for s in stretches if s.identification is not None]
    estimates = {id(own): own.theta for _, own in made}
    if validation.kind != "folds" or len(estimates) < MIN_BLOCKS:
        return ()
    pairs = {(recording, id(own)) for recording, own in made}
    apart = len(pairs) == len({recording for recording, _ in pairs})  # each in one block only
    reach = 2.0 * jackknife_std(np.array(list(estimates.values())))
    by_noise = _width_by_noise(whole.std, {id(own): own.std for _, own in made})
    return tuple(
        ParameterRange(
            name, float(value - half), float(value + half),
            "recordings" if apart else "blocks", len(estimates), float(width),
        )
        for name, value, half, width in zip(
            whole.names, whole.theta, reach, by_noise, strict=True
        )
    )  # fmt: skip


def _width_by_noise(std: np.ndarray, without: Mapping[int, np.ndarray]) -> np.ndarray:
    """Width that noise alone makes with the probability `CHANCE`, shape (parameters,).

    ``std``: standard errors of the whole record; ``without``: of the estimate without each block.
    """
    count = len(without)
    least = std**2 / (count - 1.0)  # of blocks that tell as much each
    excess = np.maximum(np.array(list(without.values())) ** 2 - std**2, least)
    total = np.sum(excess, axis=0)
    share = 1.0 - 1.0 / count
    freedom = np.maximum(share * total**2 / np.maximum(np.sum(excess**2, axis=0), 1e-300), 1.0)
    by_chance = chi_square.isf(CHANCE / std.size, freedom) / freedom
    return np.asarray(4.0 * np.sqrt(share * total * by_chance))


def friction_ranges(result: Identification, errors: ModelErrors) -> tuple[ParameterRange, ...]:
    """Range of each parameter over friction laws that fit the record about as well.

    Args:
        result: an estimate.
        errors: causes of model error of it.

    Returns:
        From the least to the largest of the estimate and those by each friction law that was
        named, and by what the record cannot tell from it; none where no friction law was named.
    """
    estimates = [result.theta]
    corrected = result.theta
    for one in errors.named:
        if one.cause.kind in ("friction", "uneven friction"):
            estimates += [*(corrected + one.changes)]
            corrected = corrected + one.changes[0]
    if len(estimates) == 1:
        return ()
    return tuple(
        ParameterRange(name, float(low), float(high), "friction laws", len(estimates))
        for name, low, high in zip(
            result.names, np.min(estimates, axis=0), np.max(estimates, axis=0), strict=True
        )
    )


def much_wider(
    result: Identification, ranges: Sequence[ParameterRange]
) -> list[tuple[float, ParameterRange]]:
    """Ranges that are much wider than the interval of ±2σ, the widest first, one a parameter.

    Args:
        result: an estimate.
        ranges: of its parameters.

    Returns:
        Width over that of the interval, and the range.
    """
    interval = dict(zip(result.names, 4.0 * np.maximum(result.free_std, 1e-300), strict=True))
    wide: dict[str, tuple[float, ParameterRange]] = {}
    for own in ranges:
        width = own.high - own.low
        ratio = width / interval[own.name]
        least = wide.get(own.name, (MUCH_WIDER, own))[0]
        if width > own.by_noise and ratio > least:
            wide[own.name] = ratio, own
    return sorted(wide.values(), key=lambda one: -one[0])
