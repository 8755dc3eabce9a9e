"""The command ``pivident predict``: torques of a new log by a result, with their errors."""

from __future__ import annotations

from pathlib import Path

from pivident.app.cli.console import Progress, can_draw, name_bodies, print_findings
from pivident.foundation.errors import ExperimentError


def predict(
    result: Path,
    log: str,
    *more: str,
    experiment: Path | None = None,
    band: float | None = None,
    csv: Path | None = None,
    html: Path | None = None,
) -> int:
    """Predict the torques of a new log by a result, and say how large the errors are.

    Parameters
    ----------
    result
        Folder that `pivident identify` wrote, or a file of a result: identification.json,
        consistent.json, model.json; or a robot with its nominal values: URDF, .toml, gallery name.
    log
        A log with the columns of the result's own logs, or an experiment file that describes it;
        or the channels of a log in several files, as the result's own were: q=positions.csv
        tau=torques.csv.
    more
        The other files of the log.
    experiment
        Experiment file that says what the columns of the log are. Default: as the result's logs.
    band
        Highest frequency of the motion in Hz, below which errors are compared. Default: from the
        motion.
    csv
        File for time, positions, measured and predicted torques.
    html
        File for a page with the errors and a drawing of each joint's torque.
    """
    from pivident.foundation.files import check_output
    from pivident.studies.prediction.new_logs import new_logs, stored_result

    for file in (csv, html):
        if file is not None:
            check_output(file.absolute().parent)
    written = []
    with Progress() as progress:
        progress.say(f"reading {result}")
        files, described = _files((log, *more)), experiment
        if described is None and isinstance(files, Path) and files.suffix.lower() == ".toml":
            described = files
        stored = stored_result(result, described)
        if result.suffix != ".json" and not result.is_dir():
            name_bodies(stored.model.robot)
        progress.say(f"reading {' '.join((log, *more))}")
        logs = list(new_logs(files, stored, experiment))
        if csv is not None and len(logs) > 1:
            raise ExperimentError(
                f"{log} gives {len(logs)} recordings, and --csv takes one",
                advice="name a log with --experiment, or one stretch between gaps with part in "
                "an experiment file",
            )
        progress.say("predicting")
        made = [stored.predict(new.recording, band=band) for new in logs]
        if csv is not None:
            made[0].account().tables["signals"].to_csv(csv)
            written.append(f"CSV:  {csv}")
        if html is not None and can_draw(progress, html.name):
            from pivident.judgement.report.builder import write_account

            written.append(f"Page: {write_account(made, html, [one.recording for one in made])}")
    for one, new in zip(made, logs, strict=True):
        print(f"{new.note}\n{one.account().body}\n")
        print_findings(one.findings)
    print("\n".join(["", *written]) if written else "", end="\n" if written else "")
    return 0


def _files(logs: tuple[str, ...]) -> Path | dict[str, str]:
    """The log, or its files by channel."""
    parts = [log.partition("=") for log in logs]
    if all(key.isidentifier() and path for key, _, path in parts) and not Path(logs[0]).exists():
        return {key: path for key, _, path in parts}
    if len(logs) > 1:
        raise ExperimentError(
            f"{' '.join(logs)}: which channel is in which file?",
            advice="write q=positions.csv tau=torques.csv, or name one log after the other",
        )
    return Path(logs[0])
