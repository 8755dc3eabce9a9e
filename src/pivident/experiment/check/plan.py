"""What an identification would do: joints, samples, rates, parameters, methods, expected time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from pivident.data.recording.recording import Recording
from pivident.estimation.method import Method
from pivident.estimation.methods import METHODS
from pivident.estimation.problem import Problem
from pivident.experiment.check.expected_time import expected_time, first_run, time_of_methods
from pivident.foundation.text.lists import plural


@dataclass(frozen=True)
class Plan:
    """What would be estimated, from what, how, and in about what time.

    Attributes:
        robot: name of the robot.
        joints: names of its joints.
        recordings: name, samples, rate [Hz] and duration [s] of each run that is fitted.
        held_out: names of the runs that results are judged on.
        parameters: names of the parameters to estimate.
        methods: short names of the methods.
        controller: kind of control law, empty without one.
        reference: where the reference comes from, empty without a control law.
        folds: blocks that are held out in turn.
        seconds: expected processor time, held-out motion, tests and report included [s]; about
            right to a factor of two.
        seconds_of: what each method there is adds to it [s], chosen or not.
        compiling: processor time on top of that which the first run needs to compile, where
            nothing of it is in the caches [s].
    """

    robot: str
    joints: tuple[str, ...]
    recordings: tuple[tuple[str, int, float, float], ...]
    held_out: tuple[str, ...]
    parameters: tuple[str, ...]
    methods: tuple[str, ...]
    controller: str
    reference: str
    folds: int
    seconds: float
    seconds_of: Mapping[str, float]
    compiling: float

    @property
    def lines(self) -> list[tuple[str, str]]:
        """What it says, in words, by what it is about."""
        runs = "; ".join(
            f"{name}: {samples} samples at {rate:.6g} Hz, {seconds:.4g} s"
            for name, samples, rate, seconds in self.recordings
        )
        joints = plural(len(self.joints), "joint")
        lines = [
            ("robot", f"{self.robot}, {joints}: {', '.join(self.joints)}"),
            ("recordings", runs),
            ("parameters", f"{len(self.parameters)} base parameters: {self._named()}"),
            ("methods", ", ".join(self.methods)),
            ("controller", f"{self.controller}, reference {self.reference}"),
            ("judged on", ", ".join(self.held_out) or self._blocks()),
            ("expected time", self._time()),
        ]
        return [(key, text) for key, text in lines if key != "controller" or self.controller]

    def __str__(self) -> str:
        return "\n".join(f"  {key:<14} {text}" for key, text in self.lines)

    def _named(self) -> str:
        names = self.parameters
        return ", ".join(names if len(names) <= 16 else (*names[:14], "…", names[-1]))

    def _blocks(self) -> str:
        return f"{self.folds} blocks held out in turn" if self.folds else "no held-out motion"

    def _time(self) -> str:
        text = f"about {in_words(self.seconds)}"
        if self.compiling:
            text += f", and about {in_words(self.compiling)} to compile, in this first run only"
        return text


def in_words(seconds: float) -> str:
    """A rough time as people say it; seconds [s]."""
    if seconds < 90:
        return f"{max(1, round(seconds))} s"
    return f"{round(seconds / 60)} min"


def plan_of(
    problem: Problem,
    methods: Mapping[str, Method],
    held_out: Sequence[Recording],
    folds: int,
    controller: str,
    reference: str,
) -> Plan:
    """What an identification of a problem would do."""
    blocks = 0 if held_out else folds
    return Plan(
        problem.robot.name,
        problem.robot.on_fixed_base.joint_names,
        tuple((r.name, r.samples, r.rate, r.duration) for r in problem.recordings),
        tuple(r.name for r in held_out),
        problem.names,
        tuple(methods),
        controller,
        reference if controller else "",
        blocks,
        expected_time(problem, methods, blocks, law_unknown=controller == "identify"),
        time_of_methods(problem, METHODS.usable() | dict(methods), blocks),
        first_run(methods),
    )
