"""The command ``pivident audit``: what is wrong with a log, as a table and a page."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from pivident.app.cli.console import DONE, FAULTY_LOG, Progress, can_draw, print_findings
from pivident.foundation.text.finding import counted, serious
from pivident.foundation.text.plain_values import write_json
from pivident.foundation.text.sentences import separated

if TYPE_CHECKING:
    from pivident.judgement.audit.audit import Audit


def audit(
    log: Path,
    /,
    *,
    robot: str | None = None,
    experiment: Path | None = None,
    columns: Annotated[str | None, Parameter(show_default=False)] = None,
    out: Path | None = None,
) -> int:
    """Report what is wrong with a log before anything is identified from it.

    Parameters
    ----------
    log
        A log (.csv, .txt, .tsv, .npz, .mat, .parquet), or an experiment file that names logs.
    robot
        Robot of a log without experiment file: name in the gallery, .toml or .urdf.
    experiment
        Experiment file that describes the log's columns.
    columns
        Names of the columns of a log without header, in their order: t,q1..q6,-,tau1..tau6, with -
        for those that are not needed.
    out
        Folder for audit.json and audit.html. Default: NAME-audit for NAME.csv.
    """
    from pivident.experiment.check.audit_file import audit_file
    from pivident.foundation.files import atomic_folder, check_output
    from pivident.judgement.audit.audit import audits_json
    from pivident.robot.gallery import load_robot

    folder = out or Path(f"{log.name.removesuffix('.gz').rpartition('.')[0] or log.name}-audit")
    check_output(folder)
    with Progress() as progress:
        machine = None if robot is None else load_robot(robot)
        audits = audit_file(log, machine, experiment, progress.say, separated([columns or ""]))
        progress.say("writing the page")
        if can_draw(progress, "audit.html"):
            from pivident.judgement.report.audit_account import write_audit

            written = f"Page: {write_audit(audits, folder)}"
        else:
            with atomic_folder(folder) as build:
                write_json(build / "audit.json", audits_json(audits))
            written = f"Findings: {folder / 'audit.json'}"
    print_audits(audits)
    print(f"\n{written}")
    return FAULTY_LOG if any(found.severity == "error" for found in audits) else DONE


def print_audits(audits: Sequence[Audit]) -> None:
    """Findings that need attention, the rest as a number."""
    for audit in audits:
        rate = f" at {audit.timing.rate:.6g} Hz" if audit.timing.rate else ""
        print(f"{audit.log.name}: {audit.log.samples} samples{rate}")
        print_findings(serious(audit.findings))
        print(f"  {counted(audit.findings)}, {audit.count('ok')} ok")
