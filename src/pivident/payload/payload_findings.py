"""What has to be said about an estimated load, and the load that is none."""

from __future__ import annotations

import numpy as np

from pivident.errors import NegativePayload
from pivident.estimation.identification import Identification
from pivident.payload.load_estimate import LoadEstimate
from pivident.text.numbers import plus_minus

#: Deviations from which on a negative mass is no matter of noise: the records are swapped.
SWAPPED = 3.0

#: Deviations by which the arm of one record may differ from that of the other.
ARM_DIFFERS = 4.5

#: Ratio of the rms error with load to that without from which on the load does not explain all.
EXPLAINED_WORSE = 1.5


def refuse_negative(load: LoadEstimate) -> None:
    """Refuse a load that weighs less than nothing.

    Args:
        load: the estimate.

    Raises:
        NegativePayload: by more than noise.
    """
    if load.determined[9] and load.mass < -SWAPPED * load.mass_std:
        raise NegativePayload(load.mass, load.mass_std)


def warnings_about(
    load: LoadEstimate, arm: Identification, change: np.ndarray, converged: bool, iterations: int
) -> list[str]:
    """What has to be said about this load, whole sentences.

    Args:
        load: the load.
        arm: the arm without load.
        change: of the arm's parameters between the records, in deviations, shape (arm,).
        converged: whether the iteration stood still.
        iterations: number of estimates.
    """
    said = []
    if not converged:
        said.append(
            f"Not converged after {iterations} estimates; the load may still change by more than "
            "its deviations."
        )
    if not arm.converged:
        said.append("The arm without load did not converge; look at its identification first.")
    if load.determined[9] and not load.is_seen:
        said.append(
            f"No load is seen: its mass, {plus_minus(load.mass, 2 * load.mass_std)} kg (2σ), is "
            "not told from zero, and so it has no centre of mass. Is the loaded record one with "
            "the load?"
        )
    elif load.is_seen and load.mass < 10.0 * load.mass_std:
        said.append(
            "The mass is known to worse than 20 % (2σ): intervals of the centre of mass are "
            "Fieller's and lopsided. Weigh the load and give its mass, or move it faster."
        )
    worst = int(np.argmax(np.abs(change)))
    if abs(change[worst]) > ARM_DIFFERS:
        said.append(
            f"The arm itself differs between the records, {arm.names[worst]} by "
            f"{abs(change[worst]):.1f} deviations: something else changed than the load, such as "
            "mounting, temperature, tool or the link that carries it."
        )
    return said


def worse_explained(arm: Identification, rms_errors: np.ndarray) -> list[str]:
    """One sentence where a load does not explain what the loaded record has more.

    Args:
        arm: the arm without load, estimated by the same method.
        rms_errors: rms of τ - Φθ with load of each joint [N m or N], shape (joints,).
    """
    worse = [
        f"{fit.name} {with_load:.3g} instead of {fit.rms_error:.3g} {fit.torque_unit}"
        for fit, with_load in zip(arm.joints, rms_errors, strict=True)
        if with_load > EXPLAINED_WORSE * fit.rms_error
    ]
    if not worse:
        return []
    return [
        "A load does not explain all that the loaded record has more; rms error "
        f"{', '.join(worse)}: look for friction that grows with the load "
        "(friction_under_load), a flexible tool, or saturated torques."
    ]
