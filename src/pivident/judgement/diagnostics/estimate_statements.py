"""What the verdict says about the estimate: which to take, whether it converged, what is known.

Of a parameter that is not known it says how much torque it can make at most, and which motion would
determine it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from pivident.data.logs.torque_scale import marked_scales, scale_sentences
from pivident.dynamics.signs import NegativeParameter, negative_parameters
from pivident.estimation.identification import Identification
from pivident.estimation.parameter_rows import ParameterRow, parameter_rows
from pivident.foundation.text.finding import Finding, Quantity, Severity
from pivident.foundation.text.numbers import format_significant, percent
from pivident.foundation.text.sentences import capital, listed
from pivident.judgement.diagnostics.diagnostics import Diagnostics
from pivident.judgement.diagnostics.slight_terms import SLIGHT, torque_shares, zero_and_slight
from pivident.loop.motion.wanted_motion import SENTENCES, FullMotion, MotionLimits, motions_for
from pivident.robot.description import Robot

#: A parameter whose 2σ is below this share of its value is well determined [%].
WELL = 10.0
#: Most warnings about an identified law that are reported one by one.
MAX_OF_LAW = 3
#: Topics of an estimator's warnings that have a statement of their own in the verdict.
RESTATED = (
    "iteration", "exogeneity", "torque scale", "instruments", "torque side", "correction",
    "intervals",
)  # fmt: skip
#: The same for single negative parameters; reversed signs are said by the estimator alone.
NEGATIVE = ("signs", "negative")


def choice(diagnostics: Diagnostics, name: str) -> Iterator[Finding]:
    """Which method to use for this record and why."""
    result, compared = diagnostics.identifications[name], diagnostics.out_of_sample
    if compared is None:
        why = (
            "it is the only one here"
            if len(diagnostics.identifications) == 1
            else "it is the last one that converged; no motion was held out to compare them"
        )
        yield Finding("note", "estimate", "chosen", f"Take that of {result.method}: {why}.")
        return
    contradicted = compared.undecided and compared.apart
    errors = ", ".join(
        f"{r.method} {percent(r.prediction.total_in_band)}" for r in compared.results.values()
    )
    yield Finding(
        "warning" if contradicted else "note" if compared.piv_is_worse else "ok",
        "estimate",
        "compared",
        " ".join(compared.advice()),
        evidence={
            r.method: Quantity(r.prediction.total_in_band, "%") for r in compared.results.values()
        },
        basis=" ".join([f"torque error on {compared.motion}: {errors}.", *compared.ratio_lines()]),
    )


def convergence(result: Identification) -> Iterator[Finding]:
    """Whether the iteration came to an end; a single solution has nothing to say."""
    if result.iterations < 2:
        return
    evidence = {"last change": Quantity(100.0 * result.history[-1].change, "%")}
    severity: Severity
    last = f"last change {percent(100.0 * result.history[-1].change)}"
    if result.converged:
        text = f"It converged in {result.iterations} iterations."
        severity, kind = "ok", "converged"
    else:
        text = (
            f"It did not converge in {result.iterations} iterations; this is not an estimate yet."
        )
        severity, kind = "error", "not converged"
    yield Finding(severity, "iteration", kind, text, evidence=evidence, basis=last)


def wanted_motions(identification: Identification, names: tuple[str, ...]) -> tuple[str, ...]:
    """Motions that would determine some parameters, one sentence for each kind of motion."""
    if not names or not identification.recordings:
        return ()
    robot, records = identification.robot, identification.recordings
    motion = (np.vstack([getattr(r, name) for r in records]) for name in ("q", "dq", "ddq"))
    limits = MotionLimits.of(robot, *motion)
    heads = [identification.parameters[identification.names.index(name)] for name in names]
    wanted = motions_for(heads, FullMotion.within(robot, limits), limits)
    groups: dict[int, tuple[list[str], set[str]]] = {}
    for name, motion_of_one in zip(names, wanted, strict=True):
        members, moved = groups.setdefault(motion_of_one.kind, ([], set()))
        members.append(name)
        moved.update(motion_of_one.joints)

    def in_order(joints: set[str]) -> str:
        return ", ".join(name for name in robot.joint_names if name in joints)

    return tuple(
        f"For {', '.join(members)}: {SENTENCES[kind].format(joints=in_order(moved))}."
        for kind, (members, moved) in sorted(groups.items())
    )


def determined(result: Identification) -> Iterator[Finding]:
    """What is well determined, what is not, and which motion would determine it."""
    rows = parameter_rows(result)
    well = [r for r in rows if is_known(r)]
    zero, slight = zero_and_slight(result, rows)
    held = tuple(r.name for r in rows if math.isnan(r.std))
    middle = tuple(r.name for r in rows if not (is_known(r) or r.includes_zero or r.name in held))
    estimated = [r for r in rows if r.name not in held] or list(rows)
    best = min(estimated, key=lambda r: r.relative_std)
    worst = max(estimated, key=lambda r: r.relative_std)
    evidence = {
        "well known": Quantity(len(well)),
        "parameters": Quantity(len(rows)),
        "condition number": Quantity(result.condition),
    }
    basis = (
        f"2σ from {percent(2 * best.relative_std)} ({best.name}) to "
        f"{percent(2 * worst.relative_std)} ({worst.name}); condition number "
        f"{format_significant(result.condition)}"
    )
    known = f"{len(rows)} parameters are known to {WELL:g} % or better (2σ)"
    if not (zero or slight or middle or held):
        text = f"All {known}."
        yield Finding("ok", "parameters", "known", text, evidence=evidence, basis=basis)
        return
    parts = [f"{len(well)} of {known}"]
    if middle:
        parts.append(f"less well known: {listed(middle)}")
    if zero:
        parts.append(f"not significantly different from zero: {listed(zero)}")
    if slight:
        parts.append(
            f"of no consequence (zero within 2σ, less than {100 * SLIGHT:g} % of any joint's "
            f"torque): {listed(slight)}"
        )
    if held:
        parts.append(f"not determined, held where they were: {listed(held)}")
    text = "; ".join(parts) + "."
    yield Finding("note", "parameters", "partly known", text, evidence=evidence, basis=basis)
    for sentence in wanted_motions(result, open_parameters(result)):
        yield Finding("note", "motion", "wanted", sentence)


def is_known(row: ParameterRow) -> bool:
    """Whether a parameter is well determined."""
    return 2.0 * row.relative_std <= WELL


def open_parameters(result: Identification) -> tuple[str, ...]:
    """Parameters that another motion would determine: those that may be zero, or are not known.

    The torque of an offset is the same in every motion. Motion that tells it from gravity or from
    friction is asked for by their parameters, where they are not known.

    Args:
        result: the estimate.
    """
    rows = parameter_rows(result)
    zero, slight = zero_and_slight(result, rows)
    offsets = {p.name for p in result.parameters if p.stem == "off"}
    told = [r for r in rows if r.name not in offsets.union(slight)]
    return tuple(r.name for r in told if r.name in zero) or tuple(
        r.name for r in told if not is_known(r)
    )


def corrected(result: Identification) -> Iterator[Finding]:
    """What was corrected with the estimate, each with its interval."""
    yield from (w for w in result.warnings if w.topic == "correction")


def torque_scale(result: Identification) -> Iterator[Finding]:
    """Where the scale of the torque is an assumption, so are all parameters."""
    for sentence in scale_sentences(marked_scales(result.torque_scale)):
        yield Finding("warning", "torque scale", "assumed", sentence)


def torque_side(result: Identification) -> Iterator[Finding]:
    """What torques behind the gears leave out of the model, and which friction stays in it."""
    yield from (w for w in result.warnings if w.topic == "torque side")


def slight_terms(diagnostics: Diagnostics) -> Iterator[Finding]:
    """What leaving out the terms of no consequence did."""
    trial = diagnostics.left_out
    if trial is None:
        return
    before, after = percent(trial.before), percent(trial.after)
    make = "makes" if len(trial.names) == 1 else "make"
    names = f"{listed(trial.names)} {make} less than {100 * SLIGHT:g} % of any joint's torque"
    evidence = {"with them": Quantity(trial.before, "%"), "without": Quantity(trial.after, "%")}
    if trial.is_needed:
        text = f"{names}, but without that the error in motion is {after} instead of {before}."
        yield Finding("note", "parameters", "needed", text, evidence=evidence)
        return
    change = f"stays {after}" if before == after else f"is {after} instead of {before}"
    text = f"{names}; left out on trial, the error in motion {change}."
    yield Finding(
        "note", "parameters", "left out", text, "",
        "To leave them out, list the others as parameters = [...] under [identify].", evidence,
    )  # fmt: skip


def signs(diagnostics: Diagnostics, name: str) -> Iterator[Finding]:
    """Friction and rotor inertias cannot be negative; of no consequence without torque."""
    result = diagnostics.identifications[name]
    negative = negative_parameters(result.parameters, result.names, result.theta, result.std)
    if not negative:
        return
    evidence = {p.name: p.quantity for p in negative}
    if certain := [p for p in negative if p.is_certain]:
        text = (
            f"{capital(' and '.join(_negative(result.robot, certain)))} came out negative, which "
            "cannot be."
        )
        basis, step = "; ".join(map(str, negative)), ""
        severity: Severity = "warning"
        if (torque_shares(result, [p.name for p in certain]) < SLIGHT).all():
            severity = "note"
            text += f" They make less than {100 * SLIGHT:g} % of any joint's torque."
        elif diagnostics.nearest is not None and not diagnostics.nearest.is_far:
            step = "The exported model has none."
        yield Finding(severity, "physics", "negative", text, "", step, evidence, basis=basis)
    else:
        values = listed([str(p) for p in negative])
        text = f"Negative, but not significantly different from zero: {values} (2σ)."
        yield Finding("note", "physics", "negative within 2σ", text, evidence=evidence)


def _negative(robot: Robot, negative: Sequence[NegativeParameter]) -> Iterator[str]:
    """What is negative, with joints and names of parameters: rotor inertia of elbow (ia3)."""
    names = dict(zip(robot.places, robot.joint_names, strict=True))
    for what in ("friction", "rotor inertia"):
        own = [
            f"{names.get(p.parameter.joint, p.parameter.joint)} ({p.name})"
            for p in negative
            if (p.parameter.friction is None) == (what == "rotor inertia")
        ]
        if own:
            yield f"{what} of {listed(own, 3)}"


def identified_law(result: Identification) -> list[Finding]:
    """What was found in the control law beside its gains; no reservation."""
    found = None if result.loop is None else result.loop.identified
    notes = () if found is None else found.notes
    return [Finding("note", "law", "found", text) for text in notes]


def is_restated(warning: Finding) -> bool:
    """Whether a statement of the verdict says what an estimator's warning says."""
    return warning.topic in RESTATED or (warning.topic, warning.kind) == NEGATIVE


