"""Warnings about an estimated load, and the load that is none."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from pivident.data.logs.log import factors_of
from pivident.data.logs.torque_scale import scale_sentences
from pivident.data.recording.recording import Recording
from pivident.estimation.identification import Identification
from pivident.foundation.errors import NegativePayload
from pivident.foundation.text.finding import Finding, Quantity
from pivident.foundation.text.numbers import percent, plus_minus
from pivident.studies.payload.arm_and_load import KnownParts
from pivident.studies.payload.joint_masses import JointMasses
from pivident.studies.payload.load_estimate import LoadEstimate

#: Standard errors from which a negative mass is no matter of noise: the records are swapped.
SWAPPED = 3.0

#: Standard errors by which the arm of one record may differ from that of the other.
ARM_DIFFERS = 4.5

#: Standard errors by which the torques contradict what is declared of a load, the share of its mass
#: and the distance of its centre [m] that matter.
CONTRADICTS, NOTABLE, NEAR = 4.0, 0.02, 2e-3

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
) -> Iterator[Finding]:
    """Reservations about this load.

    Args:
        load: the load.
        arm: the arm without load.
        change: of the arm's parameters between the records, in standard errors, shape (arm,).
        converged: whether the iteration converged.
        iterations: number of estimates.
    """
    if not converged:
        text = (
            f"Not converged after {iterations} estimates; the load may still change by more than "
            "its standard errors."
        )
        yield Finding("error", "iteration", "not converged", text)
    if not arm.converged:
        text = "The arm without load did not converge."
        step = "Look at its identification first."
        yield Finding("error", "arm", "not converged", text, next_step=step)
    mass = Quantity(
        load.mass, "kg", interval=(load.mass - 2 * load.mass_std, load.mass + 2 * load.mass_std)
    )
    if load.determined[9] and not load.is_seen:
        text = (
            f"No load is seen: its mass, {plus_minus(load.mass, 2 * load.mass_std)} kg (2σ), is "
            "not significantly different from zero, and so it has no centre of mass."
        )
        step = "Check that the loaded record is one with the load."
        yield Finding("warning", "load", "not seen", text, "", step, {"mass": mass})
    elif load.is_seen and load.mass < 10.0 * load.mass_std:
        text = (
            "The mass is known to worse than 20 % (2σ): intervals of the centre of mass are "
            "Fieller's and asymmetric."
        )
        step = "Weigh the load and give its mass, or move it faster."
        yield Finding("warning", "load", "imprecise", text, "", step, {"mass": mass})
    worst = int(np.argmax(np.abs(change)))
    if abs(change[worst]) > ARM_DIFFERS:
        text = (
            f"The arm itself differs between the records, {arm.names[worst]} by "
            f"{abs(change[worst]):.1f} standard errors: something else changed than the load, such "
            "as mounting, temperature, tool or the link that carries it."
        )
        evidence = {"change": Quantity(float(abs(change[worst])), "σ", bound=ARM_DIFFERS)}
        yield Finding("warning", "arm", "differs", text, arm.names[worst], "", evidence)


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
        f"{percent(100 * max(masses.spread, masses.farthest))}, and an error that they have in "
        "common does not show; the intervals of the load are widened for the differences."
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


def contradicted(known: KnownParts, found: LoadEstimate) -> Iterator[Finding]:
    """Warnings where the torques alone give another load than what was declared of it.

    Args:
        known: what was declared.
        found: the load by the torques, without what was declared, in the same frame.
    """
    if known.mass is not None and found.determined[9] and found.is_seen:
        spread = float(np.hypot(found.mass_std, known.mass_std))
        apart = abs(found.mass - known.mass)
        if apart > CONTRADICTS * spread and apart > NOTABLE * known.mass:
            text = (
                f"The torques alone give a mass of {plus_minus(found.mass, 2 * found.mass_std)} kg "
                f"(2σ), {apart / spread:.0f} standard errors from the declared one, "
                f"{known.mass:.6g} kg."
            )
            step = (
                "Weigh the load, with everything that is mounted with it, or correct the drive "
                "gains: an error that they share is one of the mass."
            )
            evidence = {"mass": Quantity(found.mass, "kg"), "declared": Quantity(known.mass, "kg")}
            yield Finding("warning", "load", "other mass", text, "", step, evidence)
    if known.center_of_mass is not None and found.is_seen and found.determined[9]:
        declared, centre = np.asarray(known.center_of_mass, float), found.center_of_mass
        spread = np.hypot(found.center_of_mass_std, known.center_of_mass_std)
        apart = np.abs(centre - declared)
        far = np.flatnonzero(np.isfinite(spread) & (apart > CONTRADICTS * spread) & (apart > NEAR))
        if far.size:
            axes = ", ".join(
                f"{'xyz'[k]} {plus_minus(1e3 * centre[k], 2e3 * found.center_of_mass_std[k])} mm "
                f"instead of {1e3 * declared[k]:.4g} mm"
                for k in far.tolist()
            )
            text = f"The torques alone give another centre of mass than the declared one: {axes}."
            step = "Check the drawing, the frame that it is given in, and how the load is mounted."
            yield Finding("warning", "load", "other centre", text, "", step)


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
