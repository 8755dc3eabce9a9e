"""The command beside its estimators: `pivident identify` with verdict, five folds and report."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pivident.app.cli.workflow import Results, identify_all, write_results
from pivident.data.logs.log import Log
from pivident.estimation.methods import METHODS
from pivident.estimation.problem import Problem
from pivident.experiment.experiment import load_experiment
from pivident.foundation.common_work import shared_work
from pivident.foundation.errors import Attempts, PividentError
from pivident.judgement.audit.audit import audit_log
from pivident.judgement.diagnostics.diagnostics import diagnose
from pivident.judgement.diagnostics.verdict import verdict
from pivident.loop.simulation.control_loop import Loop
from pivident.loop.simulation.controllers import PD
from pivident.loop.simulation.simulated_record import simulate

from .workloads import arm, simulated_record, whole_job

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"

FOLDS = 5

#: Largest processor time of the command over that of its estimators, and of an audit [s].
COMMAND_GOAL, AUDIT_GOAL = 4.0, 3.0

#: Methods that are estimated together.
TOGETHER = (("piv",), ("ls", "iv", "iv-full-rate", "piv"))


@dataclass(frozen=True)
class CommandRow:
    """Processor times of one command, medians [s].

    Attributes:
        work: which record.
        methods: which estimators.
        estimators: all of them together.
        judging: held-out blocks, tests and verdict.
        writing: files and report.
    """

    work: str
    methods: tuple[str, ...]
    estimators: float
    judging: float
    writing: float

    @property
    def ratio(self) -> float:
        """The whole over the estimators."""
        return (self.estimators + self.judging + self.writing) / self.estimators


class _Silent:
    """Progress that nobody sees."""

    def say(self, line: str) -> None:
        """Nothing."""

    keep = begin = say


def command_rows(repeats: int) -> Iterator[CommandRow]:
    """The TX40, EMPS and a simulated arm of seven axes."""
    for work, make in (("TX40", _tx40), ("EMPS", _emps), ("seven axes", _seven_axes)):
        try:
            label, problem = make()
        except (PividentError, OSError) as missing:
            print(f"({work} not at hand: {missing})")
            continue
        for methods in TOGETHER:
            times = np.median([_run(problem, methods) for _ in range(repeats + 1)][1:], axis=0)
            yield CommandRow(f"{work}, {label}", methods, *times.tolist())


def _run(problem: Problem, names: tuple[str, ...]) -> tuple[float, float, float]:
    """Processor times of estimators, judgement, and files with report, made as the command does.

    That is in one block of shared work [s].
    """
    methods = {name: METHODS[name] for name in names}
    with tempfile.TemporaryDirectory() as folder, shared_work():
        times = [time.process_time()]
        outcome = identify_all(problem, methods, _Silent(), Attempts())  # type: ignore[arg-type]
        times.append(time.process_time())
        diagnostics = diagnose(problem, outcome.identifications, methods, folds=FOLDS)
        str(verdict(diagnostics))
        times.append(time.process_time())
        results = Results(diagnostics.identifications, diagnostics)
        write_results(results, Path(folder) / "results", "benchmark")
        times.append(time.process_time())
    first, second, third = np.diff(times).tolist()
    return first, second, third


def _tx40() -> tuple[str, Problem]:
    label, problem = whole_job()
    return label.partition(", ")[2], problem


def _emps() -> tuple[str, Problem]:
    problem = load_experiment(EXAMPLES / "emps" / "experiment.toml").problem()
    return f"{problem.recordings[0].samples:,} x 1, {len(problem.names)} parameters", problem


def _seven_axes() -> tuple[str, Problem]:
    """An arm of random links at 1 kHz, all of its base parameters."""
    robot, bandwidth = arm(7), 2.0 * np.pi * 10.0
    inertia = robot.rotor_inertia + 1.0
    loop = Loop(PD(inertia * bandwidth**2, inertia * 2.0 * bandwidth))
    made = simulate(robot, loop, rate=1000.0, duration=30.0, encoder=1e-5, torque=0.1)
    problem = Problem(robot, (made.recording,), loop)
    return f"{made.recording.samples:,} x 7, {len(problem.names)} parameters", problem


def audit_seconds(repeats: int) -> tuple[str, float]:
    """An audit of a simulated record of six axes: what it is, median of its processor time [s]."""
    problem = simulated_record(35_000)
    (record,) = problem.recordings
    channels = {"q": record.q, "tau": record.tau}
    log = Log(
        "simulated", record.joint_names, {}, {"t": record.t}, logged=channels, channels=channels,
        robot=problem.robot,
    )  # fmt: skip
    work: Callable[[], object] = lambda: audit_log(log)  # noqa: E731
    times = []
    for _ in range(repeats + 1):
        begin = time.process_time()
        work()
        times.append(time.process_time() - begin)
    return f"audit, {record.samples:,} x {record.joints}", float(np.median(times[1:]))
