"""The audit of a log: every check that what is known of it allows, in one order."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pivident.data.logs.log import Log
from pivident.foundation.errors import PividentError, RecordingError
from pivident.foundation.text.display import Displayed
from pivident.foundation.text.finding import Finding, FindingKind, Severity, Topic, worst
from pivident.foundation.text.plain_values import plain
from pivident.foundation.text.sentences import listed
from pivident.foundation.threads import linear_algebra_in_one_thread
from pivident.foundation.version import __version__
from pivident.judgement.audit.delay import DELAY, Delay
from pivident.judgement.audit.examination import Examination, in_turn
from pivident.judgement.audit.excitation import EXCITATION, UNEXPLAINED_TORQUE, Excitation
from pivident.judgement.audit.gravity import NO_GRAVITY
from pivident.judgement.audit.inverse_model import InverseModel, build_inverse_model
from pivident.judgement.audit.log_checks import CHECKS
from pivident.judgement.audit.order import ORDER, Order
from pivident.judgement.audit.power import SIGNS, Power, mechanical_power
from pivident.judgement.audit.quantisation import (
    CHANNELS,
    QUANTISATION,
    Quantisation,
    check_quantisation,
)
from pivident.judgement.audit.saturation import check_channels
from pivident.judgement.audit.scale import SCALE, Scale, check_assumed, check_positions, check_reach
from pivident.judgement.audit.speed import DERIVATIVE, check_speeds
from pivident.judgement.audit.standstill import check_standstill
from pivident.judgement.audit.steps import CLOCK
from pivident.judgement.audit.timing import Timing, check_timing

#: What was read.
READING = Topic("reading", "What was read")

COLUMNS = FindingKind(READING, "columns")
NO_POSITIONS = FindingKind(READING, "no positions")
NO_TORQUE = FindingKind(READING, "no torque")
NOT_JUDGED = FindingKind(READING, "not judged")

#: Version of the layout of ``audit.json``.
SCHEMA = 2

#: What is left out where a log has positions only.
_NO_TORQUE = NO_TORQUE.finding(
    "note",
    "No torque was logged, or none is named: order, delay, signs, gains and excitation were not "
    "judged.",
    next_step="Name the columns of the torque (--experiment); where there is none, the known "
    "control law under [controller] stands for it.",
)


#: What an audit looks at, in the order of its page.
TOPICS = (
    READING,
    CLOCK,
    CHANNELS,
    QUANTISATION,
    DERIVATIVE.topic,
    SCALE,
    ORDER.topic,
    DELAY,
    NO_GRAVITY.topic,
    SIGNS,
    UNEXPLAINED_TORQUE.topic,
    EXCITATION,
)


@dataclass(frozen=True, eq=False)
class Audit(Displayed):
    """What was found about one log, with the numbers behind it.

    Attributes:
        log: the log.
        findings: everything that was found, check by check.
        timing: the clock.
        quantisation: grids of the values.
        model: rows of the inverse model after the faults found were made good, or None.
        order: which torque fits which joint, or None.
        delay: between torque and position, or None.
        power: signs, or None.
        scale: gains, or None.
        excitation: rank and condition, or None.
    """

    log: Log
    findings: tuple[Finding, ...]
    timing: Timing
    quantisation: Quantisation
    model: InverseModel | None = None
    order: Order | None = None
    delay: Delay | None = None
    power: Power | None = None
    scale: Scale | None = None
    excitation: Excitation | None = None

    @property
    def severity(self) -> Severity:
        """The gravest of the findings."""
        return worst(self.findings)

    def count(self, severity: Severity) -> int:
        """Number of findings of one severity."""
        return sum(finding.severity == severity for finding in self.findings)

    @property
    def topics(self) -> tuple[Topic, ...]:
        """What was looked at: its own topics, then those of other distributions."""
        kinds = [finding.declared for finding in self.findings]
        others = (kind.topic for kind in kinds if kind is not None and kind.topic.heading)
        return tuple(dict.fromkeys((*TOPICS, *others)))

    def of(self, check: str) -> tuple[Finding, ...]:
        """Findings of one check, such as ``delay``."""
        return tuple(finding for finding in self.findings if finding.topic == check)

    def as_json(self) -> dict[str, Any]:
        """Everything as plain values."""
        log, delay, excitation = self.log, self.delay, self.excitation
        content = {
            "name": log.name,
            "samples": log.samples,
            "rate_hz": self.timing.rate,
            "joints": log.joint_names,
            "robot": log.robot.name if log.robot else None,
            "sources": [{"name": s.name, "sha256": s.sha256} for s in log.sources],
            "severity": self.severity,
            "findings": self.findings,
            "grids": [
                {"signal": g.name, "step": g.step, "digits": g.digits}
                for g in self.quantisation.grids
            ],
            "delay": None
            if delay is None
            else {
                "common_s": delay.common[0],
                "common_std_s": delay.common[1],
                "joints_s": delay.estimates,
                "joints_std_s": delay.standard_errors,
            },
            "gain": None if self.scale is None else self.scale.factors,
            "relative_errors": None if self.model is None else self.model.relative_errors,
            "friction_power_w": None if self.power is None else self.power.friction,
            "excitation": None
            if excitation is None
            else {
                "parameters": excitation.names,
                "rank": excitation.rank,
                "condition": excitation.condition,
                "open_torque": excitation.open_torque,
                "used": excitation.used,
            },
        }
        return plain(content)


def audits_json(audits: Sequence[Audit]) -> dict[str, Any]:
    """Content of ``audit.json``: the audits as plain values, with the gravest severity."""
    return {
        "schema": SCHEMA,
        "pivident": __version__,
        "severity": worst(f for audit in audits for f in audit.findings),
        "audits": [audit.as_json() for audit in audits],
    }


def audit_log(log: Log, progress: Callable[[str], None] | None = None) -> Audit:
    """Carry out every check that a log allows.

    Args:
        log: the log.
        progress: called with one line at each stage.

    Returns:
        The findings, with the clock and the resolution of every channel.
    """
    with linear_algebra_in_one_thread():
        return _audit(log, progress or (lambda line: None))


def _audit(log: Log, say: Callable[[str], None]) -> Audit:
    """Every check in its order."""
    say("looking at clock and channels")
    timing = check_timing(log)
    quantisation = check_quantisation(log, timing)
    findings = [COLUMNS.finding("ok", note) for note in log.notes]
    findings += check_assumed(log)
    findings += [*timing.findings, *check_channels(log), *quantisation.findings]
    findings += check_speeds(log, timing)
    if "q" in log.channels and "tau" not in log.channels:
        findings += [*check_standstill(log), *check_reach(log, timing), _NO_TORQUE]
        return Audit(log, tuple(findings), timing, quantisation)
    if "q" not in log.channels:
        findings.append(_no_positions(log))
        return Audit(log, tuple(findings), timing, quantisation)
    still = check_standstill(log)
    findings += still
    if log.robot is None:
        findings += mechanical_power(log)
        findings.append(_not_judged("no robot is given"))
        return Audit(log, tuple(findings), timing, quantisation)
    if still:
        findings.append(_not_judged(f"{still[0].subject} stands still"))
        return Audit(log, tuple(findings), timing, quantisation)
    say("comparing torque and motion")
    try:
        model: InverseModel | None = _inverse_model(log, timing)
    except (PividentError, np.linalg.LinAlgError) as error:
        findings += check_reach(log, timing)
        findings.append(_not_judged(str(error)))
        return Audit(log, tuple(findings), timing, quantisation)
    assert model is not None
    positions, model = check_positions(log, timing, model)
    findings += positions
    if model is None:
        findings.append(_not_judged("the positions are not those of this robot"))
        return Audit(log, tuple(findings), timing, quantisation)
    return _with_model(log, model, findings, timing, quantisation, say)


def _with_model(
    log: Log,
    model: InverseModel,
    findings: list[Finding],
    timing: Timing,
    quantisation: Quantisation,
    say: Callable[[str], None],
) -> Audit:
    """The checks that need the inverse model."""
    say("looking at delay, signs, gains and excitation")
    seen = in_turn(Examination(log, timing, model, tuple(findings)), CHECKS.usable().values())
    measured = seen.results
    return Audit(
        log,
        seen.findings,
        timing,
        quantisation,
        seen.model,
        measured.get("order"),
        measured.get("delay"),
        measured.get("power"),
        measured.get("scale"),
        measured.get("excitation"),
    )


def _inverse_model(log: Log, timing: Timing) -> InverseModel:
    """Rows τ = Φ θ of a log whose clock is known."""
    if not timing.rate:
        raise RecordingError("the sampling rate is not known")
    return build_inverse_model(log, timing)


def _no_positions(log: Log) -> Finding:
    """That nothing but the clock could be judged, and which columns there are."""
    names = listed(list(log.columns), 12) if log.columns else "none"
    return NO_POSITIONS.finding(
        "error",
        f"{log.name} has no positions, or none that their names show: delay, signs, gains and "
        f"excitation were not judged. Its columns: {names}.",
        next_step="Log the positions of the joints, rename their columns (q_1 …), or name them in "
        "an experiment file (--experiment).",
    )


def _not_judged(reason: str) -> Finding:
    """What could not be said, and why."""
    text = f"Delay, signs, gains and excitation were not judged: {reason}."
    step = "Give the robot (--robot) and the columns (--experiment)."
    step = "" if reason.endswith("still") else step
    return NOT_JUDGED.finding("ok", text, "", step)
