"""What the verdict says about the model: which causes of error the residual shows, how large."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from pivident.foundation.text.finding import Finding, FindingKind, Quantity, Severity, Topic
from pivident.foundation.text.numbers import format_significant, percent
from pivident.foundation.text.repair import RECORDING
from pivident.foundation.text.sentences import capital, listed
from pivident.judgement.audit.delay import JOINT_EARLY, JOINT_LATE
from pivident.judgement.audit.scale import GAIN, LOAD, MEDIAN, WARNING
from pivident.judgement.diagnostics.diagnostics import Diagnostics
from pivident.judgement.diagnostics.ranges import much_wider
from pivident.judgement.model_errors.cause import Cause
from pivident.judgement.model_errors.coupling_errors import COUPLED
from pivident.judgement.model_errors.named_causes import MATTERS, ModelErrors, NamedCause
from pivident.judgement.model_errors.unchecked_causes import UncheckedCause
from pivident.robot.description import Robot

#: What to do about what changes at an instant.
APART = "Identify the parts of the record before and after it apart (`part`)."

#: What to do about causes that no size corrects.
STEPS = {
    "friction": "`pivident laws` compares friction laws on motion that was not fitted.",
    "uneven friction": "`pivident friction` shows it over the position; no law of speed has it.",
    "elasticity": "`pivident flexibility` identifies the joint; or move more slowly.",
    "backlash": "Keep the motor pressed to one side, or leave the reversals out.",
    "warming up": "Warm the robot up before the record, or identify shorter parts of it.",
    "torque ripple": "`pivident friction` shows the ripple over the position.",
    "offset drift": "Set the torque sensors to zero after warming up, or identify shorter parts.",
    "offset jump": APART,
    "load drift": "Keep the load as it is, or identify shorter parts of the record.",
    "load jump": APART,
    "spring": 'Describe it: with "spring" in the friction of the joint its ks is estimated.',
    "payload": "Identify the recordings apart, or take the load off; see `pivident payload`.",
    "missing parameter": "Estimate it, too ([identify] parameters).",
}

#: A fault of the log, or of how it is read, whose repair was tried.
REPAIRED = FindingKind(Topic("log", "Faults of the log"), "repaired", RECORDING)

#: Kind of the note on errors that the record would not show.
NOT_CHECKED = "not checked"

#: Most kinds of them, a line each; the evidence has all of a kind.
MAX_UNCHECKED = 3


#: Most ties between joints in the sentence.
MAX_TIES = 3

#: Most parameters in the sentence about ranges; the evidence has all.
MAX_RANGES = 3


def model_errors(diagnostics: Diagnostics) -> Iterator[Finding]:
    """Causes of model error: each kind once, those that change the estimate as reservations."""
    found = diagnostics.model_errors
    if found is None:
        return
    if not found.named:
        text = (
            f"None of {found.tried} causes of model error is seen in the residual: geometry, "
            "timing, gears, encoders, springs, friction, missing parameters, changes with time; "
            "and no joints are tied otherwise than described."
        )
        yield Finding("ok", "model", "no cause found", text)
    robot = diagnostics.identifications[diagnostics.recommended].robot
    for kind in dict.fromkeys(named.cause.kind for named in found.named):
        own = [named for named in found.named if named.cause.kind == kind]
        yield _coupled(found, own, robot) if kind == COUPLED else _of_kind(found, own)
    if found.unchecked:
        yield from _unchecked(found.unchecked)


def log_faults(diagnostics: Diagnostics) -> Iterator[Finding]:
    """What an audit has against the recordings; a delay that is measured below is said there.

    A torque's factor to the description is a note where the torques agree in scale with one another
    and with the description at large: then single masses of it are wrong. So is the delay of a
    single joint that the residual of the estimate rules out: the audit's own fit has an assumed law
    of friction, by which joints that stick seem late or early.
    """
    found = diagnostics.model_errors
    measured = found is not None and any(one.cause.kind == "delay" for one in found.named)
    joints = diagnostics.identifications[diagnostics.recommended].robot.joints
    agree = found is not None and {j.name for j in joints if j.motion == "driven"} <= {
        *found.checked_gains,
        *(own.cause.subject for own in found.named if own.cause.kind == "torque gain"),
    }
    for finding in diagnostics.log:
        common = (  # the factor of most joints
            finding.evidence[MEDIAN].value
            if finding.declared is LOAD or (finding.declared is GAIN and agree)
            else 0.0
        )
        in_scale = 1.0 / WARNING < common < WARNING
        is_refuted = (
            found is not None
            and finding.declared in (JOINT_LATE, JOINT_EARLY)
            and abs(finding.evidence["delay"].value) > found.timely.get(finding.subject, np.inf)
        )
        if (in_scale or is_refuted) and finding.severity != "note" and not finding.repairs:
            finding = replace(
                finding, severity="note", next_step="",
                message=f"{finding.message} "
                + ("Torques agree in scale: the estimate replaces masses." if in_scale
                   else "What the estimate leaves rules that out."),
            )  # fmt: skip
        if not (measured and finding.topic == "delay"):
            yield finding


def repairs(diagnostics: Diagnostics) -> Iterator[Finding]:
    """Repairs that were tried and won, each upon those before it."""
    for trial in diagnostics.trials:
        if not trial.wins or trial.repair is None:
            continue
        text = f"{trial.cause} Tried: {trial.effect}."
        if trial.alike:
            text += f" As well explained by: {' Or: '.join(trial.alike)}"
        evidence = {
            "as logged": Quantity(trial.before, "%"),
            "repaired": Quantity(trial.after, "%"),
        }
        yield REPAIRED.finding("error", text, evidence=evidence, repairs=[trial.repair])


def _of_kind(found: ModelErrors, named: Sequence[NamedCause]) -> Finding:
    """The causes of one kind."""
    first = named[0]
    sizes = listed([one.text for one in named], 3)
    text = f"{capital(first.cause.kind)}: {sizes}"
    if first.cause.kind == "friction":
        whose = listed(list(dict.fromkeys(one.cause.subject for one in named)), 3)
        text = f"Friction has another law than assumed: {whose}. Its residual has {sizes}"
    most, matters = max(named, key=lambda one: one.shift), any(one.matters for one in named)
    text += (
        f". Corrected, it changes {most.parameter} by "
        f"{format_significant(most.shift, 2)} standard errors"
        if matters
        else ". Corrected, it changes no parameter by two standard errors"
    )
    others = [str(other) for one in named for other in one.alternatives]
    if others:
        text += f". The record cannot tell it from {listed(others, 2)}"
    score, (size, std) = first.score, first.size
    evidence = {
        "size": Quantity(size, first.cause.unit, interval=(size - 2.0 * std, size + 2.0 * std)),
        "change": Quantity(most.shift, "σ"),
        "explained": Quantity(100.0 * score.explained, "%"),
    }
    basis = _basis(found, first)
    step = STEPS.get(first.cause.kind, "")
    if not step and matters:
        step = (
            f"`pivident identify --free {first.cause.kind.replace(' ', '-')}` estimates it with "
            "the parameters; or correct the description or the log."
        )
    severity: Severity = "warning" if matters else "note"
    return Finding(
        severity, "model", first.cause.kind, f"{text}.", first.cause.subject, step, evidence, basis
    )


def _coupled(found: ModelErrors, named: Sequence[NamedCause], robot: Robot) -> Finding:
    """Joints that are tied to one another otherwise than described."""
    first, most = named[0], max(named, key=lambda one: one.shift)
    torques = 100.0 * np.sqrt(sum(one.torques**2 for one in named))
    joint = int(np.argmax(torques))
    ties = [_tie(one.cause, one.size_text if one.cause.unit else "") for one in named]
    text = (
        f"Joints are tied otherwise than described: {_ties(ties)}. That is "
        f"{percent(torques[joint])} of the torque of {robot.joint_names[joint]}"
    )
    alike = [_tie(c) for one in named for c in one.alternatives if c.kind == COUPLED]
    if alike:
        text += f", and the record cannot tell it from {_ties(alike)}"
    text += ". A loop, a gear or a motor ties them, or one hangs on another link than described"
    if most.shift > MATTERS:
        text += (
            f". Parameters may be off by more than their intervals: with these torques "
            f"{most.parameter} changes by {format_significant(most.shift, 2)} standard errors"
        )
    if any(one.cause.kind != COUPLED for one in found.named):
        text += ". Other causes that are named may be part of it"
    step = "Check the loops and gears: lengths, which links they join, links that they leave out."
    if robot.constraints is None:
        step = (
            "Describe the loop ([[loops]]) or what couples them ([[gears]], couplings); check each "
            "`parent`, whether the log counts an angle from the parent or from the base, and "
            "whether torques were converted with the positions."
        )
    evidence = {
        "torque": Quantity(float(torques[joint]), "%"),
        "change": Quantity(most.shift, "σ"),
        "explained": Quantity(100.0 * first.score.explained, "%"),
    }
    basis = _basis(found, first)
    return Finding("warning", "model", COUPLED, f"{text}.", "", step, evidence, basis)


def _tie(cause: Cause, size: str = "") -> str:
    """``left, right (inertia and weight that belong to all of them)``."""
    return f"{cause.subject} ({cause.what}{': ' * bool(size)}{size})"


def _ties(said: Sequence[str]) -> str:
    """The first ones, and how many more there are."""
    more = len(said) - MAX_TIES
    return "; ".join([*said[:MAX_TIES], f"{more} more"] if more > 0 else said)


def _basis(found: ModelErrors, one: NamedCause) -> str:
    """What a cause explains, and how significant it is."""
    score = one.score
    return (
        f"explains {percent(100.0 * score.explained)} of the residual in the motion's band, "
        f"{percent(100.0 * score.unseen)} where it was not fitted; significance "
        f"{score.significance * found.tried:.1g} among {found.tried} causes"
    )


def _unchecked(errors: Sequence[UncheckedCause]) -> Iterator[Finding]:
    """Errors that would not be seen: the gravest of each kind, a line each."""
    # causes of equal effect are one error in two words: a zero position, the angle of the base
    apart = {(one.parameter, f"{one.shift:.2g}"): one for one in reversed(errors)}
    gravest = {one.cause.kind: one for one in apart.values()}
    chosen = sorted(gravest.values(), key=lambda one: -one.shift)[:MAX_UNCHECKED]
    for one in chosen:
        change = f"{format_significant(one.shift, 2)} σ"
        if one.relative < 100.0:
            change = f"{percent(one.relative)}, {change}"
        text = (
            f"The record does not check {_thing(one.cause)}: {one.size:g} {one.cause.unit} would "
            f"change {one.parameter} by {change} ({_shown_from(one)})."
        )
        last = one is chosen[-1]
        step = "Check them on the machine, in its drawing and in the logger." if last else ""
        evidence = {
            str(own.cause): Quantity(own.size, own.cause.unit, bound=own.shown_from)
            for own in errors
            if own.cause.kind == one.cause.kind
        }
        yield Finding("note", "model", NOT_CHECKED, text, one.cause.subject, step, evidence)


def _shown_from(one: UncheckedCause) -> str:
    """From which size on the record would show it."""
    if np.isinf(one.shown_from):
        return "not shown at all"
    return f"shown from {format_significant(one.shown_from, 2)} {one.cause.unit} on"


def _thing(cause: Cause) -> str:
    """``the length along x from axis_2 to axis_3``, ``the zero position of axis_3``."""
    if cause.kind == "delay":
        return (
            f"the delay of {f'the torque of {cause.subject}' if cause.subject else 'all torques'}"
        )
    what = cause.what.removeprefix("correction of ")
    if cause.kind in ("torque gain", "gear ratio", "clock"):
        what = what.replace("excess of", "the scale of")
    what = what if what.startswith("the ") else f"the {what}"
    return (
        what if not cause.subject or what.endswith(cause.subject) else f"{what} of {cause.subject}"
    )


def intervals(diagnostics: Diagnostics, name: str) -> Iterator[Finding]:
    """Parameters that vary over motion or friction laws by much more than their interval says."""
    wide = much_wider(diagnostics.identifications[name], diagnostics.ranges.get(name, ()))
    if not wide:
        return
    said = [
        f"{own.name} {format_significant(ratio, 2)} times (over {own.by})" for ratio, own in wide
    ]
    text = (
        "Intervals describe noise; over the motion or friction laws some estimates vary by much "
        f"more: {listed(said, MAX_RANGES)}."
    )
    evidence = {own.name: Quantity(ratio) for ratio, own in wide}
    basis = "width of the range over that of the interval of ±2σ"
    yield Finding("note", "intervals", "range", text, evidence=evidence, basis=basis)
