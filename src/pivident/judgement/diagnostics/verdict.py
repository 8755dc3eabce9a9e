"""The verdict: should one believe this result, in plain words, each with its numbers.

A verdict is made of statements in a fixed order: which estimate to take; what is wrong with the
recordings, and which errors of the model are named, since both come before what they cause; what is
well determined and what is not; whether the feedback biases least squares; whether the noise model
whitens; whether the instruments are fit for use; how well unseen motion is predicted; and what the
residual is made of. Each statement is a finding with its severity and the test that it is based on.
"""

from __future__ import annotations

import shlex
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from pivident.data.logs.torque_scale import scale_headline
from pivident.estimation.identification import Identification
from pivident.estimation.parameter_rows import ParameterRange
from pivident.foundation.common_work import once
from pivident.foundation.errors import Attempts, require_kind
from pivident.foundation.text.display import Displayed
from pivident.foundation.text.finding import Finding, Severity, worst
from pivident.judgement.diagnostics.consistency_statements import consistency
from pivident.judgement.diagnostics.diagnostics import Diagnostics, diagnose_one
from pivident.judgement.diagnostics.estimate_statements import (
    choice,
    convergence,
    corrected,
    determined,
    further_warnings,
    identified_law,
    is_restated,
    open_parameters,
    signs,
    slight_terms,
    torque_scale,
    torque_side,
)
from pivident.judgement.diagnostics.instrument_statements import feedback_bias, strength
from pivident.judgement.diagnostics.model_error_statements import (
    intervals,
    log_faults,
    model_errors,
    repairs,
)
from pivident.judgement.diagnostics.prediction_statements import (
    prediction,
    simulated_loop,
    simulated_positions,
    unexplained,
    unmeasured_forces,
)
from pivident.judgement.diagnostics.residual_statements import (
    friction_law,
    model_or_noise,
    noise,
    spectral_lines,
)
from pivident.judgement.diagnostics.summary import Summary, summary_of
from pivident.judgement.diagnostics.trials import Trial
from pivident.judgement.diagnostics.uses import Answer, Use, answers, uses, with_errors
from pivident.judgement.validation.held_out.held_out_errors import HeldOutErrors

#: Most parameters that a command names; a motion for more of them is one for all.
MAX_NAMED = 12


@dataclass(frozen=True)
class Verdict(Displayed):
    """Should one believe it?

    Attributes:
        method: name of the method whose estimate to take.
        name: its short name.
        statements: in the order of the page.
        scale: in what units all parameters are, a sentence; empty where torques are known in SI.
        held_out: torque errors on held-out motion by the methods' short names.
        open: parameters that another motion would determine.
        ranges: of its parameters over held-out blocks and friction laws.
        designable: whether such a motion can be designed: not yet for closed loops and measured
            bases.
        uses: what the estimate is good for.
        trials: repairs of the log that were tried, the winners first.
        summary: the verdict on one screen.
        joints: names of the robot's joints.
    """

    method: str
    name: str
    statements: tuple[Finding, ...]
    scale: str = ""
    held_out: Mapping[str, HeldOutErrors] = field(default_factory=dict)
    open: tuple[str, ...] = ()
    designable: bool = True
    ranges: tuple[ParameterRange, ...] = ()
    uses: tuple[Use, ...] = ()
    trials: tuple[Trial, ...] = ()
    summary: Summary | None = None
    joints: tuple[str, ...] = ()

    @property
    def severity(self) -> Severity:
        """``error`` where it is not good for torque prediction; a note is no reservation."""
        if self.answer("torque") == "no":
            return "error"
        gravest = worst(self.statements)
        return "ok" if gravest == "note" else "warning" if gravest == "error" else gravest

    def answer(self, use: str) -> Answer:
        """Whether the estimate is good for a use."""
        return next((own.answer for own in self.uses if own.name == use), "care")

    @property
    def repairs(self) -> tuple[Trial, ...]:
        """Repairs that were tried and won, in the order in which they are applied."""
        return tuple(trial for trial in self.trials if trial.wins)

    @property
    def reservations(self) -> tuple[Finding, ...]:
        """Statements that are reservations."""
        return tuple(s for s in self.statements if s.severity in ("warning", "error"))

    @property
    def headline(self) -> str:
        """What the estimate is good for, and in what units where the parameters are not in SI."""
        return " ".join(filter(None, [*answers(self.uses), self.scale]))

    def next_motion(self, folder: str | Path) -> str:
        """The command that designs the motion that would determine what is open.

        Args:
            folder: of the results.

        Returns:
            The command, quoted for a shell; empty where nothing is open, or none designs it.
        """
        by_motion = any(s.topic == "motion" and s.kind != "wanted" for s in self.statements)
        if not self.designable or not (self.open or by_motion):
            return ""
        place = f"./{folder}" if str(folder).startswith("-") else str(folder)
        named = len(self.open) <= MAX_NAMED and not any("," in name for name in self.open)
        wanted = ["--for", ",".join(self.open)] if self.open and named else []
        return shlex.join(["pivident", "excite", place, *wanted])

    def __str__(self) -> str:
        return "\n".join(["Verdict: " + self.headline, *(f"  {s}" for s in self.statements)])

    def __repr__(self) -> str:
        return f"<Verdict: {self.headline}>"


