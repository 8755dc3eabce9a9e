"""What the verdict says about motion that was not fitted."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from pivident.foundation.text.finding import Finding, Quantity, Severity
from pivident.foundation.text.numbers import format_significant, percent
from pivident.judgement.validation.held_out.prediction import (
    JOINT_MISSES,
    MOSTLY,
    PredictionError,
    at_rest,
)
from pivident.robot.measured_base import BASE_JOINTS

if TYPE_CHECKING:
    from pivident.judgement.diagnostics.diagnostics import Diagnostics
    from pivident.judgement.validation.held_out.cross_validation import CrossValidation

#: A simulated loop whose torque misses more than this of the measured one explains less than three
#: quarters of its power (1 - 0.5²) and is a reservation [%].
LOOP_MISSES = 50.0

#: The same for the force or moment on a measured base, whose rows have no friction [%], …
BASE_MISSES = 10.0

#: … where noise is at most this share of the rms error.
LITTLE_NOISE = 0.2

#: Error of a joint's torque, without standstill, from which on it is used with care [%].
MISSES = 25.0

#: Share of the error's power from which on it is mostly noise.
NOISE = 0.5

#: Error in the band beyond which predicted torques are farther off than none [%].
NOTHING = 100.0

#: Ratio of the errors on held-out and on fitted motion above which it is a reservation.
WORSE = 1.5


def prediction(diagnostics: Diagnostics, name: str) -> Iterator[Finding]:
    """How well unseen motion is predicted."""
    judged = diagnostics.validations.get(name)
    if judged is None:
        misses = 100.0 * float(diagnostics.identifications[name].relative_error)
        yield Finding(
            "warning",
            "prediction",
            "nothing held out",
            "Judged only on the motion that was fitted.",
            next_step="Hold blocks out, or give a second recording.",
            evidence={"torque error": Quantity(misses, "%")},
            basis=f"torque error {percent(misses)}",
        )
        return
    error, fitted = judged.prediction, judged.training
    worst = int(np.argmax(error.relative_in_band))
    basis = (
        f"below {error.band:g} Hz {percent(error.total_in_band)} on {judged.where}, "
        f"{percent(fitted.total_in_band)} on the fitted motion"
    )
    grows = error.total_in_band / max(fitted.total_in_band, 1e-300)
    if judged.replay is not None and judged.replay.total <= LOOP_MISSES:
        basis += f"; simulated loop {percent(judged.replay.total)}"
    standing = at_rest(error)
    text = f"The torque error on {judged.motion} is {percent(error.total_in_band)}{standing}"
    severity: Severity = "ok"
    kind, step = "predicts", ""
    if grows > WORSE:
        severity, kind = "warning", "predicts worse"
        text += f", {grows:.1f} times that on the fitted motion"
        step = "Estimate fewer parameters, or record more motion."
    elif error.is_poor:
        severity, kind = "warning", "predicts poorly"
        text += f", {percent(error.model_error_in_band)} without noise and standstill"
        step = (
            "Model or log do not match the machine: check the order of the joints, lengths, units "
            "and delays (pivident audit), and the friction law (pivident laws)."
        )
    # joints at rest are held by friction that no parameters know
    if min(error.total_in_band, error.total_moving_in_band) > NOTHING:
        severity, kind = "error", "predicts nothing"
        text += ": no torque at all would be nearer"
        step = "Ask pivident check and pivident audit what is wrong with the log, or record again."
    evidence = {
        "torque error": Quantity(error.total_in_band, "%"),
        "fitted motion": Quantity(fitted.total_in_band, "%"),
    }
    if len(error.joint_names) > 1:
        largest = float(error.relative_in_band[worst])
        text += f"; the largest of a joint is {percent(largest)}, {error.joint_names[worst]}"
        text += "" if standing else at_rest(error, worst)
        evidence["largest of a joint"] = Quantity(largest, "%")
    yield Finding(severity, "prediction", kind, f"{text}.", "", step, evidence, basis)
    yield from _missed_joints(judged)


def unexplained(diagnostics: Diagnostics, name: str) -> Iterator[Finding]:
    """Joints whose held-out error is large, mostly no noise, and has no named cause."""
    judged, found = diagnostics.validations.get(name), diagnostics.model_errors
    if judged is None or any(trial.wins for trial in diagnostics.trials):
        return
    named = {one.cause.subject for one in (() if found is None else found.matter)}
    for joint, share in unexplained_joints(judged.prediction).items():
        if joint in named or share > JOINT_MISSES:  # said beside its cause, or as one missed
            continue
        text = (
            f"{percent(share)} of the torque of {joint} is unexplained: no noise, and no cause "
            "that was tried."
        )
        step = f"`pivident friction` shows it over speed, position and load of {joint}."
        evidence = {"torque error": Quantity(share, "%")}
        yield Finding("warning", "prediction", "unexplained", text, joint, step, evidence)


def unexplained_joints(e: PredictionError) -> dict[str, float]:
    """Joints whose error is large and mostly no noise, with that of motion in percent.

    Args:
        e: errors on held-out motion.
    """
    modelled = np.maximum(e.rms_in_band**2 - e.rest_in_band**2 - e.noise_in_band**2, 0.0)
    share = 100.0 * np.sqrt(modelled) / np.maximum(e.torque_in_band, 1e-300)
    is_noise = e.noise_in_band**2 > NOISE * e.rms_in_band**2
    large = np.where(is_noise, e.moving_in_band > JOINT_MISSES, share > MISSES)
    return {e.joint_names[j]: float(e.moving_in_band[j]) for j in np.flatnonzero(large)}


def unmeasured_forces(diagnostics: Diagnostics, name: str) -> Iterator[Finding]:
    """Whether the measured wrenches are all that acts on a measured base.

    Its rows contain neither friction nor drives: what they miss, and noise is not, is a force that
    no sensor measures, or one that is measured in another frame than described.
    """
    robot = diagnostics.identifications[name].robot
    judged = diagnostics.validations.get(name)
    if judged is None or not robot.base_joints:
        return
    e, base = judged.prediction, slice(0, robot.base_joints)
    share, own = e.relative_in_band[base], e.rms_in_band[base]
    missed = (share > BASE_MISSES) & (e.noise_in_band[base] < LITTLE_NOISE * own)
    if not missed.any():
        return
    listed = ", ".join(
        f"{e.joint_names[j]} {percent(share[j])} ({format_significant(own[j])} {e.units[j]} rms)"
        for j in np.flatnonzero(missed)
    )
    text = (
        f"The measured wrenches do not explain the force on the base: error on {judged.motion} "
        f"{listed}, and noise is less than {100 * LITTLE_NOISE:.0f} % of it."
    )
    step = (
        "Something touches the robot that no sensor measures (a contact, a foot, a cable), or a "
        "sensor's frame, unit or sign is another one than described. Estimates from such a record "
        "are wrong."
    )
    evidence = {
        e.joint_names[j]: Quantity(float(share[j]), "%", bound=BASE_MISSES)
        for j in np.flatnonzero(missed)
    }
    yield Finding("error", "wrenches", "unmeasured force", text, "", step, evidence)


def simulated_positions(diagnostics: Diagnostics, name: str) -> Iterator[Finding]:
    """How near a fitted simulation comes to positions that were not fitted."""
    judged = diagnostics.validations.get(name)
    found = None if judged is None else judged.simulation
    if judged is None or found is None or diagnostics.identifications[name].simulation is None:
        return
    each = list(zip(found.joint_names, found.position, found.units, strict=True))
    values = ", ".join(f"{joint} {format_significant(x)} {unit}" for joint, x, unit in each)
    text = (
        f"Rms error of the positions simulated in {found.loop} loop on {judged.motion}: {values}."
    )
    evidence = {joint: Quantity(float(x), unit) for joint, x, unit in each}
    yield Finding("ok", "simulation", "held out", text, evidence=evidence)


def _missed_joints(judged: CrossValidation) -> Iterator[Finding]:
    """Joints whose torque is hardly predicted, which a small error of all joints can hide."""
    e = judged.prediction
    for name, share, moving, noise, rms, torque, unit in zip(
        e.joint_names, e.relative_in_band, e.moving_in_band, e.noise_in_band, e.rms_in_band,
        e.torque_in_band, e.units, strict=True,
    ):  # fmt: skip
        if moving <= JOINT_MISSES:  # and so may be the whole, by standstill
            continue
        if name in BASE_JOINTS and noise > MOSTLY * rms:
            continue  # the sensor under a base may have nothing to feel along one of its axes
        text = (
            f"The torque of {name} is hardly predicted: its error on {judged.motion} is "
            f"{percent(share)}, {format_significant(rms)} of {format_significant(torque)} {unit} "
            f"rms. The {percent(e.total_in_band)} over all joints do not show it."
        )
        if noise > MOSTLY * rms:
            text += " Noise of the logged torque may account for most of that."
        evidence = {"torque error": Quantity(float(share), "%", bound=JOINT_MISSES)}
        step = "Move this joint more, look at its friction, its unit and sign, or leave it out."
        yield Finding("warning", "prediction", "joint missed", text, name, step, evidence)


def simulated_loop(diagnostics: Diagnostics, name: str) -> Iterator[Finding]:
    """Whether the loop that makes the instruments is far from the machine's, and why."""
    judged = diagnostics.validations.get(name)
    if judged is None:
        return
    diverged = [h.failure for h in judged.held_out if h.prediction is not None and h.failure]
    if diverged:
        yield Finding(
            "warning",
            "simulated loop",
            "diverged",
            f"On {len(diverged)} of {len(judged.held_out)} stretches {diverged[0].rstrip('.')}.",
        )
    if judged.replay is None or judged.replay.total <= LOOP_MISSES:
        return
    loop, direct = judged.replay.total, judged.prediction.total
    basis = (
        f"all frequencies: simulated loop {percent(loop)}, measured motion {percent(direct)}; a "
        f"reservation above {LOOP_MISSES:g} %"
    )
    evidence = {
        "simulated loop": Quantity(loop, "%", bound=LOOP_MISSES),
        "measured motion": Quantity(direct, "%"),
    }
    text = _why_it_misses(judged, loop, direct)
    yield Finding("warning", "simulated loop", "misses", text, evidence=evidence, basis=basis)


def _why_it_misses(judged: CrossValidation, loop: float, direct: float) -> str:
    """Noise in the torque, which no simulation can know, or a law that is not the machine's."""
    text = f"The torque error of the simulated loop is {percent(loop)}, "
    text += f"{'and' if direct > LOOP_MISSES else 'but'} {percent(direct)} on the measured motion: "
    if direct > LOOP_MISSES:
        return (
            f"{text}most of the measured torque is noise that the loop makes from encoder noise. "
            "Friction may be biased by more than its standard errors: move faster, measure "
            "better, or filter less."
        )
    own = judged.identification.loop
    if own is not None and own.reference == "smoothed":
        return (
            f"{text}the virtual law does not follow the motion. Raise its bandwidth, or give the "
            "machine's own law."
        )
    return (
        f"{text}gains, reference or delay of the loop do not match the machine. Correct them "
        '(N m per rad on the joint side), or let the law be identified (controller = "identify").'
    )
