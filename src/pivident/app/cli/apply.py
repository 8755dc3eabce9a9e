"""The command ``pivident apply``: a repair that the verdict has tried, written into the file."""

from __future__ import annotations

from pathlib import Path


def apply(experiment: Path, number: int, /, *, results: Path | None = None) -> int:
    """Write a repair that the verdict recommends into the experiment file.

    The verdict has tried it: the log was read with it and solved again. Comments and all other
    lines of the file stay as they are.

    Parameters
    ----------
    experiment
        The experiment file.
    number
        The repair, by its number in the verdict.
    results
        Folder of the results with the verdict. Default: that of the file, or else NAME-results for
        NAME.toml.
    """
    from pivident.app.cli.console import DONE, UsageError
    from pivident.data.logs.source_files import sha256
    from pivident.experiment.edited_file import with_repair
    from pivident.experiment.experiment import load_experiment
    from pivident.foundation.errors import ExperimentError
    from pivident.foundation.files import atomic_folder
    from pivident.judgement.diagnostics.stored_verdict import (
        VERDICT_FILE,
        repairs_of,
        stored_experiment,
    )

    described = load_experiment(experiment)
    folder = results or described.output or Path(f"{experiment.stem}-results")
    repairs = repairs_of(folder)
    if stored_experiment(folder) != sha256(experiment):
        raise ExperimentError(
            f"{experiment} has changed since the verdict in {folder}",
            advice=f"identify it again: pivident identify {experiment}",
        )
    if not 0 < number <= len(repairs):
        there = f"it has {len(repairs)}" if repairs else "it has none"
        raise UsageError(
            f"{folder / VERDICT_FILE} has no repair {number}: {there}",
            advice="the numbers stand in the verdict",
        )
    repair, cause = repairs[number - 1]
    text = experiment.read_bytes().decode("utf-8-sig")
    text, words = with_repair(text, repair, described.robot.joint_names)
    with atomic_folder(experiment.parent) as build:
        (build / experiment.name).write_bytes(text.encode("utf-8"))
    print(f"{cause} {words}")
    print(f"Next       pivident identify {experiment}")
    return DONE
