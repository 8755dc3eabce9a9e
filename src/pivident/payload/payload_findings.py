"""Warnings about an estimated load, and the load that is none."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from pivident.errors import NegativePayload
from pivident.estimation.identification import Identification
from pivident.logs.joint_side import factors_of
from pivident.logs.torque_scale import scale_sentences
from pivident.payload.joint_masses import JointMasses
from pivident.payload.load_estimate import LoadEstimate
from pivident.recording.recording import Recording
from pivident.text.finding import Finding, Quantity
from pivident.text.numbers import percent, plus_minus

#: Standard errors from which a negative mass is no matter of noise: the records are swapped.
SWAPPED = 3.0

#: Standard errors by which the arm of one record may differ from that of the other.
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
) -> list[Finding]:
    """Reservations about this load.

    Args:
        load: the load.
        arm: the arm without load.
        change: of the arm's parameters between the records, in standard errors, shape (arm,).
        converged: whether the iteration converged.
        iterations: number of estimates.
    """
    found = []
    if not converged:
        text = (
            f"Not converged after {iterations} estimates; the load may still change by more than "
            "its standard errors."
        )
        found.append(Finding("error", "iteration", "not converged", text))
    if not arm.converged:
        text = "The arm without load did not converge."
        step = "Look at its identification first."
        found.append(Finding("error", "arm", "not converged", text, next_step=step))
    mass = Quantity(
        load.mass, "kg", interval=(load.mass - 2 * load.mass_std, load.mass + 2 * load.mass_std)
    )
    if load.determined[9] and not load.is_seen:
        text = (
            f"No load is seen: its mass, {plus_minus(load.mass, 2 * load.mass_std)} kg (2σ), is "
            "not significantly different from zero, and so it has no centre of mass."
        )
        step = "Check that the loaded record is one with the load."
        found.append(Finding("warning", "load", "not seen", text, "", step, {"mass": mass}))
    elif load.is_seen and load.mass < 10.0 * load.mass_std:
        text = (
            "The mass is known to worse than 20 % (2σ): intervals of the centre of mass are "
            "Fieller's and asymmetric."
        )
        step = "Weigh the load and give its mass, or move it faster."
        found.append(Finding("warning", "load", "imprecise", text, "", step, {"mass": mass}))
    worst = int(np.argmax(np.abs(change)))
    if abs(change[worst]) > ARM_DIFFERS:
        text = (
            f"The arm itself differs between the records, {arm.names[worst]} by "
            f"{abs(change[worst]):.1f} standard errors: something else changed than the load, such "
            "as mounting, temperature, tool or the link that carries it."
        )
        evidence = {"change": Quantity(float(abs(change[worst])), "σ", bound=ARM_DIFFERS)}
        found.append(Finding("warning", "arm", "differs", text, arm.names[worst], "", evidence))
    return found


def scale_sentence(recordings: Sequence[Recording]) -> str:
    """What the scale of the mass rests on: gains, or logged torques.

    Args:
        recordings: with the load.
    """
    if any(not r.has_torque for r in recordings) and all(not r.torque_scale for r in recordings):
        return (
            "No torque was logged: the mass has the scale of the declared gains of the control "
            "law. If these are all 1 % too large, so is the mass, and it does not show here."
        )
    if scales := [s for r in recordings for s in r.torque_scale]:
        return " ".join(scale_sentences(scales))
    specs = [r.reading.get("units", {}).get("tau") for r in recordings]
    units = [u for spec in specs for u in (spec if isinstance(spec, list) else [spec])]
    gains = any(isinstance(u, Mapping) or factors_of("tau", [u])[1].any() for u in units if u)
    return (
        f"The mass has the scale of {'the declared drive gains' if gains else 'the logged torque'}"
        ": an error of 1 % that all joints share is one of 1 % in the mass, and does not show here."
    )


def disagreement(masses: JointMasses | None) -> list[Finding]:
    """A warning where the joints disagree on the mass.

    Args:
        masses: the mass by each joint; None: it is not determined.
    """
    if masses is None or not masses.disagree:
        return []
    text = (
        f"The joints do not agree on the mass: {masses.listed} by their own equations (F = "
        f"{masses.statistic:.3g}, p = {masses.p_value:.2g}). Their torque scales differ by about "
        f"{percent(100 * masses.spread)}, and an error that they have in common does not show; "
        "the intervals of the load are widened for the differences."
    )
    step = (
        "Check the drive gains (`pivident gains` finds them from a load of known mass), friction "
        "that grows with the load, and the link that carries it."
    )
    evidence = {
        "spread": Quantity(100 * masses.spread, "%"),
        "F": Quantity(masses.statistic),
        "p": Quantity(masses.p_value),
    }
    return [Finding("warning", "load", "joints disagree", text, "", step, evidence)]


def worse_explained(arm: Identification, rms_errors: np.ndarray) -> list[Finding]:
    """A warning where a load does not explain what the loaded record has more.

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
    text = (
        "A load does not explain all that the loaded record has more: rms error "
        f"{', '.join(worse)}."
    )
    step = (
        "Look for friction that grows with the load (friction_under_load), the link that carries "
        "it, a flexible tool, or saturated torques."
    )
    return [Finding("warning", "load", "does not explain", text, next_step=step)]
