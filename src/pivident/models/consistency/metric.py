"""Distance of base parameters from an estimate in its own standard errors, and when it is too long.

With E the estimated base parameters, D those left out of the estimate, and the torque sums
G = ΦᵀWΦ of the fitted record,

    d² = |β_E + C β_D - θ_E|²_{P⁻¹} + |β_D|²_S / v,     C = G_EE⁻¹ G_ED,   S = G_DD - G_DE C

C β_D is the part of the omitted parameters that the estimate absorbs; S the torque they add that
it cannot explain; v the variance of one row implied by P, the geometric mean of the eigenvalues of
P G_EE, so that omitted parameters are measured in the same units as estimated ones. They are pulled
to zero, not to their least squares value: the identified model assumes that they are zero, and a
consistent estimate must not change.

P is the reported covariance. A sandwich of thirty windows cannot determine the correlations of more
parameters than windows; then its standard errors are kept, with the correlations of the formula.

Whether the step from an estimate to a consistent model is too long or costs too much torque.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pivident.dynamics.base_parameters import BaseParameters
from pivident.estimation.identification import Identification, estimated_in_base, estimated_indices
from pivident.estimation.solved_equations import TorqueSums
from pivident.foundation.distributions import chi_square
from pivident.foundation.errors import IdentificationError

#: Standard error of what was known beforehand, over its size: nothing is known better by a
#: consistent set.
FIRM = 1e-3

#: Smallest variance of a direction over that of white errors, relative to the median, below which
#: the rank of a covariance counts as too low.
LOWEST_RATIO = 1e-3
#: Smallest eigenvalue of the correlations for a factorisation in double precision.
FULL_RANK = 1e-13
#: Largest size of omitted parameters without effect on the record, over the typical size of their
#: kind.
MAX_UNSEEN = 10.0
#: An estimate is too poor if the distance is this improbable, the torque error grows by this share,
#: and the additional torque error is this share of all torque.
FAR_PROBABILITY, FAR_GROWTH, FAR_TORQUE = 1e-3, 0.10, 0.01
#: Torque error above which an improbable estimate is too poor regardless of the cost of the step.
POOR_ESTIMATE = 0.5
#: Growth of the torque error above which a note is given.
NOTABLE_COST = 0.01
#: Half of the 95 % interval of a normal estimate [σ].
HALF_INTERVAL = 1.96


@dataclass(frozen=True, eq=False)
class Metric:
    """Base parameters as β = center + root · x, with d = |x|."""

    base: BaseParameters  # base parameters of the robot
    estimated: np.ndarray  # indices of the estimated ones, shape (parameters,)
    center: np.ndarray  # the estimate, zero for those left out, shape (base,)
    root: np.ndarray  # shape (base, base)
    notes: tuple[str, ...]  # sentences


def make_metric(
    identification: Identification,
    base: BaseParameters,
    sums: TorqueSums | None,
    scales: np.ndarray,
) -> Metric:
    """The metric of an estimate.

    Without ``sums`` of the fitted record, parameters left out of the estimate count on the scale of
    the robot's own parameters only.
    """
    notes = []
    estimated = estimated_indices(identification, base)
    left_out = np.setdiff1d(np.arange(len(base)), estimated)
    covariance, mixed = full_covariance(identification)
    if mixed:
        notes.append(
            f"The covariance of {identification.method} comes from too few windows of time to "
            "determine all correlations: distances use its standard errors, and the correlations "
            "of the formula for white errors"
        )
    absorbed = np.zeros((estimated.size, left_out.size))
    root = np.zeros((len(base), len(base)))
    std = np.sqrt(np.diag(covariance))
    correlations = covariance / np.outer(std, std)
    root[np.ix_(estimated, estimated)] = std[:, None] * np.linalg.cholesky(correlations)
    if left_out.size:
        limit = 1.0 / (MAX_UNSEEN * scales[left_out]) ** 2
        if sums is None:
            seen = np.diag(limit * MAX_UNSEEN**2 * 1e4)
            notes.append(
                f"The torque sums of the record are missing: {left_out.size} omitted base "
                "parameters are limited to a hundredth of their typical size, and their effect on "
                "the torque is unknown; identify again to store the sums"
            )
        else:
            absorbed, seen = _conditional(sums.gram, covariance, estimated, left_out)
        size = 1.0 / np.sqrt(np.diag(seen) + limit)
        lower = np.linalg.cholesky((seen + np.diag(limit)) * np.outer(size, size))
        # β_D = V x with Vᵀ (S/v + limits) V = 1
        spread = size[:, None] * np.linalg.inv(lower).T
        root[np.ix_(left_out, left_out)] = spread
        root[np.ix_(estimated, left_out)] = -absorbed @ spread
    return Metric(base, estimated, estimated_in_base(identification, base), root, tuple(notes))


def full_covariance(identification: Identification) -> tuple[np.ndarray, bool]:
    """Covariance of full rank with the reported standard errors, and whether it had to be mixed."""
    reported = _firm(identification, identification.covariance)
    std = np.sqrt(np.maximum(np.diag(reported), 0.0))
    if not (np.isfinite(reported).all() and (std > 0.0).all()):
        names = [
            n
            for n, d in zip(identification.names, std, strict=True)
            if not (np.isfinite(d) and d > 0)
        ]
        raise IdentificationError(
            f"{identification.method} reports no finite standard error of {', '.join(names[:5])}",
            advice="distances cannot be computed, identify with another method",
        )
    own = reported / np.outer(std, std)
    other = _formula_correlations(identification)
    inverse = np.linalg.inv(np.linalg.cholesky(other))
    ratios = np.linalg.eigvalsh(inverse @ own @ inverse.T)
    if ratios[0] > max(LOWEST_RATIO * np.median(ratios), FULL_RANK * ratios[-1]):
        return reported, False
    return other * np.outer(std, std), True


def _firm(identification: Identification, covariance: np.ndarray) -> np.ndarray:
    """The covariance with a little room in directions that were known beforehand.

    A consistent set keeps what was fixed to within `FIRM` of its size.
    """
    restrictions = identification.restrictions
    if len(restrictions.freedom.free) == len(restrictions.names):
        return covariance
    size = np.maximum(np.abs(identification.theta), FIRM)
    room = np.where(restrictions.is_fixed, size, np.sqrt(np.maximum(np.diag(covariance), 0.0)))
    return covariance + np.diag((FIRM * room) ** 2)


def _formula_correlations(identification: Identification) -> np.ndarray:
    """Correlations of the formula for white errors, of full rank."""
    formula, names = identification.formula_covariance, identification.names
    formula = _firm(identification, formula)
    variances = np.diag(formula)
    wrong = (~np.isfinite(formula)).sum(axis=1) + ~(variances > 0.0)
    if wrong.any():
        weakest = names[int(np.argmax(wrong))]
        reason = "is not finite and positive"
    else:
        white = np.sqrt(variances)
        correlations = formula / np.outer(white, white)
        values, vectors = np.linalg.eigh(correlations)
        if values[0] > FULL_RANK:
            return correlations
        weakest = names[int(np.argmax(np.abs(vectors[:, 0])))]
        reason = "is singular"
    raise IdentificationError(
        f"the covariance of {identification.method} for white errors {reason}, the weakest "
        f"parameter is {weakest}",
        advice=f"distances cannot be computed, identify without {weakest} or with a motion that "
        "excites it",
    )


def _conditional(
    gram: np.ndarray, covariance: np.ndarray, estimated: np.ndarray, left_out: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """C, and S/v."""
    length = np.sqrt(np.where(np.diag(gram) > 0.0, np.diag(gram), 1.0))
    scaled = gram / np.outer(length, length)
    inside = scaled[np.ix_(estimated, estimated)]
    between = scaled[np.ix_(estimated, left_out)]
    values, vectors = np.linalg.eigh(inside)
    values = np.maximum(values, 1e-12 * values[-1])
    solved = (vectors / values) @ vectors.T @ between
    rest = scaled[np.ix_(left_out, left_out)] - between.T @ solved
    own = length[estimated]
    # log det (P G_EE) / size
    variance = np.linalg.slogdet(covariance * np.outer(own, own))[1] + np.log(values).sum()
    variance = np.exp(variance / own.size)
    absorbed = solved / own[:, None] * length[left_out]
    rest = rest * np.outer(length[left_out], length[left_out]) / variance
    values, vectors = np.linalg.eigh(0.5 * (rest + rest.T))
    return absorbed, (vectors * np.maximum(values, 0.0)) @ vectors.T


def probability(distance: float, directions: int, most: int) -> float:
    """χ² probability of a distance; one where the estimate was consistent."""
    if distance == 0.0:
        return 1.0
    return float(chi_square.sf(distance**2, int(np.clip(directions, 1, most))))


def is_far(p_value: float, free: float, consistent: float) -> bool:
    """Whether the step to the consistent point is improbable and costs much torque.

    Or the estimate itself does not explain half of the torque. Improbability or cost alone does
    not suffice: intervals of measured records do not include all model error, so long steps may
    cost nothing, and a noisy record may allow a step that costs much.
    """
    if not np.isfinite(consistent):
        return False
    costly = consistent > (1.0 + FAR_GROWTH) * free and consistent**2 - free**2 > FAR_TORQUE**2
    return p_value < FAR_PROBABILITY and (costly or free > POOR_ESTIMATE)


def cost_notes(errors: tuple[float, float], p_value: float) -> tuple[str, ...]:
    """A sentence where the step costs torque."""
    free, consistent = errors
    if not np.isfinite(consistent) or consistent <= (1.0 + NOTABLE_COST) * free:
        return ()
    return (
        f"Consistency raises the torque error of the fitted record from {100 * free:.3g} to "
        f"{100 * consistent:.3g} % (p = {p_value:.2g} for the step): geometry, friction law or "
        "the choice of parameters does not match the machine, or a bound is wrong",
    )
