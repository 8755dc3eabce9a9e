"""From the table ``[gains]`` to drive gains, and from gains to the lines of an experiment file."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pivident.data.logs.units import COMMAND, TORQUE, factor_to_si
from pivident.data.recording.recording import Recording
from pivident.estimation.drives.drive_gains import DriveGains, Trusted, identify_drive_gains
from pivident.estimation.drives.gear_losses import GearLosses, identify_gears
from pivident.estimation.drives.known_payload import Payload
from pivident.estimation.drives.motor_temperature import (
    MotorTemperature,
    at_reference_temperature,
    identify_motor_temperature,
)
from pivident.experiment.experiment import Experiment
from pivident.experiment.explained import errors_name
from pivident.experiment.file_keys import ExperimentFile, GainsEntry, RecordingEntry
from pivident.experiment.missing_torque import SENSORS, with_columns, without_sensors
from pivident.foundation.errors import ExperimentError
from pivident.loop.simulation.controllers import UNKNOWN_GAIN
from pivident.robot.description import Robot


@dataclass(frozen=True)
class DeclaredGain:
    """What a file says about one joint's command."""

    value: float  # torque per unit of the command that the log was read with [N m or N per unit]
    unit: str  # unit of the command as the file has it, ``mA``, ``V`` …, or of a torque
    given: bool  # whether somebody gave that gain; an assumption or 1 stands for it otherwise
    place: str  # ``robot`` (drive_gain), ``units``, ``factor`` or ``dataset``

    @property
    def base_unit(self) -> str:
        """The unit that the gain belongs to, A for a log in mA."""
        return self.unit.removeprefix("m") if self.unit in ("mA", "mV") else self.unit


@dataclass(frozen=True, eq=False)
class GainsOfExperiment:
    """Drive gains of an experiment file's records."""

    gains: DriveGains  # gains relative to the declared ones
    declared: tuple[DeclaredGain, ...]  # what the file declares, one for each joint
    torque_units: tuple[str, ...]  # ``N m`` or ``N`` of each joint
    payload: Payload | None  # the payload, or None
    trusted: tuple[str, ...]
    temperatures: tuple[MotorTemperature, ...]  # coefficients, where requested
    model: str  # the robot's model as the file names it
    gears: tuple[GearLosses, ...] = ()  # where torques behind them are logged too

    @property
    def values(self) -> np.ndarray:
        """Gains [N m or N per unit of the command], shape (joints,)."""
        return self.gains.kappa * np.array([d.value for d in self.declared])

    @property
    def gains_of_gears(self) -> np.ndarray:
        """Those by the sensors behind the gears, likewise; empty without any."""
        pairs = zip(self.gears, self.declared, strict=False)
        return np.array([gear.values[0] * said.value for gear, said in pairs])

    @property
    def std(self) -> np.ndarray:
        """Their standard errors, shape (joints,)."""
        return self.gains.std * np.abs([d.value for d in self.declared])


def gains_of(
    experiment: Experiment, progress: Callable[[str], None] | None = None
) -> GainsOfExperiment:
    """Drive gains of the records of an experiment file."""
    given, robot = experiment.content.gains, experiment.robot
    for entry in (*experiment.content.recording, *given.recording):
        if entry.is_without_torque:
            with errors_name(experiment.path, "[gains]"):
                raise ExperimentError(
                    "drive gains follow from logged commands, but a recording has no column of tau",
                    advice="map it, or identify ratios to the gain: drive_gain = "
                    f'"{UNKNOWN_GAIN}" under [controller], and one known mass gives it',
                )
    complete = with_unit_gains(experiment)
    runs = complete.runs()
    problem = complete.problem(progress, [recording for run in runs for recording in run])
    temperatures: tuple[MotorTemperature, ...] = ()
    with errors_name(experiment.path, "[gains]"):
        count = sum(map(len, runs[: len(experiment.content.recording)]))
        recordings = problem.recordings
        bare = tuple(without_sensors(r) for r in recordings)
        problem = replace(problem, recordings=bare)
        if given.temperature is not None:
            timed = given.temperature == "time"
            warmth = [r.t if timed else np.asarray(r.temperature) for r in recordings]
            # at constant load: what the payload changes must not pass for warmth
            temperatures = identify_motor_temperature(
                replace(problem, recordings=bare[:count]),
                None if timed else warmth[:count],
                given.reference_temperature,
                given.friction_drift,
            )
            problem = replace(problem, recordings=_corrected(bare, warmth, robot, temperatures))
        gears: tuple[GearLosses, ...] = ()
        if given.sensors is not None:
            felt = [r.inputs[SENSORS] for r in recordings[:count]]
            gears = identify_gears(
                replace(problem, recordings=problem.recordings[:count]), felt, progress
            )
        declared = declared_gains(experiment.content.recording[0], robot)
        payload = _payload(given, robot)
        found = identify_drive_gains(
            replace(problem, recordings=problem.recordings[:count]),
            payload,
            problem.recordings[count:],
            trusted_gains=_trusted_gains(given, robot, declared),
            trusted_parameters={
                name: Trusted(value, given.trusted_within * abs(value))
                for name, value in given.trusted_parameters.items()
            },
            friction_under_load=given.friction_under_load,
            known_within=given.known_within,
            progress=progress,
        )
    return GainsOfExperiment(
        found,
        declared,
        tuple(joint.torque_unit for joint in robot.on_fixed_base.joints),
        payload,
        (*given.trusted, *given.trusted_parameters),
        temperatures,
        experiment.content.robot.model,
        gears,
    )


