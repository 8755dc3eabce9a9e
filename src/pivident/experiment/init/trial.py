"""Whether a draft runs: its records are read, its law is looked for, its methods begin.

How dry friction reaches its full level: as the default arctangent, or as tanh.

Where nobody has said otherwise Coulomb friction passes through zero as (2/π) atan(γ dq), with a γ
from the rated speed. Its slow approach to the full level, of which 8 % are missing at a hundredth
of the rated speed, lends viscous friction some of it: where the real level is reached at once, both
come out wrong by far more than their standard errors. tanh(γ dq) is complete there. Both laws have
the same unknowns, so that the one is taken whose least squares leave less, on the same rows.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from pivident.data.logs.recognition.channel_words import Sureness
from pivident.data.recording.checks import TIMING_WORDS
from pivident.data.recording.recording import Recording
from pivident.estimation.identification import Identification
from pivident.estimation.identify import identify
from pivident.estimation.method import Method
from pivident.estimation.problem import Problem
from pivident.experiment.experiment import Experiment
from pivident.experiment.explained import validated
from pivident.experiment.init.assumption import Assumption
from pivident.experiment.missing_torque import is_without_torque
from pivident.experiment.recording_tables import log_of
from pivident.foundation.errors import (
    ConstantChannel,
    GapInClock,
    IdentificationError,
    IrregularSampling,
    MissingSamples,
    PividentError,
    SaturatedSignal,
)
from pivident.foundation.errors.recordings import written
from pivident.foundation.text.numbers import plus_minus
from pivident.foundation.text.repair import Edit, Repair
from pivident.foundation.text.sentences import half_sentence
from pivident.foundation.text.toml import parse_toml
from pivident.judgement.audit.audit import audit_log
from pivident.judgement.audit.delay import LOOP_RATE, TIMING, possible_loops, undeclared_timing
from pivident.judgement.audit.saturation import ACCEPT_CONSTANT, ACCEPT_CUT_OFF
from pivident.judgement.audit.timing import INTERPOLATED, only
from pivident.judgement.validation.held_out.folds import division_of
from pivident.loop.instruments.kinds import KINDS
from pivident.robot.description import Robot
from pivident.robot.friction import FrictionLaw, law_toml

#: Consecutive parts of each recording, whose gains tell the standard error of their sum.
PARTS = 20


@dataclass(frozen=True, eq=False)
class CompleteSign:
    """Least squares with tanh for the sign of dry friction, which leave less.

    Attributes:
        law: of every joint.
        problem: with that law.
        identification: its least squares.
        gains: shares by which the joints' squares fall, shape (joints,).
        deviations: their standard errors, likewise.
    """

    law: FrictionLaw
    problem: Problem
    identification: Identification
    gains: np.ndarray
    deviations: np.ndarray

    def __str__(self) -> str:
        names = self.problem.robot.joint_names
        own = ", ".join(
            f"{name} {plus_minus(100.0 * gain, 200.0 * deviation)} %"
            for name, gain, deviation in zip(names, self.gains, self.deviations, strict=True)
        )
        return (
            "dry friction that is complete at a hundredth of the rated speed (tanh) fits better "
            f"than the arctangent: the mean square error of least squares falls by {own} (± 2σ)"
        )


def complete_sign(
    problem: Problem,
    method: Method,
    smooth: Identification,
    progress: Callable[[str], None] | None = None,
) -> CompleteSign | None:
    """Least squares with tanh for the sign, where they leave less than with the arctangent.

    Joints count by how clear their gains are.

    Args:
        problem: with the default law on every joint.
        method: least squares.
        smooth: its result with that law.
        progress: called with one line at each stage.

    Returns:
        The better law, or None where the arctangent fits better, somebody gave another law, or the
        motion does not separate the parameters of the other one.
    """
    law = _complete_law(problem.robot)
    if law is None:
        return None
    other = replace(problem, robot=problem.robot.with_friction(law))
    try:
        found = identify(other, method, progress)
    except IdentificationError:
        return None
    before, after = _squares(smooth), _squares(found)
    shares = (before - after) / np.maximum(before.sum(axis=0), 1e-300)
    deviations = np.maximum(np.sqrt(len(shares) * shares.var(axis=0, ddof=1)), 1e-12)
    gains = shares.sum(axis=0)
    if np.sum(gains / deviations) <= 0.0:
        return None
    return CompleteSign(law, other, found, gains, deviations)


def _complete_law(robot: Robot) -> FrictionLaw | None:
    """The joints' law with tanh for the sign; None where somebody gave one, or they differ."""
    (law, *others) = {str(joint.friction): joint.friction for joint in robot.joints}.values()
    signs = [(joint, t) for joint in robot.joints for t in joint.friction.terms if t.has_sign]
    given = any(t.smoothing != "atan" or t.gamma != joint.default_gamma for joint, t in signs)
    if others or given or not signs:
        return None
    return FrictionLaw(
        tuple(
            replace(term, smoothing="tanh", gamma=None) if term.has_sign else term
            for term in law.terms
        )
    )


