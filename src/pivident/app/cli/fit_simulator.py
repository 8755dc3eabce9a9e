"""The command ``pivident fit-simulator``: joints of a simulator from positions."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from pivident.app.cli.console import Progress, name_bodies, note
from pivident.foundation.extras import is_installed
from pivident.foundation.text.sentences import separated


def fit_simulator(
    file: Path,
    /,
    *,
    to: Literal["mjcf", "urdf", "isaac"] = "mjcf",
    free: list[str] | None = None,
    held_out: float = 0.25,
    out: Path | None = None,
) -> int:
    """Fit the joints of a simulator to a log of positions: no torque is needed.

    Armature, damping, dry friction and encoder bias of each joint and one delay of the torques
    are fitted with the gains of [controller]; the links keep their inertias. The file that is
    written is simulated by MuJoCo on motion that the fit has not seen.

    Parameters
    ----------
    file
        The experiment file: robot (MJCF or URDF), [recording] with q_ref, and [controller].
    to
        mjcf, urdf, or isaac: actuators of Isaac Lab.
    free
        What is fitted: armature, damping, frictionloss, bias, delay, kp, kd; several separated by
        commas. Default: the first five.
    held_out
        Share of the recordings at their end for the judgement, where the file has no
        [[validation.recording]]; 0: none.
    out
        Folder for the results. Default: NAME-simulator for NAME.toml.
    """
    from pivident.experiment.experiment import load_experiment
    from pivident.foundation.files import check_output
    from pivident.robot.mjcf_model import mujoco_library
    from pivident.studies.simulators.account import account, file_name
    from pivident.studies.simulators.joint_quantities import DEFAULT_QUANTITIES
    from pivident.studies.simulators.simulator_of_experiment import simulator_of

    mujoco_library("fitting a simulator")
    folder = out or file.with_name(f"{file.stem}-simulator")
    check_output(folder)
    experiment = load_experiment(file)
    name_bodies(experiment.robot)
    with Progress() as progress:
        fit, robot, judged = simulator_of(
            experiment, to, folder, separated(free or DEFAULT_QUANTITIES), held_out, progress.say
        )
        progress.say("writing the results")
        drawn = is_installed("plotly")
        document, page = account(fit, robot, judged), ""
        if drawn:
            from pivident.judgement.report.builder import page_of_documents

            page = page_of_documents([document])
        more = {} if robot is None else {file_name(robot): robot.content}
        document.save(folder, "simulator", page, more)
    print(document)
    for sentence in () if robot is None else robot.differences:
        note(f"{sentence}.")
    names = [] if robot is None else [file_name(robot)]
    names += ["simulator.csv", "simulator.json", *(["simulator.html"] if drawn else [])]
    print(f"\nFiles: {', '.join([str(folder / names[0]), *names[1:]])}")
    return 3 if not fit.converged or (judged is not None and judged.findings()) else 0
