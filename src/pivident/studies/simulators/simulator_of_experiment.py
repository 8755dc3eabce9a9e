"""From an experiment file to a fitted simulator."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from pivident.data.recording.recording import Recording
from pivident.experiment.check.actuators_check import check_actuators, controller_keys
from pivident.experiment.experiment import Experiment
from pivident.experiment.explained import errors_name
from pivident.experiment.recording_tables import loop_of
from pivident.foundation.errors import ExperimentError, PividentError
from pivident.foundation.text.toml import toml_lines
from pivident.loop.simulation.control_loop import Loop
from pivident.models.export.differences import RobotFile
from pivident.robot.mjcf_actuators import actuator_law
from pivident.robot.naming import MJCF_FILES, ROBOT_FILES, URDF_FILES
from pivident.studies.simulators.fit_simulator import WARM_UP, fit_simulator
from pivident.studies.simulators.held_out import HeldOut, held_out_errors
from pivident.studies.simulators.joint_quantities import DEFAULT_QUANTITIES
from pivident.studies.simulators.robot_files import (
    ENDINGS,
    check_format,
    check_writable,
    fitted_file,
)
from pivident.studies.simulators.simulator_fit import SimulatorFit

#: Share of a recording at its end on which the simulator is judged.
HELD_OUT = 0.25


def simulator_of(
    experiment: Experiment,
    to: str,
    folder: Path,
    free: Sequence[str] = DEFAULT_QUANTITIES,
    held_out: float = HELD_OUT,
    progress: Callable[[str], None] | None = None,
) -> tuple[SimulatorFit, RobotFile | None, HeldOut | None]:
    """Fit, write and judge the simulator of an experiment file.

    Args:
        experiment: robot, recordings with their reference, and a law with known gains.
        to: ``mjcf``, ``urdf`` or ``isaac``.
        folder: where the file is going to be, for the paths of meshes.
        free: what is fitted.
        held_out: share of each recording at its end that is kept for the judgement, where there is
            no ``[[validation.recording]]``.
        progress: called with one line at each stage.

    Returns:
        The fit, with reservations as its notes; the file, None where it cannot be written; the
        errors on held-out motion, None where MuJoCo cannot simulate it.

    Raises:
        ExperimentError: names what is missing: the law, its gains, the reference.
        MissingExtra: MuJoCo is not installed; names the extra.
        RobotDescriptionError: MuJoCo refuses the robot's file.
    """
    say = progress or (lambda line: None)
    if not 0.0 <= held_out <= 0.8:
        raise ExperimentError(f"held out is a share from 0 to 0.8, not {held_out:g}")
    original = _original(experiment, to)
    try:
        if left_out := check_writable(to, original, folder):
            say(f"the robot's file: {left_out}")
    except PividentError as error:
        say(f"only the values will be written, no robot's file: {error}")
    say("reading the recordings")
    loop, runs, unseen = _material(experiment, held_out)
    fit = fit_simulator(experiment.robot, loop, runs, free, progress=say)
    remarks = check_actuators(experiment.content.controller, experiment.robot, runs)
    notes = [f"{r.message} {r.next_step}".rstrip() for r in remarks]
    file = judged = None
    try:
        file = fitted_file(fit, to, original, folder)
    except PividentError as error:
        notes.append(f"No robot's file is written: {error}. The values are in simulator.csv.")
    if unseen is not None and original.name.endswith((*MJCF_FILES, *URDF_FILES)):
        say("simulating held-out motion with MuJoCo")
        frozen = dict(experiment.content.robot.frozen)
        form = ("urdf" if original.name.endswith(URDF_FILES) else "mjcf") if to == "isaac" else to
        try:
            with tempfile.TemporaryDirectory() as place:
                written = Path(place) / f"fitted{ENDINGS[form]}"
                written.write_bytes(fitted_file(fit, form, original, Path(place)).content)
                motion, first = unseen
                judged = held_out_errors(fit, loop, motion, original, written, frozen, first)
        except PividentError as error:
            notes.append(f"Held-out motion is not simulated: {error}.")
    return replace(fit, notes=tuple(notes)), file, judged


def _original(experiment: Experiment, to: str) -> Path:
    """The file that the robot is read from."""
    model = experiment.content.robot.model
    check_format(to, model)
    return experiment.path.parent / model if model.endswith(ROBOT_FILES) else Path(model)


def _material(
    experiment: Experiment, held_out: float
) -> tuple[Loop, list[Recording], tuple[Recording, int] | None]:
    """The loop, what is fitted, and what the fit is judged on from which of its samples on."""
    law = experiment.content.controller
    if law is None or law.type not in ("pd", "pid", "cascade"):
        raise ExperimentError(
            f"{experiment.path.name}: a simulator is fitted by a loop with known gains, and "
            + (
                "[controller] is missing" if law is None else f"a law of type {law.type!r} has none"
            ),
            advice=_law_to_declare(experiment),
        )
    runs = experiment.recordings()
    with errors_name(experiment.path, "[controller]"):
        runs, loop = loop_of(law, experiment.robot, runs)
    unseen = experiment.unseen_recordings()
    if unseen or not held_out:
        first = round(WARM_UP * unseen[0].rate) if unseen else 0
        return loop, list(runs), (unseen[0], first) if unseen else None
    cuts = [round((1.0 - held_out) * run.samples) for run in runs]
    parts = [run.part(0, cut) for run, cut in zip(runs, cuts, strict=True)]
    # the simulation begins as much earlier as it is judged on, so that its start is forgotten
    begin = max(2 * cuts[0] - runs[0].samples, 0)
    return loop, parts, (runs[0].part(begin, runs[0].samples), cuts[0] - begin)


def _law_to_declare(experiment: Experiment) -> str:
    """What to write under ``[controller]``: the law of the robot's actuators, where it has one."""
    robot = experiment.robot
    if robot.description.endswith(MJCF_FILES):
        found = actuator_law(robot.description, robot.joint_names)
        if not found.reasons:
            law = "; ".join(toml_lines(controller_keys(found, with_speeds=False)))
            return f"the actuators of {Path(robot.description).name} are the law {law}"
    return 'give [controller] with type = "pd", kp and kd in joint torque, or with drive_gain'
