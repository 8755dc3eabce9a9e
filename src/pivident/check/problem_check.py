"""Methods, parameters, control law and output of an experiment, and what would be done with it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from pivident.check.actuators_check import check_actuators
from pivident.check.filters_check import check_filters
from pivident.check.plan import Plan, plan_of
from pivident.check.remark import Remark, of_error, of_finding
from pivident.check.stability_check import check_stability
from pivident.dynamics.base_parameters import base_parameters, parameter_index
from pivident.errors import PividentError
from pivident.estimation.method import Method
from pivident.estimation.problem import TOPIC, Problem
from pivident.experiment.experiment import Experiment, problem_of
from pivident.experiment.missing_torque import check_torque
from pivident.experiment.recording_tables import loop_of
from pivident.files import check_output
from pivident.logs.clocks.timestamps import LOWEST_RATE
from pivident.motion.planted_feet import on_planted_feet
from pivident.recording.recording import Recording
from pivident.robot.description import Robot
from pivident.text.finding import Finding, FindingKind, Topic
from pivident.text.repair import Edit, Place, Repair
from pivident.validation.held_out.folds import Division, division_of

#: Another number of held-out blocks than the file asks for.
FOLDS = FindingKind(Topic("validation"), "folds", ("validation", "folds"))


class ProblemCheck:
    """The tables about what is to be estimated, and how; each stage adds its remarks."""

    def __init__(
        self,
        experiment: Experiment,
        robot: Robot | None,
        recordings: list[tuple[Place, Recording]],
    ) -> None:
        self.remarks: list[Remark] = []
        self.plan: Plan | None = None  # None where an identification cannot begin
        self._experiment, self._content = experiment, experiment.content
        methods = self._methods()
        self._output()
        self._say(check_filters(methods, [r for _, r in recordings]))
        if robot is not None:
            fitted = [r for place, r in recordings if place[0] == "recording"]
            unseen = [r for place, r in recordings if place[0] == "validation"]
            self._of_robot(robot, methods, fitted, unseen)

    def _say(self, findings: Iterable[Finding]) -> None:
        self.remarks += [of_finding(finding) for finding in findings]

    def _methods(self) -> dict[str, Method]:
        try:
            return self._experiment.methods()
        except PividentError as error:
            self.remarks.append(of_error(error, "file", ("identify",)))
            return {}

    def _of_robot(
        self,
        robot: Robot,
        methods: dict[str, Method],
        fitted: list[Recording],
        unseen: list[Recording],
    ) -> None:
        """What names joints and parameters, and the plan."""
        self._joints(robot)
        try:
            self._experiment.consistency()
        except PividentError as error:
            self.remarks.append(of_error(error, "file", ("consistency",)))
        problem = self._problem(robot, fitted)
        if problem is not None and methods:
            law, folds = self._content.controller, self._content.validation.folds
            kind, source = ("", "") if law is None else (law.type, law.source)
            if not unseen:
                division = division_of(problem, folds, self._content.validation.gap)
                self._say(_folds(division))
                folds = division.count
            self._say(_without_torque(problem, methods))
            self.plan = plan_of(problem, methods, unseen, folds, kind, source)

    def _joints(self, robot: Robot) -> None:
        """Joints that other tables name."""
        load, known = self._content.payload, self._content.gains.payload
        for table, joint in (
            (("payload", "link"), None if load is None else load.link),
            (("gains", "payload", "joint"), None if known is None else known.joint),
        ):
            names = (*robot.joint_names, *(link.name for link in robot.links))
            try:
                if joint is not None and joint not in names:
                    robot.joint_index(joint)
            except PividentError as error:
                self.remarks.append(of_error(error, "file", table))

    def _problem(self, robot: Robot, fitted: list[Recording]) -> Problem | None:
        """The problem that would be identified, without a law that has to be found first."""
        given, law = self._content.identify, self._content.controller
        loop = None
        if law is not None and law.type != "identify" and law.source != "reconstruct":
            try:
                recordings = tuple(fitted)
                if recordings or law.type != "virtual_pd":
                    _, loop = loop_of(law, robot, recordings)
                    loop.controller.check(robot.size - robot.base_joints)
            except PividentError as error:
                self.remarks.append(of_error(error, "file", ("controller",)))
                loop = None
            else:
                self._stability(robot, fitted)
                self._say(check_actuators(law, robot, fitted))
        try:
            check_torque(self._content)
        except PividentError as error:
            self.remarks.append(of_error(error, "file", ("recording", 0, "columns")))
            return None
        if not fitted:
            self._parameters(robot)
            return None
        if robot.contacts:
            try:
                robot, planted = on_planted_feet(robot, fitted)
            except PividentError as error:
                self.remarks.append(of_error(error, "file", ("contact",)))
                return None
            fitted = list(planted)
        try:
            return problem_of(given, robot, fitted, loop)
        except PividentError as error:
            self.remarks.append(of_error(error, "file", ("identify",)))
            return None

    def _parameters(self, robot: Robot) -> None:
        """Names of parameters, where no recording can be read."""
        given = self._content.identify
        base = base_parameters(robot)
        for key, names in (("parameters", given.parameters or ()), ("initial", given.initial)):
            for name in names:
                try:
                    parameter_index(base, name)
                except PividentError as error:
                    self.remarks.append(of_error(error, "file", ("identify", key)))

    def _stability(self, robot: Robot, fitted: list[Recording]) -> None:
        law = self._content.controller
        if law is None or law.kp is None or not fitted:
            return
        first = fitted[0]
        rate = first.control_rate or first.rate
        if rate < LOWEST_RATE:
            return
        self._say(check_stability(robot, law, rate, np.mean(first.q, axis=0)))

    def _output(self) -> None:
        folder = self._experiment.output or Path(f"{self._experiment.path.stem}-results")
        try:
            check_output(folder)
        except PividentError as error:
            self.remarks.append(of_error(error, "file", ("output", "folder")))


def _without_torque(problem: Problem, methods: dict[str, Method]) -> Iterator[Finding]:
    """What positions alone cannot tell, and methods that take a computed torque for a measured."""
    for finding in problem.findings:
        if finding.topic == TOPIC:
            yield replace(finding, place=("controller",))
    for method in methods.values():
        for finding in method.about_torques(problem.recordings):
            yield replace(finding, subject=method.label, place=("identify", "methods"))


def _folds(division: Division) -> Iterator[Finding]:
    """Another number of blocks than the file asks for."""
    if division.reason:
        step = f"Set folds = {division.count} under [validation]."
        repairs = [Repair((Edit(FOLDS.place, division.count),))]
        yield FOLDS.finding("warning", division.line, "", step, repairs=repairs)
