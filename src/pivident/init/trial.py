"""Whether a draft runs: its records are read, its law is looked for, its methods begin."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

from pivident.errors import (
    ConstantChannel,
    GapInClock,
    IdentificationError,
    IrregularSampling,
    MissingSamples,
    PividentError,
    SaturatedSignal,
)
from pivident.errors.recordings import written
from pivident.estimation.identify import identify
from pivident.estimation.methods import InstrumentalVariables, PrefilteredIV
from pivident.estimation.problem import Problem
from pivident.experiment.experiment import Experiment
from pivident.experiment.explained import validated
from pivident.init.assumption import Assumption
from pivident.recording.recording import Recording
from pivident.text.toml import parse_toml

#: Longest record on which methods are tried [samples times joints]; longer ones are tried in part.
MAX_TRIAL = 150_000


@dataclass(frozen=True)
class Findings:
    """What trials have shown so far."""

    recording: tuple[Assumption, ...] = ()  # lines of ``[recording]`` that became necessary
    law_failed: str = ""  # why no law could be identified, or empty
    law_found: str = ""  # what the identified law is like, or empty
    loop_failed: str = ""  # why no loop can be simulated, or empty
    failed: dict[str, str] = field(default_factory=dict)  # why, by method
    troubles: tuple[str, ...] = ()  # what a person has to do before it runs
    explained: dict[str, float] = field(default_factory=dict)  # relative error by joint
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
    controller = experiment.content.controller
    try:
        problem = experiment.problem(say, recordings)
    except PividentError as error:
        if controller is None:
            return _stuck(known, error)
        if controller.type == "identify":
            return replace(known, law_failed=f"no law can be identified ({_short(error)})")
        return replace(known, loop_failed=f"no law can be declared ({_short(error)})")
    return _try_methods(experiment, problem, known, say)


def _try_methods(
    experiment: Experiment, problem: Problem, known: Findings, say: Callable[[str], None]
) -> Findings:
    """The first solution of every method."""
    shorter = replace(problem, recordings=tuple(_shortened(r) for r in problem.recordings))
    explained: dict[str, float] = {}
    failed = dict(known.failed)
    for name, method in experiment.methods().items():
        if isinstance(method, (InstrumentalVariables, PrefilteredIV)):
            try:
                identify(shorter, replace(method, max_iterations=1), say)
            except IdentificationError as error:
                failed[name] = _short(error)
        else:
            try:
                result = identify(problem, method, say)
            except PividentError as error:
                return _stuck(known, error)
            explained = {joint.name: float(joint.relative_error) for joint in result.joints}
    if failed == known.failed:
        return replace(known, explained=explained, settled=True)
    loops = [m for m in experiment.methods() if m != "ls"]
    controller = experiment.content.controller
    if controller is not None and set(loops) <= set(failed):
        reason = next(failed[m] for m in loops)
        if controller.type == "identify":
            return replace(
                known, law_failed=f"the identified law does not carry the simulation ({reason})"
            )
        return replace(
            known, loop_failed=f"a declared law does not carry the simulation ({reason})"
        )
    return replace(known, failed=failed, explained=explained, settled=True)


def _remedy(error: PividentError) -> Assumption | None:
    """The line that makes a recording acceptable that has one fault."""
    said = str(error).partition(";")[0]
    if isinstance(error, SaturatedSignal):
        return Assumption(
            "recording", "saturation", "allow", "assumed", f"{said}",
            "Torque beyond a limit is not what the model says; better cut those parts out.",
        )  # fmt: skip
    if isinstance(error, ConstantChannel):
        seen = f"{said}; what needs its motion cannot be determined"
        return Assumption("recording", "allow_constant", True, "assumed", seen)
    if isinstance(error, (MissingSamples, GapInClock)) and error.stretches.lost:
        longest = error.stretches.longest
        others = [written(part) for part in error.stretches.parts if part != longest]
        more = f"A copy of this table for each adds {', '.join(others)}." if others else ""
        seen = f"{said}; this is the longest stretch without such a gap"
        return Assumption("recording", "part", list(longest), "likely", seen, more)
    if isinstance(error, IrregularSampling):
        seen = f"{said}; samples are interpolated"
        return Assumption("recording", "resample", True, "assumed", seen)
    return None


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
