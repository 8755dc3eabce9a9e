"""What an identification would do: joints, samples, rates, parameters, methods, expected time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from pivident.estimation.methods import InstrumentalVariables, LeastSquares, Method
from pivident.estimation.problem import Problem
from pivident.plain_values import plain
from pivident.recording.recording import Recording

#: Processor time per sample, joint and parameter of one pass [s], measured on 13 to 61 parameters.
PASS = 4e-9

#: … and what each method does besides per sample and joint, in passes of that many parameters.
SIMULATION, SMOOTHER = 60, 30

#: Iterations that a method takes as a rule.
ITERATIONS = 4

#: Time that the first run after an installation takes to compile [s].
COMPILING = 60.0

#: A rough time is good to this factor.
ROUGH = 3.0


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
        seconds: expected time on one processor [s], good to a factor of three.
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

    def as_json(self) -> dict[str, Any]:
        """Plain values."""
        return plain(asdict(self))

    def __str__(self) -> str:
        runs = "; ".join(
            f"{name}: {samples} samples at {rate:.6g} Hz, {seconds:.4g} s"
            for name, samples, rate, seconds in self.recordings
        )
        lines = [
            ("robot", f"{self.robot}, {len(self.joints)} joint(s): {', '.join(self.joints)}"),
            ("recordings", runs),
            ("parameters", f"{len(self.parameters)} base parameters: {self._named()}"),
            ("methods", ", ".join(self.methods)),
            ("controller", f"{self.controller}, reference {self.reference}"),
            ("judged on", ", ".join(self.held_out) or self._blocks()),
            ("expected time", f"{self._time()} (to a factor of {ROUGH:g}; the first run compiles)"),
        ]
        shown = [(key, text) for key, text in lines if key != "controller" or self.controller]
        return "\n".join(f"  {key:<14} {text}" for key, text in shown)

    def _named(self) -> str:
        names = self.parameters
        return ", ".join(names if len(names) <= 16 else (*names[:14], "…", names[-1]))

    def _blocks(self) -> str:
        return f"{self.folds} blocks held out in turn" if self.folds else "no held-out motion"

    def _time(self) -> str:
        if self.seconds < 90:
            return f"about {max(1, round(self.seconds))} s"
        return f"about {round(self.seconds / 60)} min"


def plan_of(
    problem: Problem,
    methods: Mapping[str, Method],
    held_out: Sequence[Recording],
    folds: int,
    controller: str,
    reference: str,
) -> Plan:
    """What an identification of a problem would do.

    Args:
        problem: what is given.
        methods: by short name.
        held_out: recordings that results are judged on.
        folds: blocks that are held out in turn.
        controller: kind of control law, empty without one.
        reference: where its reference comes from.
    """
    return Plan(
        problem.robot.name,
        problem.robot.joint_names,
        tuple((r.name, r.samples, r.rate, r.duration) for r in problem.recordings),
        tuple(r.name for r in held_out),
        problem.names,
        tuple(methods),
        controller,
        reference if controller else "",
        0 if held_out else folds,
        expected_time(problem, methods.values(), 0 if held_out else folds),
    )


def expected_time(problem: Problem, methods: Sequence[Method] | Any, folds: int) -> float:
    """Processor time that an identification takes [s], to a factor of three.

    One pass over n samples of J joints with P parameters takes about c n J P; simulation and
    smoother count as passes of more parameters. Held-out blocks take as many fits again.

    Args:
        problem: what is given.
        methods: how it is estimated.
        folds: blocks that are held out in turn.
    """
    samples = sum(recording.samples for recording in problem.recordings)
    unit = PASS * samples * problem.robot.size
    parameters = len(problem.names)
    total = 0.5
    for method in methods:
        if isinstance(method, LeastSquares):
            once = unit * (parameters + SMOOTHER)
        else:
            passes = 1 if isinstance(method, InstrumentalVariables) else 3
            once = unit * ITERATIONS * (passes * parameters + SIMULATION) + unit * SMOOTHER
        total += 0.2 + once * (1 + folds)
    return total
