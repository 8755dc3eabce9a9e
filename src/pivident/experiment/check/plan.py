"""What an identification would do: joints, samples, rates, parameters, methods, expected time.

How long an identification takes, from `pivident identify` to the report.

With n samples in all, J joints, P parameters, B held-out blocks and u = n J P,

    T = T₀ + k n J + m + l n J + Σ_methods [(f + c u) + B (g + h n J) + (t + s u) + d J]
        + a + b J² P + e u + r,

that is: the start, and what is read; a control law that has to be found; for each method one fit,
in seconds f and per sample, joint and parameter c, the prediction of each block and its simulated
loop, the tests of residuals and instruments, and its figures in the report; the audit, the causes
of model error and the repairs that are tried, for the recommended method; the report. Each method
declares its f and c
(one run of the scenario *birdy*, 10,000 × 6, 45 parameters; particles on the planar arm). The
others are times measured on a two-core machine on which `import numba, scipy.linalg` takes 0.57 s,
caches filled (`benchmarks/expected_time.py`); elsewhere the beginning of a run tells the pace.

| problem | samples, joints, parameters | measured [s] | T [s] |
|---|---|---|---|
| simulated planar arm, 1 kHz, three methods | 2000 × 2, 13 | 1.6 | 2.1 |
| UR10, 125 Hz, three methods | 3441 × 6, 58 | 3.5 | 4.1 |
| EMPS, 1 kHz, four methods | 24,841 × 1, 4 | 2.6 | 2.4 |
| KR300, three axes, four methods, law to be found | 3200 × 3, 21 | 3.9 | 3.3 |
| TX40, 5 kHz, four methods | 37,250 × 6, 34 | 6.8 | 6.8 |
| simulated seven axes and a finger, 1 kHz, three methods | 20,000 × 8, 78 | 8.8 | 9.5 |
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from pivident.data.recording.recording import Recording
from pivident.dynamics.regressor_kernels import observe
from pivident.estimation.method import Method
from pivident.estimation.methods import METHODS
from pivident.estimation.problem import Problem
from pivident.foundation.compiled import is_compiled
from pivident.foundation.text.display import Displayed
from pivident.foundation.text.numbers import time_in_words
from pivident.foundation.text.sentences import plural


@dataclass(frozen=True)
class Plan(Displayed):
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
            right to a factor of 1.5.
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
        text = f"about {time_in_words(self.seconds)}"
        if self.compiling:
            text += (
                f", and about {time_in_words(self.compiling)} to compile, in this first run only"
            )
        return text


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
        TimeOfMethods(problem, methods, blocks),
        first_run(methods, problem.loop is not None),
    )


#: Libraries that a command loads before it begins [s].
LIBRARIES = 0.56

#: T₀ with k n J: libraries and robot, what is read for each sample and joint; and what comes before
#: and after that: the interpreter begins, a screen is printed [s].
START, READING, FRAME = 0.75, 1.2e-6, 0.4

#: g and h of a block that is predicted, and what its simulated loop adds [s].
PREDICTION, REPLAY = (0.005, 4e-8), (0.008, 1e-7)

#: m and l: a control law that has to be found, per sample and joint [s].
LAW = (0.5, 1.5e-5)

#: t and s: tests of residuals and instruments [s].
TESTS = (0.02, 2e-8)

#: r and d: the report, and its figures for each joint and method [s].
REPORT = (0.2, 0.01)

#: Audit, causes of model error and trials of repairs: a, b for each parameter and square of the
#: joints (each joint has causes of its own, which are tried on all rows), and e [s].
CAUSES = (0.2, 8e-4, 3e-8)

#: One consistent estimate with its intervals, per cube of the joints [s].
CONE_PROGRAMS = 0.011

#: Names of the stages behind the estimates, which have the names of their methods.
JUDGED, CONSISTENT, WRITTEN = "held-out motion and tests", "consistency", "report"

#: Processor time to compile what least squares needs, and what the simulated loop needs too [s].
COMPILING = (12.0, 25.0)


def expected_time(
    problem: Problem, methods: Mapping[str, Method], folds: int, *, law_unknown: bool
) -> float:
    """Processor time of an identification without compiling [s], about right to a factor of 1.5."""
    stages = expected_stages(problem, methods, folds)
    return FRAME + time_before(problem, law_unknown=law_unknown) + sum(stages.values())


def time_before(problem: Problem, *, law_unknown: bool) -> float:
    """Processor time until there is a problem [s]: the start, and a control law to be found."""
    samples = sum(recording.samples for recording in problem.recordings)
    signal = float(samples * problem.robot.size)
    return START + READING * signal + (_line(LAW, signal) if law_unknown else 0.0)


class TimeOfMethods(Mapping[str, float]):
    """What each method there is adds to the time of an identification [s], chosen or not.

    A method that is not chosen is imported when it is asked for.
    """

    def __init__(self, problem: Problem, chosen: Mapping[str, Method], folds: int) -> None:
        self._problem, self._chosen, self._folds = problem, chosen, folds

    def __getitem__(self, name: str) -> float:
        method = self._chosen[name] if name in self._chosen else METHODS[name]
        alone, without = (
            sum(expected_stages(self._problem, chosen, self._folds).values())
            for chosen in ({name: method}, {})
        )
        return alone - without

    def __iter__(self) -> Iterator[str]:
        return iter(dict.fromkeys((*METHODS.usable(), *self._chosen)))

    def __len__(self) -> int:
        return len(tuple(iter(self)))


def expected_stages(
    problem: Problem, methods: Mapping[str, Method], folds: int, consistent: int = 0
) -> dict[str, float]:
    """Processor time of each stage once there is a problem, in their order [s].

    Args:
        problem: what is given.
        methods: by their short names, which are the names of their stages.
        folds: blocks that are held out.
        consistent: how many estimates are made physically consistent.
    """
    samples = sum(recording.samples for recording in problem.recordings)
    joints, several = problem.robot.size, len(methods)
    signal = float(samples * joints)
    unit = signal * len(problem.names)
    stages = {name: _line(method.cost, unit) for name, method in methods.items()}
    block = _line(PREDICTION, signal)
    block += 0.0 if problem.loop is None else _line(REPLAY, signal)
    causes = CAUSES[0] + CAUSES[1] * joints**2 * len(problem.names) + CAUSES[2] * unit
    stages[JUDGED] = several * (folds * block + _line(TESTS, unit)) + causes
    if consistent:
        stages[CONSISTENT] = consistent * CONE_PROGRAMS * joints**3
    stages[WRITTEN] = REPORT[0] + REPORT[1] * joints * several
    return stages


def _line(constants: tuple[float, float], size: float) -> float:
    return constants[0] + constants[1] * size


def first_run(methods: Mapping[str, Method], looped: bool) -> float:
    """Processor time to compile what is not in the caches yet [s]; ``looped``: by a control law."""
    missing = 0.0 if is_compiled(observe) else COMPILING[0]
    if not simulates(methods, looped):
        return missing
    from pivident.loop.simulation.loop_kernel import run_loop

    return missing + (0.0 if is_compiled(run_loop) else COMPILING[1])


def simulates(methods: Mapping[str, Method], looped: bool) -> bool:
    """Whether anything is simulated; ``looped``: whether there is a control law."""
    return any(m.fits_simulation or (looped and m.simulates_loop) for m in methods.values())