def verdict(diagnostics: Diagnostics | Identification, attempts: Attempts | None = None) -> Verdict:
    """Put what was found out into words.

    Args:
        diagnostics: tests and comparisons; for a result alone the tests that need nothing else.
        attempts: what each statement is attempted by; one that fails is a statement itself.

    Returns:
        Statements in a fixed order, each with a severity and its numbers.

    Example:
        >>> robot, loop = pv.load_robot("planar_2r"), pv.Loop(pv.PD(kp=[6000, 2500], kd=[180, 60]))
        >>> recording = pv.simulate(robot, loop, duration=5.0, encoder=1e-5).recording
        >>> problem = pv.Problem(robot, (recording,), loop)
        >>> results = {"piv": pv.identify(problem, "piv")}
        >>> verdict = pv.verdict(pv.diagnose(problem, results, folds=3))
        >>> print(verdict)
        Verdict: Good for torque prediction and simulation. ...
        >>> verdict.answer("torque")
        'yes'
    """
    if isinstance(diagnostics, Identification):
        diagnostics = diagnose_one({diagnostics.method: diagnostics})
    kinds = "give an Identification, or what diagnose returns"
    require_kind("diagnostics", diagnostics, Diagnostics, kinds)
    asked = diagnostics, attempts or Attempts()
    return once(("verdict", diagnostics), lambda: _verdict(*asked))


def _verdict(diagnostics: Diagnostics, attempts: Attempts) -> Verdict:
    """The same, put into words once for files, page and terminal."""
    start = len(attempts.lines)
    name = diagnostics.recommended
    result = diagnostics.identifications[name]
    both, own, every = (diagnostics, name), (result,), (diagnostics,)
    makers: dict[Callable[..., Iterable[Finding]], tuple[Any, ...]] = {
        choice: both,
        repairs: every,
        log_faults: every,
        model_errors: every,
        corrected: own,
        torque_scale: own,
        torque_side: own,
        convergence: own,
        determined: own,
        signs: both,
        slight_terms: every,
        feedback_bias: both,
        noise: (result, diagnostics.residuals[name]),
        spectral_lines: own,
        strength: both,
        prediction: both,
        unexplained: both,
        unmeasured_forces: both,
        simulated_positions: both,
        simulated_loop: both,
        model_or_noise: every,
        intervals: both,
        friction_law: both,
        consistency: both,
        identified_law: own,
        further_warnings: own,
    }
    statements: list[Finding] = []
    for make, given in makers.items():
        about = f"Nothing is said about {make.__name__.replace('_', ' ')}"
        statements += attempts.of(about, _listed, make, *given, otherwise=())
    held_out = {
        key: attempts.of("Held-out errors are not stored", HeldOutErrors.of, one)
        for key, one in diagnostics.validations.items()
        if not one.training_only
    }
    failed = "No motion is designed for what is open"
    wanted = attempts.of(failed, open_parameters, result, otherwise=())
    judged_uses = attempts.of("Uses are not judged", uses, diagnostics, name, otherwise=())
    statements += (Finding("note", "not tested", "not tested", t) for t in diagnostics.notes)
    lines = attempts.lines[start:]
    statements += (Finding("warning", "not tested", "failed", text) for text in lines)
    judged_uses = with_errors(judged_uses, statements)
    found = Verdict(
        result.method,
        name,
        tuple(statements),
        scale_headline(result.torque_scale),
        {key: errors for key, errors in held_out.items() if errors is not None},
        wanted,
        result.robot.constraints is None and not result.robot.base_joints,
        diagnostics.ranges.get(name, ()),
        judged_uses,
        diagnostics.trials,
        joints=result.robot.joint_names,
    )
    failed = "The verdict is not summed up"
    parts = (diagnostics, name, found.headline, judged_uses, found.reservations)
    return replace(found, summary=attempts.of(failed, summary_of, *parts))


def _listed(make: Callable[..., Iterable[Finding]], *given: Any) -> list[Finding]:
    return [*make(*given)]


def beside_verdict(
    found: Verdict, findings: Mapping[str, Sequence[Finding]]
) -> list[tuple[tuple[str, ...], Finding]]:
    """What was noticed about results and is not in the verdict, once for all methods it holds for.

    Args:
        found: the verdict.
        findings: about each result, by short name of its method.

    Returns:
        Names of the methods, and the finding.
    """
    said, topics = list(found.statements), {s.topic for s in found.statements}
    taken = findings.get(found.name, ())
    kept: list[tuple[list[str], Finding]] = []
    for name, own in findings.items():
        for finding in own:
            restated = finding.topic in topics or is_restated(finding)
            if finding in said or (name == found.name and restated and finding.topic != "law"):
                continue
            if name != found.name and finding in taken:
                continue
            holders = next((names for names, other in kept if other == finding), None)
            if holders is None:
                kept.append(([name], finding))
            elif name not in holders:
                holders.append(name)
    return [(tuple(names), finding) for names, finding in kept]
