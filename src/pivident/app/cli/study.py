"""The command ``pivident study``: many simulated runs, and what they say about estimates."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from pivident.app.cli.console import Progress, check_count, chosen_pool, note
from pivident.foundation.text.sentences import separated

if TYPE_CHECKING:
    from pivident.studies.many.batch.runner import Pool
    from pivident.studies.many.study.scenario import Scenario
    from pivident.studies.many.study.summary import Summary


def study(
    scenario: str,
    /,
    *,
    runs: int | None = None,
    out: Path | None = None,
    workers: int | None = None,
    dask: Annotated[bool, Parameter(negative=())] = False,
    scheduler: str | None = None,
    condition: Annotated[tuple[str, ...], Parameter(negative=(), show_default=False)] = (),
    method: Annotated[
        tuple[str, ...],
        Parameter(name=["--methods", "--method", "-m"], negative=(), show_default=False),
    ] = (),
) -> int:
    """Simulate many runs of a scenario and judge the estimates against the truth.

    Runs that are in the folder already are kept: the same command continues where it was stopped.

    Parameters
    ----------
    scenario
        fine, loop, coloured, coarse, birdy, or a scenario file (.toml).
    runs
        Total number of runs. Default: that of the scenario.
    out
        Folder for the results. Default: NAME-study.
    workers
        Processes on this machine. Default: one for each core.
    dask
        Use a Dask cluster on this machine.
    scheduler
        Use the Dask cluster of the scheduler at this address, tcp://host:8786.
    condition
        Conditions of the scenario, such as tx40-n1-d1 or 'tx40-*'. Default: all.
    method
        Methods to compare, separated by commas or repeated; all: every one, all,-particle: every
        one but that. Default: those of the scenario.
    """
    from pivident.foundation.files import check_output
    from pivident.studies.many.study.scenario import load_scenario

    check_count("--runs", runs)
    chosen = load_scenario(scenario)
    if runs is not None:
        chosen = chosen.with_runs(runs)
    if method:
        chosen = chosen.with_methods(separated(method))
    conditions = chosen.chosen_conditions(condition)
    folder = out or Path(f"{chosen.name}-study")
    check_output(folder)
    summaries = _compute(chosen, conditions, folder, chosen_pool(workers, dask, scheduler))
    if any(m.runs for summary in summaries.values() for m in summary.methods.values()):
        return 0
    note("error: no run gave an estimate; the table shows why")
    return 1


def _compute(
    chosen: Scenario, conditions: Sequence[Scenario], folder: Path, pool: Pool
) -> dict[str, Summary]:
    """Runs, summaries and pages of all conditions."""
    from pivident.studies.many.study.conclusion import PAGE, SUMMARY, conclude_study, write_index
    from pivident.studies.many.study.run import run_study
    from pivident.studies.many.study.summary import summary_text

    varied = bool(chosen.alternatives)
    summaries: dict[str, Summary] = {}
    with Progress() as progress:
        for one in conditions:
            place = folder / one.condition if varied else folder
            try:
                run_study(one, place, pool=pool, say=progress.say)
            except KeyboardInterrupt:
                note(f"the finished runs are in {place}; the same command continues there")
                raise
            summaries[one.condition] = conclude_study(one, place, progress.say)
        if varied:
            write_index(summaries, folder)
    print("\n\n".join(summary_text(summary) for summary in summaries.values()))
    print(f"\nSummary: {folder / SUMMARY}")
    print(f"Report:  {folder / PAGE}")
    if varied:
        print(f"Reports: {folder / '*' / PAGE}")
    return summaries