def declared_gains(entry: RecordingEntry, robot: Robot) -> tuple[DeclaredGain, ...]:
    """What a recording's table and the robot say about the gain of each joint."""
    robot = robot.on_fixed_base  # a measured base has no drives
    transmission, spec = robot.transmission, entry.units.tau
    if entry.dataset is not None:
        return (DeclaredGain(1.0, "declared", True, "dataset"),) * robot.size
    made = []
    per_joint = spec if isinstance(spec, list) else [spec] * robot.size
    for j, unit in enumerate(per_joint):
        factor = 1.0 if unit is None else factor_to_si("tau", unit)[0]
        if isinstance(unit, Mapping):
            name = str(unit["unit"])
            value = factor / COMMAND_OR_TORQUE[name]
            made.append(DeclaredGain(value, name, "scale" not in unit, "units"))
        elif isinstance(unit, str) and unit in COMMAND:
            # the gain belongs to A, V or the command itself, whatever the prefix of the log
            gain, sure = float(transmission.drive_gain[j]), bool(transmission.gain_given[j])
            made.append(DeclaredGain(gain, unit, sure, "robot"))
        else:
            name = unit if isinstance(unit, str) else "unit of the log" if unit else "N m"
            made.append(DeclaredGain(factor, name, True, "factor"))
    return tuple(made)


#: Prefix of every unit that a table {unit, gain} may name.
COMMAND_OR_TORQUE = COMMAND | TORQUE


def lines_for_file(found: GainsOfExperiment) -> list[str]:
    """TOML lines that make a following `identify` work in N m; known gains only."""
    values, names, known = found.values, found.gains.joints, found.gains.anchored
    if found.gears:
        values, known = found.gains_of_gears, np.ones(len(names), bool)
    if not known.any():
        return []
    places = {d.place for d in found.declared}
    if places == {"robot"}:
        listed = ", ".join(
            f"{_key(name)} = {value:.6g}"
            for name, value, sure in zip(names, values, known, strict=True)
            if sure
        )
        units = {
            f"{t}/{d.base_unit}" for t, d in zip(found.torque_units, found.declared, strict=True)
        }
        gains = f"drive_gain = {{{listed}}}    # {', '.join(sorted(units))}"
        return ["[robot]", f'model = "{found.model}"', gains]
    if places == {"dataset"} or not known.all():
        return []
    cells = [
        f"{value:.6g}" if d.place == "factor" else f'{{unit = "{d.unit}", gain = {value:.6g}}}'
        for d, value in zip(found.declared, values, strict=True)
    ]
    return ["[recording.units]", f"tau = [{', '.join(cells)}]"]


def _key(name: str) -> str:
    """A TOML key, quoted where it has to be."""
    plain = name.replace("_", "").replace("-", "")
    return name if plain.isascii() and plain.isalnum() else f'"{name}"'


def with_unit_gains(experiment: Experiment) -> Experiment:
    """The file with a gain of 1 where nobody gave one, and with the runs under load behind."""
    content, robot = experiment.content, experiment.robot.on_fixed_base
    transmission, names = robot.transmission, robot.joint_names
    every = dict(zip(names, map(float, transmission.drive_gain), strict=True))
    recordings = [
        _with_columns(entry, content.gains)
        for entry in (*content.recording, *content.gains.recording)
    ]
    changed: ExperimentFile = content.model_copy(
        update={
            "robot": content.robot.model_copy(update={"drive_gain": every}),
            "recording": recordings,
        }
    )
    return Experiment(experiment.path, changed)


def _with_columns(entry: RecordingEntry, given: GainsEntry) -> RecordingEntry:
    """The table with the columns of temperatures and of sensors, where the log has them."""
    warm = None if given.temperature == "time" else given.temperature
    behind = entry.columns and given.sensors and {**entry.columns.inputs, SENSORS: given.sensors}
    return with_columns(entry, temperature=warm, inputs=behind)


def _corrected(
    recordings: Sequence[Recording],
    warmth: Sequence[np.ndarray],
    robot: Robot,
    temperatures: Sequence[MotorTemperature],
) -> tuple[Recording, ...]:
    """The recordings at the reference temperature, as far as a coefficient is worth it."""
    coefficients = [t.coefficient if t.is_significant else 0.0 for t in temperatures]
    reference = [t.reference for t in temperatures]
    return tuple(
        at_reference_temperature(r, robot.transmission, coefficients, values, reference)
        for r, values in zip(recordings, warmth, strict=True)
    )


def _payload(given: GainsEntry, robot: Robot) -> Payload | None:
    """The payload of the table."""
    entry = given.payload
    if entry is None:
        return None
    link = -1 if entry.joint is None else robot.link_index(entry.joint)
    return Payload(entry.mass, entry.center_of_mass, entry.inertia, entry.mass_std, link)


def _trusted_gains(
    given: GainsEntry, robot: Robot, declared: Sequence[DeclaredGain]
) -> dict[str, Trusted]:
    """Trusted gains relative to the declared ones."""
    made = {}
    for name, value in given.trusted.items():
        j = robot.joint_index(name)
        ratio = value / declared[j - robot.base_joints].value
        made[robot.joint_names[j]] = Trusted(ratio, given.trusted_within * abs(ratio))
    return made
