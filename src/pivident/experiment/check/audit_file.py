"""The audit of a file: a log, or every log that an experiment file names."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from pivident.data.logs.described_log import bare_log
from pivident.experiment.experiment import errors_name, load_experiment
from pivident.experiment.recording_tables import log_of
from pivident.foundation.errors import RecordingError
from pivident.judgement.audit.audit import Audit, audit_log
from pivident.judgement.audit.excitation import check_excitation
from pivident.robot.description import Robot


def audit_file(
    path: str | Path,
    robot: Robot | None = None,
    experiment: str | Path | None = None,
    progress: Callable[[str], None] | None = None,
    column_names: Sequence[str] = (),
) -> tuple[Audit, ...]:
    """Audit a log, or every log that an experiment file names.

    Args:
        path: a log (.csv, .txt, .tsv, .npz, .mat, .parquet), or an experiment file (.toml).
        robot: the robot, for a log without experiment file.
        experiment: experiment file that says what the columns of the log are.
        progress: called with one line at each stage.
        column_names: of a log without header and without experiment file, in their order.

    Returns:
        One audit for each log.

    Raises:
        RecordingError: the log cannot be read at all, or the arguments contradict each other.
        ExperimentError: the experiment file cannot be used.
        RobotDescriptionError: its robot cannot be used.
    """
    say = progress or (lambda line: None)
    path = Path(path)
    is_experiment = path.suffix.lower() == ".toml"
    if is_experiment and (experiment is not None or robot is not None):
        raise RecordingError(
            f"{path.name} is an experiment file, which names robot and columns itself",
            advice="leave --robot and --experiment out, or name the log instead",
        )
    if column_names and (is_experiment or experiment is not None):
        raise RecordingError(
            "the experiment file describes the columns",
            advice="write column_names under its [recording] and leave --columns out",
        )
    if not is_experiment and experiment is None:
        say(f"reading {path.name}")
        return (audit_log(bare_log(path, robot, column_names), say),)

    given = load_experiment(path if is_experiment else Path(str(experiment)))
    entries = given.content.recording if is_experiment else given.content.recording[:1]
    audits = []
    for entry in entries:
        say(f"reading {entry.name or entry.dataset or path.name}")
        with errors_name(given.path, "[recording]"):
            log = log_of(
                entry, robot or given.robot, given.path.parent, None if is_experiment else path
            )
        audits.append(audit_log(log, say))
    return excited_together(audits)


def excited_together(audits: Sequence[Audit]) -> tuple[Audit, ...]:
    """Recordings of one experiment are identified together, so they are excited together."""
    models = [audit.model for audit in audits if audit.model is not None]
    if len(models) < 2:
        return tuple(audits)
    together = check_excitation(models)
    return tuple(
        audit
        if audit.model is None
        else replace(
            audit,
            excitation=together,
            findings=(*(f for f in audit.findings if f.topic != "excitation"), *together.findings),
        )
        for audit in audits
    )