def further_warnings(result: Identification) -> Iterator[Finding]:
    """The estimator's warnings that no statement above repeats; many of one law are one."""
    further = [
        w
        for w in result.warnings
        if not is_restated(w) and (w.severity != "note" or w.topic == "motion")
    ]
    many = [*_many(further, "uncertain"), *_many(further, "wrong gain")]
    yield from (w for w in further if w not in many)
    if of_law := _many(further, "uncertain"):
        text = (
            f"The control law found from the record has {len(of_law)} uncertainties (all of them "
            "in the summary of the report), and the instruments depend on it. The first: "
            f"{of_law[0].message}"
        )
        step = 'Give the law where it is known, or compare with instruments = "response".'
        yield Finding("note", "law", "uncertain", text, next_step=step)
    if wrong := _many(further, "wrong gain"):
        text = (
            f"The simulation error contradicts {len(wrong)} declared gains, "
            f"{listed([w.subject for w in wrong])} (all of them in the summary of the report). The "
            f"first: {wrong[0].message}"
        )
        yield Finding("warning", "law", "wrong gain", text, next_step=wrong[0].next_step)


def _many(warnings: Sequence[Finding], kind: str) -> list[Finding]:
    """Warnings of one kind about the law, where they are too many to report one by one."""
    own = [w for w in warnings if (w.topic, w.kind) == ("law", kind)]
    return own if len(own) > MAX_OF_LAW else []
