"""Summary and page of the runs on disk."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

from pivident.studies.many.batch.batch_errors import StudyFolderError
from pivident.studies.many.study.account import render_league, render_page
from pivident.studies.many.study.bench import Bench
from pivident.studies.many.study.run import Store
from pivident.studies.many.study.scenario import Scenario
from pivident.studies.many.study.scenario_tables import optimised_series
from pivident.studies.many.study.summary import Summary, summarise

SUMMARY, PAGE = "summary.json", "report.html"


def conclude_study(
    scenario: Scenario, folder: str | Path, say: Callable[[str], None] | None = None
) -> Summary:
    """Judge the runs of a folder and write ``summary.json`` and ``report.html`` beside them.

    Args:
        scenario: the scenario that the folder belongs to.
        folder: results folder.
        say: progress.

    Returns:
        The summary that was written.

    Raises:
        StudyFolderError: there are no runs, or the folder cannot be written to.
    """
    say = say or (lambda line: None)
    store = Store(Path(folder))
    rows = store.rows()
    if rows.is_empty():
        raise StudyFolderError(folder, "it contains no runs", "let the study finish some first")
    say(f"{scenario.title}: summary of {rows['run'].n_unique()} runs")
    bench = Bench(scenario, optimised_series(scenario, store.folder, say))
    summary = summarise(bench, rows)
    store.write(SUMMARY, summary.to_json())
    store.write(PAGE, render_page(summary, bench, rows, store.programs()))
    return summary


def write_index(summaries: dict[str, Summary], folder: str | Path) -> None:
    """``summary.json`` of a scenario with conditions, and ``report.html``: all side by side."""
    content = {
        "conditions": {name: json.loads(summary.to_json()) for name, summary in summaries.items()}
    }
    store = Store(Path(folder))
    store.write(SUMMARY, json.dumps(content, indent=1))
    store.write(PAGE, render_league(summaries))