def _squares(found: Identification) -> np.ndarray:
    """Σ (τ - Φθ)² of each part of each recording, shape (parts, joints).

    Of all samples: laws differ most at speeds that are too slow to be fitted, where they are used
    all the same; at rest they do not.
    """
    assert found.equations is not None
    parts = []
    for record in found.equations.records:
        left = record.residual(found.equations.regressor, found.theta) ** 2
        parts += [own.sum(axis=1) for own in np.array_split(left, PARTS, axis=1)]
    return np.array(parts)


#: Longest record on which methods are tried [samples times joints]; longer ones are tried in part.
MAX_TRIAL = 150_000

#: Standard error of a delay [samples] from which on it does not tell what a torque is nearest to.
KNOWN = 0.15

#: Rate below which a log is slower than any loop that holds the torques of an arm [Hz].
SLOWEST_LOOP = 100.0


@dataclass(frozen=True)
class Findings:
    """What trials have shown so far."""

    recording: tuple[Assumption, ...] = ()  # lines of ``[recording]`` that became necessary
    timed: bool = False  # whether it was asked to which instant a torque belongs
    friction: tuple[Assumption, ...] | None = None  # its line, if any; None: not looked for yet
    law_failed: str = ""  # why no law could be identified, or empty
    law_found: str = ""  # what the identified law is like, or empty
    instruments: str = ""  # what the instruments are made of, where no loop is simulated
    failed: dict[str, str] = field(default_factory=dict)  # why, by method
    notes: tuple[str, ...] = ()  # what was left out of the recordings, in sentences
    troubles: tuple[str, ...] = ()  # what a person has to do before it runs
    explained: dict[str, float] = field(default_factory=dict)  # relative error by joint
    folds: int | None = None  # blocks that can be held out, where those of a long record cannot
    settled: bool = False  # whether nothing more is to be tried


def try_out(text: str, out: Path, known: Findings, say: Callable[[str], None]) -> Findings:
    """Go as far with a draft as a first iteration of its methods."""
    experiment = Experiment(out, validated(parse_toml(text)))
    try:
        recordings = experiment.recordings()
    except PividentError as error:
        line = _remedy(error)
        if line is None or any(line.key == other.key for other in known.recording):
            return _stuck(known, error)
        return replace(known, recording=(*known.recording, line))
    if not known.timed:  # before law and methods, which would have to be tried again
        timing, known = _timing(experiment, known), replace(known, timed=True)
        if timing is not None:
            return replace(known, recording=(*known.recording, timing))
    known = replace(known, notes=tuple(dict.fromkeys(n for r in recordings for n in r.notes)))
    try:
        problem = experiment.problem(say, recordings)
    except PividentError as error:
        return _stuck(known, error)
    if experiment.content.controller is not None and problem.loop is None:
        return replace(known, law_failed=problem.without_loop.rstrip("."))
    return _try_methods(experiment, problem, known, say)


def _try_methods(
    experiment: Experiment, problem: Problem, known: Findings, say: Callable[[str], None]
) -> Findings:
    """The first solution of every method."""
    shorter = replace(problem, recordings=tuple(_shortened(r) for r in problem.recordings))
    explained: dict[str, float] = {}
    failed, made = dict(known.failed), ""
    for name, method in experiment.methods().items():
        if (first := method.first_iteration()) is not None:
            try:
                result = identify(shorter, first, say)
            except PividentError as error:
                failed[name] = _short(error)
                continue
            made = _instead(result)
        else:
            try:
                result = identify(problem, method, say)
            except PividentError as error:
                return _stuck(known, error)
            explained = {joint.name: float(joint.relative_error) for joint in result.joints}
            if known.friction is None and method.handles.law_choice:
                known = replace(known, friction=_friction(problem, method, result, say))
                if known.friction:
                    return known
    loops = [m for m in experiment.methods() if m != "ls"]
    if is_without_torque(experiment.content) and set(loops) <= set(failed):
        text = f"pivident identify ends with: {next(failed[m] for m in loops)}"
        return replace(known, troubles=(*known.troubles, text), settled=True)
    if experiment.content.controller is not None and set(loops) <= set(failed):
        reason = next(failed[m] for m in loops)
        return replace(known, law_failed=f"the identified law does not carry the loop ({reason})")
    known = replace(known, failed=failed, explained=explained, instruments=made)
    validation = experiment.content.validation
    wanted = validation.folds
    folds = division_of(problem, wanted, validation.gap).count
    return replace(known, settled=True) if folds == wanted else replace(known, folds=folds)


