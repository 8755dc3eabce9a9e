"""The friction of a record on the command line: what is seen, as sentences, a page and curves."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from pivident.app.cli.console import Progress, note
from pivident.foundation.errors import ExperimentError
from pivident.foundation.extras import require
from pivident.foundation.text.finding import MARKS

if TYPE_CHECKING:
    from pivident.studies.friction.friction_study import FrictionStudy


def friction(
    experiment: Path,
    /,
    *,
    method: str | None = None,
    standstill: float | None = None,
    ripple: bool = False,
    out: Path | None = None,
) -> int:
    """Show friction against speed, position, load and time before choosing a law for it.

    Parameters
    ----------
    experiment
        The experiment file.
    method
        Estimate whose rigid part is subtracted from the torque. Default: iv-full-rate where the
        file has it among its methods, else the last of these.
    standstill
        Share of the rated speed that counts as standstill, 0 to 1. Default: 0.01.
    ripple
        Also search for lines that repeat with the position (some seconds per joint).
    out
        Folder for friction.html, friction.json, curves.csv and curves.parquet. Default:
        NAME-friction for NAME.toml.
    """
    return 0 if run_friction(experiment, method, standstill, out, ripple) else 3


def run_friction(
    path: Path,
    method: str | None,
    standstill: float | None,
    out: Path | None,
    ripple: bool = False,
) -> bool:
    """Identify, subtract the rigid part, print what stands out in the friction, write the files.

    True where the estimate converged.
    """
    from pivident.estimation.identify import identify
    from pivident.experiment.experiment import load_experiment
    from pivident.foundation.files import check_output
    from pivident.studies.friction.curves import write_friction
    from pivident.studies.friction.friction_study import study_friction
    from pivident.studies.friction.ripple_search import find_ripple

    if standstill is not None and not 0.0 < standstill < 1.0:
        raise ExperimentError(
            f"--standstill {standstill:g} is not a share of the rated speed",
            advice="give one between 0 and 1, such as 0.01",
        )
    require("polars", extra="tables", purpose="the table of friction curves")
    with Progress() as progress:
        experiment = load_experiment(path)
        folder = out or Path(f"{path.stem}-friction")
        check_output(folder)
        problem = experiment.problem(progress.say)
        own = list(experiment.methods())
        name = method or ("iv-full-rate" if "iv-full-rate" in own else own[-1])
        found = identify(problem, experiment.methods([name])[name], progress.say)
        study = study_friction(problem, found, standstill=standstill, progress=progress.say)
        if ripple:
            progress.say("searching for ripple")
            study = replace(study, ripple=find_ripple(found, problem.recordings))
        progress.say("writing the page")
        page = write_friction(study, folder, f"{experiment.title}: friction")
    print_friction(study)
    print(f"\nPage: {page}")
    if not found.converged:
        note(
            f"{found.method} did not converge in {found.iterations} iterations; the friction above "
            "is that of its last estimate"
        )
    return found.converged


def print_friction(study: FrictionStudy) -> None:
    """What stands out for each joint, then the sentences behind it."""
    from pivident.studies.friction.effects import headline

    for joint in study.joints:
        print(f"{joint.name}: {headline(joint.findings)}")
        for finding in joint.findings:
            terms = f" [{finding.terms}]" if finding.clear and finding.terms else ""
            print(f"  {MARKS[finding.severity]} {finding.message}{terms}")
    for name, reason in study.left_out.items():
        print(f"{name}: left out: {reason}")
    if study.ripple is not None:
        print(f"\nRipple over position\n{study.ripple}")
