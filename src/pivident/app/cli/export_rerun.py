"""``pivident export --to rrd``: the motion of a log, with measured and modelled torques."""

from __future__ import annotations

from pathlib import Path

from pivident.app.cli.console import Progress
from pivident.foundation.errors import ExportError
from pivident.foundation.extras import require


def export_rerun(result: Path, log: Path | None, out: Path) -> None:
    """Predict the torques of a log by a result, and write all of it as a file of Rerun.

    Args:
        result: of `pivident identify`.
        log: the log, or an experiment file that describes it.
        out: the file.

    Raises:
        ExportError: no log is named, or the file would replace it.
        MissingExtra: rerun-sdk is not installed.
    """
    from pivident.foundation.files import check_output
    from pivident.studies.prediction.new_logs import new_logs, stored_result
    from pivident.studies.prediction.rerun_recording import write_rerun

    if log is None:
        raise ExportError(
            "--to rrd shows a motion: name its log, or the experiment file that was identified, "
            "with --log"
        )
    if out.suffix != ".rrd":
        raise ExportError(
            f"{out.name} is no name of a file of Rerun", advice="give --out one with .rrd"
        )
    require("rerun", extra="rerun", purpose="a file of Rerun")
    check_output(out.absolute().parent)
    with Progress() as progress:
        progress.say(f"reading {result}")
        stored = stored_result(result)
        progress.say(f"reading {log}")
        logs = list(new_logs(log, stored))
        progress.say("predicting")
        made = [stored.predict(new.recording) for new in logs]
        progress.say("writing the file of Rerun")
        write_rerun(made, out)
    for one in made:
        print(f"{one.account().body}\n")
    print(f"Written: {out} (Rerun; rerun {out} shows it)")
