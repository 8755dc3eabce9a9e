"""Methods, parameters, control law and output of an experiment, and what would be done with it.

The sampled loop around the described robot has to be stable with the gains of the file, and the
recordings long and quick enough for the filters.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from pivident.data.logs.timestamps import LOWEST_RATE
from pivident.data.recording.recording import Recording
from pivident.dynamics.base_parameters import base_parameters, parameter_index
from pivident.dynamics.forward import mass_matrix
from pivident.dynamics.parameters import nominal_values
from pivident.estimation.kinematics import samples_needed, settled_recipe
from pivident.estimation.method import Method
from pivident.estimation.problem import TOPIC, Problem
from pivident.estimation.signal_recipes import Bandpass
from pivident.experiment.check.actuators_check import check_actuators
from pivident.experiment.check.gains_check import CONTROLLER, of_joint
from pivident.experiment.check.plan import Plan, plan_of
from pivident.experiment.check.remark import Remark, of_error, of_finding
from pivident.experiment.experiment import Experiment, problem_of
from pivident.experiment.file_keys import ControllerEntry
from pivident.experiment.identify_table import median_finding
from pivident.experiment.missing_torque import check_torque
from pivident.experiment.recording_tables import loop_of
from pivident.foundation.errors import PividentError
from pivident.foundation.files import check_output
from pivident.foundation.text.finding import Finding, FindingKind, Quantity, Topic
from pivident.foundation.text.repair import Edit, Place, Repair
from pivident.foundation.text.sentences import capital, sentence_of
from pivident.judgement.model_errors.time_errors import reference_temperatures
from pivident.judgement.validation.divergence_cause import missing_inertia
from pivident.judgement.validation.held_out.folds import Division, division_of
from pivident.loop.motion.planted_feet import on_planted_feet
from pivident.robot.description import Robot
from pivident.robot.mounted import carrier_of

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
        self.motionless: tuple[str, ...] = ()  # joints of which an identification has no row
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
            self.motionless = motionless_joints(problem)
            self._say(_without_rotors(problem, methods))
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
        for table, name, find in (
            (("payload", "link"), None if load is None else load.link, carrier_of),
            (("gains", "payload", "joint"), None if known is None else known.joint, carrier_of),
        ):
            try:
                if name is not None:
                    find(robot, name)
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
            problem = problem_of(given, robot, fitted, loop)
            if given.temperature is not None:
                reference_temperatures(problem)
            return problem
        except PividentError as error:
            self.remarks.append(of_error(error, "file", ("identify",)))
            return None

    def _parameters(self, robot: Robot) -> None:
        """Names of parameters, where no recording can be read."""
        given = self._content.identify
        base = base_parameters(robot)
        fixed = given.fixed if isinstance(given.fixed, dict) else {}
        named: dict[str, Iterable[str]] = {
            "parameters": given.parameters or (),
            "initial": given.initial,
            "fixed": fixed,
            "bounds": given.bounds,
            "priors": given.priors,
        }
        for key, names in named.items():
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


def motionless_joints(problem: Problem) -> tuple[str, ...]:
    """Joints that no recording moves faster than the low-speed mask, by name.

    The speed is that over a tenth of a second, which noise of single samples does not reach.
    """
    robot, moves = problem.robot, np.zeros(problem.robot.size, bool)
    for recording in problem.recordings:
        q, rate = recording.q, recording.rate
        step = min(max(1, round(0.1 * rate)), recording.samples - 1)
        limits = problem.speed_limits(recording)
        speeds = (q[step:] - q[:-step]).T * (rate / step)
        moves |= limits.moving(speeds).any(axis=1)
        moves |= ~np.isfinite(recording.tau).any(axis=0)  # nothing is asked of it
    moves[: robot.base_joints] = True
    return tuple(robot.joint_names[j] for j in np.flatnonzero(~moves))


def _without_torque(problem: Problem, methods: dict[str, Method]) -> Iterator[Finding]:
    """What positions alone cannot tell, and methods that take a computed torque for a measured."""
    for finding in problem.findings:
        if finding.topic == TOPIC:
            yield replace(finding, place=("controller",))
    for method in methods.values():
        for finding in method.about_torques(problem.recordings):
            yield replace(finding, subject=method.label, place=("identify", "methods"))


def _without_rotors(problem: Problem, methods: dict[str, Method]) -> Iterator[Finding]:
    """What the description lacks where simulations start from it; least squares estimates it."""
    described = any(method.begins_as_described for method in methods.values())
    if problem.loop is not None and described:
        step = 'Or leave out start = "initial": methods then start from least squares.'
        for sentence in missing_inertia(problem):
            yield ROTORS.finding("warning", sentence_of(sentence), "", step)


def _folds(division: Division) -> Iterator[Finding]:
    """Another number of blocks than the file asks for."""
    if division.reason:
        step = f"Set folds = {division.count} under [validation]."
        repairs = [Repair((Edit(FOLDS.place, division.count),))]
        yield FOLDS.finding("warning", division.line, "", step, repairs=repairs)


UNSTABLE = FindingKind(CONTROLLER, "unstable")
ROTORS = FindingKind(CONTROLLER, "rotors", ("robot",))

#: Growth per control period from which a loop is called unstable.
GROWTH = 1.002


def check_stability(
    robot: Robot, entry: ControllerEntry, rate: float, posture: np.ndarray
) -> list[Finding]:
    """Whether the sampled loop around the described robot holds a posture.

    With M the mass matrix, x = (δq, δdq) and a torque held for a period h,

        δq⁺ = δq + h δdq + ½h² M⁻¹δτ,  δdq⁺ = δdq + h M⁻¹δτ,  δτ = -Kp δq - Kd (δq - δq⁻)/h,

    without gravity and friction, which are slow beside the loop. The loop is unstable where an
    eigenvalue of this map exceeds one. Behind a gear the rotor is often most of a joint's inertia,
    and a URDF has no place for it: without all rotors nothing is known of the loop.
    """
    base = base_parameters(robot)
    theta = base.values(nominal_values(robot, base.standard))
    known = all(np.any(k.inertia) for k in robot.tree.links if k.is_body)
    if not np.all(robot.rotor_inertia) or entry.kp is None or not known:
        return []
    n, h = robot.size, 1.0 / rate
    inverse = np.linalg.inv(mass_matrix(robot, base.parameters, theta, posture[None])[0])
    gain = np.array([of_joint(entry.gain, j) for j in range(n)])
    kp = gain * [of_joint(entry.kp, j) for j in range(n)]
    kd = gain * [of_joint(entry.kd if entry.kv is None else entry.kv, j) for j in range(n)]
    if entry.type == "cascade":
        kp = kp * [of_joint(entry.kv, j) for j in range(n)]
    one, zero = np.eye(n), np.zeros((n, n))
    law = np.hstack([-np.diag(kp + kd / h), zero, np.diag(kd / h)])  # on δq, δdq, δq⁻
    step = np.block([[one, h * one, zero], [zero, one, zero], [one, zero, zero]])
    step[:n] += 0.5 * h**2 * inverse @ law
    step[n : 2 * n] += h * inverse @ law
    values, vectors = np.linalg.eig(step)
    k = int(np.argmax(np.abs(values)))
    growth = float(abs(values[k]))
    if growth <= GROWTH or not np.all(kd):
        return []
    worst = robot.joint_names[int(np.argmax(np.abs(vectors[:n, k])))]
    causes = "Check the units of kp and kd (N m per rad and per rad/s on the joint side), "
    causes += "drive_gain, control_rate, and the masses of the description."
    return [
        UNSTABLE.finding(
            "error",
            f"The loop of {worst} is unstable with these gains at {rate:.5g} Hz: errors grow by a "
            f"factor of {growth:.3g} in each control period.",
            worst,
            causes,
            place=("controller", "kd" if entry.type != "cascade" else "kv"),
        )
    ]


#: What this check looks at.
METHODS = Topic("methods")

CUTOFF = FindingKind(METHODS, "cutoff", ("identify", "bandpass", "cutoff"), stops=True)
TOO_SHORT = FindingKind(METHODS, "too short", ("recording", "part"), stops=True)
SLOWED = FindingKind(Topic("timing"), "slowed", ("recording", "rate"))


def check_filters(methods: Mapping[str, Method], recordings: Iterable[Recording]) -> list[Finding]:
    """Filters that a recording is too slow or too short for."""
    recordings = list(recordings)
    findings = [_slowed(r) for r in recordings if r.slowed]
    if (median := median_finding(methods)) is not None:
        findings.append(median)
    findings += [f for recording in recordings for f in _too_short(recording, methods)]
    slowest = min(recordings, key=lambda r: r.rate, default=None)
    if slowest is None:
        return findings
    for name, method in methods.items():
        signals = method.signals
        if not isinstance(signals, Bandpass) or signals.cutoff is None:
            continue
        highest = float(signals.cutoffs(slowest.joints).max())
        if highest < slowest.rate / 2:
            continue
        step = (
            "Leave cutoff out, and it is chosen from the record; or check the unit of the time "
            "stamps."
        )
        if slowest.slowed:
            step = f"{capital(slowest.slowed)}."
        findings.append(
            CUTOFF.finding(
                "error",
                f"The position filter of {name!r} has a cutoff of {highest:g} Hz, but at "
                f"{slowest.rate:g} Hz {slowest.name} holds nothing above {slowest.rate / 2:g} Hz.",
                slowest.name,
                step,
            )
        )
    return findings


def _too_short(recording: Recording, methods: Mapping[str, Method]) -> list[Finding]:
    """A recording of which the filters leave too little between its ends."""
    needed = {
        name: samples_needed(settled_recipe(method.signals, [recording]), recording.rate)
        for name, method in methods.items()
    }
    name = max(needed, key=needed.__getitem__, default="")
    if not needed or recording.samples >= needed[name]:
        return []
    text = (
        f"{recording.name} is too short for {name!r}: {recording.samples} samples; its filters, "
        f"which drop those at the ends, need {needed[name]}, {needed[name] / recording.rate:.3g} s "
        f"at {recording.rate:g} Hz."
    )
    step = "Take a longer part, or log for longer."
    return [TOO_SHORT.finding("error", text, recording.name, step)]


def _slowed(recording: Recording) -> Finding:
    """A recording that has lost samples of its positions to a slower channel."""
    return SLOWED.finding(
        "warning",
        f"{recording.name} is used at {recording.rate:g} Hz, slower than its positions were "
        "logged.",
        recording.name,
        f"{capital(recording.slowed)}.",
        {"rate": Quantity(recording.rate, "Hz")},
    )
