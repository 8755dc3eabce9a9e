"""From an experiment file to a fitted simulator."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

from pivident.errors import ExperimentError
from pivident.experiment.experiment import Experiment
from pivident.experiment.recording_tables import loop_of
from pivident.experiment.toml_file import errors_name
from pivident.export.robot_file import RobotFile
from pivident.recording.recording import Recording
from pivident.robot.naming import MJCF_FILES, ROBOT_FILES, URDF_FILES
from pivident.simulation.control_loop import Loop
from pivident.simulators.fit_simulator import fit_simulator
from pivident.simulators.held_out import HeldOut, held_out_errors
from pivident.simulators.joint_quantities import DEFAULT_QUANTITIES
from pivident.simulators.robot_files import ENDINGS, fitted_file
from pivident.simulators.simulator_fit import SimulatorFit

#: Share of a recording at its end on which the simulator is judged.
HELD_OUT = 0.25


def simulator_of(
    experiment: Experiment,
    to: str,
    folder: Path,
    free: Sequence[str] = DEFAULT_QUANTITIES,
    held_out: float = HELD_OUT,
    progress: Callable[[str], None] | None = None,
) -> tuple[SimulatorFit, RobotFile, HeldOut | None]:
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
        The fit; the file; the errors on held-out motion, None where MuJoCo cannot read the robot.

    Raises:
        ExperimentError: names what is missing: the law, its gains, the reference.
        MissingExtra: MuJoCo is not installed; names the extra.
        RobotDescriptionError: MuJoCo refuses the robot's file.
    """
    say = progress or (lambda line: None)
    if not 0.0 <= held_out <= 0.8:
        raise ExperimentError(f"held out is a share from 0 to 0.8, not {held_out:g}")
    original = _original(experiment, to)
    say("reading the recordings")
    loop, runs, unseen = _material(experiment, held_out)
    fit = fit_simulator(experiment.robot, loop, runs, free, progress=say)
    file = fitted_file(fit, to, original, folder)
    if unseen is None or not original.name.endswith((*MJCF_FILES, *URDF_FILES)):
        return fit, file, None
    say("simulating held-out motion with MuJoCo")
    frozen = dict(experiment.content.robot.frozen)
    with tempfile.TemporaryDirectory() as place:
        form = ("urdf" if original.name.endswith(URDF_FILES) else "mjcf") if to == "isaac" else to
        written = Path(place) / f"fitted{ENDINGS[form]}"
        written.write_bytes(fitted_file(fit, form, original, Path(place)).content)
        return fit, file, held_out_errors(fit, loop, unseen, original, written, frozen)


def _original(experiment: Experiment, to: str) -> Path:
    """The file that the robot is read from."""
    model = experiment.content.robot.model
    if to not in ENDINGS:
        raise ExperimentError(f"there is no format {to!r}; choose one of {', '.join(ENDINGS)}")
    if to != "isaac" and not model.endswith((*MJCF_FILES, *URDF_FILES)):
        raise ExperimentError(
            f"the robot is {model!r}, and only a URDF or MJCF can be written back as {to}; name "
            "such a file under [robot], or write --to isaac"
        )
    return experiment.path.parent / model if model.endswith(ROBOT_FILES) else Path(model)


def _material(
    experiment: Experiment, held_out: float
) -> tuple[Loop, list[Recording], Recording | None]:
    """The loop, what is fitted, and what the fit is judged on."""
    law = experiment.content.controller
    if law is None or law.type not in ("pd", "pid", "cascade"):
        raise ExperimentError(
            f"{experiment.path.name}: a simulator is fitted by a loop with known gains, and "
            + ("[controller] is missing" if law is None else f"a law of type {law.type!r} has none")
            + '; give [controller] with type = "pd", kp and kd in joint torque, or with drive_gain'
        )
    runs = experiment.recordings()
    with errors_name(experiment.path, "[controller]"):
        runs, loop = loop_of(law, experiment.robot, runs)
    unseen = experiment.unseen_recordings()
    if unseen or not held_out:
        return loop, list(runs), unseen[0] if unseen else None
    cuts = [round((1.0 - held_out) * run.samples) for run in runs]
    parts = [run.part(0, cut) for run, cut in zip(runs, cuts, strict=True)]
    return loop, parts, runs[0].part(cuts[0], runs[0].samples)
