"""The command ``pivident payload``: mass, centre of mass and inertia of a load."""

from __future__ import annotations

from pathlib import Path

from pivident.app.cli.console import Progress, name_bodies
from pivident.foundation.errors import ExperimentError


def payload(
    first: Path,
    second: Path | None = None,
    /,
    *,
    method: str | None = None,
    robot: str | None = None,
    out: Path | None = None,
) -> int:
    """Identify the load that a robot carries, from one record without it and one with it.

    Parameters
    ----------
    first
        The experiment file with [recording] and [[payload.recording]]; or, with a second file,
        the identification.json of the arm without load.
    second
        The experiment file whose [recording] is the one with the load.
    method
        ls, iv-full-rate or piv. Default: that of the file, or else piv with a controller.
    robot
        Robot of an identification.json that does not describe it: gallery name, .toml or .urdf.
    out
        Folder for payload.json, payload.csv and payload.txt. Default: NAME-payload for NAME.toml.
    """
    from pivident.experiment.experiment import load_experiment
    from pivident.foundation.files import check_output
    from pivident.studies.payload.load_of_experiment import default_folder, load_of

    file = first if second is None else second
    if second is None and first.suffix == ".json":
        raise ExperimentError(
            f"{first} is the arm without load",
            advice="name the experiment file of the record with the load too: pivident payload "
            f"{first.name} LOADED.toml",
        )
    if second is None and robot is not None:
        raise ExperimentError(
            "--robot belongs to an identification.json", advice="the file names its robot"
        )
    folder = out or default_folder(file)
    check_output(folder)
    experiment = load_experiment(file)
    name_bodies(experiment.robot)
    arm = None if second is None else _arm(first, robot)
    with Progress() as progress:
        found = load_of(experiment, arm, method, progress.say)
        progress.say("writing the results")
        account = found.account()
        account.save(folder, "payload")
    print(account)
    print(f"\nFiles: {folder / 'payload.json'}, payload.csv, payload.txt")
    return 0 if found.converged else 3


def _arm(file: Path, robot: str | None):
    """The arm without load, from its file."""
    from pivident.estimation.stored_identification import load_identification
    from pivident.judgement.diagnostics.stored_verdict import result_of
    from pivident.robot.gallery import load_robot

    return load_identification(result_of(file), None if robot is None else load_robot(robot))
