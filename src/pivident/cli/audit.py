"""The audit on the command line: what is wrong with a log, as a table and a page."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from pivident.cli.console import Progress
from pivident.cli.findings import print_findings
from pivident.cli.workflow import can_draw, check_output
from pivident.text.finding import counted, serious
from pivident.text.plain_values import write_json

if TYPE_CHECKING:
    from pivident.audit.audit import Audit


def run_audit(
    path: Path,
    robot: str | None,
    experiment: Path | None,
    out: Path | None,
    column_names: Sequence[str] = (),
) -> bool:
    """Audit a log, print and write what was found (JSON and a page); True without errors."""
    from pivident.audit.audit import audits_json
    from pivident.audit.audit_file import audit_file
    from pivident.files import atomic_folder
    from pivident.robot.gallery import load_robot

    folder = out or Path(f"{path.name.removesuffix('.gz').rpartition('.')[0] or path.name}-audit")
    check_output(folder)
    with Progress() as progress:
        machine = None if robot is None else load_robot(robot)
        audits = audit_file(path, machine, experiment, progress.say, column_names)
        progress.say("writing the page")
        if can_draw(progress, "audit.html"):
            from pivident.report.audit.audit_files import write_audit

            written = f"Page: {write_audit(audits, folder)}"
        else:
            with atomic_folder(folder) as build:
                write_json(build / "audit.json", audits_json(audits))
            written = f"Findings: {folder / 'audit.json'}"
    print_audits(audits)
    print(f"\n{written}")
    return all(audit.severity != "error" for audit in audits)


def print_audits(audits: Sequence[Audit]) -> None:
    """Findings that need attention, the rest as a number."""
    for audit in audits:
        rate = f" at {audit.timing.rate:.6g} Hz" if audit.timing.rate else ""
        print(f"{audit.log.name}: {audit.log.samples} samples{rate}")
        print_findings(serious(audit.findings))
        print(f"  {counted(audit.findings)}, {audit.count('ok')} ok")