def _friction(
    problem: Problem, method: Method, found: Identification, say: Callable[[str], None]
) -> tuple[Assumption, ...]:
    """The line with the law of friction, where the log asks for another than the default.

    Behind the gears `identify` decides by itself, together with which friction there is.
    """
    if problem.robot.torque_side == "link":
        return ()
    better = complete_sign(problem, method, found, say)
    if better is None:
        return ()
    value = parse_toml(f"x = {law_toml(better.law)}")["x"]
    seen = f"{better}; `pivident laws` compares other laws"
    return (Assumption("robot", "friction", value, "likely", seen),)


def _instead(result: Identification) -> str:
    """What instruments are made of, where it is not the simulated loop."""
    used = result.instruments
    if used is None or used.kind == "loop":
        return ""
    title = KINDS[used.kind].title
    return f"{title} ({used.instead_of.rstrip('.')})" if used.instead_of else title


def _timing(experiment: Experiment, known: Findings) -> Assumption | None:
    """The line that says which instant a torque sample belongs to, where the motion tells."""
    if any(line.key in ("torque_timing", "control_rate") for line in known.recording):
        return None
    entry = experiment.content.recording[0]
    if entry.torque_side == "link":
        return None  # a sensor's value is that of its instant
    try:
        log = replace(log_of(entry, experiment.robot, experiment.path.parent), torque_timing="")
        audit = audit_log(log)
    except PividentError:
        return None
    if audit.delay is None or audit.model is None:
        return None
    said, common, rate = audit.delay.findings[0], audit.delay.common, audit.model.rate
    seen = half_sentence(said.message)
    if said.declared is LOOP_RATE:
        loops = possible_loops(log, rate, common)
        sure: Sureness = "likely" if len(loops) == 1 else "assumed"
        return Assumption("recording", "control_rate", loops[0], sure, seen, "In Hz.")
    timing, clear = undeclared_timing(log, rate, common), said.declared is TIMING
    if not common[1] * rate <= KNOWN:  # or unknown
        if rate >= SLOWEST_LOOP:
            return None
        timing, clear = "sampled", False
        seen += f"; no loop holds the torques of an arm for {1e3 / rate:.0f} ms"
    elif timing is None:
        return None
    elif not clear:
        seen += f": nearer to torques that are {TIMING_WORDS[timing]} than to torques that are "
        seen += f"{TIMING_WORDS['held']}, which the motion does not decide"
    return Assumption(
        "recording", "torque_timing", timing, "likely" if clear else "assumed", seen,
        "Or held from its instant until the next (held), the mean over the period before it "
        "(averaged). Where you know the rate of the control loop, write control_rate in its place.",
    )  # fmt: skip


def _remedy(error: PividentError) -> Assumption | None:
    """The line that makes a recording acceptable that has one fault: the repair of a check."""
    if isinstance(error, SaturatedSignal):
        better = "Torque beyond a limit is not what the model says; better cut those parts out."
        return _line(ACCEPT_CUT_OFF, "assumed", error.fact, better)
    if isinstance(error, ConstantChannel):
        seen = f"{error.fact}; what needs its motion cannot be determined"
        return _line(ACCEPT_CONSTANT, "assumed", seen)
    if isinstance(error, (MissingSamples, GapInClock)) and error.stretches.lost:
        longest = error.stretches.longest
        others = [written(part) for part in error.stretches.parts if part != longest]
        more = f"A copy of this table for each adds {', '.join(others)}." if others else ""
        seen = f"{error.fact}; this is the longest stretch without such a gap"
        return _line(only(longest), "likely", seen, more)
    if isinstance(error, IrregularSampling):
        return _line(INTERPOLATED, "assumed", f"{error.fact}; samples are interpolated")
    return None


def _line(repair: Repair, sure: Sureness, seen: str, correct: str = "") -> Assumption:
    """The line of a recording that a repair sets."""
    (edit,) = repair.edits
    assert isinstance(edit, Edit), "these repairs set one key"
    return Assumption("recording", str(edit.place[-1]), edit.value, sure, seen, correct)


def _stuck(known: Findings, error: PividentError) -> Findings:
    """A fault that only a person can put right."""
    text = f"pivident identify ends with: {_short(error)}"
    return replace(known, troubles=(*known.troubles, text), settled=True)


def _shortened(recording: Recording) -> Recording:
    """The first part of a record that is too long for a trial."""
    longest = max(MAX_TRIAL // recording.joints, 1000)
    return recording if recording.samples <= longest else recording.part(0, longest)


def _short(error: BaseException) -> str:
    """An error in one line."""
    return " ".join(str(error).split())
