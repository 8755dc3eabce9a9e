"""The command ``pivident check``: what is wrong with an experiment, before it is computed."""

from __future__ import annotations

import json
import time
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from pivident.app.cli.console import BEGUN, DONE, FAULTY_LOG, WRONG_INPUT, Progress, print_findings
from pivident.foundation.text.finding import counted
from pivident.foundation.text.identifiers import escaped

if TYPE_CHECKING:
    from pivident.experiment.check.experiment_check import ExperimentCheck


def check(
    experiment: Path,
    /,
    *,
    robot: str | None = None,
    as_json: Annotated[bool, Parameter(name="--json", negative=(), show_default=False)] = False,
) -> int:
    """Report what is wrong with an experiment file, its robot and its logs; nothing is estimated.

    Parameters
    ----------
    experiment
        The experiment file.
    robot
        Robot in place of the file's: name in the gallery, .toml or .urdf.
    as_json
        Print everything as JSON, for programs.
    """
    from pivident.app.cli.compile_ahead import compile_in_first_run
    from pivident.app.cli.remaining import pace
    from pivident.experiment.check.experiment_check import check_experiment
    from pivident.experiment.check.plan import LIBRARIES
    from pivident.foundation.common_work import numbers_beside

    taken = time.perf_counter() - BEGUN
    compile_in_first_run()
    with Progress() as progress, numbers_beside(experiment):
        found = check_experiment(experiment, robot, progress.say)
    if as_json:
        print(json.dumps(found.as_json(), ensure_ascii=False, allow_nan=False, indent=1))
    else:
        print_check(found, pace(LIBRARIES, taken))
    if found.refused:
        return WRONG_INPUT
    return FAULTY_LOG if found.severity == "error" else DONE


def print_check(found: ExperimentCheck, slowness: float = 1.0) -> None:
    """Remarks, the gravest first; then what was checked and what would be estimated.

    ``slowness``: by which the expected time is longer here.
    """
    print(escaped(f"{found.path}: {_headline(found)}"))
    print_findings(found.remarks)
    print("Checked: " + escaped("; ".join(found.looked_at)) + ".")
    if found.plan is not None:
        when = " once the gaps are fixed as said above" if found.refused else ""
        plan = replace(found.plan, seconds=found.plan.seconds * slowness)
        print(escaped(f"To be estimated{when}:\n{plan}"))


def _headline(found: ExperimentCheck) -> str:
    if not found.remarks:
        return "no errors, no warnings"
    if found.refused:
        return f"{counted(found.remarks)}; an identification would stop"
    if found.severity == "error":
        return f"{counted(found.remarks)}; an identification would run; correct the errors first"
    return counted(found.remarks)
