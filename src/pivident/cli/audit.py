"""The audit on the command line: what is wrong with a log, as a table and a page."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from pivident.cli.console import Progress
from pivident.cli.workflow import check_output

if TYPE_CHECKING:
    from pivident.audit.audit import Audit

#: How severities look on a terminal with colours.
STYLES = {"wrong": "bold red", "look": "yellow", "fine": "green"}


def run_audit(path: Path, robot: str | None, experiment: Path | None, out: Path | None) -> bool:
    """Audit a log, print what was found and write ``audit.json`` and ``audit.html``.

    Args:
        path: a log or an experiment file.
        robot: name in the gallery or a robot file, or None.
        experiment: experiment file with the columns of the log, or None.
        out: folder for the results; NAME-audit for NAME.csv where it is not given.

    Returns:
        Whether nothing is wrong.

    Raises:
        PividentError: the log cannot be read at all, or the folder cannot be written.
    """
    from pivident.audit.audit_file import audit_file
    from pivident.report.audit.audit_files import write_audit
    from pivident.robot.gallery import load_robot

    folder = out or Path(f"{path.name.removesuffix('.gz').rpartition('.')[0] or path.name}-audit")
    check_output(folder)
    with Progress() as progress:
        machine = None if robot is None else load_robot(robot)
        audits = audit_file(path, machine, experiment, progress.say)
        progress.say("writing the page")
        page = write_audit(audits, folder)
    print_audits(audits)
    print(f"\nPage: {page}")
    return all(audit.severity != "wrong" for audit in audits)


def print_audits(audits: Sequence[Audit]) -> None:
    """Findings that need attention, the rest as a number.

    Args:
        audits: of one log or several.
    """
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    from pivident.audit.finding import grouped

    console = Console(highlight=False)
    for audit in audits:
        rate = f" at {audit.timing.rate:.6g} Hz" if audit.timing.rate else ""
        table = Table.grid(padding=(0, 2))
        for severity, sentence, step in grouped(audit.findings):
            table.add_row(Text(f"  {severity}", STYLES[severity]), Text(sentence), Text(step))
        heading = f"{audit.log.name}: {audit.log.samples} samples{rate}"
        counts = (
            f"  {audit.count('wrong')} wrong, {audit.count('look')} to look at, "
            f"{audit.count('fine')} fine"
        )
        if console.is_terminal:
            console.print(Text(heading, style="bold"), table, Text(counts), sep="\n")
        else:  # lines of a file or a pipe are not broken
            rows = grouped(audit.findings)
            lines = [" ".join(filter(None, (f"  {row[0]:<6}", *row[1:]))) for row in rows]
            print("\n".join([heading, *lines, counts]))
