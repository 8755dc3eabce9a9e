"""Whether the step from an estimate to a consistent model is too long or costs too much torque."""

from __future__ import annotations

import numpy as np

#: An estimate is too poor if the distance is this improbable, the torque error grows by this share,
#: and the additional torque error is this share of all torque.
FAR_PROBABILITY, FAR_GROWTH, FAR_TORQUE = 1e-3, 0.10, 0.01

#: Torque error above which an improbable estimate is too poor regardless of the cost of the step.
POOR_ESTIMATE = 0.5

#: Growth of the torque error above which a note is given.
NOTABLE_COST = 0.01

#: Half of the 95 % interval of a normal estimate [σ].
HALF_INTERVAL = 1.96


def probability(distance: float, directions: int, most: int) -> float:
    """χ² probability of a distance; one where the estimate was consistent."""
    from scipy.stats import chi2

    if distance == 0.0:
        return 1.0
    return float(chi2.sf(distance**2, int(np.clip(directions, 1, most))))


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
